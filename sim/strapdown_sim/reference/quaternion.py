"""Exact rotations in float64, the reference of quaternion propagation.

Quaternions are Hamilton's, scalar first, body to navigation; rates are in body axes, rad/s.
Written from the definitions of the quaternion product and the rotation vector, not from any
core's equations. Wider floats keep their width.
"""

import numpy as np

__all__ = ["angle_between", "coning_attitude", "coning_mean_rate", "cumulative", "first_order_increment", "increment",
           "product"]

# product(p, q)_k = Σ_ij p_i q_j _TABLE[i, j, k]: i² = j² = k² = ijk = -1.
_TABLE = np.zeros((4, 4, 4))
for _i, _j, _k, _sign in ((0, 0, 0, 1), (0, 1, 1, 1), (0, 2, 2, 1), (0, 3, 3, 1), (1, 0, 1, 1), (2, 0, 2, 1),
                          (3, 0, 3, 1), (1, 1, 0, -1), (2, 2, 0, -1), (3, 3, 0, -1), (1, 2, 3, 1), (2, 1, 3, -1),
                          (2, 3, 1, 1), (3, 2, 1, -1), (3, 1, 2, 1), (1, 3, 2, -1)):
    _TABLE[_i, _j, _k] = _sign


def _wide(x):
    """An array of float64 or wider floats."""
    x = np.asarray(x)
    return x.astype(np.result_type(x.dtype, float), copy=False)


def product(p, q):
    """Hamilton product p⊗q of arrays (..., 4): first p, then q in the body's axes."""
    return np.einsum("...i,...j,ijk->...k", p, q, _TABLE, optimize=True)


def increment(omega, period_s):
    """Quaternion of a constant rate held over a period.

    Parameters
    ----------
    omega : ndarray, shape (..., 3)
        Angular rate, body axes, rad/s.
    period_s : float or ndarray
        Seconds; an array of shape (..., 1) for periods of their own.

    Returns
    -------
    ndarray, shape (..., 4)
        Unit quaternions (cos(x/2), sin(x/2)·axis), x = |omega|·T.
    """
    half = _wide(omega) * (period_s / 2)
    angle = np.linalg.norm(half, axis=-1, keepdims=True)
    return np.concatenate([np.cos(angle), np.sinc(angle / np.pi) * half], axis=-1)


def first_order_increment(omega, period_s):
    """The thesis's update (eq. 2.42) as an increment: (1, T/2·omega), normalised."""
    half = _wide(omega) * (period_s / 2)
    q = np.concatenate([np.ones((*half.shape[:-1], 1)), half], axis=-1)
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def cumulative(start, increments):
    """Attitudes after each of many increments: start⊗increments[0]⊗ … ⊗increments[k].

    Shapes (4,) and (N, 4); result (N, 4), normalised. Doubling needs only log2(N) array products.
    """
    q = _wide(increments).copy()
    q[0] = product(start, q[0])
    step = 1
    while step < len(q):
        q[step:] = product(q[:-step], q[step:])
        q /= np.linalg.norm(q, axis=-1, keepdims=True)
        step *= 2
    return q


def angle_between(p, q):
    """Angle of the rotation from p to q, quaternions (..., 4) of any length, rad, in [0, pi]."""
    p, q = (_wide(x) / np.linalg.norm(x, axis=-1, keepdims=True) for x in (p, q))
    # The chord is precise where the inner product is close to one.
    chord = np.minimum(np.linalg.norm(p - q, axis=-1), np.linalg.norm(p + q, axis=-1))
    return 4 * np.arcsin(np.minimum(chord / 2, 1))


def coning_attitude(time_s, *, half_angle, frequency):
    """Classical coning: the body's z axis describes a cone, and the body does not rotate about it.

    q = (cos(β/2), sin(β/2)·cos Ωt, sin(β/2)·sin Ωt, 0) with the cone's half angle β (rad) and the
    frequency Ω (rad/s). Source: Bortz 1971; Savage, Strapdown Analytics, 7.1.1.
    """
    phase = frequency * np.asarray(time_s, float)
    cosine, sine = np.cos(half_angle / 2), np.sin(half_angle / 2)
    return np.stack([np.full(phase.shape, cosine), sine * np.cos(phase), sine * np.sin(phase), 0 * phase], axis=-1)


def coning_mean_rate(begin_s, end_s, *, half_angle, frequency):
    """Mean body rate of ``coning_attitude`` between two times, rad/s, shape (..., 3): exact.

    omega(t) = Ω·(−sin β·sin Ωt, sin β·cos Ωt, −(1 − cos β)).
    """
    begin, end = np.asarray(begin_s, float), np.asarray(end_s, float)
    sine = np.sin(half_angle)
    x = sine * (np.cos(frequency * end) - np.cos(frequency * begin)) / (end - begin)
    y = sine * (np.sin(frequency * end) - np.sin(frequency * begin)) / (end - begin)
    return np.stack([x, y, np.full(x.shape, -frequency * (1 - np.cos(half_angle)))], axis=-1)
