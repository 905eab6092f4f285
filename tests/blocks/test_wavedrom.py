"""Timing diagrams: they have the events of the line, and the levels of the pins."""

import json

import pytest

from strapdown.blocks import SENSORS, LineTiming
from strapdown.blocks.wavedrom import columns_of_line, wave_of_line


def levels(wave):
    """The level in each column."""
    level, found = "", []
    for mark in wave:
        level = level if mark == "." else mark
        found.append(level)
    return "".join(found)


@pytest.mark.parametrize(("name", "pins"), [
    # ICG falls; SH rises; SH falls; ICG rises; first pixel; first, last sample; flush; exposure begins; read out
    # ends; next line.
    ("tcd1304", {"ICG": "00011111110", "SH": "01000001000", "video": "xxxx=====xx", "exposing": "11000000111"}),
    # ST falls; exposure ends; first pixel; first, last sample; read out ends; exposure begins; next line.
    ("s11639", {"ST": "00000011", "video": "xx===xxx", "exposing": "10000011"}),
    # First pixel; SI falls; first sample; exposure begins; last sample; read out ends; SI rises; next line.
    ("tsl1402", {"SI": "10000011", "video": "=====xxx", "exposing": "00011100"}),
])
def test_waves(name, pins):
    timing = LineTiming(SENSORS[name], clock_hz=100e6)
    wave = json.loads(wave_of_line(timing))
    lanes = {lane["name"]: levels(lane["wave"]) for lane in wave["signal"]}
    assert {pin: lanes[pin] for pin in pins} == pins
    columns = columns_of_line(timing)
    assert list(columns) == sorted(columns)
    for event, cycle in timing.events.items():
        assert event in columns[cycle]
    assert {len(levels(lane["wave"])) for lane in wave["signal"]} == {len(columns)}
