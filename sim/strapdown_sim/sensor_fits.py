"""Fits of the errors of gyro, accelerometer and magnetometer to a recording: bias, scale and axes.

A sensor without error has one magnitude in all attitudes: the magnetometer that of the earth's field, the
accelerometer at rest that of gravity. With a bias b and a linear error its samples x lie on an ellipsoid, and
matrix (x − b) lies on a sphere. The matrix is symmetric, because magnitudes do not tell how the sensor is turned. The
gyro measures its bias at rest. All values are in axes of the sensor.
"""

from collections.abc import Sequence
from importlib.util import find_spec
from typing import NamedTuple

import numpy as np

from strapdown.cores import FLIGHT

from .extras import MissingExtraError
from .magnetometer import CELLS, Directions, directions, field_samples, harmonics
from .recordings import STANDARD_GRAVITY, Recording

__all__ = ["BiasFit", "EllipsoidFit", "FitError", "at_rest", "fit_accelerometer", "fit_ellipsoid",
           "fit_gyro", "fit_magnetometer", "require_scipy", "rests"]

ENTRIES = (0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)
"""Entries of a symmetric matrix in the order of the parameters; those of a diagonal one come first."""

OF_DIAGONAL = 0, 1, 2, 3, 7, 8
"""Harmonics that a bias and a diagonal matrix change; a symmetric one changes all nine."""

LEAST_INFORMATION = 0.5
"""Directions whose worth the least determined combination of parameters must have. In a room the mean strengths of
directions scatter by 1 %; this combination then has a deviation of 1.4 %, 2 degrees of heading with a dip of 65°."""

LONGEST_AXIS = 2.0
"""Ratio of the axes of an ellipsoid above which its shape is not that of a sensor."""

LARGEST_RESIDUAL = 0.05
"""RMS deviation from the ellipsoid, over the magnitude, above which it does not describe the samples: three times what
a room without iron shows."""

NO_ELLIPSOID = ("the samples are on no ellipsoid of a sensor: its surroundings changed during the recording; choose a "
                "part with --from and --to, or record far from iron and magnets")
"""Message on samples that no bias and matrix put right."""

SPREAD = 4.0
"""Multiple of the robust standard deviation beyond which a sample is left out."""

FAR = 0.05
"""Error, over the magnitude, from which on a sample counts less than its square, before those beyond SPREAD are left
out."""

MOST_SAMPLES = 10_000
"""Samples in a fit; of more, every second, third, … is used."""

MOST_STEPS = 50
"""Evaluations in a fit; samples near an ellipsoid take ten."""

SECTOR_DEG = 30
"""Width of the sectors that tell how far a sensor was turned about an axis."""

BLOCK_S, LEAST_BLOCKS = 0.5, 8
"""Time over which samples of a gyro at rest make one observation, and the number of observations that a bias needs."""

STEADY_TURN = 0.25
"""Deviation of the mean rate, over ``rest_rate``, above which a body turns steadily; that of the flight filter."""


class FitError(ValueError):
    """Samples from which the errors of a sensor do not follow. The message says why, in one line."""


def require_scipy() -> None:
    """Raises: MissingExtraError if scipy is not installed."""
    if find_spec("scipy") is None:
        raise MissingExtraError("a calibration needs scipy: pip install 'strapdown[calibrate]'")


class EllipsoidFit(NamedTuple):
    """Corrected sample = matrix (sample − bias).

    Fields
    ------
    bias : ndarray, shape (3,)
        Unit of the samples.
    matrix : ndarray, shape (3, 3)
        Symmetric.
    bias_deviation, matrix_deviation : ndarray or None
        Standard deviations of their elements; None if no direction is left over to tell them.
    magnitude : float
        Of the corrected samples, in their unit.
    residual : float
        RMS deviation of the corrected magnitude from it, relative, each direction with the same weight.
    directions : int
        Cells of the sphere, of ``CELLS``, with a sample.
    diagonal : bool
        Whether only the diagonal of the matrix was fitted.
    """

    bias: np.ndarray
    matrix: np.ndarray
    bias_deviation: np.ndarray | None
    matrix_deviation: np.ndarray | None
    magnitude: float
    residual: float
    directions: int
    diagonal: bool


class BiasFit(NamedTuple):
    """Bias of a gyro, deg/s, shape (3,), its standard deviation, and the number and length of the rests, s."""

    bias: np.ndarray
    bias_deviation: np.ndarray
    rests: int
    rest_s: float


def fit_magnetometer(recording: Recording) -> EllipsoidFit:
    """Hard iron (bias, uT) and soft iron (matrix, determinant 1) of a recording's magnetometer.

    Raises: FitError without a field, and as ``fit_ellipsoid``.
    """
    if recording.mag is None:
        raise FitError("the recording has no magnetometer")
    samples = recording.mag[field_samples(recording)]
    if len(samples) <= 3 + len(ENTRIES):
        raise FitError(f"{len(samples)} samples are too few")
    return fit_ellipsoid(samples)


def fit_accelerometer(recording: Recording) -> EllipsoidFit:
    """Bias (m/s²) and matrix of a recording's accelerometer, from the magnitude of gravity at rest.

    With nine attitudes or more the matrix is symmetric, with six or more diagonal, if they are far enough apart.

    Raises: FitError if the attitudes at rest do not tell them.
    """
    means = np.array([recording.accel[rest].mean(axis=0) for rest in rests(recording)]).reshape(-1, 3)
    seen = directions(means).cells if len(means) else 0
    for diagonal in False, True:
        parameters = 3 + (3 if diagonal else len(ENTRIES))
        if seen >= parameters and _information(directions(means), diagonal) >= LEAST_INFORMATION:
            return fit_ellipsoid(means, magnitude=STANDARD_GRAVITY, diagonal=diagonal, spikes=False)
    known = ("it was never at rest", "one attitude at rest does not tell its errors",
             f"{seen} attitudes at rest do not tell its errors")[min(seen, 2)]
    raise FitError(f"{known}; let the sensor rest for 6 s on each of its six sides, and on three "
                   "edges for a full matrix")


def fit_gyro(recording: Recording) -> BiasFit:
    """Bias of a recording's gyro: its mean over the rests.

    The deviation is the larger of two: that of means over BLOCK_S, over the root of their number, and that of the means
    of the rests, over the root of theirs.

    Raises: FitError without a rest.
    """
    found = rests(recording)
    size = max(round(BLOCK_S * recording.sample_rate_hz), 1)
    blocks, means = [], []
    for rest in found:
        rates = recording.gyro_deg_s[rest]
        if whole := len(rates) // size:
            own = rates[:whole * size].reshape(whole, size, 3).mean(axis=1)
            blocks.append(own)
            means.append(own.mean(axis=0))
    if sum(len(own) for own in blocks) < LEAST_BLOCKS:
        raise FitError("there is no rest that is long enough; let the sensor lie still for 10 s")
    every = np.concatenate(blocks)
    deviation = every.std(axis=0, ddof=1) / np.sqrt(len(every))
    if len(means) > 1:
        deviation = np.maximum(deviation, np.std(means, axis=0, ddof=1) / np.sqrt(len(means)))
    return BiasFit(every.mean(axis=0), deviation, len(means), len(every) * size / recording.sample_rate_hz)


def at_rest(recording: Recording) -> np.ndarray:
    """Which samples of a recording are at rest, bool, shape (N,), as the flight filter defines it (docs/flight.md).

    The mean squares of the deviations of rate and specific force from their running means have been small for
    ``rest_time``. Values are those of the configuration ``flight``; one usual period stands for those of the samples.
    """
    from scipy.signal import lfilter

    period_s = 1 / recording.sample_rate_hz
    share = -np.expm1(-period_s / FLIGHT.rest_average_time)

    def running(values):
        """Running mean after each sample, which begins with the first one."""
        return lfilter([share], [1, share - 1], values, axis=0, zi=(1 - share) * values[:1])[0]

    def before(values):
        return np.concatenate([values[:1], values[:-1]])

    rate, force = running(recording.gyro_deg_s), running(recording.accel)
    gravity = np.maximum(np.linalg.norm(force, axis=1), np.finfo(float).tiny)
    square = (np.square(recording.gyro_deg_s - before(rate)).sum(axis=1) / FLIGHT.rest_rate**2
              + np.square(recording.accel - before(force)).sum(axis=1) / (FLIGHT.rest_acceleration * gravity) ** 2)
    still = running(square) <= 1
    still &= (np.linalg.norm(rate, axis=1) <= FLIGHT.bias_limit) & recording.accel.any(axis=1)
    index = np.arange(len(still))
    last_moving = np.maximum.accumulate(np.where(still, -1, index))
    return (index - last_moving) * period_s > FLIGHT.rest_time


def rests(recording: Recording) -> list[slice]:
    """The rests of a recording, without their last ``rest_average_time``: motion is seen late by as much.

    A rest whose mean rate is not that of the longest one is a steady turn, and left out.
    """
    edge = np.flatnonzero(np.diff(np.concatenate([[False], at_rest(recording), [False]])))
    late = round(FLIGHT.rest_average_time * recording.sample_rate_hz)
    found = [slice(int(first), int(last) - late) for first, last in zip(edge[::2], edge[1::2], strict=True)
             if last - first > late]
    rates = [recording.gyro_deg_s[rest].mean(axis=0) for rest in found]
    longest = max(range(len(found)), key=lambda index: found[index].stop - found[index].start, default=0)
    return [rest for rest, rate in zip(found, rates, strict=True)
            if np.linalg.norm(rate - rates[longest]) <= STEADY_TURN * FLIGHT.rest_rate]


def fit_ellipsoid(samples: np.ndarray, *, magnitude: float | None = None, diagonal: bool = False,
                  spikes: bool = True) -> EllipsoidFit:
    """Bias and symmetric matrix that put samples, shape (N, 3), on a sphere around zero.

    Parameters
    ----------
    samples : ndarray, shape (N, 3)
    magnitude : float, optional
        Of the corrected samples. Without, the determinant of the matrix is 1, and the magnitude follows.
    diagonal : bool
        Whether only the diagonal of the matrix is fitted.
    spikes : bool
        Whether there may be spikes: samples beyond ``SPREAD`` standard deviations are left out.

    Raises: FitError if the directions of the samples do not determine the parameters, or if the samples are on no
    ellipsoid.

    The sum of squares of |matrix (sample − bias)| / magnitude − 1 is least. Each direction counts once, however many
    samples it has, so rests have no more weight than motion. The deviations are the larger ones of ``_covariances``.
    """
    from scipy.optimize import least_squares

    unit = float(np.median(np.linalg.norm(samples, axis=1)))
    points = samples[::-(-len(samples) // MOST_SAMPLES)] / unit
    start = _sphere(points)
    seen = directions(points - start[:3])
    if _information(seen, diagonal) < LEAST_INFORMATION:
        raise FitError(_missing(seen))
    entries = ENTRIES[:3] if diagonal else ENTRIES

    def solve(points, seen, start, loss):
        root = np.sqrt(seen.weight)
        found = least_squares(
            lambda p: root * (_magnitudes(p, points, entries)[0] - 1), start, x_scale="jac", max_nfev=MOST_STEPS,
            jac=lambda p: root[:, None] * _magnitudes(p, points, entries)[1], loss=loss)
        axes = np.linalg.eigvalsh(_symmetric(found.x, entries))
        if not found.success or axes[0] <= 0 or axes[-1] > LONGEST_AXIS * axes[0]:
            raise FitError(NO_ELLIPSOID)
        return found

    found = solve(points, seen, np.array([*start[:3], *[1 / start[3]] * 3, *[0.0] * (len(entries) - 3)]),
                  _robust(seen.weight) if spikes else "linear")
    if spikes:
        error = np.abs(_magnitudes(found.x, points, entries)[0] - 1)
        points = points[error <= SPREAD * 1.4826 * np.median(error) + 1e-9]
        seen = directions(points - found.x[:3])
        found = solve(points, seen, found.x, "linear")
    error = _magnitudes(found.x, points, entries)[0] - 1
    fit = _result(found, error, seen, entries, unit, magnitude)
    if fit.residual > LARGEST_RESIDUAL:
        raise FitError(NO_ELLIPSOID)
    return fit


def _result(found, error, seen, entries, unit, magnitude):
    """The EllipsoidFit of a solution, whose samples are in ``unit``."""
    matrix = _symmetric(found.x, entries)
    # Derivatives of the wanted matrix by the entries: those of A / det(A)^(1/3), or of A.
    steps = np.array([_symmetric(np.eye(3 + len(entries))[3 + index], entries) for index in range(len(entries))])
    if magnitude is None:
        root = np.cbrt(np.linalg.det(matrix))
        steps = (steps - matrix * np.trace(np.linalg.inv(matrix) @ steps, axis1=1, axis2=2)[:, None, None] / 3) / root
        factor, size = 1 / root, unit / root
    else:
        factor, size = magnitude / unit, magnitude
        steps = steps * factor
    bias_deviation = matrix_deviation = None
    if seen.cells > len(found.x):
        deviations = [(np.sqrt(own.diagonal()[:3]), np.sqrt(np.einsum("iab,ij,jab->ab", steps, own[3:, 3:], steps)))
                      for own in _covariances(found, error, seen)]
        bias_deviation = unit * np.max([bias for bias, _ in deviations], axis=0)
        matrix_deviation = np.max([entry for _, entry in deviations], axis=0)
    return EllipsoidFit(unit * found.x[:3], factor * matrix, bias_deviation, matrix_deviation, float(size),
                        float(np.sqrt(np.average(error**2, weights=seen.weight))), seen.cells, len(entries) == 3)


def _covariances(found, error, seen):
    """Two covariances of the parameters, where each direction is one observation.

    The first takes the errors of all directions for equally large; it is right for few directions. The second takes
    those that they have (White 1980, with the correction for the number of parameters); it is right for many.
    """
    inverse = np.linalg.pinv(found.jac.T @ found.jac)
    over = seen.cells - len(found.x)
    mean_error = np.bincount(seen.cell, seen.weight * error, minlength=CELLS)
    slopes = np.zeros((CELLS, len(found.x)))
    np.add.at(slopes, seen.cell, found.jac * found.fun[:, None])
    return (inverse * (mean_error @ mean_error) / over,
            inverse @ (slopes.T @ slopes) @ inverse * seen.cells / over)


def _sphere(points):
    """Centre and radius of the sphere next to the points, from the better of two starts: zero, the middle of the
    range."""
    from scipy.optimize import least_squares

    lowest, highest = np.percentile(points, [1, 99], axis=0)
    starts = np.array([[0.0, 0.0, 0.0, 1.0], [*(lowest + highest) / 2, max((highest - lowest).max() / 2, 1e-3)]])

    def error(place, seen):
        distance = np.linalg.norm(points - place[:3], axis=1) - place[3]
        # The last terms keep the centre near where points on a circle do not determine it.
        return np.concatenate([np.sqrt(seen.weight / seen.cells) * distance, 0.01 * place[:3]])

    found = []
    for place in starts:
        for _ in range(2):
            seen = directions(points - place[:3])
            solution = least_squares(error, place, args=(seen,), max_nfev=MOST_STEPS,
                                     loss=_robust(np.append(seen.weight / seen.cells, np.ones(3))))
            place = solution.x
        found.append(solution)
    return min(found, key=lambda solution: solution.cost).x


def _robust(weight):
    """The loss for ``least_squares`` of weighted squares that are linear in errors beyond FAR; see its ``soft_l1``."""
    def loss(squares):
        root = np.sqrt(1 + squares / (weight * FAR**2))
        return np.stack([2 * weight * FAR**2 * (root - 1), 1 / root, -0.5 / (root**3 * weight * FAR**2)])

    return loss


def _symmetric(parameters, entries):
    """The matrix of parameters, whose first three are the bias."""
    matrix = np.zeros((3, 3))
    for value, (i, j) in zip(parameters[3:], entries, strict=True):
        matrix[i, j] = matrix[j, i] = value
    return matrix


def _magnitudes(parameters, points, entries):
    """|A (x − b)| of points, and its derivatives by the parameters."""
    matrix, moved = _symmetric(parameters, entries), points - parameters[:3]
    corrected = moved @ matrix
    size = np.maximum(np.linalg.norm(corrected, axis=1), np.finfo(float).tiny)
    along = corrected / size[:, None]
    by_entry = [along[:, i] * moved[:, j] + (along[:, j] * moved[:, i] if i != j else 0) for i, j in entries]
    return size, np.column_stack([-along @ matrix, *by_entry])


def _information(seen: Directions, diagonal: bool) -> float:
    """Directions that would tell the least determined combination of parameters as well as these do."""
    shapes = harmonics(seen.unit)[:, OF_DIAGONAL if diagonal else slice(None)]
    return float(np.linalg.eigvalsh((shapes * seen.weight[:, None]).T @ shapes)[0])


def _turned_deg(seen: Directions) -> list[int]:
    """By how much the sensor was turned about each of its axes, degrees: sectors in which it saw the field, where it
    was not along the axis."""
    found = []
    for axis in range(3):
        across = seen.unit[np.abs(seen.unit[:, axis]) < np.cos(np.radians(SECTOR_DEG))]
        angle = np.degrees(np.arctan2(across[:, (axis + 2) % 3], across[:, (axis + 1) % 3])) % 360
        found.append(SECTOR_DEG * len(np.unique(angle // SECTOR_DEG)))
    return found


def _missing(seen: Directions) -> str:
    """Message on directions that do not tell the parameters."""
    if seen.cells == 1:
        return ("the field came from one direction, which does not tell its errors; turn the sensor by full turns "
                "about x, y and z")
    turned = _turned_deg(seen)
    missing = [name for name, angle in zip("xyz", turned, strict=True) if angle < 300] or list("xyz")
    return (f"the field came from {seen.cells} of {CELLS} directions, which do not tell its errors: the sensor was "
            f"turned by {turned[0]}° about x, {turned[1]}° about y and {turned[2]}° about z; turn it by full turns "
            f"about {_listed(missing)} too")


def _listed(words: Sequence[str]) -> str:
    return ", ".join(words[:-1]) + (" and " if len(words) > 1 else "") + words[-1]
