"""Attitude errors: comparison of quaternions and frames, in degrees.

Quaternions are Hamilton, scalar first, and transform a vector from the sensor frame to the earth frame:
v_earth = q v_sensor q*. q and -q are the same orientation. See ``docs/notation.md``.
"""

from typing import NamedTuple

import numpy as np

__all__ = [
    "AttitudeErrors", "Match", "angle_difference", "attitude_errors", "conjugate", "enu_to_nwu",
    "largest", "match_reference", "multiply", "quaternion_from_matrix", "remove_constant_heading", "rms",
    "rotation_angle", "spread",
]


class AttitudeErrors(NamedTuple):
    """Error of an estimated orientation, degrees in [0, 180], one value per sample.

    Fields
    ------
    total : ndarray, shape (...)
        Angle of the whole error rotation.
    heading : ndarray, shape (...)
        Part of it about the vertical.
    inclination : ndarray, shape (...)
        The rest without the heading part: the angle between the two verticals.
    """

    total: np.ndarray
    heading: np.ndarray
    inclination: np.ndarray


class Match(NamedTuple):
    """An estimate and a recording's reference at the same M times.

    Fields
    ------
    sample : ndarray of int, shape (M,)
        Index of the recording's sample nearest to each valid reference time.
    q_est, q_ref : ndarray, shape (M, 4)
        Estimated and reference orientation there, sensor to NWU.
    q_given : ndarray, shape (M, 4)
        The reference as it was given, before a constant heading was removed.
    """

    sample: np.ndarray
    q_est: np.ndarray
    q_ref: np.ndarray
    q_given: np.ndarray

    @property
    def turned(self):
        """Whether a constant heading was removed."""
        return self.q_ref is not self.q_given


def multiply(p, q):
    """Hamilton product of quaternions, scalar first, shapes (..., 4) that broadcast."""
    pw, px, py, pz = np.moveaxis(np.asarray(p, dtype=float), -1, 0)
    qw, qx, qy, qz = np.moveaxis(np.asarray(q, dtype=float), -1, 0)
    return np.stack([pw * qw - px * qx - py * qy - pz * qz,
                     pw * qx + px * qw + py * qz - pz * qy,
                     pw * qy - px * qz + py * qw + pz * qx,
                     pw * qz + px * qy - py * qx + pz * qw], axis=-1)


def conjugate(q):
    """Conjugate quaternion, the opposite rotation, shape (..., 4)."""
    return np.asarray(q, dtype=float) * (1.0, -1.0, -1.0, -1.0)


def enu_to_nwu(q_s2enu):
    """Sensor-to-ENU quaternion expressed as sensor-to-NWU, shape (..., 4).

    North is y of ENU and x of NWU, so coordinates rotate by -90 degrees about the common vertical.
    """
    half = np.sqrt(0.5)
    return multiply((half, 0.0, 0.0, -half), q_s2enu)


def quaternion_from_matrix(c_n2b):
    """Unit quaternion, sensor to earth, of a direction cosine matrix.

    Parameters
    ----------
    c_n2b : ndarray, shape (..., 3, 3)
        Direction cosine matrix, earth (navigation) to sensor (body).

    Returns
    -------
    ndarray, shape (..., 4)
        Scalar first. Along the first of the leading axes, time, the sign is continuous. The scalar
        part of a single matrix, and of the first of many, is not negative.

    Notes
    -----
    The four squares of the components come from the diagonal; the largest one is at least 1/4 and
    divides the others (Shepperd), so no orientation is badly conditioned.

    References
    ----------
    S. W. Shepperd, "Quaternion from rotation matrix", J. Guidance and Control 1(3), 1978.
    """
    c = np.asarray(c_n2b, dtype=float)
    xx, yy, zz = (c[..., k, k] for k in range(3))
    wx, wy, wz = (c[..., i, j] - c[..., j, i] for i, j in ((1, 2), (2, 0), (0, 1)))
    xy, yz, zx = (c[..., i, j] + c[..., j, i] for i, j in ((0, 1), (1, 2), (2, 0)))
    # Row k is 4 q_k q: the same quaternion four times, once for each possible divisor.
    products = np.stack([
        np.stack([1 + xx + yy + zz, wx, wy, wz], axis=-1),
        np.stack([wx, 1 + xx - yy - zz, xy, zx], axis=-1),
        np.stack([wy, xy, 1 - xx + yy - zz, yz], axis=-1),
        np.stack([wz, zx, yz, 1 - xx - yy + zz], axis=-1)], axis=-2)
    largest = np.diagonal(products, axis1=-2, axis2=-1).argmax(axis=-1)
    q = np.take_along_axis(products, largest[..., None, None], axis=-2)[..., 0, :]
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    if q.ndim == 1:
        return np.copysign(1.0, q[0]) * q
    jumps = np.where(np.vecdot(q[1:], q[:-1]) < 0, -1.0, 1.0)
    first = np.where(q[:1, ..., 0] < 0, -1.0, 1.0)
    return np.concatenate([first, jumps]).cumprod(axis=0)[..., None] * q


def attitude_errors(q_est, q_ref):
    """Error of each estimate: total angle, its heading part, its inclination part.

    Parameters
    ----------
    q_est, q_ref : ndarray, shape (..., 4)
        Estimated and reference orientation, sensor to the same earth frame (z up); not zero.

    Returns
    -------
    AttitudeErrors
        Degrees.

    Notes
    -----
    With d = q_est q_ref*, the definition of the BROAD data set: total 2 acos |d0|, heading
    2 atan |d3 / d0|, inclination 2 acos sqrt(d0^2 + d3^2), in a form that is accurate for small angles too.

    References
    ----------
    D. Laidig et al., "BROAD", Data 6(7):72, 2021.
    """
    w, x, y, z = np.moveaxis(multiply(q_est, conjugate(q_ref)), -1, 0)
    about_vertical, tilt = np.hypot(w, z), np.hypot(x, y)
    return AttitudeErrors(total=2 * np.degrees(np.arctan2(np.hypot(tilt, z), np.abs(w))),
                          heading=2 * np.degrees(np.arctan2(np.abs(z), np.abs(w))),
                          inclination=2 * np.degrees(np.arctan2(tilt, about_vertical)))


def rotation_angle(q1, q2):
    """Angle between two orientations, degrees in [0, 180], accurate for small angles too."""
    return attitude_errors(q1, q2).total


def remove_constant_heading(q_est, q_ref):
    """Estimate rotated about the vertical by the constant angle that fits the reference best.

    Parameters
    ----------
    q_est, q_ref : ndarray, shape (N, 4)
        Estimated and reference orientation, sensor to earth (z up).

    Returns
    -------
    ndarray, shape (N, 4)
        ``q_est``, rotated so that the sum of sin^2(total error / 2) is minimal.

    Notes
    -----
    A rotation by psi makes d0 the real part of (d0 + i d3) exp(-i psi / 2); the sum of its
    squares is largest where psi is the angle of the sum of (d0 + i d3)^2.
    """
    d = multiply(q_est, conjugate(q_ref))
    psi = np.angle(np.sum((d[..., 0] + 1j * d[..., 3]) ** 2))
    return multiply((np.cos(psi / 2), 0.0, 0.0, -np.sin(psi / 2)), q_est)


def match_reference(recording, q_s2nwu, *, shared_heading=False):
    """Estimate and reference at the same times, in the same frame, ready for `attitude_errors`.

    Parameters
    ----------
    recording : Recording
        With a reference.
    q_s2nwu : ndarray, shape (N, 4)
        Estimated orientation after each sample of the recording, sensor to NWU.
    shared_heading : bool
        Whether the estimate has its heading from the reference, so that there is no unknown constant.

    Returns
    -------
    Match
        Valid reference samples only. If the heading of either side has an unknown constant (a
        reference with unknown heading, a recording without magnetometer), the reference is rotated about
        the vertical to fit the estimate, and heading errors are relative to the rotated reference.
    """
    reference = recording.reference
    index = np.interp(reference.time_s, recording.time_s, np.arange(len(recording.time_s)))
    sample = np.rint(index[reference.valid]).astype(int)
    q_est, q_ref = np.asarray(q_s2nwu, dtype=float)[sample], reference.quaternion[reference.valid]
    if reference.frame == "ENU":
        q_ref = enu_to_nwu(q_ref)
    q_given = q_ref
    if not shared_heading and (recording.mag is None or not reference.heading_known):
        q_ref = remove_constant_heading(q_ref, q_est)
    return Match(sample, q_est, q_ref, q_given)


def angle_difference(a, b):
    """Difference a - b of angles in degrees, wrapped into [-180, 180)."""
    return np.mod(np.subtract(a, b) + 180.0, 360.0) - 180.0


def rms(values):
    """Root of the mean square of all values."""
    return float(np.sqrt(np.mean(np.square(values))))


def largest(values):
    """Largest magnitude of all values."""
    return float(np.abs(values).max())


def spread(errors):
    """Largest and RMS of the finite errors, as JSON values, None if none is finite; and the number of the others."""
    finite = errors[np.isfinite(errors)]
    figures: dict = {"max": float(finite.max()), "rms": rms(finite)} if finite.size else {"max": None, "rms": None}
    if finite.size < errors.size:
        figures["not_finite"] = int(errors.size - finite.size)
    return figures
