"""The optical attitude sensor (source 004): two line lasers on a vertical gyro, two line CCDs on the vehicle.

Frames: b body (x forward: outer gimbal axis; y right; z down), L local level with the body's heading (NED turned by the
heading). Roll is positive right side down, pitch nose up. The rotor axis is a unit vector towards the lasers: (0, 0, 1)
while it stands on the vertical. "Measured" angles are those of the body against the rotor.

A line laser draws a fan of light. The fan on the roll CCD contains x and z of the gimbals, that on the pitch CCD their
y and z. The roll CCD lies along y, the pitch CCD along x, both at the distance L below the pivot.
"""

import math
from typing import Any, NamedTuple

from .attitude import DEGREES, Update
from .vector import add, cross, dot, scale, subtract

__all__ = ["GRAVITY", "Calibration", "Inertial", "Light", "Settings", "Turn", "angles_of_rotor", "erection", "integer",
           "level", "light", "measured_angles", "onward", "optical_update", "patent_angles", "pixels", "precession",
           "slope"]

GRAVITY = 9.80665
"""m/s², of the erection."""

LEVEL_RATE = math.radians(1)
"""rad/s: the erection works at smaller yaw rates only."""


class Calibration(NamedTuple):
    """Constants of one instrument. Pairs are those of the roll and of the pitch CCD."""

    n0: Any
    """position of the spot at angle zero, pixels"""
    scale: Any
    """pixel pitch over L; negative where the pixels count the other way"""
    tilt: Any
    """slope of the CCD towards the pivot"""
    c3: Any
    """of the cover glass"""
    h: Any
    """sideways place of the pitch CCD over L"""
    k: Any = None
    """m·l_oc/H in s/m; None without compensation"""


class Inertial(NamedTuple):
    """Means over a line period, body axes; or sums, if there is a ``share``."""

    f: Any
    """specific force, m/s²; (0, 0, -g) at rest"""
    yaw_rate: Any = None
    """rate of the heading, rad/s"""
    share: Any = 1.0
    """1 over the number of samples that ``f`` and ``yaw_rate`` are the sums of"""
    follows: Any = 1.0
    """0 if the spots of the update before may not have been seen; then the angles do not move on, else 1"""


class Light(NamedTuple):
    """Where the light falls, in units of L. The rotor axis is in the direction (-A, a·B/b, B) of the body."""

    a: Any
    b: Any
    r_squared: Any
    r: Any
    A: Any
    A_squared: Any
    B: Any
    B_squared: Any


class Turn(NamedTuple):
    """Sine and cosine of an angle."""

    sine: Any
    cosine: Any


class Settings(NamedTuple):
    """Constants of a core."""

    period: float
    """s, of a line"""
    compensation: str = "exact"
    """none, patent or exact"""
    erection: float = 0.0
    """time constant, s; 0: none"""
    erection_limit: float = 0.0
    """largest rate of the erection, rad/s"""


def integer(number):
    """Integer i from the number 2²³ + i, the last 23 bits of which are those of i."""
    return number - 2.0**23


def pixels(xp, position, n0):
    """p = number − base; n0, so that the angle is zero, if the number is negative: no spot was seen yet.

    ``position`` is (number, base). The number has steps of 2⁻¹² from 2¹¹ to 2¹², and the base is 0 or 2¹¹.
    """
    number, base = position
    return xp.select(number < 0.0, n0, number - base)


def slope(p, n0, scale, c3):
    """w = (p − n0)·scale, then w + c3·w³: place of the spot along a CCD, in units of L. ``p`` is in pixels."""
    w = (p - n0) * scale
    return w + (c3 * w) * (w * w)


def light(xp, w, tilt, h):
    """Light of the slopes ``w`` of the roll and of the pitch CCD.

    a = w_r, b = 1 + tilt_r·w_r, r² = a² + b², A = w_p·r, B = (1 + tilt_p·w_p)·b + h·a.
    The roll CCD sees the fan in the plane y, z: tan γs = a/b. The fan of the pitch CCD is turned about x by γs, so that
    its distance from the pivot is B/r, and tan θs = A/B. The squares do not wait for the root.
    """
    a, b = w[0], 1 + tilt[0] * w[0]
    B = (1 + tilt[1] * w[1]) * b + h * a
    r_squared = a * a + b * b
    r = xp.sqrt(r_squared)
    return Light(a, b, r_squared, r, w[1] * r, (w[1] * w[1]) * r_squared, B, B * B)


def measured_angles(xp, seen):
    """γs = atan2(a, b), θs = atan2(A, B): roll and pitch of the body against the rotor, rad."""
    return xp.atan2(seen.a, seen.b), xp.atan2(seen.A, seen.B)


def onward(turn, angle):
    """The Turn of an angle that is larger by a small ``angle``, to its first order."""
    return Turn(turn.sine + angle * turn.cosine, turn.cosine - angle * turn.sine)


def level(f, roll, pitch):
    """f in the frame L, from body axes: C = Ry(θ)·Rx(γ) with the Turns ``roll`` and ``pitch``."""
    x, y, z = f
    down = roll.sine * y + roll.cosine * z
    return (pitch.cosine * x + pitch.sine * down,
            roll.cosine * y - roll.sine * z,
            pitch.cosine * down - pitch.sine * x)


def precession(n, f, turn, step, correction=None):
    """Rotor axis N one line period T later; f is in the frame L, δ = ψ̇·T is its turn, and the step is k·T.

    The torque of a centre of mass at l_oc is −m·l_oc·N × f, so Ṅ = −k·N × f − ψ̇·z × N with k = m·l_oc/H: the frame L
    turns with the heading, the rotor does not. With κ = 1 − δ²/2:
    M = (κ·Nx + δ·Ny, κ·Ny − δ·Nx, Nz) − k·T·(N × f) + (correction, 0), N = M·(1.5 − 0.5·M·M).
    The last step is Newton's for 1/|M|, from 1.
    """
    x, y, z = n
    near = 1 - (0.5 * turn) * turn
    torque = scale(step, cross(n, f))
    turned = (near * x + turn * y, near * y - turn * x)
    if correction is not None:
        turned = add(turned, correction)
    m = subtract((*turned, z), torque)
    return scale(1.5 - 0.5 * dot(m, m), m)


def erection(xp, f, turn, step, settings):
    """T·clip(f/(g·τ), ±limit) for x and y of the level f, in straight flight only: |ψ̇| < 1 deg/s.

    ``turn`` is ψ̇·T; ``step`` is T, or T times the share if ``f`` is a sum.
    """
    bound = settings.erection_limit * settings.period
    straight = turn * turn < (LEVEL_RATE * settings.period)**2
    factor = step * (1 / (GRAVITY * settings.erection))

    def clipped(value):
        change = factor * value
        change = xp.select(change < -bound, -bound, change)
        return xp.select(straight, xp.select(change > bound, bound, change), 0.0)

    return clipped(f[0]), clipped(f[1])


def angles_of_rotor(xp, seen, n):
    """Roll and pitch of the body, rad, and their Turns, from the Light and from the rotor axis N in the frame L.

    The body's rotation takes the measured axis of the rotor to N. With q² = A² + B², e = Ny·q, d² = B² − e²:
    roll = atan2(a·d − b·e, b·d + a·e), pitch = atan2(Nx·d + Nz·A, Nz·d − Nx·A), which equal
    γs − asin(Ny/cos θs) and atan2(Nx, Nz) + asin(sin θs/√(1 − Ny²)). The arguments have the lengths r·B and
    √((Nx² + Nz²)·(d² + A²)).
    """
    x, y, z = n
    q_squared = seen.A_squared + seen.B_squared
    e = y * xp.sqrt(q_squared)
    d_squared = xp.maximum(seen.B_squared - (y * y) * q_squared, 0.0)
    d = xp.sqrt(d_squared)
    roll = Turn(seen.a * d - seen.b * e, seen.b * d + seen.a * e)
    pitch = Turn(x * d + z * seen.A, z * d - x * seen.A)
    lengths = 1 / (seen.r * seen.B), xp.rsqrt((x * x + z * z) * (d_squared + seen.A_squared))
    return (xp.atan2(*roll), xp.atan2(*pitch)), tuple(
        Turn(*scale(factor, turn)) for factor, turn in zip(lengths, (roll, pitch), strict=True))


def patent_angles(measured, cosine, drift, f, step):
    """Roll and pitch as source 004 compensates them, rad, and the next integrals ``drift``.

    Iγ += k·T·(fx + fz·θs), Iθ += k·T·(fy − fz·γs); roll = γs + cos θs·Iγ, pitch = θs + Iθ. ``step`` is k·T,
    ``cosine`` that of θs. The integrals are in body axes, so that a turn leaves them behind, and take the angles as
    small.
    """
    drift = (drift[0] + step * (f[0] + f[2] * measured[1]), drift[1] + step * (f[1] - f[2] * measured[0]))
    return (measured[0] + cosine * drift[0], measured[1] + drift[1]), drift


def optical_update(xp, px, calibration, inertial, settings, **state):
    """One update of OPT_attitude: one line of both CCDs.

    Parameters
    ----------
    px : pair
        Positions of the spots on the roll and on the pitch CCD, pixels.
    calibration : Calibration
    inertial : Inertial or None
        None without compensation.
    settings : Settings
    **state
        exact: ``n``; the Turns ``roll`` and ``pitch`` that are expected in this update, and the angles ``measured`` in
        the update before, rad. These are zero at first, so that the first update has no precession. An update expects
        the angles of the next one: it moves its own on as the measured ones have moved since the update before.
        patent: ``drift``, and ``step`` (k·T) of the update before, likewise zero.

    Returns
    -------
    Update
    """
    with xp.section("LIGHT"):
        w = tuple(slope(*values) for values in zip(px, calibration.n0, calibration.scale, calibration.c3, strict=True))
        seen = light(xp, w, calibration.tilt, calibration.h)
    if settings.compensation == "exact":
        with xp.section("ROTOR"):
            step = inertial.share * settings.period
            turn = step * inertial.yaw_rate
            f = level(inertial.f, Turn(*state["roll"]), Turn(*state["pitch"]))
            correction = erection(xp, f, turn, step, settings) if settings.erection else None
            n = precession(state["n"], f, turn, calibration.k * step, correction)
    with xp.section("ANGLES"):
        measured = measured_angles(xp, seen)
        angles, next_state = measured, {}
        if settings.compensation == "exact":
            follows = xp.select(Turn(*state["roll"]).cosine > 0.0, inertial.follows, 0.0)
            moved = scale(follows, subtract(measured, state["measured"]))
            angles, turns = angles_of_rotor(xp, seen, n)
            roll, pitch = map(onward, turns, moved)
            next_state = {"n": n, "roll": roll, "pitch": pitch, "measured": measured}
        elif settings.compensation == "patent":
            cosine = seen.B * xp.rsqrt(seen.A_squared + seen.B_squared)
            angles, drift = patent_angles(measured, cosine, state["drift"], inertial.f, state["step"] * inertial.share)
            next_state = {"drift": drift, "step": calibration.k * settings.period}
        return Update({"angles": scale(DEGREES, angles), "measured": scale(DEGREES, measured)}, next_state, {})
