"""Calibration of the optical attitude sensor: its constants from positions of the lines at known attitudes."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from strapdown.files import written_together

from .errors import largest, rms
from .instrument.calibration import Calibration
from .instrument.flights import body_from_level, level_from_body
from .instrument.rays import measured_angles
from .recordings.table import read_table, require
from .reference.optical import GRAVITY_M_S2, angles_of_pixels, pixels_of_angles, rotor_axis

__all__ = ["CCDS", "CONSTANTS", "REST", "TABLE", "CalibrationError", "Fit", "fit_attitudes", "fit_rest",
           "write_calibration"]

CCDS = {"roll": ("n0_r", "scale_r", "tilt_r", "c3_r"), "pitch": ("n0_p", "scale_p", "tilt_p", "c3_p", "h")}
"""Constants that the attitudes of a table determine, by the CCD that sees them."""

CONSTANTS = *CCDS["roll"], *CCDS["pitch"], "k"
"""All constants."""

TABLE = "roll_deg", "pitch_deg", "roll_px", "pitch_px"
"""Columns of a table: attitude of the body against the rotor axis, positions of the lines."""

REST = "time_s", *TABLE
"""Columns of a rest; its attitudes are those of the body against the vertical."""

LEAST_TILT_DEG = 0.5
"""Of the rotor axis in a rest: below, the drift is too small to measure."""

DEPENDENT = 1e-4
"""Least singular value of the normalised Jacobian for which constants count as independent."""


class CalibrationError(ValueError):
    """Points from which the constants do not follow. The message is one line."""


@dataclass(frozen=True)
class Fit:
    """Constants and how well they fit.

    Attributes
    ----------
    calibration : Calibration
        All constants, those that were held too.
    deviation : dict
        Standard deviations of those that were fitted, by name; None if no point is left over to tell them.
    angle_deg, error_deg : dict
        Angles of the points, and measured minus known angle, (N,), by "roll" and "pitch".
    error_px : dict
        Measured minus expected position, (N,), likewise.
    """

    calibration: Calibration
    deviation: dict[str, float | None]
    angle_deg: dict[str, np.ndarray]
    error_deg: dict[str, np.ndarray]
    error_px: dict[str, np.ndarray]


def fit_attitudes(path: Path, held: Mapping[str, float] | None = None) -> Fit:
    """Fit n0, scale, tilt and c3 of both CCDs, and h, to the attitudes of a CSV file with the columns ``TABLE``.

    Parameters
    ----------
    path : Path
    held : dict or None
        Constants that keep a value.

    Raises: RecordingError for a file that is no table; CalibrationError for too few points or equal ones.

    The squares of the position errors are least. The roll CCD is fitted first: pitch needs roll, but not the reverse.
    """
    table = _read(path, TABLE)
    held = dict(held or {})
    roll, pitch = np.radians(table[TABLE[:2]]).T
    seen = dict(zip(CCDS, table[TABLE[2:]].T, strict=True))
    if np.abs([roll, pitch]).max() >= np.pi / 2:
        raise CalibrationError(f"{path}: attitudes must be within ±90 degrees")
    words = Calibration(0.0, 0.0, 1.0, 1.0)
    deviation: dict[str, float | None] = {}
    for index, (ccd, names) in enumerate(CCDS.items()):
        free = [name for name in names if name not in held]
        if len(table.values) < len(free):
            raise CalibrationError(f"{path}: {len(table.values)} points do not determine the {len(free)} constants "
                                   f"{', '.join(free)}; add points, or hold constants with --hold")
        words = replace(words, **_line(path, ccd, seen[ccd], (roll, pitch)[index]))
        words = replace(words, **{name: held[name] for name in names if name in held})

        def error(changes, words=words, index=index, ccd=ccd):
            return seen[ccd] - pixels_of_angles(roll, pitch, replace(words, **changes))[index]

        fitted, spread = _least_squares(path, {name: getattr(words, name) for name in free}, error)
        words, deviation = replace(words, **fitted), deviation | spread
    words = replace(words, k=held.get("k", 0.0))
    told = angles_of_pixels(seen["roll"], seen["pitch"], words)
    expected = pixels_of_angles(roll, pitch, words)
    known = dict(zip(CCDS, np.degrees([roll, pitch]), strict=True))
    return Fit(words, deviation, known,
               {ccd: np.degrees(angle) - known[ccd] for ccd, angle in zip(CCDS, told, strict=True)},
               {ccd: seen[ccd] - position for ccd, position in zip(CCDS, expected, strict=True)})


def fit_rest(path: Path, fit: Fit) -> Fit:
    """The fit with k too, from a rest with a tilted rotor axis, a CSV file with the columns ``REST``.

    The axis turns about the vertical at the rate k·g, from north to west if k is positive. The squares of the position
    errors are least.

    Raises: RecordingError; CalibrationError for an axis that is not tilted, or does not move.
    """
    table = _read(path, REST)
    time_s, seen = table["time_s"] - table["time_s"][0], table[TABLE[2:]].T
    roll, pitch = np.radians(table[TABLE[:2]]).T
    if len(time_s) < 3 or not (np.diff(time_s) > 0).all():
        raise CalibrationError(f"{path}: a rest needs at least 3 points whose times rise")
    words = fit.calibration
    axis = level_from_body(rotor_axis(*angles_of_pixels(seen[0], seen[1], words)), roll, pitch)
    turned = np.unwrap(np.arctan2(axis[:, 1], axis[:, 0]))
    tilt = np.hypot(axis[:, 0], axis[:, 1]).mean()
    if np.degrees(tilt) < LEAST_TILT_DEG:
        raise CalibrationError(f"{path}: the rotor axis is tilted by {np.degrees(tilt):.2f} degrees, which is too "
                               f"little for k; tilt it by at least {LEAST_TILT_DEG:g}")
    start = {"k": -np.polyfit(time_s, turned, 1)[0] / GRAVITY_M_S2, "x": tilt * np.cos(turned[0]),
             "y": tilt * np.sin(turned[0])}

    def error(values):
        angle = -values["k"] * GRAVITY_M_S2 * time_s
        x = values["x"] * np.cos(angle) - values["y"] * np.sin(angle)
        y = values["x"] * np.sin(angle) + values["y"] * np.cos(angle)
        expected = body_from_level(np.stack([x, y, np.sqrt(1 - x**2 - y**2)], axis=-1), roll, pitch)
        return np.concatenate(np.subtract(seen, pixels_of_angles(*measured_angles(expected), words)))

    fitted, deviation = _least_squares(path, start, error)
    return replace(fit, calibration=replace(words, k=fitted["k"]), deviation=fit.deviation | {"k": deviation["k"]})


def _read(path, columns):
    table = read_table(path, columns)
    require(table, columns)
    return table


def _line(path, ccd, position, angle):
    """n0 and scale of one CCD, from a straight line through the tangents."""
    if np.ptp(position) == 0 or np.ptp(angle) == 0:
        raise CalibrationError(f"{path}: all points have the same {ccd}; the constants of its CCD need several")
    slope, offset = np.polyfit(position, np.tan(angle), 1)
    suffix = ccd[0]
    return {f"n0_{suffix}": -offset / slope, f"scale_{suffix}": slope}


def _least_squares(path, start, error):
    """Values that make the squares of ``error(values)`` least, by Gauss's method, and their standard deviations."""
    names, values = list(start), np.array(list(start.values()), float)
    step = 1e-4 * np.maximum(np.abs(values), 0.01)
    for _ in range(30):
        jacobian = np.stack([(error(dict(zip(names, values + move, strict=True)))
                              - error(dict(zip(names, values - move, strict=True)))) / (2 * move.sum())
                             for move in np.diag(step)], axis=-1)
        size = np.linalg.norm(jacobian, axis=0)
        if not size.all():
            raise CalibrationError(_undetermined(path, [names[index] for index in np.flatnonzero(size == 0)]))
        _, singular, rows = np.linalg.svd(jacobian / size)
        if singular[-1] < DEPENDENT:
            raise CalibrationError(_undetermined(path, [
                name for name, part in zip(names, rows[-1], strict=True) if abs(part) > 0.3]))
        left = error(dict(zip(names, values, strict=True)))
        change = -np.linalg.lstsq(jacobian / size, left)[0] / size
        values = values + change
        if (np.abs(change) < 1e-9 * np.maximum(np.abs(values), 0.01)).all():
            break
    over = len(left) - len(names)
    variance = np.linalg.inv((jacobian / size).T @ (jacobian / size)).diagonal() / size**2
    deviation = np.sqrt(variance * (left @ left) / over).tolist() if over else [None] * len(names)
    return dict(zip(names, values.tolist(), strict=True)), dict(zip(names, deviation, strict=True))


def _undetermined(path, names):
    return (f"{path}: the points do not determine {', '.join(names)}; add other attitudes, or hold a constant, as in "
            f"--hold {names[-1]}=0")


def write_calibration(fit: Fit, directory: Path) -> dict[str, Any]:
    """Write ``calibration.json`` and ``calibration.png``; returns the contents of the first.

    It maps each input port of the core to its value and its word, hexadecimal binary32, and has the standard deviation
    of each fitted constant and the errors of the points, degrees and pixels, largest and rms.
    """
    words = {port: {"value": value, "word": f"{np.float32(value).view(np.uint32):08x}"}
             for port, value in fit.calibration.ports().items()}
    result = {"words": words, "standard_deviation": fit.deviation, "points": len(fit.error_px["roll"]), "errors": {
        ccd: {"largest_deg": largest(fit.error_deg[ccd]), "rms_deg": rms(fit.error_deg[ccd]),
              "largest_px": largest(fit.error_px[ccd]), "rms_px": rms(fit.error_px[ccd])} for ccd in CCDS}}
    with written_together(directory) as folder:
        (folder / "calibration.json").write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
        _picture(fit, folder / "calibration.png")
    return result


def _picture(fit, path):
    """Errors of both angles over each angle."""
    figure = Figure(figsize=(9.0, 6.0), dpi=150, layout="constrained")
    panels = figure.subplots(2, 2, sharex="col", sharey="row")
    for row, (told, colour) in zip(panels, (("roll", "#3366aa"), ("pitch", "#cc6633")), strict=True):
        for axes, over in zip(row, CCDS, strict=True):
            axes.plot(fit.angle_deg[over], 1000 * fit.error_deg[told], ".", color=colour)
            axes.axhline(0, color="#10243e", linewidth=0.8)
            axes.grid(color="#e4e4e4", linewidth=0.6)
            axes.spines[["top", "right"]].set_visible(False)
        row[0].set_ylabel(f"error of {told} (0.001°)")
    for axes, over in zip(panels[-1], CCDS, strict=True):
        axes.set_xlabel(f"known {over} (°)")
    figure.suptitle("Measured minus known angle at the points of the calibration", x=0.01, ha="left",
                    fontweight="bold")
    FigureCanvasAgg(figure).print_png(path, metadata={"Software": None})
