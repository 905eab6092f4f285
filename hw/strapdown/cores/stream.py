# amaranth: UnusedElaboratable=no
# A core tells its latency and its ports without being elaborated.
"""Attitude of several IMUs from one core: samples in and results out with a channel number."""

from dataclasses import replace

from strapdown.kernel.stream import StreamEngine

from .attitude import ins_top
from .core import Core

__all__ = ["stream_core"]


def stream_core(config):
    """The core INS_top_x<channels> for a StreamConfig: a Core, ready to be elaborated."""
    system = ins_top(config)
    system = replace(system, name=f"{system.name}_x{config.channels}",
                     title=f"{system.title}, {config.channels} channels")
    return Core(system, config.pool, engine=StreamEngine, channels=config.channels, interval=config.interval)
