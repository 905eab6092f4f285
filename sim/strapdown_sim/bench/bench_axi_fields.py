"""Bench for the registers of a core behind its bus: each field of their SystemRDL text does on the bus what it says."""

from pathlib import Path
from tempfile import TemporaryDirectory

import cocotb
from cocotb.handle import Force, Release
from cocotb.triggers import FallingEdge
from systemrdl import RDLCompiler
from systemrdl.rdltypes import AccessType, OnWriteType

from strapdown.ip import rdl
from strapdown_sim.bench.bench_axi import SLVERR, Bench
from strapdown_sim.drivers.bench import core_under_test

top, _ = core_under_test()
ALL = 0xFFFF_FFFF


def described():
    """The registers of the text, as systemrdl-compiler reads it: a list of RegNode."""
    compiler = RDLCompiler()
    with TemporaryDirectory() as folder:
        file = Path(folder, "table.rdl")
        file.write_text(rdl.text(top.component.table), encoding="utf-8")
        compiler.compile_file(str(file))
    return list(compiler.elaborate().top.registers())


def mask(*fields):
    """Ones in the bits of some fields."""
    return sum((1 << field.high + 1) - (1 << field.low) for field in fields)


def reset_value(register):
    """The value of a register after a reset."""
    return sum(field.get_property("reset") << field.low for field in register.fields())


def member(register, field):
    """Name of a field's port of the slave."""
    return register.inst_name.lower() + ("" if field.inst_name == "value" else f"_{field.inst_name}")


def of_kind(register, kind):
    """The fields of a register that are of a kind."""
    return [field for field in register.fields() if kind_of(field) == kind]


def kind_of(field):
    """What software may do with a field, from its properties."""
    if field.get_property("onwrite") is OnWriteType.woclr:
        return "clear"
    if field.get_property("singlepulse"):
        return "pulse"
    access = field.get_property("sw")
    if access is AccessType.rw:
        return "write"
    assert access is AccessType.r
    return "constant" if field.get_property("hw") is AccessType.na else "read"


registers = described()


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def addresses_and_reset_values(dut):
    """Each register of the text has its reset value, and no other address has a register."""
    bench = Bench(dut)
    await bench.reset()
    # It counts from the reset.
    assert await bench.read("SAMPLE_TIME") < 20
    by_address = {register.absolute_address: register for register in registers}
    assert len(by_address) == len(registers)
    for address, register in by_address.items():
        if register.inst_name != "SAMPLE_TIME":
            assert await bench.read(address) == reset_value(register), register.inst_name
    holes = sorted({*range(0, 4096, 4)} - {*by_address})
    for address in holes[::7] + holes[-1:]:
        await bench.read(address, SLVERR)


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def fields_that_are_written(dut):
    """A field that can be written keeps each of its bits; no other bit of its register is kept."""
    bench = Bench(dut)
    await bench.reset()
    for register in registers:
        kept, address = mask(*of_kind(register, "write")), register.absolute_address
        if register.inst_name == "CONTROL" or not kept:
            continue
        for value in ALL, 0, 0xAAAA_AAAA, 0x5555_5555:
            await bench.write(address, value)
            assert await bench.read(address) == value & kept, register.inst_name


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def fields_of_control(dut):
    """A pulse lasts a cycle and reads 0; a field that is written stays."""
    bench = Bench(dut)
    await bench.reset()
    (control,) = (register for register in registers if register.inst_name == "CONTROL")
    assert {kind_of(field) for field in control.fields()} <= {"pulse", "write"}
    pulses = [member(control, field) for field in of_kind(control, "pulse")]
    for field in control.fields():
        bench.master.init_write(control.absolute_address, mask(field).to_bytes(4, "little"))
        seen = dict.fromkeys(pulses, 0)
        for _ in range(12):
            await FallingEdge(dut.aclk)
            for pulse in pulses:
                seen[pulse] += int(getattr(dut.slave, pulse).value)
        assert seen == {pulse: int(pulse == member(control, field)) for pulse in pulses}
        kept = mask(field) if kind_of(field) == "write" else 0
        assert await bench.read(control.absolute_address) == kept


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def fields_that_are_read(dut):
    """A field that the circuit drives shows each of its bits, and only these; a write changes nothing."""
    bench = Bench(dut)
    await bench.reset()
    for register in registers:
        fields, address = of_kind(register, "read"), register.absolute_address
        for field in fields:
            port = getattr(dut.slave, member(register, field))
            assert len(port) == field.width
            for value in (1 << field.width) - 1, 0xAAAA_AAAA & (1 << field.width) - 1, 0:
                port.value = Force(value)
                found = await bench.read(address) & ~mask(*(other for other in fields if other is not field))
                assert found == value << field.low, register.inst_name
            port.value = Release()
        if fields:
            await bench.write(address, ALL, SLVERR)
    for register in registers:
        if of_kind(register, "constant"):
            await bench.write(register.absolute_address, ALL, SLVERR)
            assert await bench.read(register.absolute_address) == reset_value(register)


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def fields_that_are_cleared(dut):
    """A flag is set by the circuit, stays, is cleared by a 1 and not by a 0, and a set at the same time wins."""
    bench = Bench(dut)
    await bench.reset()
    (flags,) = (register for register in registers if of_kind(register, "clear"))
    address, every = flags.absolute_address, mask(*flags.fields())
    for field in flags.fields():
        bit = mask(field)
        if field.inst_name == "bad_access":
            await bench.read(0xFFC, SLVERR)
        else:
            port = getattr(dut.slave, f"{member(flags, field)}_set")
            port.value = Force(1)
            await bench.cycles(1)
            await bench.write(address, ALL)
            assert await bench.read(address) == bit
            port.value = Force(0)
            await bench.cycles(1)
            port.value = Release()
        await bench.write(address, every & ~bit)
        assert await bench.read(address) == bit
        await bench.write(address, ALL)
        assert await bench.read(address) == 0
