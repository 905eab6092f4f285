// Pipelined ADC with a parallel output of 12 bits. No data sheet in particular: the limits are usual ones of 10 MS/s.
//
// It samples at the rising edge of CLK. The word of a sample is valid at the LATENCYth rising edge after it: it leaves
// the ADC ACCESS after the edge before. Until then the receiver sees the inverse: its pins follow at the falling edges
// of its clock ``observe``.
// Parameters of time are in nanoseconds.
`timescale 1ps / 1ps

module adc_parallel #(
    parameter LATENCY = 1,              // clocks, 1 to 16
    parameter CLOCK_MIN = 100,          // period of CLK
    parameter PULSE_MIN = 40,           // CLK high, and CLK low
    parameter ACCESS = 20,
    parameter SETTLE_MIN = 0,           // video changes, ADC samples
    parameter HOLD_MIN = 5,             // ADC samples, video changes
    parameter GUARD_MIN = 0             // edge of ``quiet``, ADC samples; and the reverse
) (
    input observe,
    input clk,
    input [11:0] level,                 // voltage
    input changed,                      // inverts when the voltage changes
    input quiet,                        // a pin without edges near a sample
    output reg [11:0] data,
    output reg [11:0] word,             // last sample
    output reg [31:0] samples,          // number of samples
    output reg [15:0] violated,         // rules that were broken: bit n for rule n
    output reg [31:0] violations        // number of violations
);
  localparam CLOCK = 1, CLOCK_PULSE = 2, SETTLE = 3, HOLD = 4, GUARD = 5;

  reg [11:0] pipeline [0:15];
  reg [11:0] out;
  reg sampled;
  integer stage;
  time rose, fell, changed_at, quiet_at;

  initial begin
    data = 0;
    word = 0;
    samples = 0;
    violated = 0;
    violations = 0;
    for (stage = 0; stage < 16; stage = stage + 1) pipeline[stage] = 0;
    out = 0;
    sampled = 0;
    rose = 0;
    fell = 0;
    changed_at = 0;
    quiet_at = 0;
  end

  task broken(input [3:0] rule);
    begin
      violated[rule] = 1;
      violations = violations + 1;
    end
  endtask

  always @(posedge clk) begin
    if (sampled && $time - rose < 1000 * CLOCK_MIN) broken(CLOCK);
    if (sampled && $time - fell < 1000 * PULSE_MIN) broken(CLOCK_PULSE);
    if (changed_at != 0 && $time - changed_at < 1000 * SETTLE_MIN) broken(SETTLE);
    if (GUARD_MIN && $time - quiet_at < 1000 * GUARD_MIN) broken(GUARD);
    sampled = 1;
    rose = $time;
    for (stage = 15; stage > 0; stage = stage - 1) pipeline[stage] = pipeline[stage-1];
    pipeline[0] = level;
    out = pipeline[LATENCY-1];
    word = level;
    samples = samples + 1;
  end

  always @(negedge clk) begin
    if (sampled && $time - rose < 1000 * PULSE_MIN) broken(CLOCK_PULSE);
    fell = $time;
  end

  always @(changed) begin
    if (sampled && $time - rose < 1000 * HOLD_MIN) broken(HOLD);
    changed_at = $time;
  end

  always @(quiet) begin
    if (GUARD_MIN && sampled && $time - rose < 1000 * GUARD_MIN) broken(GUARD);
    quiet_at = $time;
  end

  always @(negedge observe) data <= $time - rose < 1000 * ACCESS ? ~out : out;
endmodule
