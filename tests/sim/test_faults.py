"""The driver that flips bits: a hand-made core whose registers have known faults, and a generated one."""

import math

import numpy as np
import pytest

from strapdown.cores import QUATERNION_J3, THESIS, main_module
from strapdown.export import write_core
from strapdown.fp import BINARY16
from strapdown.kernel.pool import Pool
from strapdown_sim.drivers.faults import HORIZON, Fault, FaultModel, Outcome
from strapdown_sim.drivers.storage import MEMORY, REGISTER, ROM, exposed, storage
from strapdown_sim.drivers.toolchain import SimulatorMissingError

SECOND = 20
COUNT = HORIZON + SECOND + 12
ROUND = 5

# In the form of the generator's files. Each bit of ``fault`` makes the core fail in another way; only the memory and
# ``lasting`` keep their contents during a reset.
MODULE = """
module QUAT_direct(in_rate_en, in_p, in_q, in_r, in_load_en, in_e0, in_e1, in_e2, in_e3, out_quat_finish, out_e0,
out_e1, out_e2, out_e3, out_status, clk, rst_n);
  input in_rate_en, in_load_en, clk, rst_n;
  input [31:0] in_p, in_q, in_r, in_e0, in_e1, in_e2, in_e3;
  output out_quat_finish;
  reg out_quat_finish = 1'h0;
  output [31:0] out_e0;
  reg [31:0] out_e0 = 32'd0;
  output [31:0] out_e1;
  reg [31:0] out_e1 = 32'd0;
  output [31:0] out_e2, out_e3;
  output [1:0] out_status;
  reg [1:0] out_status = 2'h0;
  reg [8:0] fault = 9'h000;
  reg [8:0] lasting = 9'h000;
  reg [0:0] odd = 1'h0;
  reg [0:0] busy = 1'h0;
  reg [6:0] healing = 7'h00;
  reg [15:0] count = 16'h0000;
  reg [31:0] fixed [1:0];
  initial begin
    fixed[0] = 32'h00000000;
    fixed[1] = 32'h00000000;
  end
  reg [31:0] scratch [3:0];
  initial begin
    scratch[0] = 32'h00000000;
  end
  reg [31:0] second;
  always @(posedge clk) second <= fixed[0];
  always @(posedge clk) if (busy) scratch[0] <= 32'h00000000;
  wire wrong = fault[3] | (fault[5] & odd[0]) | fault[4] | lasting[0] | (healing != 7'h00);
  assign out_e2 = second;
  assign out_e3 = scratch[0];
  always @(posedge clk) begin
    lasting <= lasting;
    if (!rst_n) begin
      fault <= 9'h000;
      busy <= 1'h0;
      out_quat_finish <= 1'h0;
      odd <= 1'h0;
      healing <= 7'h00;
      out_status <= 2'h0;
    end else begin
      fault <= fault;
      if (!busy) begin
        count <= 16'd1;
        if (in_rate_en & !fault[0]) begin
          busy <= 1'h1;
          out_quat_finish <= 1'h0;
          odd <= ~odd;
        end
      end else begin
        count <= count + 16'd1;
        if (count == LATENCY + fault[1]) begin
          busy <= 1'h0;
          out_quat_finish <= ~fault[2];
          out_status <= fault[4] | (fault[5] & odd[0]);
          out_e0 <= wrong ? 32'h00000000 : 32'h3f800000;
          out_e1 <= wrong ? 32'h3f800000 : 32'h00000000;
          if (healing != 7'h00) healing <= healing - 7'h01;
        end
      end
    end
  end
endmodule
"""


@pytest.fixture(scope="module")
def broken(make_core, models, tmp_path_factory):
    """The model of the hand-made core."""
    core = make_core(main_module(QUATERNION_J3), QUATERNION_J3)
    file = tmp_path_factory.mktemp("faults") / "QUAT_direct.v"
    file.write_text(MODULE.replace("LATENCY", str(core.latency)), encoding="utf-8")
    return model_of(core, file, models)


def model_of(core, file, models):
    try:
        return FaultModel(core, file, models)
    except SimulatorMissingError as error:
        pytest.skip(str(error))


def verdicts(model, faults):
    """Verdicts of faults, given as the name of their place and the other fields."""
    names = [place.name for place in model.places]
    rates = np.random.default_rng(1).uniform(-1, 1, (len(model.core.system.input_ports), COUNT))
    samples = dict(zip(model.core.system.input_ports, rates, strict=True)) | {"in_load_en": np.zeros(COUNT)}
    return model.verdicts([Fault(names.index(name), *rest) for name, *rest in faults], samples, SECOND)


HALF_TURN = 180 / 0.01
KNOWN = {
    ("fault", 0, 0): (Outcome.HANG, True, 0),             # no start is taken
    ("fault", 0, 1): (Outcome.OUT_OF_STEP, True, 0),      # one cycle late
    ("fault", 0, 2): (Outcome.HANG, True, 0),             # no finish
    ("fault", 0, 3): (Outcome.WRONG_SILENT, True, HALF_TURN),
    ("fault", 0, 4): (Outcome.STUCK, True, HALF_TURN),    # every update is refused
    ("fault", 0, 5): (Outcome.WRONG_FLAGGED, True, HALF_TURN),  # every second update is refused, and wrong
    ("fault", 0, 8): (Outcome.MASKED, True, 0),           # nothing reads it
    ("lasting", 0, 0): (Outcome.WRONG_SILENT, False, HALF_TURN),
    ("healing", 0, 3): (Outcome.TRANSIENT, True, HALF_TURN),  # wrong for 8 updates
    ("healing", 0, 5): (Outcome.WRONG_SILENT, True, HALF_TURN),  # wrong for 32 updates
    ("fixed", 0, 30): (Outcome.WRONG_SILENT, False, HALF_TURN),
    ("fixed", 1, 30): (Outcome.MASKED, True, 0),          # no word that is read
    ("scratch", 0, 30): (Outcome.MASKED, True, 0),        # written again before the next start
    ("scratch", 1, 30): (Outcome.MASKED, True, 0),
}


@pytest.mark.verilator
def test_the_outcome_of_known_faults(broken):
    found = verdicts(broken, [(*place, ROUND, 0.4) for place in KNOWN])
    for (place, (outcome, restored, error)), verdict in zip(KNOWN.items(), found, strict=True):
        assert verdict[:2] == (outcome, restored), place
        assert verdict.error == pytest.approx(error, rel=1e-6), place


@pytest.mark.verilator
def test_the_time_of_a_fault(broken):
    # Between finish and start the status is shown until the next finish; a flip before the finish is overwritten.
    before, after = verdicts(broken, [("out_status", 0, 0, ROUND, time) for time in (0.5, 0.95)])
    assert (before.outcome, after.outcome) == (Outcome.MASKED, Outcome.TRANSIENT)


CHANNELS = """
module QUAT_direct_x2 (
  input wire clk,
  input wire rst_n,
  input wire in_rate_en,
  input wire in_channel,
  input wire in_load_en,
  input wire [31:0] in_p, in_q, in_r, in_e0, in_e1, in_e2, in_e3,
  output wire in_ready,
  output reg out_quat_finish = 1'b0,
  output reg out_channel = 1'b0,
  output reg [31:0] out_e0 = 32'h00000000,
  output reg [31:0] out_e1 = 32'h00000000,
  output wire [31:0] out_e2,
  output wire [31:0] out_e3,
  output reg [STATUS:0] out_status = 0
);
  reg [1:0] dead = 2'b00;
  reg [1:0] refused = 2'b00;
  reg busy = 1'b0;
  reg channel = 1'b0;
  reg [15:0] count = 16'h0000;
  assign in_ready = !busy & !dead[in_channel];
  assign out_e2 = 32'h00000000;
  assign out_e3 = 32'h00000000;
  always @(posedge clk) begin
    out_quat_finish <= 1'b0;
    if (!rst_n) begin
      dead <= 2'b00;
      refused <= 2'b00;
      busy <= 1'b0;
    end else begin
      dead <= dead;
      count <= count + 16'd1;
      if (in_rate_en & in_ready) begin
        busy <= 1'b1;
        channel <= in_channel;
        count <= 16'd1;
      end
      if (busy & (count == LATENCY)) begin
        busy <= 1'b0;
        out_quat_finish <= 1'b1;
        out_channel <= channel;
        out_status <= refused[channel] << REFUSED;
        refused[channel] <= 1'b0;
        if (!refused[channel]) begin
          out_e0 <= channel ? 32'h00000000 : 32'h3f800000;
          out_e1 <= channel ? 32'h3f800000 : 32'h00000000;
        end
      end
    end
  end
endmodule
"""


@pytest.mark.verilator
def test_faults_of_channels(make_core, models, tmp_path):
    config = QUATERNION_J3.replace(channels=2)
    core = make_core(main_module(config), config)
    names = core.engine.status_names
    file = tmp_path / "QUAT_direct_x2.v"
    file.write_text(CHANNELS.replace("LATENCY", str(core.latency)).replace(
        "REFUSED", str(names.index("refused"))).replace("STATUS", str(len(names) - 1)), encoding="utf-8")
    model = model_of(core, file, models)
    samples = {port: np.zeros((COUNT, 2)) for port in core.system.input_ports}
    place = [place.name for place in model.places].index
    found = model.verdicts([Fault(place(name), 0, bit, ROUND, time) for name, bit, time in (
        ("dead", 0, 0.7), ("dead", 1, 0.7), ("refused", 1, 0.1), ("busy", 0, 0.2))], samples, SECOND)
    dead, transient = (Outcome.DEAD_CHANNEL, True), (Outcome.TRANSIENT, True)
    assert [verdict[:2] for verdict in found] == [dead, dead, transient, transient]
    # The outputs of a refused update are those of the other channel, and do not count.
    assert [verdict.error for verdict in found] == [0, 0, 0, 0]


@pytest.mark.verilator
def test_faults_that_are_too_early_or_too_late(broken):
    for wrong in 0, COUNT - HORIZON - SECOND - 1:
        with pytest.raises(ValueError, match=f"^QUAT_direct: a fault must be in rounds 1 to 10, not {wrong}$"):
            verdicts(broken, [("fault", 0, 0, wrong, 0.5)])


@pytest.fixture(scope="module")
def quaternion(make_core, models, tmp_path_factory):
    core = make_core(main_module(QUATERNION_J3), QUATERNION_J3)
    return model_of(core, write_core(core, QUATERNION_J3, tmp_path_factory.mktemp("faults"), ""), models)


@pytest.mark.verilator
def test_faults_of_a_generated_core(quaternion):
    program = quaternion.core.engine.program
    memory = next(place.name for place in quaternion.places if place.kind == MEMORY)
    state, sign, late = program.state["e0"], program.format.width - 1, 0.99
    banks = verdicts(quaternion, [(memory, state + bank, sign, ROUND, late) for bank in (0, 1)])
    # One bank is the state, and its error remains until a reset; the other is written again.
    assert {(verdict.outcome, verdict.restored) for verdict in banks} == \
        {(Outcome.WRONG_SILENT, True), (Outcome.MASKED, True)}
    output, counter = verdicts(quaternion, [("engine.out_e0", 0, sign, ROUND, late), ("engine.left", 0, 1, ROUND, 0.4)])
    assert (output.outcome, output.restored, output.updates) == (Outcome.TRANSIENT, True, 1)
    # The body turns by less than 1e-2 rad in these rounds; with another sign of e0 it seems to have turned back.
    assert 0 < output.error < math.degrees(2e-2) / 0.01
    # The turn of the update that is refused is missing until a reset.
    assert (counter.outcome, counter.restored) == (Outcome.WRONG_FLAGGED, True)


def test_everything_that_a_core_stores(quaternion):
    program = quaternion.core.engine.program
    sizes = {(place.kind, place.rows, place.width) for place in quaternion.places if place.kind != REGISTER}
    assert (MEMORY, program.depth, program.format.width) in sizes
    assert {(rows, width) for kind, rows, width in sizes if kind == ROM} == {
        (program.length, program.layout.size), (len(program.constants), program.format.width)}
    names = [place.name for place in quaternion.places]
    assert len(set(names)) == len(names)
    assert {"engine.state", "engine.word", "engine.out_e0", "engine.adder.result"} <= {*names}


def test_registers_that_are_ports_get_a_variable():
    text = exposed(MODULE)
    assert "  output [31:0] out_e0;\n  reg [31:0] out_e0__register = 32'd0;\n" in text
    assert "  assign out_e0 = out_e0__register;\n" in text
    assert "out_e0__register <= wrong" in text
    assert "assign out_e2 = second;" in text
    assert [place.name for place in storage(text, "QUAT_direct")] == \
        [place.name for place in storage(MODULE, "QUAT_direct")]


ENGINE = """
module A_engine (
  input wire clk,
  output reg [3:0] number = 4'h1,
  output reg done = 1'b0
);

  // Registers.
  reg [4:0] word;
  reg state = 1'b0;

  // Combinational logic.
  reg choice;
  always @*
    choice = state <= word[0];

  always @(posedge clk)
    (* rom_style = "block" *)
    case (number)
      4'h0: word <= 5'h11;  // the first line
                            //   of two
      4'h1: word <= 5'h02;
      default: word <= 5'h00;
    endcase

  always @(posedge clk)
    if (state <= 1'b0)
      number <= {number[2:0], choice};
    else begin
      state <= 1'b1;
      done <= done;
    end
endmodule
"""


def test_a_case_becomes_a_memory():
    text = exposed(ENGINE)
    assert """  reg [4:0] word_rom [0:1];
  initial begin
    word_rom[0] = 5'h11;
    word_rom[1] = 5'h02;
  end
""" in text
    assert """    (* rom_style = "block" *)
    word <= word_rom[number__register];
""" in text
    assert "  output wire [3:0] number,\n  output wire done\n);" in text
    assert "  reg done__register = 1'b0;\n" in text
    assert [(place.kind, place.variable, place.rows, place.width) for place in storage(text, "A_engine")] == [
        (ROM, "word_rom", 2, 5), (REGISTER, "done__register", 1, 1), (REGISTER, "number__register", 1, 4),
        (REGISTER, "word", 1, 5), (REGISTER, "state", 1, 1)]
    # Tables of operators are logic.
    assert "case (number__register)" in exposed(ENGINE.replace("A_engine", "A_adder"))


def test_cores_that_cannot_be_judged(make_core, tmp_path):
    with pytest.raises(ValueError, match=r"^INS_atan has neither attitude nor position, by which faults are judged$"):
        FaultModel(make_core("INS_atan", THESIS), tmp_path, tmp_path)
    half = THESIS.replace(pool=Pool(format=BINARY16))
    with pytest.raises(ValueError, match=r"^INS_atan: faults are judged in binary32 and binary64, not binary16$"):
        FaultModel(make_core("INS_atan", half), tmp_path, tmp_path)
