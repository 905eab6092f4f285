"""An AXI4-Lite slave with the registers of a table."""

from functools import reduce
from operator import or_
from typing import Any

from amaranth import *
from amaranth.lib import data, stream
from amaranth.lib.wiring import In, Out
from amaranth.utils import exact_log2

from strapdown.component import Described

from .buffers import skid_buffer
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

LANES = REGISTER_BITS // LANE

PLACE = exact_log2(LANES)
"""Bits of an address that select a byte of a register."""

GROUP = 8
"""Registers of which a read selects one in the first of its two cycles."""

LOAD: Any = data.StructLayout({"data": REGISTER_BITS, "address": ADDRESS_BITS - PLACE})
"""A word for a register, and the address of the register, in registers."""

_WRITE: Any = data.StructLayout({"data": REGISTER_BITS, "strobe": LANES})
_ADDRESS: Any = unsigned(ADDRESS_BITS - PLACE)


class AxiLiteSlave(Described):
    """The registers of a table behind AXI4-Lite, one access per cycle.

    Parameters
    ----------
    table : RegisterTable
        Or another iterable of Register.
    flag : tuple of str
        Register and field, of Access.CLEAR, that a bad access sets: one to an address without a register, or a write to
        a register that cannot be written. A bad read returns 0, a bad write changes nothing.
    error_response : str
        A key of ``ERROR_RESPONSES``: the answer to a bad access.
    loaded : iterable of str
        Registers that ``load`` can write, all of Access.WRITE.

    Members
    -------
    awaddr, awprot, awvalid, awready, wdata, wstrb, wvalid, wready, bresp, bvalid, bready, araddr, arprot, arvalid,
    arready, rdata, rresp, rvalid, rready
        The bus: 12 bits of address, 32 bits of data. The bits of an address below a register, and the protection, mean
        nothing. awready, wready and arready are inverses of registers; all outputs for answers are registers.
    load : In(stream of LOAD)
        Only if there are registers to load. Writes a register from within; the bus comes first.
    locked : In(1)
        Only if there are registers to load. While it is high, a write to them from the bus is a bad one.
    pause : In(1)
        While it is high, no write from the bus acts.
    A member for each field, called REGISTER_FIELD in lower case, or REGISTER if the field is called ``value``:
    In(width) for Access.READ; Out(width) for Access.WRITE; Out(width), high for one cycle, for Access.PULSE; for
    Access.CLEAR Out(width), and, but for ``flag``, REGISTER_FIELD_set : In(width) with the bits to set; none for
    Access.CONSTANT.

    Latency: a write acts in the cycle after the edge that takes the later one of address and data, and its answer is
    valid in the next cycle; the answer to a read is valid in the second cycle after the edge that takes its address.
    Both wait while an earlier answer waits.
    Raises: ValueError for another answer, and for a register that cannot be loaded.
    """

    def __init__(self, table, flag, *, error_response="slverr", loaded=()):
        if error_response not in ERROR_RESPONSES:
            raise ValueError(f"error_response must be {' or '.join(ERROR_RESPONSES)}, not {error_response!r}")
        self._registers, self._flag, self._error = tuple(table), flag, ERROR_RESPONSES[error_response]
        self._loaded = tuple(register for register in self._registers if register.name in set(loaded))
        for register in self._loaded:
            if any(field.access is not Access.WRITE for field in register.fields):
                raise ValueError(f"register {register.name} cannot be loaded: it does not keep what is written")
        members: dict[str, Any] = {
            "awaddr": In(ADDRESS_BITS), "awprot": In(3), "awvalid": In(1), "awready": Out(1),
            "wdata": In(REGISTER_BITS), "wstrb": In(LANES), "wvalid": In(1), "wready": Out(1),
            "bresp": Out(2), "bvalid": Out(1), "bready": In(1),
            "araddr": In(ADDRESS_BITS), "arprot": In(3), "arvalid": In(1), "arready": Out(1),
            "rdata": Out(REGISTER_BITS), "rresp": Out(2), "rvalid": Out(1), "rready": In(1), "pause": In(1)}
        if self._loaded:
            members |= {"load": In(stream.Signature(LOAD)), "locked": In(1)}
        for register in self._registers:
            for field in register.fields:
                name = _name(register.name, field.name)
                if field.access is Access.READ:
                    members[name] = In(field.width)
                elif field.access is not Access.CONSTANT:
                    members[name] = Out(field.width, init=field.reset)
                if field.access is Access.CLEAR and (register.name, field.name) != flag:
                    members[f"{name}_set"] = In(field.width)
        super().__init__(members)

    def field(self, register, field="value"):
        """The member of a field, by the names of register and field."""
        return getattr(self, _name(register, field))

    def elaborate(self, platform):
        m = Module()
        bad_write = Signal()
        bad_read = Signal()
        bad = Signal()
        m.d.comb += bad.eq(bad_write | bad_read)
        self._writes(m, bad_write, bad)
        self._reads(m, bad_read)
        return m

    def _writes(self, m, bad_write, bad):
        """Writes: address and data are brought together, act in the next cycle, and are answered after it."""
        aw_valid, aw, aw_taken = skid_buffer(m, "aw", _ADDRESS, self.awvalid, self.awaddr[PLACE:], self.awready)
        w_valid, w, w_taken = skid_buffer(m, "w", _WRITE, self.wvalid, Cat(self.wdata, self.wstrb), self.wready)
        valid = Signal(name="write_valid")
        address = Signal(_ADDRESS, name="write_address")
        write = Signal(_WRITE)
        answered = Signal(init=1)
        goes = Signal()
        paired = Signal()
        # A write from the bus acts only if its answer has room.
        m.d.comb += [goes.eq(~(valid & answered & (self.pause | self.bvalid & ~self.bready))),
                     paired.eq(aw_valid & w_valid), aw_taken.eq(goes & paired), w_taken.eq(goes & paired)]
        with m.If(goes):
            m.d.sync += [valid.eq(paired), address.eq(aw), write.eq(w)]
        if self._loaded:
            m.d.comb += self.load.ready.eq(goes & ~paired)
            with m.If(goes):
                m.d.sync += answered.eq(paired)
                with m.If(~paired):
                    m.d.sync += [valid.eq(self.load.valid), address.eq(self.load.p.address),
                                 write.data.eq(self.load.p.data), write.strobe.eq(-1)]
        acts = Signal()
        permitted = Signal()
        m.d.comb += [acts.eq(valid & goes), bad_write.eq(acts & ~permitted)]
        for register in self._registers:
            if register.writable:
                selected, allowed = Signal(name=f"writes_{register.name.lower()}"), C(1)
                m.d.comb += selected.eq(address == register.address >> PLACE)
                if register in self._loaded:
                    allowed = ~(self.locked & answered)
                with m.If(selected & allowed):
                    m.d.comb += permitted.eq(1)
                for field in register.fields:
                    self._write(m, register, field, acts & selected & allowed, write, bad)
        with m.If(acts & answered):
            m.d.sync += [self.bvalid.eq(1), self.bresp.eq(Mux(permitted, OKAY, self._error))]
        with m.Elif(self.bready):
            m.d.sync += self.bvalid.eq(0)

    def _write(self, m, register, field, acts, write, bad):
        """A field of a register that is written while ``acts`` is high."""
        if not field.access.writable:
            return
        name = _name(register.name, field.name)
        member = getattr(self, name)
        if field.access is Access.CLEAR:
            target, domain = Signal(field.width, name=f"{name}_clear"), m.d.comb
            sets = bad if (register.name, field.name) == self._flag else getattr(self, f"{name}_set")
            m.d.sync += member.eq(member & ~target | sets)
        else:
            target, domain = member, m.d.comb if field.access is Access.PULSE else m.d.sync
        for low, high, lane in _lanes(field):
            with m.If(acts & write.strobe[lane]):
                domain += target[low - field.low:high - field.low].eq(write.data[low:high])

    def _reads(self, m, bad_read):
        """Reads: a register of each group is selected, then the group."""
        moves = Signal()
        valid = Signal(name="read_valid")
        found = Signal()
        ar_valid, ar, ar_taken = skid_buffer(m, "ar", _ADDRESS, self.arvalid, self.araddr[PLACE:], self.arready)
        m.d.comb += [moves.eq(~self.rvalid | self.rready), ar_taken.eq(~valid | moves),
                     bad_read.eq(moves & valid & ~found)]
        place = exact_log2(GROUP)
        groups: dict = {}
        for register in self._registers:
            number = register.address >> PLACE
            groups.setdefault(number >> place, []).append((number & GROUP - 1, register))
        with m.If(ar_taken):
            m.d.sync += [valid.eq(ar_valid), found.eq(0)]
        selected = []
        for number, registers in groups.items():
            group = Signal(REGISTER_BITS, name=f"group_{number:02x}", reset_less=True)
            selected.append(group)
            with m.If(ar_taken):
                m.d.sync += group.eq(0)
                with m.If(ar[place:] == number), m.Switch(ar[:place]):
                    for index, register in registers:
                        with m.Case(index):
                            m.d.sync += [group.eq(self._value(register)), found.eq(1)]
        with m.If(moves):
            m.d.sync += [self.rvalid.eq(valid), self.rdata.eq(reduce(or_, selected)),
                         self.rresp.eq(Mux(found, OKAY, self._error))]

    def _value(self, register):
        """What a read of a register returns."""
        parts, end = [], 0
        for field in register.fields:
            value = {Access.CONSTANT: C(field.reset, field.width), Access.PULSE: C(0, field.width)}.get(field.access)
            parts += [C(0, field.low - end), self.field(register.name, field.name) if value is None else value]
            end = field.high + 1
        return Cat(*parts)


def _name(register, field):
    return register.lower() + ("" if field == "value" else f"_{field}")


def _lanes(field):
    """The bits of a field by byte lane: lowest bit, the bit after the highest one, and the lane."""
    for start in range(field.low - field.low % LANE, field.high + 1, LANE):
        yield max(start, field.low), min(start + LANE, field.high + 1), start // LANE
