"""QUAT_direct: quaternion propagated straight from body rates (source 001)."""

from collections.abc import Callable

from strapdown.algorithms import quaternion
from strapdown.kernel.system import System

__all__ = ["QUATERNION_CORES", "quat_direct"]

MEANINGS = {
    "omega": "angular rate p, q, r, body axes, rad/s, mean over the update period",
    "first": "angular rate p, q, r, body axes, rad/s, mean over the first half of the update period",
    "second": "angular rate p, q, r, body axes, rad/s, mean over the second half of the update period",
    "load": "1.0: the update takes the start quaternion; 0.0: it propagates",
    "start": "start quaternion, body to navigation, scalar first, unit length",
    "e": "quaternion, body to navigation, scalar first",
}
"""Meaning, unit and frame of the ports, by the kernel's names."""


def quat_direct(config):
    """System of QUAT_direct for a QuaternionConfig."""
    coefficients = config.coefficients

    def equations(xp, e, load, start, count=None, omega=None, first=None, second=None):
        return quaternion.quaternion_update(
            xp, e, first if config.coning else omega, load, start, a0=coefficients.a0, d0=coefficients.d0,
            period=config.period_s, renormalise=config.renormalise_every, count=count, second=second)

    rates = ({"first": ("in_p", "in_q", "in_r"), "second": ("in_p2", "in_q2", "in_r2")} if config.coning
             else {"omega": ("in_p", "in_q", "in_r")})
    kernels: list[Callable] = [quaternion.transition_coefficients, quaternion.transition]
    if config.coning:
        kernels.insert(0, quaternion.coning_correction)
    if config.renormalise_every:
        kernels.append(quaternion.renormalisation)
    state: dict[str, object] = {"e": ("e0", "e1", "e2", "e3")}
    if config.renormalise_every > 1:
        state["count"] = "count"
    return System(
        "QUAT_direct", "quaternion one update period later, straight from body rates", equations,
        kernels=tuple(kernels), meanings=MEANINGS, sections=("PROPAGATE",),
        start="in_rate_en", finish="out_quat_finish",
        inputs=rates | {"load": "in_load_en", "start": ("in_e0", "in_e1", "in_e2", "in_e3")},
        outputs={"e": ("out_e0", "out_e1", "out_e2", "out_e3")},
        state=state, reset={"e0": 1.0, "e1": 0.0, "e2": 0.0, "e3": 0.0} | ({"count": 0.0} if "count" in state else {}),
        status_port="out_status")


QUATERNION_CORES = {"QUAT_direct": quat_direct}
"""Module name to the function that makes its System for a QuaternionConfig."""
