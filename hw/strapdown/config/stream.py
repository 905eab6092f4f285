"""The complementary attitude filter for several IMUs on one core: INS_top_x8."""

from typing import Annotated

from pydantic import AfterValidator, Field

from strapdown.kernel.operators import Adder, Arctangent, Divider, Multiplier, Selector
from strapdown.kernel.pool import MemoryStyle, Pool

from .attitude import THESIS, AttitudeConfig

__all__ = ["StreamConfig", "THESIS_X8"]


def _power_of_two(number):
    if number & (number - 1):
        raise ValueError("must be a power of two")
    return number


class StreamConfig(AttitudeConfig):
    """Parameters of the complementary attitude filter for several IMUs."""

    channels: Annotated[int, AfterValidator(_power_of_two)] = Field(ge=2, le=64, description="IMUs, a power of two")
    interval: int = Field(ge=1, le=10_000, description="clock cycles from one sample to the next")


THESIS_X8 = StreamConfig(**dict(THESIS) | {
    "name": "thesis_x8", "description": "eight IMUs on one core, each with the filter of the 2015 thesis",
    # Not the latency of an operation counts but how fast the clock can be: so one step a cycle
    # where operations are iterated, in as many units as are in time.
    "pool": Pool(operators=(Adder(latency=5), Multiplier(latency=4), Divider(count=2, bits_per_cycle=1),
                            Arctangent(steps_per_cycle=1), Selector()),
                 forwarding=False, operand_memory=MemoryStyle.BLOCK, microcode=MemoryStyle.DISTRIBUTED),
    "channels": 8, "interval": 106})
