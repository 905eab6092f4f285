"""Quaternion straight from body rates (source 001), without division or root.

``e`` is the body-to-navigation quaternion, scalar first; ``omega`` the body's rate in body axes,
rad/s, held over the update period T. The matrix of the update,

    Φ = [[a, −p̄, −q̄, −r̄], [p̄, a, r̄, −q̄], [q̄, −r̄, a, p̄], [r̄, q̄, −p̄, a]],

rotates e by |omega|·T for a = cos(|omega|·T/2) and (p̄, q̄, r̄) = d·omega, d = sin(|omega|·T/2)/|omega|.
"""

from .attitude import Update
from .vector import add, cross, dot, polynomial, scale

__all__ = ["coning_correction", "quaternion_step", "quaternion_update", "rate_product",
           "renormalisation", "transition", "transition_coefficients"]


def transition_coefficients(xp, omega, a0, d0, period):
    """(a, d) from u = T²·(p² + q² + r²): a = Σ a0_i·uⁱ, d = Σ (T·d0_i)·uⁱ (steps a to c).

    The patent prints u = T²/σ. Its own optimisation criteria contradict this; they need T²·σ.
    """
    u = period**2 * dot(omega, omega)
    return polynomial(a0, u), polynomial([period * coefficient for coefficient in d0], u)


def transition(xp, a, d, omega, e):
    """e := Φ·e = a·e + d·(e⊗(0, omega)) (step d).

    d is factored out: the twelve products of e and omega do not wait for the polynomials, and only
    eight multiplications wait for a and d.
    """
    return add(scale(a, e), scale(d, rate_product(e, omega)))


def rate_product(e, omega):
    """e⊗(0, omega): twice the quaternion's derivative."""
    (e0, e1, e2, e3), (p, q, r) = e, omega
    return (-(p * e1) - (q * e2 + r * e3),
            p * e0 + (r * e2 - q * e3),
            q * e0 + (p * e3 - r * e1),
            r * e0 + (q * e1 - p * e2))


def coning_correction(xp, first, second, period):
    """Rate that rotates by the vector Δθ₁ + Δθ₂ + 2/3·Δθ₁×Δθ₂ when it is held over T.

    ``first`` and ``second`` are the mean rates over the halves of the period, Δθ = T/2·rate.
    The vector product corrects for the change of the axis between the two halves (Miller, 1983).
    """
    mean = scale(0.5, add(first, second))
    return add(mean, scale(period / 6, cross(first, second)))


def renormalisation(xp, e):
    """Factor 3/2 − |e|²/2 that corrects a norm near 1: one Newton step, no root."""
    return 1.5 - 0.5 * dot(e, e)


def quaternion_step(xp, e, omega, *, a0, d0, period, factor=None):
    """One update, e := Φ·e; with a ``factor``, e := Φ·(factor·e)."""
    a, d = transition_coefficients(xp, omega, a0, d0, period)
    if factor is not None:
        a, d = factor * a, factor * d
    return transition(xp, a, d, omega, e)


def quaternion_update(xp, e, omega, load, start, *, a0, d0, period, renormalise, count=None, second=None):
    """One update of QUAT_direct.

    A ``load`` above 1/2 replaces the propagated quaternion by ``start``. ``renormalise`` is the number of
    updates from one renormalisation to the next, 0 for none. If it is 2 or more, ``count`` holds the
    number of updates since the last one. With ``second``, ``omega`` is the mean rate of the first
    half of the period and ``second`` that of the second half.
    """
    state, factor = {}, None
    with xp.section("PROPAGATE"):
        if second is not None:
            omega = coning_correction(xp, omega, second, period)
        if renormalise:
            factor = renormalisation(xp, e)
        if renormalise > 1:
            due = renormalise - 1.5 < count
            factor = xp.select(due, factor, 1.0)
            state["count"] = xp.select(due, 0.0, count + 1)
        e = quaternion_step(xp, e, omega, a0=a0, d0=d0, period=period, factor=factor)
        loads = load > 0.5
        e = tuple(xp.select(loads, given, own) for given, own in zip(start, e, strict=True))
    return Update(outputs={"e": e}, state=state | {"e": e})
