"""Calibration of gyro, accelerometer and magnetometer from a recording: fits, fields of a configuration, picture."""

import json
import shlex
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from strapdown.files import written_together

from .magnetometer import CELLS, FieldFacts, dip_deg, directions, field_facts, field_samples, vertical
from .recordings import Recording
from .sensor_fits import (
    BiasFit,
    EllipsoidFit,
    FitError,
    fit_accelerometer,
    fit_gyro,
    fit_magnetometer,
    require_scipy,
)
from .sensors import corrected

__all__ = ["CalibrationFields", "SensorCalibration", "calibrate_sensors", "calibrated", "calibration_picture",
           "write_sensor_calibration"]

_BEFORE, _AFTER, _GRID = "#e0a458", "#3366aa", "#e4e4e4"
_MOST_POINTS = 3000


class CalibrationFields(NamedTuple):
    """Fields of a configuration for one sensor: corrected sample = matrix (sample − bias), in axes of the sensor.

    The bias, shape (3,), has the unit of the core's input; the matrix, shape (3, 3), is None for one that is not
    fitted. Deviations are standard deviations of their elements, None if they are not known.
    """

    bias: np.ndarray
    matrix: np.ndarray | None
    bias_deviation: np.ndarray | None
    matrix_deviation: np.ndarray | None


@dataclass(frozen=True)
class SensorCalibration:
    """What a recording tells about its sensors.

    Attributes
    ----------
    recording : Recording
    magnetometer, accelerometer : EllipsoidFit or None
    gyro : BiasFit or None
    refused : dict
        Name of each sensor without a fit to the reason, in one line.
    before, after : FieldFacts or None
        The field as it was recorded, and with its calibration.
    field_unit : str
        Unit of the field, for people.
    """

    recording: Recording
    magnetometer: EllipsoidFit | None
    gyro: BiasFit | None
    accelerometer: EllipsoidFit | None
    refused: dict[str, str]
    before: FieldFacts | None
    after: FieldFacts | None
    field_unit: str = "µT"

    @property
    def fields(self) -> dict[str, CalibrationFields]:
        """The fitted sensors, by name."""
        found = {}
        for name in "magnetometer", "gyro", "accelerometer":
            if (fit := getattr(self, name)) is not None:
                matrix, deviation = getattr(fit, "matrix", None), getattr(fit, "matrix_deviation", None)
                found[name] = CalibrationFields(fit.bias, matrix, fit.bias_deviation, deviation)
        return found

    @property
    def notes(self) -> list[str]:
        """What the user should know about the fits, each in one line."""
        lines = [f"{name}: {reason}" for name, reason in self.refused.items()]
        if self.magnetometer is not None and self.after is not None and self.after.strength_varies:
            lines.append("magnetometer: after the calibration its field strength still varies by "
                         f"{100 * self.after.strength_variation:.2g} % with attitude, headings err by about "
                         f"{self.after.heading_error_deg:.2g}°: choose a part of the recording with --from and --to, "
                         "or record far from iron and magnets")
        if self.magnetometer is not None and self.after is not None and self.after.dip_varies:
            lines.append("magnetometer: after the calibration its dip still varies by "
                         f"{self.after.dip_variation_deg:.2g}° with attitude: are its axes those of the accelerometer?")
        if self.accelerometer is not None and self.accelerometer.diagonal:
            lines.append(f"accelerometer: {self.accelerometer.directions} attitudes at rest tell bias and scales; a "
                         "full matrix needs three edges too")
        return lines

    def options(self) -> str:
        """The fields as options of a command line: ``--set magnetometer_bias=… --set …``."""
        words = []
        for sensor, own in self.fields.items():
            words += ["--set", f"{sensor}_bias={_text(own.bias)}"]
            if own.matrix is not None:
                words += ["--set", f"{sensor}_matrix={_text(own.matrix)}"]
        return shlex.join(words)


def _text(values):
    """Numbers as the value of a field; a matrix by rows."""
    return ",".join(f"{value:.7g}" for value in np.ravel(values))


def calibrate_sensors(recording: Recording, field_unit: str = "µT") -> SensorCalibration:
    """Fit what a recording tells about its sensors; ``field_unit`` is that of its magnetometer, for people.

    Raises: MissingExtraError without scipy; FitError if it tells nothing, with the reasons.
    """
    require_scipy()
    fits: dict[str, Any] = {}
    refused = {}
    for name, fit in (("magnetometer", fit_magnetometer), ("gyro", fit_gyro), ("accelerometer", fit_accelerometer)):
        try:
            fits[name] = fit(recording)
        except FitError as error:
            fits[name], refused[name] = None, str(error)
    if len(refused) == len(fits):
        raise FitError("; ".join(f"{name}: {reason}" for name, reason in refused.items()))
    found = SensorCalibration(recording, **fits, refused=refused, before=None, after=None, field_unit=field_unit)
    return replace(found, before=field_facts(recording), after=field_facts(calibrated(recording, found)))


def calibrated(recording: Recording, calibration: SensorCalibration) -> Recording:
    """A recording with the fields of a calibration applied."""
    for sensor, own in calibration.fields.items():
        recording = corrected(recording, sensor, own.bias, np.eye(3) if own.matrix is None else own.matrix)
    return recording


def write_sensor_calibration(calibration: SensorCalibration, directory: Path) -> None:
    """Write ``calibration.json``, ``set.txt``, the options of a command line, and ``calibration.png`` with a field.

    The first has the fields of each sensor and their standard deviations, the reasons of the sensors without, and the
    facts of the field before and after.
    """
    def listed(values):
        return None if values is None else np.asarray(values).tolist()

    result = {
        "recording": calibration.recording.name,
        "fields": {name: value for sensor, own in calibration.fields.items() for name, value in (
            (f"{sensor}_bias", listed(own.bias)), (f"{sensor}_matrix", listed(own.matrix))) if value is not None},
        "standard_deviation": {name: value for sensor, own in calibration.fields.items() for name, value in (
            (f"{sensor}_bias", listed(own.bias_deviation)), (f"{sensor}_matrix", listed(own.matrix_deviation)))
            if value is not None},
        "not_fitted": calibration.refused, "notes": calibration.notes,
        "field_before": calibration.before and calibration.before._asdict(),
        "field_after": calibration.after and calibration.after._asdict()}
    with written_together(directory) as folder:
        (folder / "calibration.json").write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
        (folder / "set.txt").write_text(calibration.options() + "\n", encoding="utf-8")
        if calibration.magnetometer is not None:
            calibration_picture(folder / "calibration.png", calibration)


def calibration_picture(path: Path, calibration: SensorCalibration) -> None:
    """Draw the field before and after the calibration of the magnetometer.

    Three projections with the sphere; strength and dip over time; deviation of the strength over the direction of the
    field in the sensor. Equal data give PNG files of equal bytes.
    """
    fit = calibration.magnetometer
    assert fit is not None, "the picture is that of a magnetometer"
    new, unit = field_samples(calibration.recording), calibration.field_unit
    states: list[tuple[np.ndarray, np.ndarray, str, str]] = []
    for recording, label, colour in ((calibration.recording, "before", _BEFORE),
                                     (calibrated(calibration.recording, calibration), "after", _AFTER)):
        assert recording.mag is not None
        states.append((recording.mag[new], vertical(recording)[new], label, colour))
    time_s = calibration.recording.time_s[new]
    every = slice(None, None, max(len(time_s) // _MOST_POINTS, 1))

    figure = Figure(figsize=(11.0, 10.0), dpi=120, layout="constrained")
    grid = figure.add_gridspec(3, 1, height_ratios=(1.25, 1, 1))
    spheres, curves, maps = (figure.add_subfigure(grid[row]) for row in range(3))
    angle = np.linspace(0, 2 * np.pi, 181)
    for axes, (i, j) in zip(spheres.subplots(1, 3), ((0, 1), (1, 2), (2, 0)), strict=True):
        for field, _, label, colour in states:
            axes.plot(field[every, i], field[every, j], ".", color=colour, markersize=2, markeredgewidth=0, label=label)
        axes.plot(fit.magnitude * np.cos(angle), fit.magnitude * np.sin(angle), color="#10243e", linewidth=0.8)
        axes.set_aspect("equal", adjustable="datalim")
        axes.set_xlabel(f"{'xyz'[i]} ({unit})")
        axes.set_ylabel(f"{'xyz'[j]} ({unit})")
        _plain(axes)
    axes.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=2, frameon=False, fontsize="small", markerscale=4)
    figure.suptitle(f"{calibration.recording.name}: field of the magnetometer before and after its calibration",
                    x=0.01, ha="left", fontweight="bold", parse_math=False)

    strength, dip = curves.subplots(1, 2)
    for field, up, _, colour in states:
        drawn = {"color": colour, "markersize": 2, "markeredgewidth": 0}
        strength.plot(time_s[every], np.linalg.norm(field[every], axis=1), ".", **drawn)
        dip.plot(time_s[every], dip_deg(up[every], field[every]), ".", **drawn)
    for axes, name in (strength, f"strength ({unit})"), (dip, "dip (°)"):
        axes.set_ylabel(name)
        axes.set_xlabel("time (s)")
        _plain(axes)

    panels = maps.subplots(1, 2, sharey=True)
    deviations = [_by_direction(field) for field, *_ in states]
    largest = max(np.abs(values).max() for values in deviations)
    for axes, values, (field, _, label, _) in zip(panels, deviations, states, strict=True):
        x, y, z = directions(field[every]).unit.T
        image = axes.scatter(np.degrees(np.arctan2(y, x)), z, s=12, c=values[every],
                             cmap="RdBu_r", vmin=-largest, vmax=largest, linewidths=0)
        axes.set_xlim(-180, 180)
        axes.set_ylim(-1, 1)
        axes.set_facecolor("#d4d4d4")
        axes.set_xlabel("direction of the field in the sensor: angle about z, from x (°)")
        axes.set_title(f"deviation of the strength from its mean, {label}", loc="left", fontsize="medium")
    panels[0].set_ylabel("z of the unit vector")
    maps.colorbar(image, ax=panels, label="%")
    FigureCanvasAgg(figure).print_png(path, metadata={"Software": None})


def _by_direction(field):
    """Mean deviation of the strength, from its mean over all directions, in the cell of each sample, %, shape (N,)."""
    seen, strength = directions(field), np.linalg.norm(field, axis=1)
    means = np.bincount(seen.cell, seen.weight * strength, minlength=CELLS)
    return 100 * (means[seen.cell] / means[np.unique(seen.cell)].mean() - 1)


def _plain(axes):
    axes.grid(color=_GRID, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
