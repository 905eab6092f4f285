"""The Verilog comes from Amaranth's built-in Yosys, for any PATH."""

import os
import re
import subprocess
import sys

import pytest
from amaranth import *
from amaranth._toolchain.yosys import find_yosys
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out

from strapdown.export.backend import to_verilog
from strapdown.export.tidy import tidy
from strapdown_sim.drivers.toolchain import icarus_missing, run_tool

FAKE = """\
#!/bin/sh
if [ "$1" = -V ]; then echo "Yosys 0.99 (git sha1 0000000)"; else echo "module INS_matx(); reg signed [33:0] x;"; fi
"""


def test_a_newer_yosys_on_path_changes_nothing(tmp_path, monkeypatch):
    fake = tmp_path / "bin" / "yosys"
    fake.parent.mkdir()
    fake.write_text(FAKE, encoding="utf-8")
    fake.chmod(0o755)
    path = os.environ["PATH"]
    written = {}
    for name, search in ("with", f"{fake.parent}{os.pathsep}{path}"), ("without", path):
        subprocess.run([sys.executable, "-m", "strapdown", "generate", "--module", "INS_matx",
                        "--output", tmp_path / name], env=os.environ | {"PATH": search}, check=True,
                       capture_output=True)
        written[name] = [(tmp_path / name / f"INS_matx.{suffix}").read_bytes() for suffix in ("v", "json")]
    assert written["with"] == written["without"]
    # By default, Amaranth takes the Yosys on PATH.
    monkeypatch.setenv("PATH", search := f"{fake.parent}{os.pathsep}{path}")
    monkeypatch.delenv("AMARANTH_USE_YOSYS", raising=False)
    assert find_yosys(lambda version: True).version() == (0, 99, 0), search


def test_the_keyword_signed_stays():
    text = "module top(a);\n  input [3:0] a;\n  reg signed [3:0] \\b.c ;\n  reg \\signed ;\nendmodule\n"
    tidied = tidy(text)
    assert "reg signed [3:0] b_c;" in tidied
    assert "reg signed_2;" in tidied


def test_literals_are_not_taken_for_names():
    """A wire may have the letters of a number's base and digits: 6'b??1 and 4'h?a name neither b nor a."""
    text = """module top(x, y, z);
  input [5:0] x;
  output y;
  output z;
  wire a;
  wire b;
  wire b1;
  wire \\x.parity ;
  wire h;
  assign \\x.parity  = ^x;
  assign a = \\x.parity ;
  assign b = \\x.parity ;
  assign h = x[0];
  assign b1 = b;
  assign y = b1 & a;
  always @*
    casez (x)
      6'b??1:
        z = b & 4'h?a & 1'b1;
      default:
        z = b;
    endcase
endmodule
"""
    tidied = tidy(text)
    assert "      6'b??1:\n        z = x_parity & 4'h?a & 1'b1;\n" in tidied
    assert "assign y = x_parity & x_parity;" in tidied
    # Nothing reads them: the letter in a literal is no reader.
    assert not re.search(r"\b(?:wire|assign) (?:a|b|b1|h)\b", tidied)


def test_wires_without_bits_are_removed():
    """The backend declares them [-1:0], which is two bits to every tool, undriven."""
    text = "module top(x, y);\n  input x;\n  output y;\n  wire [-1:0] \\word.address ;\n  assign y = x;\nendmodule\n"
    assert "wire" not in tidy(text)


class Choice(wiring.Component):
    """A combinational block."""

    choose: In(1)
    chosen: Out(4)

    def elaborate(self, platform):
        m = Module()
        with m.Switch(self.choose):
            with m.Case(0):
                m.d.comb += self.chosen.eq(6)
            with m.Default():
                m.d.comb += self.chosen.eq(9)
        return m


@pytest.mark.icarus
@pytest.mark.parametrize("language", ["2001", "2012"])
def test_combinational_blocks_run_at_time_zero(tmp_path, language):
    if missing := icarus_missing():
        pytest.skip(missing)
    # Nothing in the bench changes, so only an event of the file itself can start the block.
    (tmp_path / "bench.v").write_text(to_verilog(Choice(), "top") + """
module bench;
  reg choose = 0;
  wire [3:0] chosen;
  top dut(.choose(choose), .chosen(chosen));
  initial #1 $display("%b", chosen);
endmodule
""")
    run_tool(["iverilog", f"-g{language}", "-s", "bench", "-o", tmp_path / "bench.vvp", tmp_path / "bench.v"])
    assert run_tool(["vvp", "-n", tmp_path / "bench.vvp"]) == "0110\n"
