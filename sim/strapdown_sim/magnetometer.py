"""What a magnetometer says about its own calibration: how strength and dip of its field vary with attitude.

A field of the earth that the sensor measures without error has one strength F and one dip δ in all attitudes. An error
that turns with the sensor (hard iron, soft iron, a scale, axes that are not perpendicular) has three components. That
along the field changes the strength. That across it in the vertical plane changes the dip. The horizontal one across it
turns the heading, by its size over the horizontal field F cos δ. Over all attitudes the three have the same mean square
if the error is a constant vector; if it is linear in the field, their RMS agree within 13 %. So the RMS error of the
heading in rad is the RMS variation of the strength over F cos δ, and that of the dip over cos δ. With a dip of 65°, one
percent of the strength is 1.4 degrees of heading.

The field of a building varies too, with the place. Only what attitude explains counts: the part of the variation that
is a function of first and second degree of the direction of the field in the sensor, if it has half of the mean square.
"""

from typing import NamedTuple

import numpy as np

from .recordings import Recording
from .reference.attitude import matrix_from_quaternion
from .reference.quaternion import cumulative, increment

__all__ = ["CELLS", "Directions", "FieldFacts", "dip_deg", "directions", "field_facts", "field_rows", "field_samples",
           "harmonics", "vertical"]

COLUMNS = 5
CELLS = 6 * COLUMNS**2
"""Cells of the sphere of directions: squares on the faces of a cube, 18 degrees wide. An axis is inside one."""

LEAST_DIRECTIONS = 6
"""Cells with a sample below which attitudes are too much alike for a statement."""

LEAST_SHARE = 0.5
"""Share of the mean square variation that attitude must explain."""

LARGEST_HEADING_ERROR_DEG = 3.0
"""RMS heading error that a varying strength may mean: twice what the flight filter adds to an ideal field."""

LARGEST_DIP_VARIATION_DEG = 5.0
"""RMS variation of the dip: four times the error of ``vertical`` in fast motion, 1.3 degrees."""

LARGEST_PLACE_VARIATION = 0.05
"""RMS variation of the strength, over the mean, above which the place changes the dip too."""

SLOW_DEG_S = 60.0
"""Rate below which the dip is judged: a field that is 20 ms late is wrong by 1.2 degrees then."""

HALF_WINDOW_S = 4.0
"""Half of the time over which ``vertical`` averages: a change of velocity by 1 m/s in it tilts by 0.7 degrees."""

SMALLEST_SINGULAR = 0.01
"""Combinations of the regressors that vary less, against the largest, are left out."""


class Directions(NamedTuple):
    """Unit vectors, shape (N, 3), the cell of each, (N,), and weights (N,) by which each cell with samples counts 1."""

    unit: np.ndarray
    cell: np.ndarray
    weight: np.ndarray

    @property
    def cells(self) -> int:
        """Cells with samples."""
        return len(np.unique(self.cell))


class FieldFacts(NamedTuple):
    """Field of a magnetometer, each of whose directions in the sensor counts once.

    Fields
    ------
    strength, dip_deg : float
        Mean strength, in the unit of the recording, and mean dip: angle of the field below the horizontal plane.
    directions : int
        Cells of the sphere, of ``CELLS``, with a sample.
    strength_variation, strength_share : float
        RMS of what attitude explains of the strength, over the mean; and its share of the mean square variation.
    dip_variation_deg, dip_share : float
        The same of the dip, while the sensor turns slowly; 0 if it never does.
    """

    strength: float
    dip_deg: float
    directions: int
    strength_variation: float
    strength_share: float
    dip_variation_deg: float
    dip_share: float

    @property
    def heading_error_deg(self) -> float:
        """RMS heading error that the variation of the strength means: of all attitudes, or, if the sensor turns about
        the vertical only, cos δ of it."""
        return float(np.degrees(self.strength_variation) / np.cos(np.radians(self.dip_deg)))

    @property
    def strength_varies(self) -> bool:
        """Whether the strength says that the sensor is not calibrated."""
        return self.strength_share >= LEAST_SHARE and self.heading_error_deg >= LARGEST_HEADING_ERROR_DEG

    @property
    def dip_varies(self) -> bool:
        """Whether the dip says that its axes are not those of the accelerometer."""
        return (self.dip_share >= LEAST_SHARE and self.dip_variation_deg >= LARGEST_DIP_VARIATION_DEG
                and self.strength_variation**2 < LARGEST_PLACE_VARIATION**2 * self.strength_share)


def directions(vectors: np.ndarray) -> Directions:
    """Directions of vectors, shape (N, 3). A vector of zero has no direction; it counts to the cell of +x."""
    unit = vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), np.finfo(float).tiny)
    axis = np.abs(unit).argmax(axis=1)
    row = np.arange(len(unit))
    along = unit[row, axis]
    cell = 2 * axis + (along < 0)
    along = np.where(along == 0, 1, along)
    for step in 1, 2:
        # Equal angles from the middle of the face; its edges are at ±45 degrees.
        place = np.arctan(unit[row, (axis + step) % 3] / along) / (np.pi / 2) + 0.5
        cell = COLUMNS * cell + np.minimum((COLUMNS * place).astype(int), COLUMNS - 1)
    return Directions(unit, cell, 1 / np.bincount(cell, minlength=CELLS)[cell])


def harmonics(unit: np.ndarray) -> np.ndarray:
    """Real spherical harmonics of degree 0, 1 and 2 of unit vectors, shape (N, 9); mean square 1 over the sphere."""
    x, y, z = unit.T
    return np.stack([np.ones(len(x)), *np.sqrt(3) * unit.T, *np.sqrt(15) * np.stack([x * y, y * z, z * x]),
                     np.sqrt(15) / 2 * (x * x - y * y), np.sqrt(5) / 2 * (3 * z * z - 1)], axis=-1)


def vertical(recording: Recording) -> np.ndarray:
    """The upward unit vector in axes of the sensor at all samples, shape (N, 3).

    The gyro turns the specific force into axes that do not turn. There its mean over ``HALF_WINDOW_S`` before and after
    a sample is the vertical. A bias of the gyro turns both halves against each other: it cancels in a sensor that does
    not turn, and else tilts by less than its angle in half of ``HALF_WINDOW_S``.
    """
    period_s = np.full(len(recording.time_s), 1 / recording.sample_rate_hz)
    if recording.period_s is not None:
        period_s = recording.period_s
    turns = increment(np.radians(recording.gyro_deg_s), period_s[:, None])
    c_n2b = matrix_from_quaternion(cumulative(np.array([1.0, 0.0, 0.0, 0.0]), turns))
    force = np.einsum("nji,nj->ni", c_n2b, recording.accel)
    summed = np.vstack([np.zeros(3), np.cumsum(force, axis=0)])
    first = np.searchsorted(recording.time_s, recording.time_s - HALF_WINDOW_S)
    last = np.searchsorted(recording.time_s, recording.time_s + HALF_WINDOW_S, side="right")
    up = np.einsum("nij,nj->ni", c_n2b, summed[last] - summed[first])
    return up / np.maximum(np.linalg.norm(up, axis=1, keepdims=True), np.finfo(float).tiny)


def dip_deg(up: np.ndarray, field: np.ndarray) -> np.ndarray:
    """Angle of fields, shape (N, 3), below the plane across ``up``, degrees."""
    return -np.degrees(np.arcsin(np.clip(np.vecdot(up, field) / np.linalg.norm(field, axis=1), -1, 1)))


def field_samples(recording: Recording) -> np.ndarray:
    """Which samples of a recording with magnetometer have a new field: bool, shape (N,)."""
    assert recording.mag is not None, "field_samples is for a recording with magnetometer"
    present = np.any(recording.mag, axis=1)
    return present if recording.mag_new is None else present & recording.mag_new


def field_facts(recording: Recording) -> FieldFacts | None:
    """Facts of the field of a recording; None without magnetometer, or with fewer than LEAST_DIRECTIONS directions."""
    if recording.mag is None:
        return None
    new = field_samples(recording)
    if not new.any():
        return None
    field = recording.mag[new]
    seen = directions(field)
    if seen.cells < LEAST_DIRECTIONS:
        return None
    strength = np.linalg.norm(field, axis=1)
    mean = float(np.average(strength, weights=seen.weight))
    varied, share = _explained(harmonics(seen.unit)[:, 1:], strength / mean, seen.weight)
    up = vertical(recording)[new]
    dip = dip_deg(up, field)
    slow = np.linalg.norm(recording.gyro_deg_s[new], axis=1) < SLOW_DEG_S
    dip_varied, dip_share = _explained_dip(up[slow], field[slow]) if slow.any() else (0.0, 0.0)
    return FieldFacts(mean, float(np.average(dip, weights=seen.weight)), seen.cells, varied, share, dip_varied,
                      dip_share)


def _explained_dip(up, field):
    """RMS of what attitude explains of the dip, degrees, and its share of the mean square.

    An error b + M m of the field changes sin δ by a sum of the components of the vertical, and of their products with
    those of the field. The sum of the three products of equal axes is sin δ itself.
    """
    seen = directions(field)
    products = np.einsum("ni,nj->nij", up, seen.unit).reshape(-1, 9)
    equal = np.stack([products[:, 0] - products[:, 4], products[:, 0] + products[:, 4] - 2 * products[:, 8]], axis=-1)
    return _explained(np.hstack([up, products[:, (1, 2, 3, 5, 6, 7)], equal]), dip_deg(up, field), seen.weight)


def _explained(regressors, values, weight):
    """RMS of the part of values that is linear in the regressors, shape (N, k), and its share of the mean square."""
    weight = weight / weight.sum()
    regressors = regressors - weight @ regressors
    values = values - weight @ values
    root = np.sqrt(weight)
    factors = np.linalg.lstsq(regressors * root[:, None], values * root, rcond=SMALLEST_SINGULAR)[0]
    part, whole = weight @ (regressors @ factors) ** 2, weight @ values**2
    return float(np.sqrt(part)), float(part / whole) if whole > 0 else 0.0


def field_rows(facts: FieldFacts | None, remedy: str) -> list[tuple[str, str]]:
    """Rows of a table that tell of a magnetometer without calibration, or in wrong axes.

    ``remedy`` is the command that calibrates it.
    """
    if facts is None:
        return []
    if facts.strength_varies:
        return [("magnetometer not calibrated", f"field strength varies by {100 * facts.strength_variation:.2g} % with "
                 f"attitude, headings err by about {facts.heading_error_deg:.2g}°: {remedy}")]
    if facts.dip_varies:
        return [("magnetometer axes", f"dip varies by {facts.dip_variation_deg:.2g}° with attitude, field strength "
                 "does not: are the axes of magnetometer and accelerometer those of one body?")]
    return []
