"""The optical attitude sensor: from pixels to roll and pitch in float64, and the spot finder in integers.

Body axes: x forward, the outer gimbal axis; y right, the inner gimbal axis at zero roll; z down. Roll is positive
right side down, pitch nose up. "Measured" angles are those of the body against the rotor axis; the rotor axis leaves
the vertical as the accelerometer's specific force f turns it. The level frame L has z down and the body's heading.

Written from the text of source 004, as corrected in docs/optical.md, with angles and arc sines in the place of the
sines and cosines of the core. A calibration is any object with the fields of
``strapdown_sim.instrument.calibration.Calibration``.
"""

from math import asin, atan2, cos, radians, sin, sqrt
from typing import NamedTuple

import numpy as np

__all__ = ["BLOCK", "GRAVITY_M_S2", "SATURATED", "Attitude", "Spot", "angles_of_pixels", "attitude", "next_exposure",
           "pixels_of_angles", "rotor_axis", "specific_force_level", "spot", "thresholds"]

GRAVITY_M_S2 = 9.80665
"""The g of the erection rate."""

SLOW_TURN_RAD_S = radians(1.0)
"""Erection works while the yaw rate is smaller."""

BLOCK, SATURATED = 64, 4_000
"""Pixels whose mean is a candidate for the black level; a pixel with this count or more is saturated."""


def angles_of_pixels(position_r, position_p, calibration):
    """Measured roll and pitch, rad, from the positions of both lines, 0-based pixels, shape (...).

    Each fan of light is a plane through the pivot that holds the rotor axis, and its normal is a gimbal axis. The
    roll CCD's point (w, 1 + tilt·w) in y and z is normal to (cos γ, −sin γ), the pitch CCD's point
    (−w, h, 1 + tilt·w) to (cos θ, sin γ·sin θ, cos γ·sin θ).
    """
    w_r = _slope(position_r, calibration.n0_r, calibration.scale_r, calibration.c3_r)
    w_p = _slope(position_p, calibration.n0_p, calibration.scale_p, calibration.c3_p)
    roll = np.arctan2(w_r, 1 + calibration.tilt_r * w_r)
    pitch = np.arctan2(w_p, (1 + calibration.tilt_p * w_p) * np.cos(roll) + calibration.h * np.sin(roll))
    return roll, pitch


def pixels_of_angles(roll, pitch, calibration):
    """Positions of both lines, pixels, from measured roll and pitch, rad: the inverse of ``angles_of_pixels``."""
    tan_r, tan_p = np.tan(roll), np.tan(pitch)
    w_r = tan_r / (1 - calibration.tilt_r * tan_r)
    w_p = tan_p * (np.cos(roll) + calibration.h * np.sin(roll)) / (1 - calibration.tilt_p * tan_p * np.cos(roll))
    return (calibration.n0_r + _undistorted(w_r, calibration.c3_r) / calibration.scale_r,
            calibration.n0_p + _undistorted(w_p, calibration.c3_p) / calibration.scale_p)


def _slope(position, n0, scale, c3):
    w = (np.asarray(position, float) - n0) * scale
    return w * (1 + c3 * w**2)


def _undistorted(wanted, c3):
    """The w of w·(1 + c3·w²) = wanted, by Newton's method."""
    w = np.asarray(wanted, float)
    for _ in range(6):
        w = w - (w * (1 + c3 * w**2) - wanted) / (1 + 3 * c3 * w**2)
    return w


def rotor_axis(roll, pitch):
    """Rotor axis in body axes for measured roll and pitch, rad; shape (..., 3)."""
    roll, pitch = np.broadcast_arrays(roll, pitch)
    return np.stack([-np.sin(pitch), np.sin(roll) * np.cos(pitch), np.cos(roll) * np.cos(pitch)], axis=-1)


class Attitude(NamedTuple):
    """Roll and pitch, rad, shape (N,); rotor axis in L after each update, shape (N, 3)."""

    roll: np.ndarray
    pitch: np.ndarray
    axis: np.ndarray


def attitude(measured_roll, measured_pitch, f_b, yaw_rate, *, k, period_s, compensation="exact", erection_s=0.0,
             erection_limit_deg_min=0.5):
    """Roll and pitch of a run, from a rotor that is vertical at its start.

    Parameters
    ----------
    measured_roll, measured_pitch : ndarray, shape (N,)
        Angles of the body against the rotor axis, rad, at the end of each line period.
    f_b : ndarray, shape (N, 3)
        Mean specific force over each line period, body axes, m/s².
    yaw_rate : ndarray, shape (N,)
        Mean rate of the heading over each line period, rad/s.
    k : float
        Precession coefficient m·l_oc/H, s/m.
    period_s : float
        Line period.
    compensation : str
        "none": the rotor is taken as vertical. "patent": the integrals as printed. "exact".
    erection_s, erection_limit_deg_min : float
        With "exact": time constant that pulls the axis to the accelerometer's vertical, 0 for none, and largest rate.

    Returns
    -------
    Attitude
        Its axis stays vertical without "exact".

    The first update has no precession, because the angles before it are not known. ``patent`` integrates from the
    second update on too; its integrals take the angles of the same update.
    """
    steps = {"none": _no_steps, "patent": _patent_steps, "exact": _exact_steps}
    samples = zip(measured_roll, measured_pitch, np.asarray(f_b).tolist(), yaw_rate, strict=True)
    found = steps[compensation](samples, k * period_s, period_s, erection_s, radians(erection_limit_deg_min) / 60)
    roll, pitch, *axis = (np.array(values) for values in zip(*found, strict=True))
    return Attitude(roll, pitch, np.stack(axis, axis=-1))


def specific_force_level(roll, pitch, f_b, moved=(0.0, 0.0)):
    """Specific force in L from body axes; both angles have moved on a little, to the first order."""
    fx, fy, fz = f_b
    (sin_r, cos_r), (sin_p, cos_p) = ((sin(angle) + change * cos(angle), cos(angle) - change * sin(angle))
                                      for angle, change in zip((roll, pitch), moved, strict=True))
    y, z = cos_r * fy - sin_r * fz, sin_r * fy + cos_r * fz
    return cos_p * fx + sin_p * z, y, cos_p * z - sin_p * fx


def _no_steps(samples, kt, period_s, erection_s, limit):
    for roll, pitch, _, _ in samples:
        yield roll, pitch, 0.0, 0.0, 1.0


def _patent_steps(samples, kt, period_s, erection_s, limit):
    integral_roll = integral_pitch = step = 0.0
    for roll, pitch, (fx, fy, fz), _ in samples:
        integral_roll += step * (fx + fz * pitch)
        integral_pitch += step * (fy - fz * roll)
        step = kt
        yield roll + cos(pitch) * integral_roll, pitch + integral_pitch, 0.0, 0.0, 1.0


def _exact_steps(samples, kt, period_s, erection_s, limit):
    """N follows −k·N × f − ψ̇·z × N; then the attitude is the rotation from the measured axis to N.

    The force is in L by the angles that are expected: those of the update before, moved on as the measured ones had
    moved until then.
    """
    nx, ny, nz = 0.0, 0.0, 1.0
    before, angles, moved = None, (0.0, 0.0), (0.0, 0.0)
    for measured_roll, measured_pitch, f_b, yaw_rate in samples:
        fx, fy, fz = (0.0, 0.0, 0.0) if before is None else specific_force_level(*angles, f_b, moved)
        turn = yaw_rate * period_s
        shrunk = 1 - turn**2 / 2
        mx = shrunk * nx + turn * ny - kt * (ny * fz - nz * fy)
        my = shrunk * ny - turn * nx - kt * (nz * fx - nx * fz)
        mz = nz - kt * (nx * fy - ny * fx)
        if erection_s and before is not None and abs(yaw_rate) < SLOW_TURN_RAD_S:
            mx += period_s * min(max(fx / (GRAVITY_M_S2 * erection_s), -limit), limit)
            my += period_s * min(max(fy / (GRAVITY_M_S2 * erection_s), -limit), limit)
        length = sqrt(mx * mx + my * my + mz * mz)
        nx, ny, nz = mx / length, my / length, mz / length
        angles = (measured_roll - asin(ny / cos(measured_pitch)),
                  atan2(nx, nz) + asin(sin(measured_pitch) / sqrt(1 - ny * ny)))
        if before is not None:
            moved = measured_roll - before[0], measured_pitch - before[1]
        before = measured_roll, measured_pitch
        yield *angles, nx, ny, nz


class Spot(NamedTuple):
    """What is found in one line: integers, and flags as bool.

    Fields
    ------
    found : bool
        A run is valid. Without one all fields below are zero, except the last three.
    position : int
        Centre of gravity, 2**-12 pixels.
    peak, width, sum, saturated : int
        Of the run that is used: largest count above black, pixels from its first to its last above ``lo``, sum of
        the counts above ``lo``, pixels of 4,000 counts or more.
    several, edge : bool
        More than one run is valid; the run that is used touches an end of the line.
    black : int
        Least mean of the line's blocks of 64 pixels, for the next line.
    line_peak, line_saturated : int, bool
        Of the whole line: largest count above the black level, at least zero; a pixel has 4,000 counts or more. They
        set the next line's thresholds and exposure, so that background light in a run cannot hold them.
    """

    found: bool
    position: int
    peak: int
    width: int
    sum: int
    saturated: int
    several: bool
    edge: bool
    black: int
    line_peak: int
    line_saturated: bool


def spot(line, black, lo, hi, *, gap=5, width_max=1024):
    """The brightest run of one line of 12-bit counts, light positive; see ``Spot``.

    A pixel counts if it is more than ``lo`` above ``black``. A run starts at such a pixel; it ends after ``gap``
    pixels in a row that do not count, at ``width_max`` pixels, or with the line. It is valid if its largest count
    above black is more than ``hi`` and its width is less than ``width_max``: a wider one is background light. The
    run with the largest sum is used, the first of equals.
    """
    line = [int(count) for count in line]
    valid = [run for run in _runs(line, black, lo, gap, width_max)
             if max(line[i] for i in run) - black > hi and run[-1] - run[0] + 1 < width_max]
    whole = max(max(line) - black, 0), max(line) >= SATURATED
    least = min(sum(line[i:i + BLOCK]) // BLOCK for i in range(0, len(line) - BLOCK + 1, BLOCK))
    if not valid:
        return Spot(False, 0, 0, 0, 0, 0, False, False, least, *whole)
    weights = [{i: line[i] - black - lo for i in run} for run in valid]
    totals = [sum(weight.values()) for weight in weights]
    best = totals.index(max(totals))
    run, weight, total = valid[best], weights[best], totals[best]
    start = run[0]
    moment = sum((i - start) * weight[i] for i in run)
    return Spot(True, start * 2**12 + moment * 2**12 // total, max(line[i] for i in run) - black,
                run[-1] - start + 1, total, sum(line[i] >= SATURATED for i in run), len(valid) > 1,
                start == 0 or run[-1] == len(line) - 1, least, *whole)


def _runs(line, black, lo, gap, width_max):
    """Runs, each as the list of the pixels that count."""
    runs: list[list[int]] = []
    open_ = False
    for i, count in enumerate(line):
        if open_ and (i - runs[-1][-1] > gap or i - runs[-1][0] >= width_max):
            open_ = False
        if count - black > lo:
            if not open_:
                runs.append([])
                open_ = True
            runs[-1].append(i)
    return runs


def thresholds(peak_before, *, lo_min=40, shift=2):
    """lo and hi of a line, counts above black, from the largest count above black of the line before."""
    lo = max(lo_min, peak_before >> shift)
    return lo, max(2 * lo_min, lo + (lo >> 1))


def next_exposure(exposure, peak, saturated, least, most):
    """Exposure of the next line, in integer steps, from ``line_peak`` and ``line_saturated`` of this one."""
    if saturated:
        exposure -= exposure >> 1
    elif peak > 3_200:
        exposure -= exposure >> 3
    elif peak < 650:
        exposure += exposure
    elif peak < 2_000:
        exposure += exposure >> 2
    return min(max(exposure, least), most)
