"""Quaternion propagation straight from body rates: QUAT_direct."""

import math
from typing import Literal

from pydantic import Field

from strapdown.design import METHODS

from .base import Config

__all__ = ["QUATERNION_J2", "QUATERNION_J3", "QuaternionConfig"]


class QuaternionConfig(Config):
    """Parameters of QUAT_direct."""

    rate_max_deg_s: float = Field(gt=0, allow_inf_nan=False,
                                  description="largest length of the rate vector, for which coefficients are designed")
    order: int = Field(ge=2, le=8, description="order j of the polynomials in u = (|omega|·T)²")
    method: Literal["least-squares", "minimax"] = Field(
        default="minimax", description="how coefficients are found: the patent's way or with the least largest error")
    renormalise_every: int = Field(default=0, ge=0, le=1_000_000,
                                   description="updates from one renormalisation to the next; 0: never")
    coning: bool = Field(default=False, description="two rates an update, of the halves of T, with coning correction")

    @property
    def coefficients(self):
        """The coefficient vectors a0 and d0: a strapdown.design.TransitionCoefficients.

        Raises: ValueError if the largest rate turns too far in one update.
        """
        return METHODS[self.method](self.order, math.radians(self.rate_max_deg_s) * self.period_s)


QUATERNION_J2 = QuaternionConfig(
    name="quaternion_j2", description="500 Hz, up to 2000 deg/s, second order",
    sample_rate_hz=500, rate_max_deg_s=2000, order=2)

QUATERNION_J3 = QuaternionConfig(
    name="quaternion_j3", description="500 Hz, up to 2000 deg/s, third order, renormalised in every update",
    sample_rate_hz=500, rate_max_deg_s=2000, order=3, renormalise_every=1)
