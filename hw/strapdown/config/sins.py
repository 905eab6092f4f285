"""Strapdown inertial navigation: SINS_top."""

from typing import Literal

import pydantic
from pydantic import Field

from strapdown.fp import BINARY64, Subnormals
from strapdown.kernel.operators import Adder, Arctangent, Divider, Multiplier, Selector
from strapdown.kernel.pool import MemoryStyle, Pool

from .base import Config

__all__ = ["SINS", "SINS_DAMPED", "SinsConfig"]


DOUBLE_POOL = Pool(format=BINARY64.with_subnormals(Subnormals.FLUSH),
                   operators=(Adder(), Multiplier(), Divider(bits_per_cycle=2), Arctangent(), Selector()),
                   operand_memory=MemoryStyle.BLOCK)
"""Operators in binary64, operands in block RAM: there are more than LUTs would hold cheaply. The adder sets the clock
frequency, so that two bits a cycle in the divider cost nothing."""


class SinsConfig(Config):
    """Parameters of SINS_top."""

    sample_rate_hz: float = Field(gt=0, le=1000, allow_inf_nan=False, description="samples per second, 1/T")
    earth: Literal["source", "wgs84"] = Field(default="source", description="constants of the earth")
    alignment_samples: int = Field(default=3000, ge=2, le=1_000_000,
                                   description="samples that a coarse alignment averages")
    damping_s: float = Field(default=0, ge=0, le=1e5, allow_inf_nan=False,
                             description="time constant of the vertical loop, s; 0: free, without altitude input")
    rate_max_deg_s: float = Field(default=400, gt=0, allow_inf_nan=False,
                                  description="largest rate, for which coefficients are designed; beyond: out of range")
    force_max_m_s2: float = Field(default=160, gt=0, allow_inf_nan=False,
                                  description="largest specific force; beyond: out of range")
    pool: pydantic.InstanceOf[Pool] = Field(default=DOUBLE_POOL, description="operators of the engine")


SINS = SinsConfig(name="sins", description="50 Hz, free vertical channel", sample_rate_hz=50)
SINS_DAMPED = SinsConfig(name="sins_damped", description="50 Hz, vertical channel damped by an altitude, 100 s",
                         sample_rate_hz=50, damping_s=100)
