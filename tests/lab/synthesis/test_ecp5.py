"""Place and route of a module whose slowest path is known beforehand."""

from strapdown_lab.synthesis import ECP5_SEEDS, place_ecp5

SUM = """
module sum(input clk, input [15:0] a, b, output reg [15:0] y);
  reg [15:0] first, second;
  always @(posedge clk) begin
    first <= a;
    second <= first * first + first;
    y <= second;
  end
endmodule
"""
"""One multiplier and an adder between two ranks of registers; a register everywhere else."""


def test_slowest_path_and_cells_of_a_known_module(nextpnr, cache):
    placed = place_ecp5(SUM, "sum", cache)
    assert placed.critical == ("first", "second")
    assert placed.multiplier == 1
    assert placed.ff == 48  # the registers of the wrapper do not count
    assert placed.lut == 16  # nor its LUTs; the adder's carry chain has a bit for each of the sum
    assert len(placed.fmax_mhz) == len(ECP5_SEEDS)
    assert min(placed.fmax_mhz) <= placed.median_mhz <= max(placed.fmax_mhz)
