"""The Verilog means what Amaranth means: the same values in Icarus and in Amaranth's simulator."""
# amaranth: UnusedElaboratable=no

import re

import numpy as np
import pytest
from amaranth import *
from amaranth.lib import wiring
from amaranth.lib.memory import Memory
from amaranth.lib.wiring import In, Out
from amaranth.sim import Simulator

from strapdown.export import CircuitError, to_verilog
from strapdown_sim.drivers.toolchain import icarus_missing, run_tool

CYCLES, SEED = 400, 20250611


class Operations(wiring.Component):
    """Every operation, with operands of different widths and signs."""

    RESULTS = (
        lambda a, b, c: a + b, lambda a, b, c: a - c, lambda a, b, c: b - a, lambda a, b, c: -b, lambda a, b, c: -a,
        lambda a, b, c: a * b, lambda a, b, c: b * b, lambda a, b, c: a * c, lambda a, b, c: ~a, lambda a, b, c: ~b,
        lambda a, b, c: (a + c) & ~b, lambda a, b, c: a | b, lambda a, b, c: b ^ (c + a), lambda a, b, c: a == b,
        lambda a, b, c: b != c, lambda a, b, c: b < c, lambda a, b, c: a >= b, lambda a, b, c: b > -3,
        lambda a, b, c: (b < 0) | (a <= c), lambda a, b, c: a << c, lambda a, b, c: b << c, lambda a, b, c: a >> c,
        lambda a, b, c: b >> c, lambda a, b, c: (b >> c) + a, lambda a, b, c: (a + 1) >> 1,
        lambda a, b, c: Cat(a, b, c).as_signed() >> 5, lambda a, b, c: a.any() + b.all() + c.xor() + a.bool(),
        lambda a, b, c: ~(a & 3).any(), lambda a, b, c: Mux(c[0], a, b), lambda a, b, c: Mux(c == 2, b, c) + a,
        lambda a, b, c: a // Mux(c == 0, 1, c), lambda a, b, c: a % Cat(c, C(1, 1)), lambda a, b, c: a.bit_select(c, 1),
        lambda a, b, c: a.bit_select(c, 3), lambda a, b, c: b.bit_select(c, 4), lambda a, b, c: a.word_select(c, 2),
        lambda a, b, c: (a - c)[:4], lambda a, b, c: (a * c + b)[2:6], lambda a, b, c: a.rotate_left(3) + c,
        lambda a, b, c: abs(b) - c, lambda a, b, c: Cat(b[2:4], C(5, 3), c, c, a[7]),
        lambda a, b, c: a.replicate(2) + b,
        lambda a, b, c: (a & 0) | (c ^ 7), lambda a, b, c: (a | 0xff) + (c & 7), lambda a, b, c: Mux(C(1), a, c) ^ 0)

    def __init__(self):
        super().__init__({"a": In(8), "b": In(signed(6)), "c": In(3),
                          **{f"y{index}": Out(16) for index in range(len(self.RESULTS))}})

    def elaborate(self, platform):
        m = Module()
        for index, function in enumerate(self.RESULTS):
            m.d.comb += getattr(self, f"y{index}").eq(function(self.a, self.b, self.c))
        return m


class Statements(wiring.Component):
    """Every form of statement, combinational and clocked, and memories."""

    a: In(8)
    b: In(4)
    c: In(3)
    nested: Out(8)
    parts: Out(8)
    chain: Out(4)
    wild: Out(4)
    listed: Out(6)
    counted: Out(8)
    flags: Out(4)
    state: Out(3)
    stored: Out(8)
    delayed: Out(8)
    rom: Out(5)
    constants: Out(4)

    def elaborate(self, platform):
        m = Module()
        with m.If(self.c[0]):
            m.d.comb += self.nested.eq(self.a + self.b)
            with m.If(self.b == 3):
                m.d.comb += self.nested[2:5].eq(self.c)
        with m.Elif(self.c[1]):
            m.d.comb += self.nested.eq(~self.a)
        with m.If(self.a[7]):
            m.d.comb += self.nested[0].eq(self.b[1])
        # A part that depends on another part of the same signal.
        m.d.comb += [self.parts[:4].eq(self.b), self.parts[4:].eq(self.parts[:4] + 1)]
        with m.If(self.c[2]):
            m.d.comb += self.parts[4:].eq(self.parts[1:4])
        with m.Switch(self.a[:5]):
            for place in range(4):
                with m.Case("-" * (4 - place) + "1" + "0" * place):
                    m.d.comb += self.wild.eq(place)
            with m.Default():
                m.d.comb += self.wild.eq(self.b)
        with m.Switch(self.b):
            for value in range(11):
                with m.Case(value):
                    m.d.comb += self.listed.eq(value * 5 ^ self.a)
        m.d.comb += self.chain.eq(Array([self.b, self.a[4:], C(5, 4), self.c])[self.c])
        with m.Switch(C(1, 2)), m.Case(1):
            m.d.comb += self.constants.eq(9)
        with m.If(self.c == 5):
            m.d.sync += self.counted.eq(0)
        with m.Elif(self.a[0]):
            m.d.sync += self.counted.eq(self.counted + 1)
        m.d.sync += self.flags[0].eq(self.a[3])
        with m.If(self.b[2]):
            m.d.sync += [self.flags[1:3].eq(self.c), self.flags[3].eq(~self.flags[3])]
        with m.If(self.b == 15):
            m.d.sync += self.flags[0].eq(0)
        with m.FSM(init="B"):
            for name, following in ("A", "B"), ("B", "C"), ("C", "A"):
                with m.State(name):
                    m.d.comb += self.state.eq("ABC".index(name) + 2)
                    with m.If(self.a[1] ^ self.b[0]):
                        m.next = following
        m.submodules.memory = memory = Memory(shape=8, depth=16, init=range(3, 19))
        write, read, early = memory.write_port(granularity=4), memory.read_port(), memory.read_port(domain="comb")
        m.d.comb += [write.addr.eq(self.b), write.data.eq(self.a), write.en.eq(self.c[1:]), read.addr.eq(self.a[4:]),
                     read.en.eq(self.c[0]), early.addr.eq(self.b), self.stored.eq(early.data)]
        m.d.comb += self.delayed.eq(Mux(self.counted == 0, 0, read.data))
        m.submodules.rom = rom = Memory(shape=5, depth=13, init=[value * 7 % 32 for value in range(13)],
                                        attrs={"rom_style": "block"})
        m.submodules.one = one = Memory(shape=5, depth=1, init=[21])
        fetch, early_fetch = rom.read_port(), rom.read_port(domain="comb")
        m.d.comb += [fetch.addr.eq(self.b), early_fetch.addr.eq(self.a),
                     self.rom.eq(Mux(self.counted == 0, 0, fetch.data) ^ early_fetch.data
                                 ^ one.read_port(domain="comb").data)]
        return m


def values(component, stimulus):
    """Outputs before each clock edge, by Amaranth's simulator."""
    outputs = [name for name, member in component.signature.members.items() if member.flow is Out]
    rows = []

    async def drive(context):
        for row in zip(*stimulus.values(), strict=True):
            for name, value in zip(stimulus, row, strict=True):
                context.set(getattr(component, name), int(value))
            await context.delay(1e-9)
            rows.append([context.get(getattr(component, name)) for name in outputs])
            await context.delay(1e-6 - 1e-9)

    simulator = Simulator(component)
    simulator.add_clock(1e-6, if_exists=True)
    simulator.add_testbench(drive)
    simulator.run()
    return rows


def simulated(component, stimulus, folder, language):
    """The same by Icarus, from the Verilog."""
    members = component.signature.members
    outputs = [name for name, member in members.items() if member.flow is Out]
    text = to_verilog(component, "dut")
    clocked = "input wire clk" in text
    bench = ["module bench;", "  reg clk = 0;"]
    for name, member in members.items():
        bench.append(f"  {'reg' if member.flow is In else 'wire'} [{Shape.cast(member.shape).width - 1}:0] {name};")
    ports = [f".{name}({name})" for name in members] + ([".clk(clk)", ".rst(1'b0)"] if clocked else [])
    bench += [f"  dut dut({', '.join(ports)});", "  initial begin"]
    for row in zip(*stimulus.values(), strict=True):
        bench.append("    " + " ".join(f"{name} = {value};" for name, value in zip(stimulus, row, strict=True)))
        bench.append(f"    #1 $display(\"{' '.join(['%0d'] * len(outputs))}\", {', '.join(outputs)});")
        bench.append("    #1 clk = 1; #1 clk = 0;")
    bench += ["  end", "endmodule"]
    path = folder / "bench.v"
    path.write_text(text + "\n".join(bench) + "\n", encoding="utf-8")
    assert run_tool(["iverilog", f"-g{language}", "-Wall", "-Wno-timescale", "-s", "bench", "-o", folder / "bench.vvp",
                     path]) == ""
    return [[int(word) for word in line.split()]
            for line in run_tool(["vvp", "-n", folder / "bench.vvp"]).splitlines()]


@pytest.mark.icarus
@pytest.mark.parametrize("kind", [Operations, Statements])
@pytest.mark.parametrize("language", ["2001", "2012"])
def test_verilog_means_what_amaranth_means(kind, language, tmp_path):
    if missing := icarus_missing():
        pytest.skip(missing)
    component, rng = kind(), np.random.default_rng(SEED)
    members = component.signature.members
    stimulus = {}
    for name, member in members.items():
        if member.flow is In:
            shape = Shape.cast(member.shape)
            least = -(1 << shape.width - 1) if shape.signed else 0
            stimulus[name] = rng.integers(least, least + (1 << shape.width), CYCLES)
    outputs = [name for name, member in members.items() if member.flow is Out]
    expected, found = values(kind(), stimulus), simulated(component, stimulus, tmp_path, language)
    for index, name in enumerate(outputs):
        assert [row[index] for row in found] == [row[index] for row in expected], name


class Choice(wiring.Component):
    """A combinational block."""

    choose: In(3)
    chosen: Out(4)

    def elaborate(self, platform):
        m = Module()
        with m.Switch(self.choose):
            for value in range(7):
                with m.Case(value):
                    m.d.comb += self.chosen.eq(6 ^ value)
        return m


@pytest.mark.icarus
@pytest.mark.parametrize("language", ["2001", "2012"])
def test_combinational_blocks_run_at_time_zero(tmp_path, language):
    if missing := icarus_missing():
        pytest.skip(missing)
    text = to_verilog(Choice(), "top")
    assert "case (choose)" in text
    # Nothing in the bench changes, so only an event of the file itself can start the block.
    (tmp_path / "bench.v").write_text(text + """
module bench;
  reg [2:0] choose = 0;
  wire [3:0] chosen;
  top dut(.choose(choose), .chosen(chosen));
  initial #1 $display("%b", chosen);
endmodule
""", encoding="utf-8")
    run_tool(["iverilog", f"-g{language}", "-s", "bench", "-o", tmp_path / "bench.vvp", tmp_path / "bench.v"])
    assert run_tool(["vvp", "-n", tmp_path / "bench.vvp"]) == "0110\n"


class Made(wiring.Component):
    """A component with one output, made by a function of its module and its ports."""

    a: In(8)
    y: Out(8)

    def __init__(self, make):
        self._make = make
        super().__init__()

    def elaborate(self, platform):
        m = Module()
        self._make(m, self.a, self.y)
        return m


def verilog(make):
    return to_verilog(Made(make), "top")


def test_keywords_are_not_names():
    def make(m, a, y):
        case, signed, logic = Signal(8, name="case"), Signal(8, name="signed"), Signal(8, name="logic")
        m.d.comb += [case.eq(a + 1), signed.eq(case * 3), logic.eq(case ^ signed), y.eq(logic + case + signed)]
    text = verilog(make)
    assert {"case_2", "signed_2", "logic_2"} <= set(re.findall(r"^  wire \[\d+:0\] (\w+) = ", text, re.MULTILINE))
    component = wiring.Component({"table": In(1), "begin": Out(1)})
    component.elaborate = lambda platform: _connected(component)
    assert "input wire table_2,\n  output wire begin_2\n" in to_verilog(component, "top")


def _connected(component):
    m = Module()
    m.d.comb += component.begin.eq(component.table)
    return m


def test_equal_operations_are_one_wire():
    def make(m, a, y):
        m.d.comb += y.eq(((a + 1) * 3) ^ ((a + 1) << 2) ^ ((a + 1) >> 1))
    assert verilog(make).count("+") == 1


def test_an_enabled_register_is_one_statement():
    def make(m, a, y):
        with m.If(a[0]):
            m.d.sync += y.eq(a)
    assert """\
  always @(posedge clk)
    if (rst)
      y <= 8'h00;
    else if (a[0])
      y <= a;
""" in verilog(make)


def test_repeated_bits_are_a_replication():
    def make(m, a, y):
        m.d.comb += y.eq(a[7].replicate(8) ^ a)
    assert "assign y = {8{a[7]}} ^ a;" in verilog(make)


def test_a_very_long_number_is_in_pieces():
    def make(m, a, y):
        number = int("1234567890" * 16, 16)
        m.d.comb += y.eq((Cat(a, a.replicate(79)) ^ C(number, 640)).xor())
        wide = Signal(640, init=0, name="wide")
        m.d.sync += wide.eq(Cat(a, wide))
        with m.If(wide.all()):
            m.d.comb += y.eq(1)
    text = verilog(make)
    assert "reg [639:0] wide = {640{1'b0}};" in text
    words = re.search(r"\{128'h(\w+),\s+256'h(\w+),\s+256'h(\w+)\}", text)
    assert "".join(words.groups()) == "1234567890" * 16


def test_a_register_may_be_reset_asynchronously():
    def make(m, a, y):
        m.domains.other = ClockDomain(async_reset=True)
        m.d.comb += [ClockSignal("other").eq(ClockSignal()), ResetSignal("other").eq(a[0])]
        m.d.other += y.eq(a)
    assert """\
  always @(posedge clk or posedge other_rst)
    if (other_rst)
      y <= 8'h00;
    else
      y <= a;
""" in verilog(make)


def test_a_vendors_primitive_keeps_its_parameters():
    def make(m, a, y):
        m.submodules.buffer = Instance("BUF", p_WIDTH=8, p_MODE="fast", i_I=a, o_O=y)
    text = verilog(make)
    assert re.search(r"""BUF #\(\.WIDTH\(8\), \.MODE\("fast"\)\) buffer \(\s+\.I\(a\),\s+\.O\(y\)\s+\);""", text)


def test_a_parameter_keeps_its_kind():
    def make(m, a, y):
        m.submodules.buffer = Instance("BUF", p_REAL=1.5, p_LEAST=-3, p_FOUR=Const(-2, 4), p_NAME="1.5", i_I=a, o_O=y)
    assert re.search(r"""BUF #\(\.REAL\(1\.5\), \.LEAST\(32'shfffffffd\), \.FOUR\(4'she\), \.NAME\("1\.5"\)\) buffer""",
                     verilog(make))


def test_a_rom_is_a_case_with_the_style_at_both_places():
    def make(m, a, y):
        m.submodules.rom = rom = Memory(shape=8, depth=3, init=[1, 2, 250], attrs={"rom_style": "block"})
        read = rom.read_port()
        m.d.comb += [read.addr.eq(a), y.eq(read.data)]
    text = to_verilog(Made(make), "top", comments={"rom": {0: "first", 2: "last"}})
    assert re.search(r"""  \(\* rom_style = "block" \*\)\n  (?:output )?reg \[7:0\] y""", text)
    assert """\
    (* rom_style = "block" *)
    case (read_addr)
      2'b00: y <= 8'h01;  // first
      2'b01: y <= 8'h02;
      2'b10: y <= 8'hfa;  // last
      default: y <= 8'h00;
    endcase
""" in text
    assert "initial" not in text


def transparent(m, a, y):
    m.submodules.memory = memory = Memory(shape=8, depth=4, init=[])
    write = memory.write_port()
    read = memory.read_port(transparent_for=(write,))
    m.d.comb += [write.addr.eq(a), write.data.eq(a), write.en.eq(1), read.addr.eq(a), y.eq(read.data)]


def circular(m, a, y):
    # No bit depends on itself, but the word does.
    m.d.comb += y.eq(a & Cat(C(1, 1), y[:7]))


def printing(m, a, y):
    m.d.sync += Print(a)


def floored(m, a, y):
    m.d.comb += y.eq(a.as_signed() // 3)


@pytest.mark.parametrize(("make", "message"), [
    (transparent, "top: a transparent port of memory memory cannot be written as Verilog"),
    (circular, r"top: \w+ depends on itself without a register between"),
    (printing, r"top: a cell \$print cannot be written as Verilog"),
    (floored, r"top: a cell \$divfloor cannot be written as Verilog")])
def test_what_plain_verilog_cannot_express_is_refused(make, message):
    with pytest.raises(CircuitError, match=f"^{message}$"):
        verilog(make)
