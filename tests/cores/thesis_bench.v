// One start of a module ``user`` after its reset; prints the module's results whenever a core finishes.
// The macro DATA holds the operands.
module bench;
  reg clk, reset_n, start;
  wire [7:0] finish;
  wire [1311:0] results;
  user dut(.clk(clk), .reset_n(reset_n), .start(start), .data(`DATA), .finish(finish), .results(results));
  integer cycle;
  initial begin
    clk = 0;
    for (cycle = -8; cycle < 400; cycle = cycle + 1) begin
      reset_n = cycle >= -4;
      start = cycle == 0;
      #5 clk = 1;
      #5 clk = 0;
      if (finish) $display("%0d %b %h", cycle, finish, results);
    end
  end
endmodule
