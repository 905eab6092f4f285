"""The accuracy of the optical attitude sensor: flights with a known truth, positions of noisy lines, geometry.

`make accuracy` runs the script, which writes docs/report/optical.json, docs/report/optical.png and the tables of
docs/optical.md. It takes some minutes.
"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from strapdown.blocks import SpotFinder, Thresholds
from strapdown.blocks.sensors import SENSORS
from strapdown.cores import OPTICAL_ERECTED, OPTICAL_TCD1304, OpticalConfig, opt_attitude
from strapdown.markdown import markdown_table
from strapdown_lab.checkout import ROOT, write_blocks
from strapdown_lab.studies.equations import equations_digest
from strapdown_sim.errors import largest, rms
from strapdown_sim.instrument.calibration import Calibration
from strapdown_sim.instrument.flights import FLIGHTS, Flight
from strapdown_sim.instrument.gyro import Gyro
from strapdown_sim.instrument.image import LineCamera
from strapdown_sim.instrument.observation import Observation, observe
from strapdown_sim.instrument.rays import Instrument, LineSeat
from strapdown_sim.reference.optical import Attitude, angles_of_pixels, attitude, pixels_of_angles, rotor_axis

__all__ = ["CASES", "SPOTS", "draw", "flight_errors", "flights_table", "geometry", "geometry_lines", "measured",
           "optical_digest", "position_error", "positions_table", "twin_errors"]

DRIFT_RAD_S = np.radians(0.2) / 60
"""Of the bearings, in the flight with drift."""

FAR = 20.0
"""Pixels; more than the error of any line that is found."""

COLOURS = {"none": "#b8bcc4", "patent": "#cc6633", "exact": "#3366aa", "erected": "#448855"}


class Case(NamedTuple):
    """A flight, and what differs from an ideal sensor.

    ``noise_px`` is that of both positions, rms; ``bias_m_s2`` that of each axis of the accelerometer; ``k`` and
    ``yaw_rate`` are factors of what the core gets.
    """

    title: str
    flight: str
    compensations: tuple[str, ...] = ("exact",)
    noise_px: float = 0.0
    bias_m_s2: float = 0.0
    k: float = 1.0
    yaw_rate: float = 1.0
    drift_rad_s: float = 0.0
    erection_s: float = 0.0


ALL = "none", "patent", "exact"
CASES = (
    *(Case(flight.title, letter, ALL) for letter, flight in FLIGHTS.items()),
    Case("without yaw rate", "c", yaw_rate=0.0),
    Case("0.1 px noise", "f", noise_px=0.1), Case("1 px noise", "f", noise_px=1.0),
    Case("accelerometer bias of 0.05 m/s²", "f", bias_m_s2=0.05), Case("k larger by 10 %", "f", k=1.1),
    Case("erection, 30 s", "g", erection_s=30.0),
    Case("bearing drift of 0.2°/min on both axes", "g", ALL, drift_rad_s=DRIFT_RAD_S),
    Case("the same with erection, 30 s", "g", drift_rad_s=DRIFT_RAD_S, erection_s=30.0))
"""Flights of the table."""


@cache
def seen(letter: str, drift_rad_s: float = 0.0) -> Observation:
    """The observation of a flight, which several cases share."""
    return observe(FLIGHTS[letter], gyro=Gyro(drift_rad_s=drift_rad_s))


class Samples(NamedTuple):
    """What a core gets in a case, (N,) or (N, 3), and the words of its calibration."""

    roll_px: np.ndarray
    pitch_px: np.ndarray
    f_b: np.ndarray
    yaw_rate: np.ndarray
    words: Calibration


def samples(case: Case) -> Samples:
    """Inputs of a case. The positions have the 12 bits of fraction that the finder gives."""
    observed, rng = seen(case.flight, case.drift_rad_s), np.random.default_rng(1)
    roll_px, pitch_px = (np.floor(4096 * (px + case.noise_px * rng.standard_normal(len(px)))) / 4096
                         for px in (observed.roll_px, observed.pitch_px))
    return Samples(roll_px, pitch_px, observed.lines.f_b + case.bias_m_s2, observed.lines.yaw_rate * case.yaw_rate,
                   Instrument().calibration(k=Gyro().k * case.k))


def told(case: Case, compensation: str) -> Attitude:
    """What the float64 reference makes of a case."""
    given = samples(case)
    roll, pitch = angles_of_pixels(given.roll_px, given.pitch_px, given.words)
    return attitude(roll, pitch, given.f_b, given.yaw_rate, k=given.words.k,
                    period_s=1 / FLIGHTS[case.flight].rate_hz, compensation=compensation, erection_s=case.erection_s)


def twin(cases: Sequence[Case], compensation: str, count: int | None = None) -> list[dict[str, np.ndarray]]:
    """What the twin of OPT_attitude makes of cases with one line rate and one erection, which run side by side.

    Returns: for each case ``angles`` and ``measured``, roll and pitch in degrees, (N, 2); only ``count`` updates, if
    given.
    """
    config = configuration(cases[0], compensation)
    system, given = opt_attitude(config), [samples(case) for case in cases]
    lengths = [len(one.roll_px) if count is None else count for one in given]

    def side_by_side(name):
        # Shorter flights stand still at their ends.
        return np.stack([np.take(getattr(one, name), np.arange(max(lengths)), axis=0, mode="clip")
                         for one in given], axis=1)

    values = {"px": np.stack([side_by_side("roll_px"), side_by_side("pitch_px")], axis=-1), "f": side_by_side("f_b"),
              "yaw_rate": side_by_side("yaw_rate"), "h": np.array([one.words.h for one in given]),
              "k": np.array([one.words.k for one in given])}
    values |= {name: np.array([[getattr(one.words, f"{name}_{ccd}") for ccd in "rp"] for one in given])
               for name in ("n0", "scale", "tilt", "c3")}
    result, _ = system.run(config.pool, system.bind(**{name: values[name] for name in system.inputs}))
    told = system.read(result)
    return [{name: told[name][:length, index].astype(float) for name in ("angles", "measured")}
            for index, length in enumerate(lengths)]


def configuration(case: Case, compensation: str) -> OpticalConfig:
    """The configuration of a core for a case."""
    lines = round(OPTICAL_TCD1304.sensor_clock_hz / FLIGHTS[case.flight].rate_hz)
    return OPTICAL_TCD1304.replace(line_clocks=lines, compensation=compensation, erection_s=case.erection_s)


def twin_errors(cases: Sequence[Case], count: int | None = None) -> list[dict[str, list[float]]]:
    """Largest difference of the twin from the float64 reference, roll and pitch in degrees, by compensation."""
    rows: list[dict[str, list[float]]] = [{} for _ in cases]
    for compensation in ALL[1:]:
        chosen = sorted((index for index, case in enumerate(cases) if compensation in case.compensations),
                        key=lambda index: _kind(cases[index]))
        for _, group in groupby(chosen, lambda index: _kind(cases[index])):
            indices = list(group)
            for index, found in zip(indices, twin([cases[index] for index in indices], compensation, count),
                                    strict=True):
                # The measured angles are those without compensation.
                for name, output in ((compensation, "angles"), ("none", "measured")):
                    if name in cases[index].compensations:
                        truth = told(cases[index], name)
                        apart = found[output] - np.degrees([truth.roll, truth.pitch]).T[:len(found[output])]
                        rows[index][name] = list(map(largest, apart.T))
    return rows


def _kind(case):
    return FLIGHTS[case.flight].rate_hz, case.erection_s


def differences(case: Case, found: Attitude) -> tuple[np.ndarray, np.ndarray]:
    """Errors of roll and pitch, degrees, shape (N,)."""
    lines = seen(case.flight, case.drift_rad_s).lines
    return np.degrees(found.roll - lines.roll), np.degrees(found.pitch - lines.pitch)


def flight_errors(case: Case) -> dict[str, dict[str, list[float]]]:
    """Largest and rms error of the float64 reference, roll and pitch in degrees, by compensation."""
    rows = {}
    for compensation in case.compensations:
        errors = differences(case, told(case, compensation))
        rows[compensation] = {"largest": list(map(largest, errors)), "rms": list(map(rms, errors))}
    return rows


def optical_digest() -> str:
    """Digest of the equations that the twin computes."""
    return equations_digest(opt_attitude(OPTICAL_ERECTED), OPTICAL_ERECTED.pool)


DIE: dict[str, Any] = {"prnu": 0.02, "fringes": 0.03, "lag": 0.01, "transfer": 0.95}
"""Errors of a die and its window."""

SPOTS: dict[str, dict[str, Any]] = {
    "shot and read noise": {},
    "and PRNU of 2 %": {"prnu": 0.02},
    "and fringes of 1 %, lag, deferred charge": DIE | {"fringes": 0.01},
    "and fringes of 3 %, lag, deferred charge": DIE,
    "the same, σ = 3 px": DIE | {"sigma_px": 3.0},
    "the same, σ = 20 px": DIE | {"sigma_px": 20.0},
    "the same, `s11639`, σ = 4.6 px": DIE | {"sigma_px": 4.6, "sensor": "s11639"},
    "the same, saturated 8-fold": DIE | {"exposure": 8.0},
    "the same, ambient light of 10 %": DIE | {"ambient": 0.1},
    "the same, ambient light of 30 %": DIE | {"ambient": 0.3},
    "the same, gradient of 10 %": DIE | {"gradient": 0.1},
    "the same, ghost of 20 % at 40 px": DIE | {"ghost": 0.2, "ghost_px": 40.0},
    "the same, ghost of 20 % at 150 px": DIE | {"ghost": 0.2, "ghost_px": 150.0},
}
"""Rows of the table of positions: options of LineCamera; ``sensor`` and ``exposure``, a factor of the right one."""


def position_error(die: int, lines: int, sensor: str = "tcd1304", exposure: float = 1.0,
                   **options: Any) -> tuple[np.ndarray, int]:
    """Errors of the positions that a die gives, pixels, without their mean; number of lines that are lost.

    A line is lost if nothing is found, or something more than ``FAR`` pixels away.
    """
    pixels = SENSORS[sensor].pixels
    position = np.random.default_rng(die).uniform(0.1 * pixels, 0.9 * pixels, lines)
    camera = LineCamera(pixels, seed=die, **options)
    found = Thresholds().track(SpotFinder(pixels), camera.charge(position, exposure * camera.exposure_s))
    # The first line only sets the black level, and the second the thresholds.
    error = (found["position"] / 4096 - position)[2:]
    good = (found["found"][2:] == 1) & (np.abs(error) < FAR)
    return error[good] - error[good].mean(), int((~good).sum())


def positions(dies: int, lines: int) -> dict[str, Any]:
    """RMS error of all lines and of the first die, and lines that are lost, for each row of ``SPOTS``."""
    rows = {}
    for title, options in SPOTS.items():
        errors, lost = zip(*(position_error(die, lines, **options) for die in range(dies)), strict=True)
        rows[title] = {"rms_px": rms(np.concatenate(errors)), "first_die_px": rms(errors[0]), "lost": sum(lost)}
    return {"dies": dies, "lines": lines, "rows": rows}


def geometry() -> dict[str, float]:
    """Largest difference of the closed form from the rays, and of the inverse; what a cover glass makes at 30°."""
    roll, pitch = np.meshgrid(*[np.radians(np.linspace(-31, 31, 63))] * 2)
    placed = Instrument(LineSeat(tilt=0.02), LineSeat(distance_mm=25.5, n0=1830.25, tilt=-0.01, aside_mm=6.12))
    position, words = placed.pixels(rotor_axis(roll, pitch)), placed.calibration()
    roll_back, pitch_back = angles_of_pixels(position[0], position[1], words)
    angle = np.radians(np.linspace(-30, 30, 61))
    glass = LineSeat(glass_mm=0.7)
    offset = Instrument(glass, glass).pixels(rotor_axis(angle, 0))[0] - glass.n0
    left = {}
    for name, columns in ("glass_deg", [offset]), ("glass_with_c3_deg", [offset, offset**3]):
        scale, *cubic = np.linalg.lstsq(np.stack(columns, axis=-1), np.tan(angle))[0]
        fitted = replace(words, scale_r=scale, tilt_r=0.0, c3_r=cubic[0] / scale**3 if cubic else 0.0)
        left[name] = largest(np.degrees(angles_of_pixels(offset + glass.n0, 0.0, fitted)[0] - angle))
    return {"rays_deg": largest(np.degrees([roll_back - roll, pitch_back - pitch])),
            "inverse_px": largest(np.subtract(pixels_of_angles(roll_back, pitch_back, words), position)), **left}


def measured(dies: int = 10, lines: int = 200) -> dict[str, Any]:
    """All figures of the study."""
    return {"equations_sha256": optical_digest(),
            "flights": [{"title": case.title, "flight": case.flight, "rate_hz": FLIGHTS[case.flight].rate_hz,
                         "errors_deg": flight_errors(case), "twin_deg": apart}
                        for case, apart in zip(CASES, twin_errors(CASES), strict=True)],
            "positions": positions(dies, lines), "geometry": geometry()}


def flights_table(result: dict[str, Any]) -> str:
    """Largest errors in flight as a Markdown table: roll / pitch in degrees."""
    return markdown_table(
        ["flight", "what happens", "lines per second:", *(f"{name}:" for name in ALL), "twin − float64:"],
        [[row["flight"], row["title"], f"{row['rate_hz']:.0f}", *_cells(row["errors_deg"]),
          f"{max(map(max, row['twin_deg'].values())):.6f}"]
         for row in result["flights"]])


def _cells(errors: dict) -> Iterator[str]:
    for name in ALL:
        yield " / ".join(f"{value:.4f}" if value < 1 else f"{value:.3f}"
                         for value in errors[name]["largest"]) if name in errors else "–"


def positions_table(result: dict[str, Any]) -> str:
    """Errors of the positions as a Markdown table."""
    return markdown_table(["image", "rms error, px:", "lines lost:"], [
        [title, f"{row['rms_px']:.3f}", row["lost"]] for title, row in result["positions"]["rows"].items()])


def geometry_lines(result: dict[str, Any]) -> str:
    """Figures of the geometry as a list."""
    figures = result["geometry"]
    return "\n".join((
        f"- equations against the ray tracer, within ±31°: {figures['rays_deg']:.1g}°",
        f"- positions from angles from positions: {figures['inverse_px']:.1g} px",
        f"- cover glass of 0.7 mm at 25 mm, within ±30°: {figures['glass_deg']:.4f}° without c3, "
        f"{figures['glass_with_c3_deg']:.4f}° with it"))


def draw(path: Path) -> None:
    """Errors over time: the turn with each compensation, and the long flight with drift and erection."""
    figure = Figure(figsize=(9.0, 6.4), dpi=150, layout="constrained")
    turn = next(case for case in CASES if case.flight == "c" and case.compensations == ALL)
    plain, erected = (case for case in CASES if case.drift_rad_s)
    curves: tuple[tuple[Flight, list], ...] = (
        (FLIGHTS["c"], [(name, turn, name) for name in ALL]),
        (FLIGHTS["g"], [("none", plain, "none"), ("exact", plain, "exact"), ("erected", erected, "exact")]))
    for axes, (flight, lines), note in zip(figure.subplots(2, 1), curves, ("", ", bearing drift 0.2°/min"),
                                           strict=True):
        for label, case, compensation in lines:
            error = np.max(np.abs(differences(case, told(case, compensation))), axis=0)
            time_s = seen(case.flight, case.drift_rad_s).lines.time_s
            axes.plot(time_s, error, color=COLOURS[label], linewidth=1.2, label=label)
        axes.set_yscale("log")
        axes.set_ylim(bottom=1e-4)
        axes.yaxis.set_major_formatter("{x:g}")
        axes.set_ylabel("larger error (°)")
        axes.set_title(f"{flight.title}{note}", loc="left", fontweight="bold")
        axes.grid(color="#e4e4e4", linewidth=0.6)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(loc="lower right", ncols=3, frameon=False, fontsize="small")
    axes.set_xlabel("time (s)")
    FigureCanvasAgg(figure).print_png(path, metadata={"Software": None})


def main():
    """Measure, and write the JSON file, the picture and the tables."""
    result = measured()
    folder = ROOT / "docs" / "report"
    (folder / "optical.json").write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    draw(folder / "optical.png")
    write_blocks(ROOT / "docs" / "optical.md", {"flights": flights_table(result), "positions": positions_table(result),
                                                "geometry": geometry_lines(result)})


if __name__ == "__main__":
    main()
