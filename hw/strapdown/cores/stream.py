"""Attitude of several IMUs from one core: samples in and results out with a channel number."""

from dataclasses import replace

from .attitude import ins_top

__all__ = ["ins_top_stream"]


def ins_top_stream(config):
    """System of INS_top_x<channels> for a StreamConfig: that of INS_top, which every channel has to itself."""
    system = ins_top(config)
    return replace(system, name=f"{system.name}_x{config.channels}",
                   title=f"{system.title}, {config.channels} channels")
