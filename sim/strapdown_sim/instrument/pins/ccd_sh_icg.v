// Line CCD with the pins phiM, SH and ICG, which checks the timing of its data sheet (Toshiba TCD1304DG, Rev. 1.4).
//
// An SH pulse while ICG is high flushes the charge; the one while ICG is low moves it into the register. A slot of the
// register takes four phiM. The first begins when ICG rises; each of the others begins at a rising edge of phiM.
// Parameters of time are in nanoseconds. Times at ports are in picoseconds.
`timescale 1ps / 1ps

module ccd_sh_icg #(
    parameter PIXELS = 3648,
    parameter LEAD = 32,            // slots before the first pixel
    parameter SLOTS = 3694,         // slots of a line
    parameter LINES = 1,            // lines in the memory, which are used in turn
    parameter INVERT = 1,           // video falls with light
    parameter CLOCK_MIN = 250,      // period of phiM
    parameter CLOCK_MAX = 1250,
    parameter ICG_SH_MIN = 100,     // t2: ICG falls, SH rises
    parameter ICG_SH_MAX = 1000,
    parameter SH_MIN = 1000,        // t3: SH high
    parameter SH_ICG_MIN = 1000,    // t1: SH falls, ICG rises
    parameter EXPOSURE_MIN = 10000
) (
    input phi_m,
    input sh,
    input icg,
    output reg [11:0] level,        // video
    output reg changed,             // inverts when the level changes
    output reg [15:0] slot,         // present slot
    output reg [31:0] transfers,    // lines that were moved into the register
    output reg [63:0] opened,       // start of the exposure of the last of them
    output reg [63:0] closed,       // its end
    output reg [15:0] violated,     // rules that were broken: bit n for rule n
    output reg [31:0] violations    // number of violations
);
  localparam CLOCK = 1, ICG_TO_SH = 2, SH_WIDTH = 3, SH_TO_ICG = 4, ICG_PHASE = 5, EXPOSURE = 6, READ_OUT = 7,
             TRANSFER = 8;

  reg [11:0] image [0:PIXELS*LINES-1];
  reg [1:0] quarter;
  reg reading, clocked, raised, flushed, moved;
  time clock_rose, sh_rose, sh_fell, icg_fell;

  initial begin
    level = INVERT ? 4095 : 0;
    changed = 0;
    slot = 0;
    transfers = 0;
    opened = 0;
    closed = 0;
    violated = 0;
    violations = 0;
    quarter = 0;
    reading = 0;
    clocked = 0;
    raised = 0;
    flushed = 0;
    moved = 1;
    clock_rose = 0;
    sh_rose = 0;
    sh_fell = 0;
    icg_fell = 0;
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

  always @(posedge phi_m) begin
    if (clocked && ($time - clock_rose < 1000 * CLOCK_MIN || $time - clock_rose > 1000 * CLOCK_MAX)) broken(CLOCK);
    clock_rose = $time;
    clocked = 1;
    if (reading) begin
      quarter = quarter + 1;
      if (quarter == 0) begin
        show(slot + 1);
        reading = slot != SLOTS;
      end
    end
  end

  always @(negedge icg) begin
    if (reading) broken(READ_OUT);
    if (sh) broken(ICG_TO_SH);
    reading = 0;
    moved = 0;
    icg_fell = $time;
  end

  always @(posedge sh) begin
    if (!icg) begin
      if (moved) broken(TRANSFER);
      else if ($time - icg_fell < 1000 * ICG_SH_MIN || $time - icg_fell > 1000 * ICG_SH_MAX) broken(ICG_TO_SH);
    end
    raised = 1;
    sh_rose = $time;
  end

  always @(negedge sh) if (raised) begin
    if ($time - sh_rose < 1000 * SH_MIN) broken(SH_WIDTH);
    if (!icg && !moved) begin
      if (flushed && $time - sh_fell < 1000 * EXPOSURE_MIN) broken(EXPOSURE);
      moved = 1;
      opened = sh_fell;
      closed = $time;
      transfers = transfers + 1;
    end
    flushed = 1;
    sh_fell = $time;
  end

  always @(posedge icg) begin
    if (!moved) broken(TRANSFER);
    else if (transfers != 0) begin
      if (sh || $time - sh_fell < 1000 * SH_ICG_MIN) broken(SH_TO_ICG);
      if (!phi_m) broken(ICG_PHASE);
      reading = 1;
      quarter = 0;
      show(0);
    end
  end
endmodule
