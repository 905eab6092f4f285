"""The block diagram of OPT_top in docs/optical.md."""

from pathlib import Path

from strapdown.ip.drawing import arrow, box, sheet, wire, write_svg

__all__ = ["draw_optical"]

OUTSIDE, CORE, MODULE, INNER = "#dbe7f5", "#f4f4f4", "#e3f1dc", "#ffffff"
"""Colours: what is connected to the core, the core, its modules, and blocks that are no module of their own."""


def draw_optical(path: Path) -> None:
    """Draw the modules of OPT_top and what is between them. Two runs give equal bytes."""
    figure, axes = sheet(126, 54)

    def module(corner, size, text):
        return box(axes, corner, size, text, MODULE)

    box(axes, (28, 2), (80, 50), "", CORE)
    axes.text(68, 49.5, "OPT_top", ha="center", va="center", weight="bold")
    sensors = box(axes, (2, 36), (13, 10), "CCDs of\nroll and pitch", OUTSIDE)
    adcs = box(axes, (2, 16), (13, 10), "ADCs of\nroll and pitch", OUTSIDE)
    timing = module((31, 36), (16, 10), "OPT_timing")
    captured = module((31, 16), (16, 10), "OPT_capture")
    buffer = module((43, 4), (16, 8), "OPT_buffer,\nif buffered")
    spot = module((63, 16), (16, 10), "OPT_spot,\none a CCD")
    control = box(axes, (63, 36), (16, 10), "thresholds and\nexposure,\none each a CCD", INNER)
    attitude = module((90, 16), (16, 10), "OPT_attitude")
    means = box(axes, (90, 36), (16, 10), "mean of\nthe samples", INNER)
    sender = module((90, 4), (16, 8), "OPT_send")

    # Light and video.
    _beside(axes, sensors, adcs, "video")
    arrow(axes, (timing.left, 41), (sensors.right, 41), "clock, SH/ST")
    arrow(axes, (captured.left, 23), (adcs.right, 23), "clock")
    arrow(axes, (adcs.right, 18), (captured.left, 18), "data")
    _beside(axes, timing, captured, "samples")
    arrow(axes, (captured.right, 21), (spot.left, 21), "pixels")
    wire(axes, (39, captured.bottom), (39, 8), (buffer.left, 8))
    wire(axes, (buffer.right, 8), (68, 8), (68, spot.bottom))

    # What follows a line.
    wire(axes, (67, spot.top), (67, control.bottom))
    axes.text(66.4, 31, "peak,\nblack", ha="right", va="center", size=9)
    wire(axes, (75, control.bottom), (75, spot.top))
    axes.text(75.6, 31, "thresholds", ha="left", va="center", size=9)
    arrow(axes, (control.left, 41), (timing.right, 41), "exposures")
    arrow(axes, (spot.right, 21), (attitude.left, 21), "positions")
    _beside(axes, means, attitude, "means")
    _beside(axes, attitude, sender, "")

    # Outside.
    arrow(axes, (125, 41), (means.right, 41), "acc, yaw rate")
    arrow(axes, (125, 23.5), (attitude.right, 23.5), "calibration")
    arrow(axes, (attitude.right, 18.5), (125, 18.5), "roll, pitch")
    arrow(axes, (sender.right, 8), (125, 8), "uart_tx")
    write_svg(figure, path)


def _beside(axes, above, below, text):
    """An arrow down from a Block to the one under it, with a text beside it."""
    middle = above.centre[0]
    wire(axes, (middle, above.bottom), (middle, below.top))
    axes.text(middle + 0.6, (above.bottom + below.top) / 2, text, ha="left", va="center", size=9)
