"""Numbers for frames of the serial link, and their comparison with what a decoder found in these frames."""

import numpy as np

__all__ = ["COUNT", "assert_frames", "numbers_of_frames"]

COUNT = 40
"""Number of frames."""


def numbers_of_frames():
    """Nine random numbers a frame, shape (COUNT, 9): some with 17 digits, some with the bytes of a sync, and -0."""
    values = np.random.default_rng(1).normal(0, 1e3, (COUNT, 9))
    values[3] = np.frombuffer(b"\xeb\x90\x48\x01\x48\xeb\x90\x3f" * 9)
    values[4, :4] = 0.1, 1 / 3, -0.0, 5e-324
    return values


def assert_frames(found, wanted, numbers):
    """``found`` are the frames of these indices, in every bit, with the index modulo 32 as their status."""
    assert [(frame.number, frame.status) for frame in found] == [(index - wanted[0], index % 32) for index in wanted]
    np.testing.assert_array_equal(np.array([frame.values for frame in found]).view(np.uint64),
                                  numbers[list(wanted)].view(np.uint64))
