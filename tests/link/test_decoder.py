"""The decoder on streams that these tests make from the document of the frame, with all kinds of damage."""

import numpy as np
import pytest

from strapdown.link import NAVIGATION, FrameDecoder, FrameSender

from ..frames import COUNT, assert_frames, numbers_of_frames
from .support import frame


@pytest.fixture(scope="module")
def numbers():
    return numbers_of_frames()


@pytest.fixture
def frames(numbers):
    return [frame(counter, counter % 32, row) for counter, row in enumerate(numbers)]


def decode(data, piece=1 << 16):
    decoder, found = FrameDecoder(), []
    for start in range(0, len(data), piece):
        found += decoder.feed(data[start:start + piece])
    return found + decoder.finish(), decoder


def counts(decoder):
    return decoder.frames, decoder.lost, decoder.crc_errors, decoder.restarts, decoder.skipped_bytes


@pytest.mark.parametrize("piece", [1, 2, 7, 80, 81, 82, 1 << 16])
def test_clean_stream_in_pieces(frames, numbers, piece):
    found, decoder = decode(b"".join(frames), piece)
    assert_frames(found, range(COUNT), numbers)
    assert counts(decoder) == (COUNT, 0, 0, 0, 0)


@pytest.mark.parametrize("piece", [1, 1 << 16])
def test_garbage_around_and_between(frames, numbers, piece):
    rng = np.random.default_rng(2)
    # The garbage contains beginnings of frames, also in its last byte; without EB it contains none.
    plain = rng.integers(0, 0xEB, 300, dtype=np.uint8).tobytes()
    garbage = plain + b"\xeb\xeb\x90\x48\x03\xeb\x90\x49\x01\xeb\xeb"
    data = garbage.join([b"", *frames, b""])
    found, decoder = decode(data, piece)
    assert_frames(found, range(COUNT), numbers)
    assert counts(decoder) == (COUNT, 0, 0, 0, (COUNT + 1) * len(garbage))


def test_begins_in_the_middle_of_a_frame_and_ends_in_another(frames, numbers):
    data = b"".join(frames)[50:-20]
    found, decoder = decode(data)
    assert_frames(found, range(1, COUNT - 1), numbers)
    assert counts(decoder) == (COUNT - 2, 0, 0, 0, 31 + 61)


def test_every_single_flipped_bit_costs_that_frame_and_no_other(frames, numbers):
    for bit in range(8 * len(frames[5])):
        damaged = bytearray(frames[5])
        damaged[bit // 8] ^= 1 << bit % 8
        found, decoder = decode(b"".join([*frames[4:5], bytes(damaged), *frames[6:9]]))
        assert_frames(found, [4, 6, 7, 8], numbers)
        # Damage before the counter hides the frame; after it, the CRC detects the damage.
        assert counts(decoder) == (4, 1, int(bit >= 32), 0, len(damaged))


def test_frame_within_a_broken_one(frames, numbers):
    """A cable is disconnected during a frame and connected again: the partial frame hides no complete frame."""
    data = frames[10] + frames[11][:33] + frames[12] + frames[13]
    found, decoder = decode(data)
    assert_frames(found, [10, 12, 13], numbers)
    assert counts(decoder) == (3, 1, 1, 0, 33)
    # The same at the end, where no further bytes follow.
    found, decoder = decode(frames[11][:33] + frames[12][:40])
    assert counts(decoder) == (0, 0, 0, 0, 73)
    found, decoder = decode(frames[11][:5] + frame(12, 12, numbers[12], "<f4"))
    assert [frame.number for frame in found] == [0]


def test_lost_frames_wrap_and_restart(numbers):
    sequence = [65_530, 65_531, 65_535, 0, 3, 4, 0, 1, 1]
    found, decoder = decode(b"".join(frame(counter, 0, numbers[0]) for counter in sequence))
    assert [frame.number for frame in found] == [0, 1, 5, 6, 9, 10, 11, 12, 13]
    assert counts(decoder) == (9, 3 + 2, 0, 2, 0)


def test_binary32(numbers):
    single = numbers.astype(np.float32)
    found, _ = decode(b"".join(frame(index, 0, row, "<f4") for index, row in enumerate(single)))
    assert {frame.values.dtype for frame in found} == {np.dtype(np.float32)}
    np.testing.assert_array_equal(np.array([frame.values for frame in found]).view(np.uint32), single.view(np.uint32))


def test_twin_of_the_sender(numbers):
    """The twin's bytes agree with the document; test_uart compares the circuit's bytes with the document."""
    for dtype in "<f8", "<f4":
        row = numbers[3].astype(dtype)
        sender = FrameSender(NAVIGATION.number, row.nbytes, clock_hz=1e8, baud_rate=921_600)
        assert sender.compute(65_535, 17, row.tobytes()) == frame(65_535, 17, row, dtype)
    with pytest.raises(ValueError, match=r"^payload must have 36 bytes, not 35$"):
        sender.compute(0, 0, bytes(35))
