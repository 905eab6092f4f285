"""What the bench of a package writes to a core, and what it must read: from the software twin."""

import math
from dataclasses import dataclass
from enum import IntEnum
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from strapdown.bus import ERROR_RESPONSES, REGISTER_BITS, TABLE_SIZE, Access
from strapdown.cores import constant_ports

__all__ = ["STREAM", "UPDATES", "Op", "Step", "steps"]

UPDATES = 100
"""Updates of the bench that finish."""

BAD_INPUT, OVERRUN, CORE_RESET, RESET, BAD_SAMPLE = 20, 40, 60, 80, 95
"""Updates with an input that is no number, with a second start, after a reset of the core, after a reset of all, and
with another bad input."""

STREAM = 90
"""First update whose sample comes as a stream."""

SEED = 20150
"""Seed of the inputs."""

WORD = (1 << REGISTER_BITS) - 1


class Op(IntEnum):
    """What a step of the bench does. The bench has the same numbers."""

    END = 0
    UPDATE = 1
    """The number of the update, for messages."""
    WRITE = 2
    """Write data; mask is the expected answer."""
    READ = 3
    """Read, and compare the bits of the mask with data."""
    READ_ANSWER = 4
    """Read; mask is the expected answer."""
    INTERRUPT = 5
    """Wait for irq, as many cycles as data says at most."""
    IDLE = 6
    """Wait for some cycles."""
    RESET = 7
    """Reset for some cycles."""
    SEND = 8
    """Send a word to the stream; mask is TLAST, and above it TID."""
    TAKE = 9
    """Take a word from the stream, at the register of the address; mask as in SEND."""


@dataclass(frozen=True)
class Step:
    """A step of the bench.

    Attributes
    ----------
    op : Op
    address, data, mask : int
        16, 32 and 32 bits.
    """

    op: Op
    address: int = 0
    data: int = 0
    mask: int = 0

    @property
    def digits(self):
        """The step as 22 hexadecimal digits."""
        return f"{self.op:02x}{self.address:04x}{self.data & WORD:08x}{self.mask & WORD:08x}"


def steps(top, config) -> list[Step]:
    """All steps of the bench of a core behind a bus.

    UPDATES updates finish. Each has random inputs, and its outputs, status and number must be those of the twin. One
    has an input that is no number, one gets a second start, one follows a reset of the core in mid-update, one follows
    a reset of all in mid-update. The last ones come as a stream, if the core has streams.

    Parameters
    ----------
    top : Top
        With an AxiCore.
    config : Config
        Its configuration.
    """
    return _Bench(top, config).steps


class _Update(NamedTuple):
    channel: int
    sample: dict
    """Input port to number."""


class _Bench:
    """The steps, written one after another."""

    def __init__(self, top, config):
        self.core, self.table, self.engine = top.component, top.component.table, top.component.engine
        self.system, self.format = self.engine.system, self.engine.program.format
        self.steps: list[Step] = []
        updates = list(self._updates(config))
        answers = [answer for first, end in pairwise((1, CORE_RESET, RESET, UPDATES + 1))
                   for answer in self._answers(updates[first - 1:end - 1])]
        self._identity()
        self._start_over(updates[0])
        finished = 0
        for number, (update, (outputs, status)) in enumerate(zip(updates, answers, strict=True), 1):
            self._add(Op.UPDATE, data=number)
            if number in (CORE_RESET, RESET):
                finished = 0
                self._in_mid_update(update, everything=number == RESET)
            finished += 1
            if self.core.streams and number >= STREAM:
                self._by_stream(number, update, outputs, status)
            else:
                self._by_register(number, update)
            self._check(number, finished, update, outputs, status)
        self._add(Op.END, data=UPDATES)

    # What the core gets, and what it must answer

    def _updates(self, config):
        """Random inputs in sizes from 0.1 to 100, in the units of the ports; parameters have their values."""
        rng = np.random.default_rng(SEED)
        fixed = constant_ports(self.system, config)
        first = next(word.port for word in self.table.samples if word.format != "bits")
        for number in range(1, UPDATES + 1):
            sample = {port: fixed.get(port, rng.normal() * 10 ** rng.uniform(-1, 2))
                      for port in self.system.input_ports}
            if number in (BAD_INPUT, BAD_SAMPLE):
                sample[first] = math.nan
            yield _Update(number % self.engine.channels, sample)

    def _answers(self, updates):
        """Outputs as bits by port, and the status, of updates from a reset on."""
        engine, system, pool = self.engine, self.system, self.engine.program.schedule.pool
        answers: list = [None] * len(updates)
        for channel in range(engine.channels):
            own = [index for index, update in enumerate(updates) if update.channel == channel]
            inputs = {port: np.array([updates[index].sample[port] for index in own]) for port in system.input_ports}
            result, _ = system.run(pool, inputs)
            outputs = {port: self.format.to_bits(result[port]) for port in system.output_ports}
            for row, index in enumerate(own):
                status = sum(int(result[name][row]) << bit for bit, name in enumerate(engine.status_names)
                             if name in result)
                answers[index] = {port: int(bits[row]) for port, bits in outputs.items()}, status
        # A refused update does not change the outputs, which are those of the update before it, of any channel.
        for index, (_, status) in enumerate(answers):
            if index and self._refused(status):
                answers[index] = answers[index - 1][0], status
        return answers

    def _refused(self, status):
        return bool(status >> self.engine.status_names.index("refused") & 1)

    # Steps

    def _add(self, op, register=None, data=0, mask=0):
        self.steps.append(Step(op, self.table[register].address if register else 0, data, mask))

    def _write(self, register, data):
        self._add(Op.WRITE, register, data)

    def _read(self, register, data):
        self._add(Op.READ, register, data, WORD)

    def _fields(self, register, names):
        """A value of a register with ones in some of its fields."""
        return sum(self.table[register][name].mask for name in names)

    def _control(self, *names):
        self._write("CONTROL", self._fields("CONTROL", names))

    def _flags(self, *names):
        """The flags are these; a write of ones clears them."""
        value = self._fields("INTERRUPT_FLAGS", names)
        self._read("INTERRUPT_FLAGS", value)
        self._write("INTERRUPT_FLAGS", value)
        self._read("INTERRUPT_FLAGS", 0)

    def _words(self, words, bits):
        """Register and bits of each register of words; ``bits`` maps ports to bits."""
        for word in words:
            for part, register in enumerate(word.registers):
                yield register.name, bits[word.port] >> part * REGISTER_BITS & WORD

    def _inputs(self, words, sample):
        """Register and bits of each register of inputs."""
        with np.errstate(all="ignore"):
            return self._words(words, {
                word.port: int(self.system.input_bits(word.port, self.format, np.array([sample[word.port]]))[0])
                for word in words})

    # Parts of the bench

    def _identity(self):
        """Constant registers, the scratch register, and a bad access."""
        for register in self.table.common:
            if all(field.access is Access.CONSTANT for field in register.fields):
                self._read(register.name, register.reset)
        self._write("SCRATCH", 0x600D_C0DE)
        self._read("SCRATCH", 0x600D_C0DE)
        answer = ERROR_RESPONSES[self.core.error_response]
        self.steps += [Step(Op.READ_ANSWER, TABLE_SIZE - 4, mask=answer),
                       Step(Op.WRITE, self.table["IDENTITY"].address, mask=answer)]
        self._flags("bad_access")

    def _start_over(self, update):
        """What a reset clears: the enabled interrupt, and the parameters."""
        self._write("INTERRUPT_ENABLE", self._fields("INTERRUPT_ENABLE", ["finish"]))
        for register, bits in self._inputs(self.table.parameters, update.sample):
            self._write(register, bits)

    def _sample(self, update):
        """The inputs of an update, and its start."""
        for register, bits in self._inputs(self.table.samples, update.sample):
            self._write(register, bits)
        if self.engine.channels > 1:
            self._write("CHANNEL", update.channel)
        self._control("start")

    def _in_mid_update(self, update, *, everything):
        """A reset while an update runs, which then never finishes."""
        self._sample(update)
        self._add(Op.IDLE, data=self.engine.latency // 2)
        if everything:
            self._add(Op.RESET, data=3)
            self._read("SCRATCH", 0)
            self._start_over(update)
        else:
            self._control("core_reset")
        self._read("STATUS", 0)
        self._add(Op.IDLE, data=2 * self.engine.latency)
        self._read("INTERRUPT_FLAGS", 0)
        self._read("UPDATES", 0)

    def _by_register(self, number, update):
        """An update by the registers."""
        self._sample(update)
        if number == OVERRUN:
            self._control("start")
        self._add(Op.INTERRUPT, "INTERRUPT_FLAGS", 4 * self.engine.latency + 1000)

    def _by_stream(self, number, update, outputs, status):
        """An update by the streams; the last sample has TLAST."""
        if number == STREAM:
            self._control("stream")
        last = number == UPDATES
        sent, taken = [*self._inputs(self.table.samples, update.sample)], [*self._words(self.table.outputs, outputs)]
        for op, words in (Op.SEND, sent), (Op.TAKE, [*taken, ("SNAPSHOT_STATUS", status)]):
            for index, (register, bits) in enumerate(words):
                self._add(op, register, bits, update.channel << 1 | (last and index == len(words) - 1))

    def _check(self, number, finished, update, outputs, status):
        """Flags, number, status and outputs of the last update."""
        self._flags("finish", *(["refused"] if self._refused(status) else []),
                    *(["overrun"] if number == OVERRUN else []))
        self._read("UPDATES", finished)
        self._control("snapshot", *(["stream"] if self.core.streams and number >= STREAM else []))
        self._read("SNAPSHOT_UPDATE", finished)
        self._read("SNAPSHOT_STATUS", status)
        if self.engine.channels > 1:
            self._read("SNAPSHOT_CHANNEL", update.channel)
        for register, bits in self._words(self.table.outputs, outputs):
            self._read(register, bits)
