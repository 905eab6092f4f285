"""The transmitter, the sender of frames, and a core with both: their lines sampled in Verilator."""

import json
import re
from dataclasses import dataclass, replace

import numpy as np
import pytest
from amaranth import *
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out
from click.testing import CliRunner

from strapdown.cli import main
from strapdown.cores import SINS, Top, UartLink, Wrapper
from strapdown.cores.sins import DOUBLE_POOL
from strapdown.export import write
from strapdown.export.backend import to_verilog
from strapdown.fp import BINARY16, Subnormals
from strapdown.kernel.engine import Engine
from strapdown.kernel.pool import Pool
from strapdown.kernel.system import System
from strapdown.link import LAYOUT, NAVIGATION, FrameSampler, FrameSender, UartTransmitter, frame_size
from strapdown_sim.drivers.verilated import Interface

from .support import crc16, frame, received, verilated

DIVISOR = 5
BAUD = 921_600
NAMES = tuple(quantity.name for quantity in NAVIGATION.quantities)


@dataclass
class Halves:
    outputs: dict
    status: dict
    state: dict


def halves(xp, *, numbers):
    """A kernel that halves numbers exactly; status bits are set if its first and last number are negative."""
    with xp.section("HALVE"):
        return Halves({"numbers": tuple(0.5 * number for number in numbers)},
                      {"first_negative": numbers[0] < 0.0, "last_negative": numbers[-1] < 0.0}, {})


HALVES = System("HALVES", "halves", halves, inputs={"numbers": tuple(f"in_{name}" for name in NAMES)},
                outputs={"numbers": tuple(f"out_{name}" for name in NAMES)}, sections=("HALVE",), start="in_en",
                finish="out_finish", status=("first_negative", "last_negative"), status_port="out_status")


def linked(pool, **changes):
    parameters = {"sample_rate_hz": 50, "clock_hz": DIVISOR * BAUD, "baud_rate": BAUD} | changes
    return Top(UartLink(Engine(HALVES, pool), **parameters))


class Lines(wiring.Component):
    """Transmitters and senders, in one model because it compiles in a third of the time.

    One sender takes the output of a sampler (sample, status, payload), one a stream (valid, status, payload).
    """

    def __init__(self):
        super().__init__({**{name: In(width) for name, width in (
            ("data", 8), ("valid", 1), ("send", 1), ("status", 8), ("payload", 24))},
            **{f"{name}_{port}": Out(1) for name, ports in LINE_OUTPUTS.items() for port in ports}})

    def elaborate(self, platform):
        m = Module()
        for divisor in 4, 7:
            m.submodules[f"uart{divisor}"] = uart = UartTransmitter(clock_hz=divisor * BAUD, baud_rate=BAUD)
            m.d.comb += [uart.data.payload.eq(self.data), uart.data.valid.eq(self.valid),
                         getattr(self, f"uart{divisor}_ready").eq(uart.data.ready),
                         getattr(self, f"uart{divisor}_tx").eq(uart.tx)]
        m.submodules.sampler = sampler = FrameSampler(3)
        m.submodules.sender, m.submodules.streamed = sender, streamed = [
            FrameSender(0xA7, 3, clock_hz=DIVISOR * BAUD, baud_rate=BAUD) for _ in range(2)]
        wiring.connect(m, sampler.frames, sender.frames)
        m.d.comb += [
            sampler.sample.eq(self.send), sampler.status.eq(self.status), sampler.payload.eq(self.payload),
            self.sender_tx.eq(sender.tx), self.sender_busy.eq(~sender.frames.ready),
            self.sender_overrun.eq(sampler.overrun),
            streamed.frames.valid.eq(self.send), streamed.frames.p.status.eq(self.status),
            streamed.frames.p.payload.eq(self.payload), streamed.frames.p.counter.eq(self.payload[4:20]),
            self.streamed_tx.eq(streamed.tx), self.streamed_ready.eq(streamed.frames.ready)]
        return m


LINE_OUTPUTS = {"uart4": ("ready", "tx"), "uart7": ("ready", "tx"), "sender": ("busy", "overrun", "tx"),
                "streamed": ("ready", "tx")}


@pytest.fixture(scope="module")
def lines(models, tmp_path_factory):
    """Outputs of one of the Lines for a stimulus."""
    outputs = tuple(f"{name}_{port}" for name, ports in LINE_OUTPUTS.items() for port in ports)
    path = tmp_path_factory.mktemp("lines") / "lines.v"
    path.write_text(to_verilog(Lines(), "lines"), encoding="utf-8")
    model = verilated(path, Interface("lines", ("data", "valid", "send", "status", "payload"), outputs, reset="rst",
                                      reset_active=1), models)

    def run(name, **stimulus):
        answer = model.stream(stimulus)
        return {port: answer[f"{name}_{port}"] for port in LINE_OUTPUTS[name]}

    return run


@pytest.fixture(scope="module")
def core(models, tmp_path_factory):
    """A core with its link, from the exported file."""
    core = linked(DOUBLE_POOL)
    path = write(core, tmp_path_factory.mktemp("core"), command="as in this test", config=SINS)
    return core, verilated(path, Interface("HALVES_uart", ("in_en", *HALVES.input_ports),
                                           ("uart_tx", "out_finish", "out_link_overrun")), models)


@pytest.mark.verilator
@pytest.mark.parametrize("divisor", [4, 7])
def test_all_bytes_without_a_gap(lines, divisor):
    # A byte is offered until it is taken; the data then changes at the edge that takes it.
    sent = np.random.default_rng(1).permutation(256)
    taken = 10 * divisor * np.arange(257) + 3
    data = np.zeros(taken[-1] + 20, dtype=int)
    for byte, first, last in zip(sent, np.r_[0, taken[:-2] + 1], taken[:-1], strict=True):
        data[first:last + 1] = byte
    valid = np.zeros_like(data)
    valid[3:taken[255] + 1] = 1
    answer = lines(f"uart{divisor}", data=data, valid=valid)
    got, starts = received(answer["tx"], divisor)
    assert got == bytes(sent.tolist())
    np.testing.assert_array_equal(starts, taken[:-1] + 1)
    ready = np.ones_like(data)
    for cycle in taken[:-1]:
        ready[cycle + 1:cycle + 10 * divisor] = 0
    np.testing.assert_array_equal(answer["ready"], ready)


@pytest.mark.verilator
@pytest.mark.parametrize("divisor", [4, 7])
def test_idle_line_is_high_and_gaps_are_kept(lines, divisor):
    valid = np.zeros(400, dtype=int)
    valid[[17, 200]] = 1
    answer = lines(f"uart{divisor}", data=np.where(np.arange(400) < 100, 0x00, 0xFF), valid=valid)
    assert received(answer["tx"], divisor) == (b"\x00\xff", [18, 201])


@pytest.mark.parametrize(("clock_hz", "baud_rate", "message"), [
    (3e6, 921_600, "921600 baud need a clock of 3.6864e+06 Hz or more, not 3e+06 Hz"),
    (4.1e6, 921_600, "4.1e+06 Hz / 4 is 1.025e+06 baud, more than 2% from 921600: choose another clock or baud rate"),
    (1e6, 0, "clock and baud rate must be above zero, not 1e+06 Hz and 0 baud"),
])
def test_refuses_rates(clock_hz, baud_rate, message):
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        UartTransmitter(clock_hz=clock_hz, baud_rate=baud_rate)


def test_takes_rates_within_two_percent():
    for clock_hz, baud_rate, divisor in (100e6, 921_600, 109), (50e6, 115_200, 434), (12e6, 921_600, 13), (4e6, 1e6, 4):
        assert UartTransmitter(clock_hz=clock_hz, baud_rate=baud_rate).divisor == divisor


@pytest.mark.parametrize(("kind", "size", "message"), [
    (256, 3, "type of a frame must be 0 to 255, not 256"),
    (-1, 3, "type of a frame must be 0 to 255, not -1"),
    (1, 0, "payload must have 1 to 255 bytes, not 0"),
    (1, 256, "payload must have 1 to 255 bytes, not 256"),
])
def test_refuses_frames(kind, size, message):
    with pytest.raises(ValueError, match=f"^{message}$"):
        FrameSender(kind, size, clock_hz=1e8, baud_rate=BAUD)


def short_frame(counter, status, payload):
    """Like ``frame``, for the sender under test."""
    body = bytes((3, 0xA7, counter & 0xFF, counter >> 8, status)) + payload.to_bytes(3, "little")
    return b"\xeb\x90" + body + crc16(body).to_bytes(2, "big")


def test_own_division_has_the_published_check_value():
    # R. N. Williams, A painless guide to CRC error detection algorithms, 1993; the catalogue's CRC-16/IBM-3740.
    assert crc16(b"123456789") == 0x29B1


@pytest.mark.verilator
def test_sends_when_and_only_when_free(lines):
    rng = np.random.default_rng(2)
    interval = frame_size(3) * 10 * DIVISOR + 1
    send = (rng.random(40 * interval) < 0.01).astype(int)
    # Some come exactly in the first cycle that can take one, some in the last cycle that cannot.
    send[:5 * interval] = 0
    send[[10, 10 + interval, 9 + 2 * interval, 10 + 3 * interval]] = 1
    send[-interval - 5:] = 0
    status, payload = rng.integers(0, 256, len(send)), rng.integers(0, 1 << 24, len(send))
    answer = lines("sender", send=send, status=status, payload=payload)

    wanted, starts, free, overrun = b"", [], 0, 0
    busy, overruns = np.zeros_like(send), np.zeros_like(send)
    for counter, cycle in enumerate(np.flatnonzero(send)):
        overruns[cycle + 1:] = cycle < free
        if cycle >= free:
            wanted += short_frame(counter, status[cycle], int(payload[cycle]))
            starts += [cycle + 2 + 10 * DIVISOR * index for index in range(frame_size(3))]
            free = cycle + interval
            busy[cycle + 1:free] = 1
        else:
            overrun += 1
    assert overrun > 20
    assert received(answer["tx"], DIVISOR) == (wanted, starts)
    np.testing.assert_array_equal(answer["busy"], busy)
    np.testing.assert_array_equal(answer["overrun"], overruns)


@pytest.mark.verilator
def test_frames_without_a_gap(lines):
    # A frame is offered until it is taken; the next one at once, or after a pause.
    rng = np.random.default_rng(4)
    interval = frame_size(3) * 10 * DIVISOR + 1
    pauses = np.array([0, 0, 1, 50, 0])
    taken = 3 + np.cumsum(np.r_[0, interval + pauses])
    offered = np.r_[taken[0], np.where(pauses, taken[1:], taken[:-1] + 1)]
    valid, status, payload = (np.zeros(taken[-1] + interval + 2, dtype=int) for _ in range(3))
    wanted = b""
    for first, last in zip(offered, taken, strict=True):
        word, number = int(rng.integers(256)), int(rng.integers(1 << 24))
        valid[first:last + 1], status[first:last + 1], payload[first:last + 1] = 1, word, number
        wanted += short_frame(number >> 4 & 0xFFFF, word, number)
    answer = lines("streamed", send=valid, status=status, payload=payload)
    np.testing.assert_array_equal(np.flatnonzero(valid & answer["ready"].astype(int)), taken)
    got, starts = received(answer["tx"], DIVISOR)
    assert got == wanted
    assert starts[::frame_size(3)] == (taken + 2).tolist()


@pytest.mark.verilator
def test_counter_wraps(lines):
    # 65,534 lost samples are also counted, so that the counter reaches its end quickly.
    interval = frame_size(3) * 10 * DIVISOR + 1
    send = np.zeros(67_000, dtype=int)
    send[:65_536] = 1
    send[65_536 + interval] = 1
    got, _ = received(lines("sender", send=send)["tx"], DIVISOR)
    size = frame_size(3)
    counters = [int.from_bytes(got[start + 4:start + 6], "little") for start in range(0, len(got), size)]
    assert counters == [index * interval for index in range(-(-65_536 // interval))] + [0]


@pytest.mark.verilator
def test_core_sends_what_it_found(core, tmp_path):
    core, model = core
    fmt = core.component.engine.program.format
    rng = np.random.default_rng(3)
    count, period = 12, core.component.sender.interval + 30
    numbers = fmt.from_bits(fmt.to_bits(rng.normal(0, 1e3, (count, len(NAMES)))))
    start = np.zeros(count * period + core.latency, dtype=np.uint64)
    start[:count * period:period] = 1
    # Inputs are valid for one cycle only: the link sends the results of the core, not the values at its inputs.
    stimulus = {"in_en": start}
    for column, port in enumerate(HALVES.input_ports):
        stimulus[port] = np.zeros(len(start), dtype=np.uint64)
        stimulus[port][:count * period:period] = fmt.to_bits(numbers[:, column])
    answer = model.stream(stimulus)
    got, starts = received(answer["uart_tx"], DIVISOR)
    dtype = f"<f{fmt.width // 8}"
    status = (numbers[:, 0] < 0) + 2 * (numbers[:, -1] < 0)
    assert set(status) == {0, 1, 2, 3}
    assert got == b"".join(frame(counter, status[counter], numbers[counter] / 2, dtype) for counter in range(count))
    rises = np.flatnonzero(np.diff(answer["out_finish"].astype(int)) == 1) + 1
    np.testing.assert_array_equal(starts[::core.component.sender.size], rises + 2)
    assert not answer["out_link_overrun"].any()

    # The same numbers reach the user's file, in every bit.
    (tmp_path / "line.bin").write_bytes(got)
    result = CliRunner().invoke(main, ["monitor", str(tmp_path / "line.bin"), "--output", str(tmp_path / "nav.csv")])
    assert result.exit_code == 0, result.output
    rows = [line.split(",") for line in (tmp_path / "nav.csv").read_text(encoding="utf-8").splitlines()[1:]]
    assert [(int(row[0]), int(row[1])) for row in rows] == list(enumerate(status))
    written = np.array([row[2:] for row in rows], dtype=float).astype(fmt.dtype)
    np.testing.assert_array_equal(fmt.to_bits(written), fmt.to_bits(numbers / 2))


@pytest.mark.verilator
def test_core_that_is_faster_than_its_line(core):
    core, model = core
    latency, interval = core.latency, core.component.sender.interval
    starts = np.arange(0, interval - 1, latency + 2)
    # All updates but the first finish while its frame is sent; one more finishes after that.
    start = np.zeros(2 * interval + 3 * latency, dtype=np.uint64)
    start[starts] = 1
    start[starts[-1] + 2 * latency] = 1
    answer = model.stream({"in_en": start})
    got, _ = received(answer["uart_tx"], DIVISOR)
    assert got == frame(0, 0, np.zeros(9)) + frame(len(starts), 0, np.zeros(9))
    rises = np.flatnonzero(np.diff(answer["out_finish"].astype(int)) == 1) + 1
    assert len(rises) == len(starts) + 1
    overrun = np.zeros_like(start)
    overrun[rises[1] + 1:rises[-1] + 1] = 1
    np.testing.assert_array_equal(answer["out_link_overrun"], overrun)


def test_frame_must_fit_into_the_sample_period():
    with pytest.raises(ValueError, match=r"^a frame of 81 bytes takes 0.879 ms at 921600 baud, longer than the sample "
                                         r"period of 0.833 ms$"):
        linked(DOUBLE_POOL, sample_rate_hz=1200)
    assert linked(DOUBLE_POOL, sample_rate_hz=1130).component.sender.size == 81
    assert linked(Pool(), sample_rate_hz=1200).component.sender.size == 45


def test_a_link_goes_around_a_wrapper_that_shows_what_it_sends():
    parameters = {"sample_rate_hz": 50, "clock_hz": DIVISOR * BAUD, "baud_rate": BAUD}
    engine = Engine(HALVES, Pool())
    link = UartLink(Wrapper(engine, hidden=("in_height",)), **parameters)
    names = [port.name for port in engine.ports if port.name != "in_height"]
    assert [port.name for port in link.ports] == [*names, "uart_tx", "out_link_busy", "out_link_overrun"]
    for hidden in "out_height", "out_finish", "out_status":
        with pytest.raises(ValueError, match=r"^no type of frame holds the outputs of HALVES: 1 holds latitude, "):
            UartLink(Wrapper(engine, hidden=(hidden,)), **parameters)


def test_a_frame_holds_binary32_or_binary64():
    with pytest.raises(ValueError, match=r"^a frame holds binary32 or binary64, not binary16$"):
        linked(Pool(format=BINARY16.with_subnormals(Subnormals.FLUSH)))


def test_a_frame_holds_eight_status_bits():
    flags = tuple(f"flag_{number}" for number in range(7))

    def kernel(xp, *, numbers):
        update = halves(xp, numbers=numbers)
        return replace(update, status=dict.fromkeys(flags, update.status["first_negative"]))

    seven = replace(HALVES, equations=kernel, status=flags)
    with pytest.raises(ValueError, match=r"^a frame holds 8 status bits, and HALVES has 9$"):
        UartLink(Engine(seven, Pool()), sample_rate_hz=50, clock_hz=DIVISOR * BAUD, baud_rate=BAUD)


def test_description_has_the_ports_of_the_verilog(tmp_path):
    core = linked(Pool())
    path = write(core, tmp_path, command="as in this test", config=SINS)
    facts = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))
    top = path.read_text(encoding="utf-8").split("module HALVES_uart (")[1].split("\n);")[0]
    ports = re.findall(r"^  (input|output) (?:wire|reg) (?:\[(\d+):0\] )?(\w+)", top, re.MULTILINE)
    declared = {name: (direction, int(high or 0) + 1) for direction, high, name in ports}
    assert {port["name"]: (port["direction"], port["width"]) for port in facts["ports"]} == declared
    assert declared["in_height"] == ("input", 32)
    assert declared["uart_tx"] == ("output", 1)
    assert (facts["frame_bytes"], facts["bit_cycles"], facts["frame_cycles"]) == (45, DIVISOR, 45 * 10 * DIVISOR + 1)


@pytest.mark.parametrize(("arguments", "message"), [
    (["--config", "flight"], "no type of frame holds the outputs of INS_flight: 1 holds latitude, longitude, height, "),
    (["--set", "channels=8"], "a frame has no channel number: SINS_top_x8 with its 8 channels cannot be linked"),
    (["--set", "sample_rate_hz=0"], "configuration sins: sample_rate_hz must be greater than 0"),
])
def test_mistakes_end_in_one_line(tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(main, ["link", "DIR", *arguments])
    assert result.exit_code == 2
    assert result.stderr.startswith(f"strapdown: {message}")
    assert result.stderr.count("\n") == 1
    assert not any(tmp_path.iterdir())


def test_document_has_the_layout(root):
    text = (root / "docs" / "link.md").read_text(encoding="utf-8")
    for field in LAYOUT:
        assert f"| `{field.name}` | {field.size or 'length'} | {field.meaning} |" in text
    offset = 0
    for quantity in NAVIGATION.quantities:
        assert f"| {offset} | `{quantity.name}` | {quantity.unit} | {quantity.meaning} |" in text
        offset += 8
