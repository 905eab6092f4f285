"""QUAT_direct: quaternion propagated straight from body rates (source 001)."""

import math
from collections.abc import Callable
from typing import Literal

from pydantic import Field

from strapdown.algorithms import quaternion
from strapdown.config import Config
from strapdown.design import METHODS
from strapdown.kernel.system import System, vector

__all__ = ["QUATERNION_J2", "QUATERNION_J3", "QuaternionConfig", "quat_direct"]

class QuaternionConfig(Config):
    """Parameters of QUAT_direct."""

    rate_max_deg_s: float = Field(
        gt=0, allow_inf_nan=False,
        description="largest magnitude of the rate vector; the coefficients are designed for it")
    order: int = Field(ge=2, le=8, description="order j of the polynomials in u = (|omega|·T)²")
    method: Literal["least-squares", "minimax"] = Field(
        default="minimax",
        description="design of the coefficients: as in the patent, or with the smallest maximum error")
    renormalise_every: int = Field(default=0, ge=0, le=1_000_000,
                                   description="number of updates from one renormalisation to the next; 0: never")
    coning: bool = Field(
        default=False, description="two rates per update, one for each half of T, with coning correction")

    @property
    def coefficients(self):
        """The coefficient vectors a0 and d0: a strapdown.design.TransitionCoefficients.

        Raises: ValueError if the rotation in one update at the largest rate is too large.
        """
        return METHODS[self.method](self.order, math.radians(self.rate_max_deg_s) * self.period_s)

    def systems(self):
        """QUAT_direct."""
        return {"QUAT_direct": quat_direct}


MEANINGS = {
    "omega": "angular rate p, q, r, body axes, rad/s, mean over the update period",
    "first": "angular rate p, q, r, body axes, rad/s, mean over the first half of the update period",
    "second": "angular rate p, q, r, body axes, rad/s, mean over the second half of the update period",
    "load": "1.0: load the start quaternion; 0.0: propagate",
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

    rates = ({"first": vector("in_{}", "pqr"), "second": vector("in_{}2", "pqr")} if config.coning
             else {"omega": vector("in_{}", "pqr")})
    kernels: list[Callable] = [quaternion.transition_coefficients, quaternion.transition]
    if config.coning:
        kernels.insert(0, quaternion.coning_correction)
    if config.renormalise_every:
        kernels.append(quaternion.renormalisation)
    state: dict[str, object] = {"e": vector("e{}", "0123")}
    if config.renormalise_every > 1:
        state["count"] = "count"
    return System(
        "QUAT_direct", "quaternion one update period later, straight from body rates", equations,
        kernels=tuple(kernels), meanings=MEANINGS, sections=("PROPAGATE",),
        start="in_rate_en", finish="out_quat_finish",
        inputs=rates | {"load": "in_load_en", "start": vector("in_e{}", "0123")},
        outputs={"e": vector("out_e{}", "0123")},
        state=state, reset={"e0": 1.0}, status_port="out_status")


QUATERNION_J2 = QuaternionConfig(
    name="quaternion_j2", description="500 Hz, up to 2000 deg/s, second order",
    sample_rate_hz=500, rate_max_deg_s=2000, order=2)

QUATERNION_J3 = QuaternionConfig(
    name="quaternion_j3", description="500 Hz, up to 2000 deg/s, third order, renormalised in every update",
    sample_rate_hz=500, rate_max_deg_s=2000, order=3, renormalise_every=1)
