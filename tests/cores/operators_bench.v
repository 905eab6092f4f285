// One operation, started once; every operator's result as it gets ready, in order of readiness.
// Operands are macros: A, B, FIXED, X, Y.
module bench;
  reg clk, nd;
  wire [9:0] rdy;
  wire [31:0] add_out, sub_out, mult_out, div_out, sqrt_out, fi16tofl32_out;
  wire [15:0] fl32tofi16_out, atan_out;
  wire [0:0] equl_out, less_out;
  user dut(.clk(clk), .sclr(1'b0), .ce(1'b1), .nd(nd), .a(`A), .b(`B),
    .fixed(`FIXED), .x(`X), .y(`Y),
    .add_rdy(rdy[0]), .sub_rdy(rdy[1]), .mult_rdy(rdy[2]), .div_rdy(rdy[3]), .sqrt_rdy(rdy[4]), .equl_rdy(rdy[5]),
    .less_rdy(rdy[6]), .fl32tofi16_rdy(rdy[7]), .fi16tofl32_rdy(rdy[8]), .atan_rdy(rdy[9]),
    .add_out(add_out), .sub_out(sub_out), .mult_out(mult_out), .div_out(div_out), .sqrt_out(sqrt_out),
    .equl_out(equl_out), .less_out(less_out), .fl32tofi16_out(fl32tofi16_out), .fi16tofl32_out(fi16tofl32_out),
    .atan_out(atan_out));
  integer cycle;
  initial begin
    clk = 0; nd = 1;
    for (cycle = 1; cycle < 40; cycle = cycle + 1) begin
      #5 clk = 1;
      #1 nd = 0;
      if (rdy[0]) $display("add %0d %h", cycle, add_out);
      if (rdy[1]) $display("sub %0d %h", cycle, sub_out);
      if (rdy[2]) $display("mult %0d %h", cycle, mult_out);
      if (rdy[3]) $display("div %0d %h", cycle, div_out);
      if (rdy[4]) $display("sqrt %0d %h", cycle, sqrt_out);
      if (rdy[5]) $display("equl %0d %h", cycle, equl_out);
      if (rdy[6]) $display("less %0d %h", cycle, less_out);
      if (rdy[7]) $display("fl32tofi16 %0d %h", cycle, fl32tofi16_out);
      if (rdy[8]) $display("fi16tofl32 %0d %h", cycle, fi16tofl32_out);
      if (rdy[9]) $display("atan %0d %h", cycle, atan_out);
      #4 clk = 0;
    end
  end
endmodule
