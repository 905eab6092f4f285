"""An AXI4-Lite slave with the registers of a table."""

from typing import Any

from amaranth import *
from amaranth.lib import data, stream
from amaranth.lib.wiring import In, Out
from amaranth.utils import exact_log2

from strapdown.component import Described

from .buffers import SkidBuffer
from .registers import REGISTER_BITS, TABLE_SIZE, Access

__all__ = ["ADDRESS_BITS", "ERROR_RESPONSES", "LOAD", "OKAY", "PLACE", "SLVERR", "AxiLiteSlave"]

ADDRESS_BITS = exact_log2(TABLE_SIZE)
"""Bits of an address, in bytes."""

OKAY, SLVERR = 0b00, 0b10
"""Answers of AXI (IHI 0022, table A3-5)."""

ERROR_RESPONSES = {"slverr": SLVERR, "okay": OKAY}
"""Maps the names of the answers to a bad access to their codes."""

LANE = 8
"""Bits of a byte lane."""

PLACE = exact_log2(REGISTER_BITS // LANE)
"""Bits of an address that select a byte of a register."""

GROUP = 8
"""Registers of which a read selects one in the first of its two cycles."""

LOAD: Any = data.StructLayout({"data": REGISTER_BITS, "address": ADDRESS_BITS - PLACE})
"""A word for a register, and the address of the register, in registers."""

_WRITE: Any = data.StructLayout({"data": REGISTER_BITS, "strobe": REGISTER_BITS // LANE})
_READ: Any = data.StructLayout({"data": REGISTER_BITS, "response": 2})


class AxiLiteSlave(Described):
    """The registers of a table behind AXI4-Lite, one access per cycle.

    Parameters
    ----------
    table : RegisterTable
        Or another iterable of Register.
    error_response : str
        A key of ``ERROR_RESPONSES``: the answer to an access to an address without a register, and to a write to a
        register that cannot be written. Such a read returns 0, such a write changes nothing.
    flag : tuple of str
        Register and field, of Access.CLEAR, that such an access sets.
    loaded : iterable of str
        Registers that ``load`` can write, all of Access.WRITE.

    Members
    -------
    aw, ar : In(stream of unsigned(10))
        Addresses of registers: bytes, divided by 4.
    w : In(stream of data and strobe)
        Data, and a bit for each byte that is written.
    b, r : Out(stream of unsigned(2)), Out(stream of data and response)
        The answers. ``ready`` of ``aw``, ``w`` and ``ar`` is a register.
    load : In(stream of LOAD)
        Only if there are registers to load. Writes a register from within; the bus comes first.
    locked : In(1)
        Only if there are registers to load. While it is high, the bus cannot write them.
    pause : In(1)
        While it is high, no write from the bus acts.
    A member for each field, called REGISTER_FIELD in lower case, or REGISTER if the field is called ``value``:
    In(width) for Access.READ; Out(width) for Access.WRITE; Out(width), high for one cycle, for Access.PULSE; for
    Access.CLEAR Out(width), and, but for ``flag``, REGISTER_FIELD_set : In(width) with the bits to set; none for
    Access.CONSTANT.

    Latency: a write acts one cycle, its answer is valid two cycles after the edge that takes the later one of address
    and data; the answer to a read is valid two cycles after the edge that takes its address; with one more cycle for
    each one in which an earlier answer waits.
    Raises: ValueError for another answer, and for a register that cannot be loaded.
    """

    def __init__(self, table, flag, *, error_response="slverr", loaded=()):
        if error_response not in ERROR_RESPONSES:
            raise ValueError(f"error_response must be {' or '.join(ERROR_RESPONSES)}, not {error_response!r}")
        self._registers, self._error = tuple(table), ERROR_RESPONSES[error_response]
        self._flag = flag
        self._loaded = tuple(register for register in self._registers if register.name in set(loaded))
        for register in self._loaded:
            if any(field.access is not Access.WRITE for field in register.fields):
                raise ValueError(f"register {register.name} cannot be loaded: it does not keep what is written")
        address: Any = unsigned(ADDRESS_BITS - PLACE)
        answer: Any = unsigned(2)
        members = {"aw": In(stream.Signature(address)), "w": In(stream.Signature(_WRITE)),
                   "b": Out(stream.Signature(answer)), "ar": In(stream.Signature(address)),
                   "r": Out(stream.Signature(_READ)), "pause": In(1)}
        if self._loaded:
            members |= {"load": In(stream.Signature(LOAD)), "locked": In(1)}
        for register in self._registers:
            for field in register.fields:
                name = self._name(register.name, field.name)
                if field.access is Access.READ:
                    members[name] = In(field.width)
                elif field.access is not Access.CONSTANT:
                    members[name] = Out(field.width, init=field.reset)
                if field.access is Access.CLEAR and (register.name, field.name) != self._flag:
                    members[f"{name}_set"] = In(field.width)
        super().__init__(members)

    @staticmethod
    def _name(register, field):
        return register.lower() + ("" if field == "value" else f"_{field}")

    def field(self, register, field="value"):
        """The member of a field, by the names of register and field."""
        return getattr(self, self._name(register, field))

    def elaborate(self, platform):
        m = Module()
        bad_write, bad_read = Signal(), Signal()
        self._writes(m, bad_write, bad_write | bad_read)
        self._reads(m, bad_read)
        return m

    def _writes(self, m, bad, refused):
        """Writes: address and data are brought together, act in the next cycle, and are answered after it."""
        m.submodules.aw = aw = SkidBuffer(self.aw.payload.shape())
        m.submodules.w = w = SkidBuffer(_WRITE)
        for member, buffer in (self.aw, aw), (self.w, w):
            m.d.comb += [buffer.input.valid.eq(member.valid), buffer.input.payload.eq(member.payload),
                         member.ready.eq(buffer.input.ready)]
        valid, address, written = Signal(), Signal.like(self.aw.payload), Signal(_WRITE)
        answered, goes, paired = Signal(init=1), Signal(), Signal()
        # A write from the bus acts only if its answer has room.
        m.d.comb += [goes.eq(~(valid & answered & (self.pause | self.b.valid & ~self.b.ready))),
                     paired.eq(aw.output.valid & w.output.valid),
                     aw.output.ready.eq(goes & w.output.valid), w.output.ready.eq(goes & aw.output.valid)]
        with m.If(goes):
            m.d.sync += [valid.eq(paired), address.eq(aw.output.payload), written.eq(w.output.payload)]
        if self._loaded:
            m.d.comb += self.load.ready.eq(goes & ~paired)
            with m.If(goes):
                m.d.sync += answered.eq(paired)
                with m.If(~paired):
                    m.d.sync += [valid.eq(self.load.valid), address.eq(self.load.p.address),
                                 written.data.eq(self.load.p.data), written.strobe.eq(-1)]
        acts, permitted = Signal(), Signal()
        m.d.comb += acts.eq(valid & goes)
        for register in self._registers:
            if register.writable:
                self._write(m, register, address, acts, written, permitted, refused)
        m.d.comb += bad.eq(acts & ~permitted)
        with m.If(acts & answered):
            m.d.sync += [self.b.valid.eq(1), self.b.payload.eq(Mux(permitted, OKAY, self._error))]
        with m.Elif(self.b.ready):
            m.d.sync += self.b.valid.eq(0)

    def _write(self, m, register, address, acts, written, permitted, refused):
        """The fields of a register that can be written."""
        selected = Signal(name=f"{register.name.lower()}_selected")
        m.d.comb += selected.eq(address == register.address >> PLACE)
        if register in self._loaded:
            open = Signal(name=f"{register.name.lower()}_open")
            m.d.comb += open.eq(~self.locked)
            with m.If(selected & open):
                m.d.comb += permitted.eq(1)
        else:
            with m.If(selected):
                m.d.comb += permitted.eq(1)
        for field in register.fields:
            name = self._name(register.name, field.name)
            if field.access is Access.CLEAR:
                member, cleared = getattr(self, name), Signal(field.width, name=f"{name}_cleared")
                for low, high, lane in lanes(field):
                    with m.If(acts & selected & written.strobe[lane]):
                        m.d.comb += cleared[low - field.low:high - field.low].eq(written.data[low:high])
                sets = refused if (register.name, field.name) == self._flag else getattr(self, f"{name}_set")
                m.d.sync += member.eq(member & ~cleared | sets)
            elif field.access.writable:
                member = getattr(self, name)
                domain = m.d.comb if field.access is Access.PULSE else m.d.sync
                for low, high, lane in lanes(field):
                    with m.If(acts & selected & written.strobe[lane]):
                        domain += member[low - field.low:high - field.low].eq(written.data[low:high])

    def _reads(self, m, bad):
        """Reads: a register of each group is selected, then the group."""
        m.submodules.ar = ar = SkidBuffer(self.ar.payload.shape())
        m.d.comb += [ar.input.valid.eq(self.ar.valid), ar.input.payload.eq(self.ar.payload),
                     self.ar.ready.eq(ar.input.ready)]
        moves, valid, found = Signal(), Signal(), Signal()
        m.d.comb += [moves.eq(~self.r.valid | self.r.ready), ar.output.ready.eq(~valid | moves)]
        place = exact_log2(GROUP)
        groups: dict = {}
        for register in self._registers:
            number = register.address >> PLACE
            groups.setdefault(number >> place, []).append((number & GROUP - 1, register))
        address = ar.output.payload
        with m.If(ar.output.ready):
            m.d.sync += [valid.eq(ar.output.valid), found.eq(0)]
        selected = []
        for number, registers in groups.items():
            group = Signal(REGISTER_BITS, name=f"group_{number:x}", reset_less=True)
            selected.append(group)
            with m.If(ar.output.ready):
                m.d.sync += group.eq(0)
                with m.If(address[place:] == number), m.Switch(address[:place]):
                    for index, register in registers:
                        with m.Case(index):
                            m.d.sync += [group.eq(self._value(register)), found.eq(1)]
        answer = Signal(REGISTER_BITS)
        for group in selected:
            answer = answer | group
        with m.If(moves):
            m.d.sync += [self.r.valid.eq(valid), self.r.p.data.eq(answer),
                         self.r.p.response.eq(Mux(found, OKAY, self._error))]
        m.d.comb += bad.eq(moves & valid & ~found)

    def _value(self, register):
        """What a read of a register returns."""
        parts, end = [], 0
        for field in register.fields:
            value = {Access.CONSTANT: C(field.reset, field.width), Access.PULSE: C(0, field.width)}.get(field.access)
            parts += [C(0, field.low - end), self.field(register.name, field.name) if value is None else value]
            end = field.high + 1
        return Cat(*parts)


def lanes(field):
    """The bits of a field by byte lane: lowest bit, the bit after the highest one, and the lane."""
    first = field.low - field.low % LANE
    for start in range(first, field.high + 1, LANE):
        yield max(start, field.low), min(start + LANE, field.high + 1), start // LANE
