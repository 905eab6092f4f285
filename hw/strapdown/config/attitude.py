"""The complementary attitude filter of the 2015 thesis: INS_acc to INS_top."""

from pydantic import Field

from strapdown.kernel.operators import Adder, Arctangent, Divider, Multiplier, Selector
from strapdown.kernel.pool import MemoryStyle, Pool

from .base import Axes, Config

__all__ = ["AttitudeConfig", "MAHONY", "THESIS", "THESIS_COMPACT", "THESIS_FAST"]


class AttitudeConfig(Config):
    """Parameters of the complementary attitude filter (INS_acc … INS_top)."""

    kp: float = Field(ge=0, le=1e6, allow_inf_nan=False,
                      description="proportional gain Kp, rad/s per unit error")
    ki: float = Field(ge=0, le=1e6, allow_inf_nan=False,
                      description="integral gain Ki, rad/s² per unit error")
    magnetometer_axes: Axes = Field(description="sensor axes of the magnetometer that lie along body x, y and z")


THESIS = AttitudeConfig(
    name="thesis",
    description="the 2015 thesis: 500 Hz, Kp 10, Ki·T 0.001, magnetometer turned by 90 degrees",
    sample_rate_hz=500, kp=10, ki=0.5, magnetometer_axes=("+y", "-x", "+z"))

THESIS_COMPACT = THESIS.replace(
    name="thesis_compact", description="the same, small: one operation after another, atan2 without a unit of its own",
    pool=Pool(operators=(Adder(), Multiplier(), Divider(), Selector()),
              forwarding=False, private_ports=False, operand_memory=MemoryStyle.BLOCK))

THESIS_FAST = THESIS.replace(
    name="thesis_fast", description="the same, fast: several operators of each kind",
    pool=Pool(operators=(Adder(count=2, latency=4), Multiplier(count=3), Divider(count=2, bits_per_cycle=2),
                         Arctangent(count=3), Selector()),
              side_memory=True))

MAHONY = AttitudeConfig(
    name="mahony",
    description="the same filter with Kp 0.5, Ki 0, all sensors along the body axes, any sample rate",
    sample_rate_hz=500, kp=0.5, ki=0, magnetometer_axes=("+x", "+y", "+z"))
