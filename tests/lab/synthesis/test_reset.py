"""No asynchronous control reaches a block RAM or a DSP block of a 7-series netlist without a clock edge."""

import pytest

from strapdown.cores import THESIS, THESIS_COMPACT
from strapdown_lab.report.measure import core_circuit
from strapdown_lab.synthesis import asynchronous_paths

UNSAFE = """
module unsafe(input clk, input rst_n, input write, input [9:0] value, output reg [31:0] word);
  reg [31:0] memory [0:1023];
  reg [9:0] address;
  always @(posedge clk%s) if (!rst_n) address <= 0; else address <= address + value;
  always @(posedge clk) begin
    if (write) memory[~address] <= {word, value};
    word <= memory[address];
  end
endmodule
"""
"""A counter that addresses a block RAM, on one port as it is, on the other through LUTs."""


def test_an_asynchronous_reset_of_an_address_is_found(yosys, cache):
    found = asynchronous_paths(UNSAFE % " or negedge rst_n", "unsafe", cache)
    assert {pin.rstrip("0123456789") for _, pin in found} == {"ADDRARDADDR", "ADDRBWRADDR"}
    assert asynchronous_paths(UNSAFE % "", "unsafe", cache) == ()


@pytest.mark.parametrize(("module", "config"), [("INS_top", THESIS), ("INS_top", THESIS_COMPACT)])
def test_no_reset_reaches_a_block_ram_or_a_dsp_at_once(module, config, make_core, yosys, cache):
    assert asynchronous_paths(core_circuit(make_core(module, config), config), module, cache) == ()
