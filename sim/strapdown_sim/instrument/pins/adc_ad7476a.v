// Serial ADC of 12 bits, which checks the timing of its data sheet (Analog Devices AD7476A, Rev. F, pages 8 and 9).
//
// It samples when CS falls. Four zeros and then 12 bits from the top follow: the first zero with CS, each of the others
// with a falling edge of SCLK. The receiver sees the inverse of a bit until ACCESS has passed: its pin follows at the
// falling edges of its clock ``observe``.
// Parameters of time are in nanoseconds.
`timescale 1ps / 1ps

module adc_ad7476a #(
    parameter SCLK_MIN = 50,            // period of SCLK
    parameter SCLK_PULSE_MIN = 20,      // SCLK high, and SCLK low: 0.4 of the least period
    parameter CS_SCLK_MIN = 10,         // t2: CS falls, SCLK falls
    parameter CS_HIGH_MIN = 10,         // t1: CS high
    parameter QUIET_MIN = 50,           // tQUIET: end of a conversion, next one
    parameter CYCLE_MIN = 1000,         // 1 MS/s
    parameter ACCESS = 40,              // t4: SCLK falls, SDATA is valid
    parameter SETTLE_MIN = 0,           // video changes, ADC samples
    parameter HOLD_MIN = 10,            // ADC samples, video changes
    parameter GUARD_MIN = 0             // edge of ``quiet``, ADC samples; and the reverse
) (
    input observe,
    input cs_n,
    input sclk,
    input [11:0] level,                 // voltage
    input changed,                      // inverts when the voltage changes
    input quiet,                        // a pin without edges near a sample
    output reg sdata,
    output reg [11:0] word,             // last sample
    output reg [31:0] samples,          // number of samples
    output reg [15:0] violated,         // rules that were broken: bit n for rule n
    output reg [31:0] violations        // number of violations
);
  localparam SCLK = 1, SCLK_PULSE = 2, CS_TO_SCLK = 3, CS_HIGH = 4, QUIET = 5, CYCLE = 6, CONVERSION = 7, SETTLE = 8,
             HOLD = 9, GUARD = 10;

  reg [15:0] shift;
  reg [4:0] falls;
  reg data, converted, selected, fallen;
  time cs_fell, cs_rose, sclk_fell, sclk_rose, ended, data_at, changed_at, quiet_at;

  initial begin
    sdata = 0;
    word = 0;
    samples = 0;
    violated = 0;
    violations = 0;
    shift = 0;
    falls = 0;
    data = 0;
    converted = 0;
    selected = 0;
    fallen = 0;
    cs_fell = 0;
    cs_rose = 0;
    sclk_fell = 0;
    sclk_rose = 0;
    ended = 0;
    data_at = 0;
    changed_at = 0;
    quiet_at = 0;
  end

  task broken(input [3:0] rule);
    begin
      violated[rule] = 1;
      violations = violations + 1;
    end
  endtask

  always @(negedge cs_n) begin
    if (selected && $time - cs_rose < 1000 * CS_HIGH_MIN) broken(CS_HIGH);
    if (converted && $time - ended < 1000 * QUIET_MIN) broken(QUIET);
    if (selected && $time - cs_fell < 1000 * CYCLE_MIN) broken(CYCLE);
    if (changed_at != 0 && $time - changed_at < 1000 * SETTLE_MIN) broken(SETTLE);
    if (GUARD_MIN && $time - quiet_at < 1000 * GUARD_MIN) broken(GUARD);
    selected = 1;
    cs_fell = $time;
    falls = 0;
    word = level;
    samples = samples + 1;
    shift = {4'b0000, level};
    data = 0;
    data_at = $time;
  end

  always @(posedge cs_n) begin
    if (selected && falls < 16) broken(CONVERSION);
    cs_rose = $time;
  end

  always @(posedge sclk) begin
    if (fallen && $time - sclk_fell < 1000 * SCLK_PULSE_MIN) broken(SCLK_PULSE);
    sclk_rose = $time;
  end

  always @(negedge sclk) begin
    if (fallen && $time - sclk_fell < 1000 * SCLK_MIN) broken(SCLK);
    if (fallen && $time - sclk_rose < 1000 * SCLK_PULSE_MIN) broken(SCLK_PULSE);
    if (!cs_n && falls == 0 && $time - cs_fell < 1000 * CS_SCLK_MIN) broken(CS_TO_SCLK);
    fallen = 1;
    sclk_fell = $time;
    if (!cs_n && falls != 16) begin
      falls = falls + 1;
      data = falls == 16 ? ~word[0] : shift[14];      // the pin floats after the last bit
      data_at = $time;
      if (falls == 16) begin
        converted = 1;
        ended = $time;
      end
      shift = {shift[14:0], 1'b0};
    end
  end

  always @(changed) begin
    if (selected && $time - cs_fell < 1000 * HOLD_MIN) broken(HOLD);
    changed_at = $time;
  end

  always @(quiet) begin
    if (GUARD_MIN && selected && $time - cs_fell < 1000 * GUARD_MIN) broken(GUARD);
    quiet_at = $time;
  end

  always @(negedge observe) sdata <= $time - data_at < 1000 * ACCESS ? ~data : data;
endmodule
