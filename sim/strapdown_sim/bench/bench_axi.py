"""Bench for a core behind its bus: registers, updates, streams and interrupts, with stalls on every channel."""

import itertools
import math
import random

import cocotb
import numpy as np
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, RisingEdge
from cocotbext.axi import AxiLiteBus, AxiLiteMaster, AxiStreamBus, AxiStreamFrame, AxiStreamSink, AxiStreamSource

from strapdown_sim.drivers.bench import core_under_test
from strapdown_sim.drivers.bus import answer_words, sample_words

top, config = core_under_test()
core = top.component
table, system = core.table, core.system
OKAY, SLVERR = 0, 2
PERIOD_NS = 10

UPDATES = min(200, 51_200_000 // (core.latency * core.program.format.width**2))
"""As in the bench for all cores."""
MANY = np.iinfo(np.int32).max



class Bench:
    """A core behind its bus, with a master, a source and a sink; each channel may stall at random."""

    def __init__(self, dut, *, stalls=0.0):
        self.dut, self.clock = dut, dut.aclk
        start_clock(dut)
        reset = {"reset": dut.aresetn, "reset_active_level": False}
        self.master = AxiLiteMaster(AxiLiteBus.from_prefix(dut, "s_axi"), dut.aclk, **reset)
        self.source = AxiStreamSource(AxiStreamBus.from_prefix(dut, "s_axis"), dut.aclk, byte_lanes=1, **reset)
        self.sink = AxiStreamSink(AxiStreamBus.from_prefix(dut, "m_axis"), dut.aclk, byte_lanes=1, **reset)
        self.random = random.Random(cocotb.RANDOM_SEED)
        if stalls:
            write, read = self.master.write_if, self.master.read_if
            for channel in (write.aw_channel, write.w_channel, write.b_channel, read.ar_channel, read.r_channel,
                            self.source, self.sink):
                channel.set_pause_generator(self.random.random() < stalls for _ in itertools.count())

    async def reset(self):
        """Reset for a few cycles."""
        await reset(self.dut)

    async def cycles(self, count):
        """Wait."""
        for _ in range(count):
            await RisingEdge(self.clock)

    async def read(self, name, answer=OKAY):
        """The value of a register, by its name or its address."""
        found = await self.master.read(table[name].address if isinstance(name, str) else name, 4)
        assert found.resp == answer, name
        return int.from_bytes(found.data, "little")

    async def write(self, name, value, answer=OKAY, *, lanes=(0, 4)):
        """Write some bytes of a register, from the first of ``lanes`` to before the last."""
        first, end = lanes
        address = table[name].address if isinstance(name, str) else name
        done = await self.master.write(address + first, value.to_bytes(4, "little")[first:end])
        assert done.resp == answer, name

    async def command(self, *fields):
        """Write ones to fields of CONTROL, zeros to the others."""
        await self.write("CONTROL", sum(table["CONTROL"][field].mask for field in fields))

    async def flags(self):
        """Names of the interrupt flags that are set; clears them."""
        value = await self.read("INTERRUPT_FLAGS")
        await self.write("INTERRUPT_FLAGS", value)
        return {field.name for field in table["INTERRUPT_FLAGS"].fields if value & field.mask}

    async def put(self, words, channel=0):
        """Write a sample, and its channel."""
        if core.channels > 1:
            await self.write("CHANNEL", channel)
        for register, value in zip(registers(table.samples), words, strict=True):
            await self.write(register.name, int(value))

    async def idle(self):
        """Wait until no update runs."""
        while await self.read("STATUS") & table["STATUS"]["busy"].mask:
            pass

    async def snapshot(self):
        """Number, and words of the answer, of the last update."""
        await self.command("snapshot")
        names = [*(register.name for register in registers(table.outputs)), "SNAPSHOT_STATUS"]
        return await self.read("SNAPSHOT_UPDATE"), [await self.read(name) for name in names]

    async def receive(self, count):
        """Answers of the stream, the channels of their words by column, and whether each word ended a packet."""
        words: list = []
        channels: list = []
        last: list = []
        while len(words) < count:
            packet = await self.sink.recv(compact=False)
            words += packet.tdata
            channels += packet.tid if core.channels > 1 else [0] * len(packet.tdata)
            last += [False] * (len(packet.tdata) - 1) + [True]
        shape = -1, table.answer_words
        return np.reshape(words, shape), np.reshape(channels, shape).T.tolist(), last


def start_clock(dut):
    """Starts the clock."""
    Clock(dut.aclk, PERIOD_NS, unit="ns").start()


async def reset(dut, cycles=3):
    """Resets the core; after it the falling edge of a cycle has passed."""
    dut.aresetn.value = 0
    for cycle in range(cycles + 2):
        await FallingEdge(dut.aclk)
        dut.aresetn.value = cycle >= cycles - 1


def registers(words):
    """The registers of words, in their order."""
    return [register for word in words for register in word.registers]


def samples(count):
    """Random samples: their words, their channels, and the words of their answers. A few are refused."""
    rng = np.random.default_rng(cocotb.RANDOM_SEED)
    inputs = {port: rng.standard_normal(count) * 10 ** rng.uniform(-2, 2, count) for port in system.input_ports}
    for port in {"in_load", "in_load_en", "in_align"} & {*inputs}:
        inputs[port] = (rng.random(count) < 0.1).astype(float)
    inputs[system.input_ports[0]][7::50] = math.nan
    channels = rng.integers(core.channels, size=count)
    answers = np.zeros((count, table.answer_words), np.uint32)
    for channel in range(core.channels):
        if (own := channels == channel).any():
            result, _ = system.run(core.program.schedule.pool, {port: values[own] for port, values in inputs.items()})
            answers[own] = answer_words(top, result)
    for index in range(1, count):
        if is_refused(answers[index]):
            # The outputs of the engine hold, also if they are those of another channel.
            answers[index, :-1] = answers[index - 1, :-1]
    return sample_words(top, inputs), channels.tolist(), answers


def is_refused(answer):
    """Whether an answer is that of a refused update."""
    return int(answer[-1]) >> core.engine.status_names.index("refused") & 1


def frame(rows, channels):
    """Samples as one packet."""
    return AxiStreamFrame(rows.ravel().tolist(), tid=np.repeat(channels, table.sample_words).tolist())


@cocotb.test(timeout_time=50, timeout_unit="ms")
async def updates_by_register(dut):
    """With random stalls: all outputs and the status equal the twin's; the counters count, the flags are set."""
    bench = Bench(dut, stalls=0.3)
    await bench.reset()
    rows, channels, answers = samples(UPDATES)
    for index, (row, channel, answer) in enumerate(zip(rows, channels, answers.tolist(), strict=True)):
        await bench.put(row, channel)
        await bench.command("start")
        await bench.idle()
        assert await bench.snapshot() == (index + 1, answer)
        assert await bench.flags() == ({"finish", "refused"} if is_refused(answer) else {"finish"})
        if core.channels > 1:
            assert await bench.read("SNAPSHOT_CHANNEL") == channel
        assert await bench.read("CYCLES") == core.latency
    assert await bench.read("UPDATES") == UPDATES


@cocotb.test(timeout_time=50, timeout_unit="ms")
async def updates_by_stream(dut):
    """With random stalls: all answers equal the twin's, each once, in order, the last word with TLAST."""
    bench = Bench(dut, stalls=0.3)
    await bench.reset()
    await bench.command("stream")
    rows, channels, answers = samples(UPDATES)
    ends = sorted({*bench.random.sample(range(UPDATES), 5), UPDATES - 1})
    for first, end in itertools.pairwise([-1, *ends]):
        await bench.source.send(frame(rows[first + 1:end + 1], channels[first + 1:end + 1]))
    found, found_channels, last = await bench.receive(answers.size)
    assert np.array_equal(found, answers)
    assert found_channels == [channels] * table.answer_words
    assert np.flatnonzero(last).tolist() == [(end + 1) * table.answer_words - 1 for end in ends]
    await bench.cycles(2 * core.latency)
    assert bench.sink.empty()
    assert await bench.read("UPDATES") == UPDATES
    assert await bench.read("STATUS") == 0
    assert await bench.flags() == {"finish", "refused"}


@cocotb.test(timeout_time=50, timeout_unit="ms")
async def snapshots_are_of_one_update(dut):
    """While the stream runs, each snapshot has the outputs and the status of the update whose number it has."""
    bench = Bench(dut)
    await bench.reset()
    await bench.command("stream")
    count = 30
    rows, channels, answers = samples(count)
    bench.source.send_nowait(frame(rows, channels))
    seen: set = set()
    while len(seen) < count - 2:
        # With stream off, no sample would start.
        await bench.command("stream", "snapshot")
        number = await bench.read("SNAPSHOT_UPDATE")
        found = [await bench.read(register.name) for register in registers(table.outputs)]
        found.append(await bench.read("SNAPSHOT_STATUS"))
        if number:
            assert found == answers[number - 1].tolist()
        seen.add(number)
        if number == count:
            break
    assert len(seen) > count / 4


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def byte_strobes(dut):
    """A write changes the bytes whose strobes are high, in every register that keeps what is written."""
    bench = Bench(dut)
    await bench.reset()
    for register in [table["SCRATCH"], *registers(table.samples)]:
        expected = 0
        for first, end in (0, 4), (1, 2), (3, 4), (0, 1), (2, 3), (1, 4), (0, 3):
            value = bench.random.getrandbits(32)
            mask = (1 << 8 * end) - (1 << 8 * first)
            expected = expected & ~mask | value & mask
            await bench.write(register.name, value, lanes=(first, end))
            kept = sum(field.mask for field in register.fields)
            assert await bench.read(register.name) == expected & kept


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def bad_accesses(dut):
    """An unmapped address, a read-only register, and an input while the stream is on: SLVERR, a flag, no change."""
    bench = Bench(dut)
    await bench.reset()
    known = {register.address for register in table}
    unmapped = [address for address in range(0, 4096, 4) if address not in known]
    for address in [*bench.random.sample(unmapped, 20), unmapped[-1]]:
        assert await bench.read(address, SLVERR) == 0
        assert await bench.flags() == {"bad_access"}
        await bench.write(address, MANY, SLVERR)
        assert await bench.flags() == {"bad_access"}
    for register in table:
        if not register.writable and register.name != "SAMPLE_TIME":
            before = await bench.read(register.name)
            await bench.write(register.name, ~before & 0xFFFF_FFFF, SLVERR)
            assert await bench.flags() == {"bad_access"}
            assert await bench.read(register.name) == before
    await bench.command("stream")
    for register in registers(table.samples):
        await bench.write(register.name, MANY, SLVERR)
        assert await bench.read(register.name) == register.reset
    assert await bench.flags() == {"bad_access"}


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def start_while_busy_is_an_overrun(dut):
    """A start while an update runs, or while the stream is on, sets the flag and starts nothing."""
    bench = Bench(dut)
    await bench.reset()
    (row,), (channel,), (answer,) = samples(1)
    await bench.put(row, channel)
    await bench.command("start")
    assert await bench.read("STATUS") == table["STATUS"]["busy"].mask
    await bench.command("start")
    assert await bench.flags() == {"overrun"}
    await bench.idle()
    assert await bench.snapshot() == (1, answer.tolist())
    assert await bench.flags() == {"finish"}
    await bench.command("stream")
    await bench.command("stream", "start")
    assert await bench.flags() == {"overrun"}
    await bench.cycles(2 * core.latency)
    assert await bench.read("UPDATES") == 1


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def inputs_are_sampled_by_the_start(dut):
    """Inputs that are written after a start belong to the next one."""
    bench = Bench(dut)
    await bench.reset()
    rows, channels, answers = samples(2)
    await bench.put(rows[0], channels[0])
    await bench.command("start")
    await bench.put(rows[1], channels[1])
    await bench.idle()
    assert await bench.snapshot() == (1, answers[0].tolist())
    await bench.command("start")
    await bench.idle()
    assert await bench.snapshot() == (2, answers[1].tolist())


@cocotb.test(timeout_time=2, timeout_unit="ms")
async def pieces_of_samples_are_dropped(dut):
    """A TLAST inside a sample, and the end of CONTROL.stream inside one, drop its words; other samples are whole."""
    bench = Bench(dut, stalls=0.2)
    await bench.reset()
    await bench.command("stream")
    rows, channels, answers = samples(6)
    for index, (row, channel) in enumerate(zip(rows, channels, strict=True)):
        piece = [bench.random.getrandbits(32) for _ in range(bench.random.randrange(1, table.sample_words))]
        if index % 2 and core.channels > 1:
            # The channel changes inside a packet.
            tid = [channel ^ 1] * len(piece) + [channel] * len(row)
            await bench.source.send(AxiStreamFrame(piece + row.tolist(), tid=tid))
        else:
            await bench.source.send(AxiStreamFrame(piece, tid=channel))
            await bench.source.send(AxiStreamFrame(row.tolist(), tid=channel))
    found, found_channels, last = await bench.receive(answers.size)
    assert np.array_equal(found, answers)
    assert found_channels == [channels] * table.answer_words
    assert sum(last) == len(rows)
    assert await bench.flags() >= {"bad_frame"}
    # TLAST would end the piece by itself.
    bench.source.set_pause_generator(itertools.chain([0, 0], itertools.repeat(1)))
    bench.source.send_nowait(AxiStreamFrame([1, 2, 3]))
    await bench.cycles(10)
    assert await bench.read("STATUS") == table["STATUS"]["streaming"].mask
    assert "bad_frame" not in await bench.flags()
    await bench.write("CONTROL", 0)
    assert await bench.flags() == {"bad_frame"}
    assert await bench.read("STATUS") == 0


@cocotb.test(timeout_time=2, timeout_unit="ms")
async def interrupt(dut):
    """irq is the level of the enabled flags; a flag is cleared by a 1 alone; a set in the same cycle wins."""
    bench = Bench(dut)
    await bench.reset()
    finish = table["INTERRUPT_FLAGS"]["finish"].mask
    (row,), _, _ = samples(1)
    await bench.put(row)
    await bench.command("start")
    await bench.idle()
    await bench.cycles(3)
    assert not dut.irq.value
    await bench.write("INTERRUPT_ENABLE", finish)
    await bench.cycles(2)
    assert dut.irq.value
    await bench.write("INTERRUPT_FLAGS", ~finish & 0xFFFF_FFFF)
    assert await bench.read("INTERRUPT_FLAGS") == finish
    assert dut.irq.value
    await bench.write("INTERRUPT_FLAGS", finish)
    await bench.cycles(2)
    assert not dut.irq.value
    # One of these clears acts in the cycle in which an update finishes.
    met = core.channels > 1
    for early in range(0 if met else 20):
        await bench.command("start")
        await bench.cycles(core.latency - early)
        bench.master.init_write(table["INTERRUPT_FLAGS"].address, finish.to_bytes(4, "little"))
        sets = acts = -1
        for cycle in range(40):
            await FallingEdge(dut.aclk)
            if dut.slave.interrupt_flags_finish_set.value:
                sets = cycle
            if dut.s_axi_wvalid.value and dut.s_axi_wready.value:
                acts = cycle + 1
        assert min(sets, acts) >= 0
        assert await bench.read("INTERRUPT_FLAGS") == (0 if acts > sets else finish)
        met += acts == sets
        await bench.flags()
    assert met


@cocotb.test(timeout_time=2, timeout_unit="ms")
async def reset_in_the_middle(dut):
    """aresetn at any time: no answer is offered, registers have their reset values, and updates are as the first."""
    bench = Bench(dut)
    await bench.reset()
    rows, channels, answers = samples(2)
    for cycles in range(1, 14):
        # A read, a write, an update and a sample of the stream are on their way.
        await bench.write("INTERRUPT_ENABLE", 1)
        await bench.put(rows[1])
        await bench.command("start")
        await bench.command("stream")
        bench.source.send_nowait(AxiStreamFrame(rows[1].tolist()))
        bench.master.init_read(table["SAMPLE_TIME"].address, 4)
        bench.master.init_write(table["SCRATCH"].address, b"abcd")
        await bench.cycles(cycles)
        dut.aresetn.value = 0
        await bench.cycles(1)
        for _ in range(3):
            await FallingEdge(dut.aclk)
            for name in "s_axi_bvalid", "s_axi_rvalid", "m_axis_tvalid", "irq":
                assert not getattr(dut, name).value
        bench.source.clear()
        await bench.reset()
        for register in table:
            if register.name != "SAMPLE_TIME":
                assert await bench.read(register.name) == register.reset, register.name
        await bench.put(rows[0], channels[0])
        await bench.command("start")
        await bench.idle()
        assert await bench.snapshot() == (1, answers[0].tolist())


@cocotb.test(timeout_time=2, timeout_unit="ms")
async def reset_of_the_core(dut):
    """CONTROL.core_reset ends the update and the sample, but keeps the table; updates are as the first."""
    bench = Bench(dut)
    await bench.reset()
    rows, channels, answers = samples(2)
    await bench.put(rows[0], channels[0])
    await bench.write("SCRATCH", 0x1234_5678)
    for cycles in (0, 5, core.latency - 8, core.latency + 20):
        await bench.command("start")
        await bench.cycles(cycles)
        await bench.command("core_reset")
        assert await bench.read("STATUS") == 0
        assert await bench.read("UPDATES") == 0
        await bench.flags()
        await bench.command("start")
        await bench.idle()
        assert await bench.snapshot() == (1, answers[0].tolist())
        assert await bench.read("SCRATCH") == 0x1234_5678
        assert await bench.flags() == {"finish"}
    await bench.command("core_reset", "start")
    assert await bench.flags() == {"overrun"}
    # A piece of a sample, and one whose answer is on its way.
    await bench.command("stream")
    for words in rows[1][:-1].tolist(), rows[1].tolist():
        bench.source.send_nowait(AxiStreamFrame(words))
        await bench.cycles(core.latency // 2)
        await bench.command("core_reset", "stream")
    bench.source.send_nowait(frame(rows[:1], channels[:1]))
    found, _, _ = await bench.receive(table.answer_words)
    assert np.array_equal(found, answers[:1])


@cocotb.test(timeout_time=5, timeout_unit="ms")
async def interval_of_the_stream(dut):
    """Without stalls an update of the stream finishes every ``stream_interval`` cycles."""
    bench = Bench(dut)
    await bench.reset()
    await bench.command("stream")
    rows, _, _ = samples(12)
    bench.source.send_nowait(frame(rows, [index % core.channels for index in range(len(rows))]))
    finished = []
    for cycle in itertools.count():
        await FallingEdge(dut.aclk)
        if dut.slave.interrupt_flags_finish_set.value:
            finished.append(cycle)
            if len(finished) == len(rows):
                break
    assert {later - earlier for earlier, later in itertools.pairwise(finished)} == {core.stream_interval}


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def one_access_per_cycle(dut):
    """Accesses that follow each other are taken in each cycle; each answer comes in the second cycle after it."""
    start_clock(dut)
    for channel in "aw", "w", "ar":
        getattr(dut, f"s_axi_{channel}valid").value = 0
    await reset(dut)
    count, addresses = 20, [register.address for register in table]
    answers: dict = {"b": [], "r": []}
    dut.s_axi_bready.value = dut.s_axi_rready.value = 1
    for cycle in range(count + 4):
        going = cycle < count
        for channel in "aw", "w", "ar":
            assert getattr(dut, f"s_axi_{channel}ready").value
            getattr(dut, f"s_axi_{channel}valid").value = going
        dut.s_axi_awaddr.value = table["SCRATCH"].address
        dut.s_axi_wdata.value, dut.s_axi_wstrb.value = cycle, 15
        dut.s_axi_araddr.value = table["SCRATCH"].address if cycle % 2 else addresses[0]
        for channel, found in answers.items():
            if getattr(dut, f"s_axi_{channel}valid").value:
                found.append((cycle, int(dut.s_axi_rdata.value) if channel == "r" else 0))
        await FallingEdge(dut.aclk)
    assert [cycle for cycle, _ in answers["b"]] == [cycle + 2 for cycle in range(count)]
    assert [cycle for cycle, _ in answers["r"]] == [cycle + 2 for cycle in range(count)]
    # A write acts in the cycle after the one that takes it, and a read sees registers in the cycle that takes it.
    assert [value for _, value in answers["r"]][3::2] == [cycle - 2 for cycle in range(3, count, 2)]
    assert {value for _, value in answers["r"][::2]} == {table["IDENTITY"].reset}
