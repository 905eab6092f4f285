// Line sensor with the pins CLK and ST, which checks the timing of its data sheet.
//
// START_SAMPLED = 0 (Hamamatsu S11639): the exposure lasts while ST is high, and EXPOSURE_CLOCKS longer. The read-out
// begins when ST falls; pixel 1 begins at the LEADth rising edge of CLK after that.
// START_SAMPLED = 1 (ams TSL1402): ST is the pin SI, whose rise ends the exposure. The rising edge of CLK at which it is
// high begins the read-out, and pixel 1. The next exposure begins EXPOSURE_CLOCKS after the rise.
// In both, a pixel takes one CLK. Parameters of time are in nanoseconds. Times at ports are in picoseconds.
`timescale 1ps / 1ps

module ccd_st_clk #(
    parameter PIXELS = 2048,
    parameter LEAD = 88,
    parameter LINES = 1,                // lines in the memory, which are used in turn
    parameter INVERT = 0,               // video falls with light
    parameter START_SAMPLED = 0,
    parameter EXPOSURE_CLOCKS = 48,
    parameter CLOCK_MIN = 100,          // period of CLK
    parameter CLOCK_MAX = 5000,
    parameter PULSE_MIN = 0,            // CLK high, and CLK low
    parameter HIGH_MIN = 6,             // ST high, in CLK; only START_SAMPLED = 0
    parameter LOW_MIN = 100,            // ST low, in CLK; only START_SAMPLED = 0
    parameter SETUP_MIN = 20,           // ST before the rising edge of CLK; only START_SAMPLED = 1
    parameter HOLD_MIN = 0,             // ST after it; only START_SAMPLED = 1
    parameter LINE_MIN = 2145,          // read-out, in CLK
    parameter LINE_EXTRA = 0            // and this time
) (
    input clk,
    input st,
    output reg [11:0] level,            // video
    output reg changed,                 // inverts when the level changes
    output reg [15:0] slot,             // present slot
    output reg [31:0] transfers,        // exposures that have ended
    output reg [63:0] opened,           // start of the exposure of the last of them
    output reg [63:0] closed,           // its end
    output reg [15:0] violated,         // rules that were broken: bit n for rule n
    output reg [31:0] violations        // number of violations
);
  localparam CLOCK = 1, CLOCK_PULSE = 2, START_HIGH = 3, START_LOW = 4, START_SETUP = 5, READ_OUT = 6;

  reg [11:0] image [0:PIXELS*LINES-1];
  reg reading, clocked, raised, started, sampled;
  reg [31:0] clocks;                    // since the read-out began
  time clock_rose, clock_fell, period, st_rose, st_fell, began, exposing;

  initial begin
    level = INVERT ? 4095 : 0;
    changed = 0;
    slot = 0;
    transfers = 0;
    opened = 0;
    closed = 0;
    violated = 0;
    violations = 0;
    reading = 0;
    clocked = 0;
    raised = 0;
    started = 0;
    sampled = 0;
    clocks = 0;
    clock_rose = 0;
    clock_fell = 0;
    period = 0;
    st_rose = 0;
    st_fell = 0;
    began = 0;
    exposing = 0;
  end

  task broken(input [3:0] rule);
    begin
      violated[rule] = 1;
      violations = violations + 1;
    end
  endtask

  task show(input [15:0] number);
    reg [11:0] charge;
    begin
      charge = 0;
      if (number >= LEAD && number < LEAD + PIXELS)
        charge = image[((transfers - 1) % LINES) * PIXELS + number - LEAD];
      slot = number;
      level = INVERT ? 4095 - charge : charge;
      changed = ~changed;
    end
  endtask

  // An exposure ends, and its read-out begins.
  task transfer(input [63:0] from, input [63:0] to);
    begin
      if (started && (clocks < LINE_MIN || $time - began < LINE_MIN * period + 1000 * LINE_EXTRA)) broken(READ_OUT);
      started = 1;
      began = $time;
      clocks = 0;
      reading = !START_SAMPLED;
      slot = 0;
      opened = from;
      closed = to;
      transfers = transfers + 1;
    end
  endtask

  always @(negedge clk) begin
    if (clocked && $time - clock_rose < 1000 * PULSE_MIN) broken(CLOCK_PULSE);
    clock_fell = $time;
  end

  always @(posedge clk) begin
    if (clocked) begin
      period = $time - clock_rose;
      if (period < 1000 * CLOCK_MIN || period > 1000 * CLOCK_MAX) broken(CLOCK);
      if ($time - clock_fell < 1000 * PULSE_MIN) broken(CLOCK_PULSE);
    end
    clock_rose = $time;
    clocked = 1;
    clocks = clocks + 1;
    if (START_SAMPLED && st) begin
      if ($time - st_rose < 1000 * SETUP_MIN) broken(START_SETUP);
      sampled = 1;
      clocks = 0;
      reading = 1;
      show(LEAD);
    end else begin
      if (START_SAMPLED && raised && $time - st_fell < 1000 * SETUP_MIN) broken(START_SETUP);
      if (reading) begin
        show(slot + 1);
        reading = slot != LEAD + PIXELS;
      end
    end
  end

  always @(posedge st) begin
    if (!START_SAMPLED && started && $time - st_fell < LOW_MIN * period) broken(START_LOW);
    raised = 1;
    st_rose = $time;
    if (START_SAMPLED) begin
      transfer(exposing, $time);
      exposing = $time + EXPOSURE_CLOCKS * period;
    end
  end

  always @(negedge st) if (raised) begin
    st_fell = $time;
    if (START_SAMPLED) begin
      if (!sampled || $time - clock_rose < 1000 * HOLD_MIN) broken(START_SETUP);
      sampled = 0;
    end else begin
      if ($time - st_rose < HIGH_MIN * period) broken(START_HIGH);
      transfer(st_rose, $time + EXPOSURE_CLOCKS * period);
    end
  end
endmodule
