"""Runs a flight or recorded lines through OPT_top, from the pins of sensors and ADCs, and shows what it does."""

import csv
import json
import os
import shlex
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from strapdown.blocks import SENSORS, LineSensor
from strapdown.config import ConfigError
from strapdown.cores import OpticalConfig
from strapdown.cores.optical_update import STATUS
from strapdown.export import write_core
from strapdown.files import written_together
from strapdown.link import Frame, FrameDecoder

from .drivers.optical import TOP, Inertial, OpticalRun, PinBench, Spots
from .drivers.toolchain import compiler, verilator_root
from .errors import angle_difference, spread
from .instrument.calibration import Calibration
from .instrument.errors import InstrumentError
from .instrument.flights import Flight
from .instrument.scene import Scene
from .optical_page import lost_lines, optical_page
from .optical_picture import PARTS, angles_picture, budget_picture, exposure_picture, lines_picture
from .page import require_plotly
from .reference.optical import angles_of_pixels, attitude

__all__ = ["SAMPLES", "Judgement", "Recorded", "Source", "Turned", "errors_of", "flight_scene", "inertial_samples",
           "judged", "optical", "recorded_source", "scene_source"]

SAMPLES = 4
"""Samples of accelerometer and yaw rate in a line period of a flight."""


class Source(NamedTuple):
    """Where the light comes from.

    Fields
    ------
    name : str
        Title in pictures.
    image : callable
        Gives the pixels of a Line.
    calibration : Calibration
    scene : Scene or None
        With the truth, for a flight.
    """

    name: str
    image: Callable
    calibration: Calibration
    scene: Scene | None = None


class Recorded:
    """Recorded lines of both sensors, shape (2, N, pixels), in their order; the last one repeats."""

    def __init__(self, lines):
        self._lines = lines

    def __call__(self, line):
        return self._lines[line.ccd, min(line.number, self._lines.shape[1] - 1)]


def recorded_source(name: str, lines: np.ndarray, sensor: LineSensor, calibration: Calibration | None = None) -> Source:
    """The Source of recorded lines, shape (2, N, pixels); by default the sensors have their middle at angle zero, 25 mm
    from the pivot, and the centre of mass is on it.
    """
    middle, scale = (sensor.pixels - 1) / 2, sensor.pitch_um / 25_000
    return Source(name, Recorded(lines), calibration or Calibration(middle, middle, scale, scale))


def flight_scene(flight: Flight, config: OpticalConfig, lines: int, *, start_s: float = 0.0, camera: dict | None = None,
                 seed: int = 0) -> Scene:
    """The Scene of some line periods of a flight, for the sensors of a configuration.

    The run begins ``start_s`` seconds after the flight; then the rotor axis is vertical. ``camera`` and ``seed`` are
    those of Scene. Raises: InstrumentError if the flight ends before the run.
    """
    duration_s = (lines + 2) / config.sample_rate_hz
    if start_s + duration_s > flight.duration_s:
        begin = f" from {start_s:g} s on" if start_s else ""
        raise InstrumentError(f"{lines} lines{begin} take {duration_s:g} s, and the flight lasts "
                              f"{flight.duration_s:g} s")
    sensor = SENSORS[config.sensor]
    return Scene(flight.later(start_s), pixels=sensor.pixels, pitch_um=sensor.pitch_um, duration_s=duration_s,
                 exposure_s=config.exposure_us * 1e-6, camera=camera, seed=seed)


def scene_source(name: str, scene: Scene, calibration: Calibration | None = None) -> Source:
    """The Source of a Scene; the core's words are by default the right ones."""
    return Source(name, scene.image, calibration or scene.calibration, scene)


class Turned(NamedTuple):
    """Roll and pitch in degrees, shape (N,)."""

    roll: np.ndarray
    pitch: np.ndarray

    def less(self, other: "Turned") -> "Turned":
        """The difference, wrapped into [-180, 180)."""
        return Turned(*(angle_difference(mine, its) for mine, its in zip(self, other, strict=True)))


def optical(source: Source, config: OpticalConfig, directory: str | os.PathLike, *, lines: int,
            build: str | os.PathLike, command: Sequence[str] = (), shown: int | None = None, html: bool = False,
            progress: Callable[[str, int, int], object] | None = None) -> dict[str, Any]:
    """Run lines through OPT_top in Verilator, from power-up, and write what happened.

    The function writes the core's ``.v`` and ``.json``; ``summary.json``; ``angles.csv`` (t, the middle of the roll
    sensor's exposure, in seconds; angles in degrees; positions in pixels, nan before the first; peaks in counts;
    exposures in µs; status); the pictures ``lines.png``, ``angles.png``, ``exposure.png`` and, for a flight,
    ``budget.png``; and, if asked, ``optical.html``, one self-contained page. The files are moved into the folder after
    all are written. If the run fails or is interrupted, the folder does not change.

    Parameters
    ----------
    source : Source
    config : OpticalConfig
        With an internal trigger.
    directory : Path
        Folder to write to.
    lines : int
        Line periods; as many updates come.
    build : Path
        Folder for compiled models.
    command : sequence of str
        Words of the command line that makes the Verilog again; empty for none.
    shown : int or None
        Update whose lines are drawn; by default the middle one.
    html : bool
        Whether to write ``optical.html``. Needs plotly.
    progress : callable or None
        ``progress(stage, done, total)``, called from time to time; stages are "build", "simulate", "compare".

    Returns
    -------
    dict
        Contents of ``summary.json``.

    Raises: SimulatorMissingError without g++ or Verilator, MissingPlotlyError for a page without plotly, and
    ConfigError for an external trigger, before any file is made; InstrumentError without scipy; ToolError if g++ or
    Verilator fails; OSError if files cannot be written.
    """
    compiler()
    verilator_root()
    if html:
        require_plotly()
    if config.trigger != "internal":
        raise ConfigError(f"configuration {config.name}: a run needs trigger=internal, not {config.trigger!r}")
    told = progress or (lambda stage, done, total: None)
    told("build", 0, 1)
    with written_together(Path(directory)) as partial:
        bench = PinBench(config, build)
        write_core(bench.core, config, partial, shlex.join(command))
        told("build", 1, 1)
        inertial = inertial_samples(source.scene, bench, lines) if source.scene else Inertial.none()
        run = bench.run(lines, source.image, calibration=source.calibration.ports(), inertial=inertial,
                        progress=lambda done: told("simulate", done, lines))
        told("simulate", lines, lines)
        told("compare", 0, 1)
        summary = _written(source, bench, run, partial, shown, html)
        told("compare", 1, 1)
    return summary


def inertial_samples(scene: Scene, bench: PinBench, lines: int) -> Inertial:
    """Samples of accelerometer and yaw rate of a flight: SAMPLES in a line period, equidistant."""
    line, clock_hz = bench.timing.line_cycles, bench.config.clock_hz
    cycle = line // (2 * SAMPLES) + np.arange((lines + 1) * SAMPLES) * line // SAMPLES
    motion = scene.flight.at(cycle / clock_hz)
    return Inertial(cycle, motion.f_b, motion.yaw_rate)


def errors_of(source: Source, run: OpticalRun, spots: tuple[Spots, Spots]) -> tuple[Turned, dict[str, Turned], slice]:
    """Angles in float64, and the parts of the error of a run, of the updates from the first one with both spots on.

    Returns
    -------
    reference : Turned
        Roll and pitch in float64 from the positions that the circuit used.
    parts : dict
        ``arithmetic``: the circuit less the reference. For a flight also ``light``: the reference less that from the
        true positions, ``equations``: that less the truth; and ``total``, their sum.
    rows : slice
        The updates.
    """
    positions = [own.position for own in spots]
    known = np.flatnonzero(np.logical_and.reduce([position >= 0 for position in positions]))
    rows = slice(int(known[0]) if len(known) else len(run.cycle), len(run.cycle))
    circuit = Turned(*(run.angles[port][rows].astype(float) for port in ("out_roll", "out_pitch")))
    sums, number = run.sums
    share = np.where(number, 1 / np.maximum(number, 1), 0)[rows]
    means = {port: values[rows] * share for port, values in sums.items()}

    def angles(roll_px, pitch_px):
        config = run.config
        measured = angles_of_pixels(roll_px, pitch_px, source.calibration)
        f_b = np.stack([means[f"in_acc{axis}"] for axis in "xyz"], axis=-1)
        found = attitude(measured[0], measured[1], f_b, means["in_yaw_rate"], k=source.calibration.k,
                         period_s=config.period_s, compensation=config.compensation, erection_s=config.erection_s,
                         erection_limit_deg_min=config.erection_limit_deg_min)
        return Turned(np.degrees(found.roll), np.degrees(found.pitch))

    if rows.start == rows.stop:
        return Turned(np.zeros(0), np.zeros(0)), {}, rows
    reference = angles(*(position[rows] / 4096 for position in positions))
    parts = {"arithmetic": circuit.less(reference)}
    if source.scene is not None:
        middles = [np.array([pair[ccd].middle_s for pair in run.seen[rows]]) for ccd in range(2)]
        truth_r, truth_p = (source.scene.at(times) for times in middles)
        ideal = angles(truth_r.roll_px, truth_p.pitch_px)
        truth = Turned(np.degrees(truth_r.roll), np.degrees(truth_p.pitch))
        parts |= {"light": reference.less(ideal), "equations": ideal.less(truth), "total": circuit.less(truth)}
    return reference, parts, rows


class Judgement(NamedTuple):
    """A run beside its twin, float64 and the truth.

    Fields
    ------
    spots : pair of Spots
        Of the roll and of the pitch sensor.
    differing_bits : int
        Bits of angles and status that differ from the twin.
    decoder, frames : FrameDecoder, list of Frame
        That of the serial line, and what it has read.
    frames_differing : int
        Frames that differ from the twin.
    reference, parts, rows : Turned, dict, slice
        As from ``errors_of``.
    truth : Turned or None
        True angles of all updates, for a flight.
    position_error_px : pair of ndarray, or None
        Errors of the positions that were found, of each sensor, for a flight.
    """

    spots: tuple[Spots, Spots]
    differing_bits: int
    decoder: FrameDecoder
    frames: list[Frame]
    frames_differing: int
    reference: Turned
    parts: dict[str, Turned]
    rows: slice
    truth: Turned | None = None
    position_error_px: tuple[np.ndarray, ...] | None = None


def judged(source: Source, bench: PinBench, run: OpticalRun) -> Judgement:
    """Compare a run without faults with its twin, with float64 and, for a flight, with the truth."""
    twin, spots = bench.twin(run)
    decoder, frames = run.frames()
    found = Judgement(spots, bench.differing_bits(run, twin), decoder, frames, bench.frames_differing(frames, twin),
                      *errors_of(source, run, spots))
    if source.scene is None or found.rows.start == found.rows.stop:
        return found
    roll, pitch = (source.scene.at(np.array([pair[ccd].middle_s for pair in run.seen])) for ccd in range(2))
    return found._replace(
        truth=Turned(np.degrees(roll.roll), np.degrees(pitch.pitch)),
        position_error_px=tuple((own.position / 4096 - true)[own.good]
                                for own, true in zip(spots, (roll.roll_px, pitch.pitch_px), strict=True)))


def _written(source, bench, run, folder, shown, html):
    """Write CSV, pictures, page and summary; returns the summary."""
    config, seen = run.config, run.seen
    found = judged(source, bench, run)
    spots, truth, parts = found.spots, found.truth, found.parts
    exposures = np.array([[line.exposure_s * 1e6 if line else np.nan for line in pair] for pair in seen]).reshape(-1, 2)
    time_s = np.array([pair[0].middle_s if pair[0] else np.nan for pair in seen])
    summary: dict[str, Any] = {
        "source": source.name, "config": config.name, "sensor": config.sensor, "updates": len(run.cycle),
        "lost_lines": int(lost_lines(run.line).sum()),
        "line_rate_hz": config.sample_rate_hz, "cycles_per_line": bench.timing.line_cycles,
        "cycles_from_last_pixel_to_angles": bench.core.latency,
        "bits_differing_from_twin": found.differing_bits,
        "timing_violations": [f"cycle {each.cycle}, {each.model}: {', '.join(each.rules)}"
                              for each in run.pins.violations],
        "frames": {"received": len(found.frames), "lost": found.decoder.lost, "crc_errors": found.decoder.crc_errors,
                   "differing_from_twin": found.frames_differing},
        "updates_by_status": {name: int(run.flag(name).sum()) for name in STATUS},
        "counts": {"least": int(run.light.min()), "largest": int(run.light.max())} if len(run.cycle) else None,
        "updates_with_both_spots": int(np.logical_and(*(own.good for own in spots)).sum()),
    }
    # After the first lines the exposure settles, and the first updates have no precession.
    summary["error_deg"] = {name: {axis: spread(np.abs(values)) for axis, values in part._asdict().items()}
                            for name, part in parts.items()}
    if found.position_error_px is not None:
        summary["position_error_px"] = {
            axis: spread(np.abs(error)) for axis, error in zip(Turned._fields, found.position_error_px, strict=True)}
    own_title = f"{TOP}, configuration {config.name}, {config.sample_rate_hz:g} Hz"
    title = f"{source.name}\n{own_title}"
    angles = Turned(*(run.angles[port].astype(float) for port in ("out_roll", "out_pitch")))
    measured = Turned(*(run.angles[f"{port}_measured"].astype(float) for port in ("out_roll", "out_pitch")))
    _write_csv(folder / "angles.csv", {
        "t": (time_s, 7), "roll": (angles.roll, 6), "pitch": (angles.pitch, 6),
        "roll_measured": (measured.roll, 6), "pitch_measured": (measured.pitch, 6),
        **({"roll_true": (truth.roll, 6), "pitch_true": (truth.pitch, 6)} if truth else {}),
        **{f"{axis}_px": (np.where(own.position < 0, np.nan, own.position / 4096), 4)
           for axis, own in zip(Turned._fields, spots, strict=True)},
        "roll_peak": (spots[0].results["peak"], 0), "pitch_peak": (spots[1].results["peak"], 0),
        "roll_exposure_us": (exposures[:, 0], 2), "pitch_exposure_us": (exposures[:, 1], 2), "status": (run.status, 0)})
    if len(run.cycle):
        flags = {name.replace("_", " "): run.flag(name) for name in STATUS}
        known, known_measured = _known(angles, spots), _known(measured, spots)
        index = len(run.cycle) // 2 if shown is None else min(shown, len(run.cycle) - 1)
        lines_picture(folder / "lines.png", title=title, light=run.light, spots=spots, index=index, line=run.line)
        angles_picture(folder / "angles.png", title=title, time_s=time_s, angles=known,
                       measured=known_measured, truth=truth, time_of_errors=time_s[found.rows],
                       reference=found.reference, parts=parts)
        exposure_picture(folder / "exposure.png", title=title, time_s=time_s, exposure_us=exposures,
                         peaks=[own.results["peak"] for own in spots], flags=flags)
        if html:
            optical_page(folder / "optical.html", title=f"{source.name}: {own_title}", time_s=time_s, run=run,
                         spots=spots, angles=known, measured=known_measured, truth=truth, reference=found.reference,
                         parts=parts, rows=found.rows, exposure_us=exposures, flags=flags, facts=list(_facts(summary)))
    if truth is not None:
        budget_picture(folder / "budget.png", title=title, parts=parts)
    (folder / "summary.json").write_text(json.dumps(summary, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    return summary


def _facts(summary):
    """Rows of the table of a page."""
    frames = summary["frames"]
    yield "source", summary["source"]
    yield "configuration", f"{summary['config']}, {summary['sensor']}"
    yield "updates", f"{summary['updates']:,} at {summary['line_rate_hz']:g} Hz"
    yield "lost lines", f"{summary['lost_lines']:,}"
    yield "cycles from last pixel to angles", f"{summary['cycles_from_last_pixel_to_angles']:,}"
    yield "bits that differ from the twin", f"{summary['bits_differing_from_twin']:,}"
    yield "violations of the sensors' timing", f"{len(summary['timing_violations']):,}"
    yield "frames", f"{frames['received']:,}, {frames['lost']:,} lost, {frames['crc_errors']:,} CRC errors"
    for part, name in PARTS.items():
        for axis, error in summary["error_deg"].get(part, {}).items():
            if error["max"] is not None:
                yield f"{axis}, {name}", f"{error['rms']:.6f}° RMS, {error['max']:.6f}° at most"


def _known(angles, spots):
    """The angles, NaN before the first position of their sensor."""
    return Turned(*(np.where(own.position < 0, np.nan, values) for values, own in zip(angles, spots, strict=True)))


def _write_csv(path, columns):
    """Write a CSV file; ``columns`` maps names to (numbers, decimals)."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*([f"{value:.{decimals}f}" for value in np.asarray(values).tolist()]
                               for values, decimals in columns.values()), strict=True))

