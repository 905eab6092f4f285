// All ten operators, instantiated as the thesis's RTL does it.
module user(clk, sclr, ce, nd, a, b, fixed, x, y,
            add_rdy, sub_rdy, mult_rdy, div_rdy, sqrt_rdy,
            equl_rdy, less_rdy, fl32tofi16_rdy, fi16tofl32_rdy, atan_rdy,
            add_out, sub_out, mult_out, div_out, sqrt_out,
            equl_out, less_out, fl32tofi16_out, fi16tofl32_out, atan_out);
  input clk, sclr, ce, nd;
  input [31:0] a, b;
  input [15:0] fixed, x, y;
  output add_rdy, sub_rdy, mult_rdy, div_rdy, sqrt_rdy, equl_rdy, less_rdy, fl32tofi16_rdy, fi16tofl32_rdy, atan_rdy;
  output [31:0] add_out, sub_out, mult_out, div_out, sqrt_out, fi16tofl32_out;
  output [15:0] fl32tofi16_out, atan_out;
  output [0:0] equl_out, less_out;
  wire [0:0] equl_result;
  wire [0:0] less_result;
  assign equl_out = equl_result;
  assign less_out = less_result;

  add u_add (.a(a), .b(b), .operation_nd(nd), .clk(clk), .sclr(sclr), .ce(ce), .result(add_out), .rdy(add_rdy));
  sub u_sub (.a(a), .b(b), .operation_nd(nd), .clk(clk), .sclr(sclr), .ce(ce), .result(sub_out), .rdy(sub_rdy));
  mult u_mult (.a(a), .b(b), .operation_nd(nd), .clk(clk), .sclr(sclr), .ce(ce), .result(mult_out), .rdy(mult_rdy));
  div u_div (.a(a), .b(b), .operation_nd(nd), .clk(clk), .sclr(sclr), .ce(ce), .result(div_out), .rdy(div_rdy));
  sqrt u_sqrt (.a(a), .operation_nd(nd), .clk(clk), .sclr(sclr), .ce(ce), .result(sqrt_out), .rdy(sqrt_rdy));
  equl u_equl (.a(a), .b(b), .operation_nd(nd), .clk(clk), .sclr(sclr), .ce(ce), .result(equl_result[0:0]),
               .rdy(equl_rdy));
  less u_less (.a(a), .b(b), .operation_nd(nd), .clk(clk), .sclr(sclr), .ce(ce), .result(less_result),
               .rdy(less_rdy));
  fl32tofi16 u_fl32tofi16 (.a(a), .operation_nd(nd), .clk(clk), .sclr(sclr), .ce(ce), .result(fl32tofi16_out),
                           .rdy(fl32tofi16_rdy));
  fi16tofl32 u_fi16tofl32 (.a(fixed), .operation_nd(nd), .clk(clk), .sclr(sclr), .ce(ce), .result(fi16tofl32_out),
                           .rdy(fi16tofl32_rdy));
  atan u_atan (.x_in(x), .y_in(y), .nd(nd), .clk(clk), .sclr(sclr), .ce(ce), .phase_out(atan_out), .rdy(atan_rdy));
endmodule
