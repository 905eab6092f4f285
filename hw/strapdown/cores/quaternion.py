# amaranth: UnusedElaboratable=no
# A core tells its latency and its ports without being elaborated.
"""QUAT_direct: quaternion propagated straight from body rates (source 001)."""

import math
from collections.abc import Callable
from typing import Literal

import pydantic
from pydantic import BaseModel, ConfigDict, Field

from strapdown.algorithms import quaternion
from strapdown.design import METHODS
from strapdown.kernel.pool import Pool
from strapdown.kernel.system import System

from .core import Core

__all__ = ["QUATERNION_CONFIGS", "QUATERNION_J2", "QUATERNION_J3", "QuaternionConfig", "quat_direct",
           "quaternion_core"]


class QuaternionConfig(BaseModel):
    """Parameters of QUAT_direct."""

    model_config = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)

    name: str = Field(pattern="^[a-z][a-z0-9_]*$", description="name of the configuration, and of its output folder")
    description: str = Field(description="one line for people")
    update_rate_hz: float = Field(gt=0, le=1e6, allow_inf_nan=False, description="updates per second, 1/T")
    rate_max_deg_s: float = Field(gt=0, allow_inf_nan=False,
                                  description="largest length of the rate vector, for which coefficients are designed")
    order: int = Field(ge=2, le=8, description="order j of the polynomials in u = (|omega|·T)²")
    method: Literal["least-squares", "minimax"] = Field(
        default="minimax", description="how coefficients are found: the patent's way or with the least largest error")
    renormalise_every: int = Field(default=0, ge=0, le=1_000_000,
                                   description="updates from one renormalisation to the next; 0: never")
    coning: bool = Field(default=False, description="two rates an update, of the halves of T, with coning correction")
    pool: pydantic.InstanceOf[Pool] = Field(default=Pool(), description="operators of the engine")

    @property
    def period_s(self):
        """Update period T in seconds."""
        return 1 / self.update_rate_hz

    @property
    def coefficients(self):
        """The coefficient vectors a0 and d0: a strapdown.design.TransitionCoefficients.

        Raises: ValueError if the largest rate turns too far in one update.
        """
        return METHODS[self.method](self.order, math.radians(self.rate_max_deg_s) * self.period_s)


QUATERNION_J2 = QuaternionConfig(
    name="quaternion_j2", description="500 Hz, up to 2000 deg/s, second order",
    update_rate_hz=500, rate_max_deg_s=2000, order=2)

QUATERNION_J3 = QuaternionConfig(
    name="quaternion_j3", description="500 Hz, up to 2000 deg/s, third order, renormalised in every update",
    update_rate_hz=500, rate_max_deg_s=2000, order=3, renormalise_every=1)

QUATERNION_CONFIGS = {config.name: config for config in (QUATERNION_J2, QUATERNION_J3)}

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


def quaternion_core(config):
    """QUAT_direct for a QuaternionConfig: a Core, ready to be elaborated."""
    return Core(quat_direct(config), config.pool)
