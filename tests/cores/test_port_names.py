"""The port names of the thesis's RTL: interfaces, netlists in Icarus, and parameters that stop every tool."""

import json
import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from strapdown.cli import main
from strapdown.cores import ATTITUDE_CORES, MAHONY, TEXT_PORTS, THESIS, THESIS_RTL_PORTS, Constant
from strapdown.export import verilog_text, write_core
from strapdown.export.constants import with_constants
from strapdown.kernel.system import leaves
from strapdown.tools import ToolError
from strapdown_lab.synthesis import ToolMissingError, run_yosys
from strapdown_sim.drivers.toolchain import (
    SimulatorMissingError,
    icarus_missing,
    run_tool,
    verilator_environment,
    verilator_root,
)

FOLDER = Path(__file__).parent
USERS = {TEXT_PORTS: FOLDER / "thesis_text_user.v", THESIS_RTL_PORTS: FOLDER / "thesis_rtl_user.v"}

RTL_PORTS = {
    "INS_acc": "clk rst in_acc_en in_accx in_accy in_accz in_c13 in_c23 in_c33 out_exa out_eya out_eza out_acc_finish",
    "INS_mag": "clk rst in_mag_en in_magx in_magy in_magz in_c11 in_c12 in_c13 in_c21 in_c22 in_c23 in_c31 in_c32 "
               "in_c33 out_exm out_eym out_ezm out_mag_finish",
    "INS_gyro": "clk rst in_gyro_en in_gyrox in_gyroy in_gyroz in_exa in_eya in_eza in_exm in_eym in_ezm in_exi in_eyi "
                "in_ezi out_exi out_eyi out_ezi out_wx out_wy out_wz out_gyro_finish",
    "INS_quat": "clk rst in_quat_en in_q0 in_q1 in_q2 in_q3 in_wx in_wy in_wz out_q0 out_q1 out_q2 out_q3 "
                "out_quat_finish",
    "INS_matx": "clk rst in_matx_en in_q0 in_q1 in_q2 in_q3 out_c11 out_c12 out_c13 out_c21 out_c22 out_c23 out_c31 "
                "out_c32 out_c33 out_matx_finish",
    "INS_euler": "clk rst in_euler_en in_c11 in_c12 in_c13 in_c23 in_c33 out_pitch out_roll out_yaw out_euler_finish",
    "INS_atan": "clk rst en a b result atan_finish",
    "INS_top": "clk rst in_accx in_accy in_accz in_gyrox in_gyroy in_gyroz in_magx in_magy in_magz in_data_en "
               "out_pitch out_roll out_yaw c_c11 c_c12 c_c13 c_c21 c_c22 c_c23 c_c31 c_c32 c_c33 out_INS_finish",
}
"""Ports in the RTL of the thesis."""

SINGLE = re.compile("clk|rst|en|in_.*_en|.*_finish")


@pytest.fixture(scope="module")
def written(make_core, tmp_path_factory):
    """Folder of all modules, for either names."""
    folders = {names: tmp_path_factory.mktemp(names.name) for names in USERS}
    for names, folder in folders.items():
        for module in ATTITUDE_CORES:
            write_core(make_core(module, THESIS, names), THESIS, folder, "")
    return folders


def sources(folder):
    return [folder / f"{module}.v" for module in ATTITUDE_CORES]


@pytest.mark.parametrize("module", RTL_PORTS)
def test_ports_are_those_of_the_rtl(make_core, written, module):
    assert set(RTL_PORTS) == set(ATTITUDE_CORES)
    core = make_core(module, THESIS, THESIS_RTL_PORTS)
    flows = {name: member.flow.name for name, member in core.signature.members.items()}
    assert flows == {name: "Out" if re.match("out_|c_|result|atan_", name) else "In"
                     for name in RTL_PORTS[module].split()}
    assert {len(getattr(core, name)) for name in flows if SINGLE.fullmatch(name)} == {1}
    assert {len(getattr(core, name)) for name in flows if not SINGLE.fullmatch(name)} == {32}
    description = json.loads((written[THESIS_RTL_PORTS] / f"{module}.json").read_text(encoding="utf-8"))
    assert [port["name"] for port in description["ports"]] == [port.name for port in core.ports]


def test_command_line(written, tmp_path, monkeypatch, make_core):
    monkeypatch.chdir(tmp_path)
    for ports, folder in ([], "thesis"), (["--ports", "thesis-rtl"], "thesis-thesis-rtl"):
        result = CliRunner().invoke(main, ["generate", "INS_quat", *ports])
        assert result.output == f"build/verilog/{folder}/INS_quat.v  {make_core('INS_quat', THESIS).latency} cycles\n"
        file = tmp_path / "build" / "verilog" / folder / "INS_quat.json"
        description = json.loads(file.read_text(encoding="utf-8"))
        command = shlex.join(["strapdown", "generate", "--config", "thesis", *ports, "--module", "INS_quat"])
        assert description["command_line"] == command
        assert [row["name"] for row in description.get("parameters", ())] == (["PERIOD", "HPERIOD"] if ports else [])


def test_parameters_are_constants_of_the_configuration(make_core):
    def parameters(module, config):
        return {constant.name: constant.digits for constant in make_core(module, config, THESIS_RTL_PORTS).constants}

    # As in the RTL: Kp 10, Ki 0.001; 0.002 s and half of it.
    assert parameters("INS_gyro", THESIS) == {"Kp": "41200000", "Ki": "3a83126f"}
    assert parameters("INS_quat", THESIS) == {"PERIOD": "3b03126f", "HPERIOD": "3a83126f"}
    assert parameters("INS_gyro", MAHONY) == {"Kp": "3f000000", "Ki": "00000000"}
    assert parameters("INS_top", THESIS) == {}
    assert make_core("INS_gyro", THESIS).constants == ()
    header = verilog_text(make_core("INS_quat", THESIS, THESIS_RTL_PORTS), THESIS).split("\nmodule ")[0]
    assert "// PARAMETERS\n//   PERIOD   32'h3b03126f  sample period, s: the field sample_rate_hz\n" in header


def test_a_parameter_is_declared_in_its_module_only():
    text = "module b (\n  input a\n);\nendmodule\nmodule bb(a);\n  input a;\nendmodule\n"
    constants = (Constant("N", 10, 6, ""),)
    assert with_constants(text, "b", ()) == text
    for module, other in ("b", "bb"), ("bb", "b"):
        changed = with_constants(text, module, constants)
        inside, outside = (re.search(rf"^module {name}\b.*?^endmodule", changed, re.MULTILINE | re.DOTALL)[0]
                           for name in (module, other))
        assert "parameter N = 6'h0a;" in inside
        assert outside in text


# In Icarus.

@pytest.mark.icarus
def test_both_netlists_compute_the_same_bits(make_core, written, tmp_path):
    if missing := icarus_missing():
        pytest.skip(missing)
    rng = np.random.default_rng(2015)
    data = "".join(f"{word:08x}" for word in rng.uniform(-1, 1, 16).astype(np.float32).view(np.uint32))
    lines = {}
    for names, folder in written.items():
        program = tmp_path / f"{names.name}.vvp"
        warnings = run_tool(["iverilog", "-g2001", "-Wall", "-Wno-timescale", "-s", "bench", "-o", program,
                             f"-DDATA=512'h{data}", FOLDER / "thesis_bench.v", USERS[names], *sources(folder)])
        assert warnings == ""
        lines[names] = run_tool(["vvp", "-n", program]).splitlines()
    assert lines[TEXT_PORTS] == lines[THESIS_RTL_PORTS]
    # INS_acc, INS_mag and INS_top start together, the others in a chain: INS_gyro follows INS_acc.
    takes = {module: make_core(module, THESIS).latency for module in ATTITUDE_CORES}
    due = {module: takes[module] for module in ("INS_acc", "INS_mag", "INS_top")}
    for module, after in zip(("INS_gyro", "INS_quat", "INS_matx", "INS_euler"),
                             ("INS_acc", "INS_gyro", "INS_quat", "INS_matx"), strict=True):
        due[module] = due[after] + 1 + takes[module]
    due["INS_atan"] = due["INS_matx"] + 1 + takes["INS_atan"]
    finished = {}
    for cycle, finish, results in map(str.split, lines[TEXT_PORTS]):
        assert re.fullmatch("[0-9a-f]{328}", results)
        finished |= {module: int(cycle) for module, bit in zip(ATTITUDE_CORES, reversed(finish), strict=True)
                     if bit == "1"}
    assert finished == due
    # Each finish shows other results, and none of them is left out.
    words = re.findall("[0-9a-f]{8}", results)
    assert "00000000" not in words
    assert len({line.split()[2] for line in lines[TEXT_PORTS]}) == len(lines[TEXT_PORTS])


@pytest.mark.icarus
def test_netlist_of_the_rtl_needs_its_names(written, tmp_path):
    if missing := icarus_missing():
        pytest.skip(missing)
    with pytest.raises(ToolError, match="port ``rst'' is not a port of"):
        run_tool(["iverilog", "-g2001", "-s", "user", "-o", tmp_path / "user.vvp", USERS[THESIS_RTL_PORTS],
                  *sources(written[TEXT_PORTS])])


WRONG = [("INS_gyro", "Kp", "32'h41200000", "32'h41200001", "INS_gyro_was_generated_for_Kp_41200000"),
         ("INS_gyro", "Ki", "32'h3A83126F", "0", "INS_gyro_was_generated_for_Ki_3a83126f"),
         ("INS_quat", "PERIOD", "32'h3B03126F", "0.002", "INS_quat_was_generated_for_PERIOD_3b03126f"),
         ("INS_quat", "HPERIOD", "32'h3A83126F", "32'h3CCCCCCD", "INS_quat_was_generated_for_HPERIOD_3a83126f")]


def instance(module, parameter, value):
    return f"module user; {module} #(.{parameter}({value})) instance_1 (); endmodule\n"


def icarus(directory):
    if missing := icarus_missing():
        pytest.skip(missing)
    run_tool(["iverilog", "-g2001", "-s", "user", "-o", "user.vvp", "user.v", "module.v"], directory=directory)


def verilator(directory):
    try:
        environment = verilator_environment()
    except SimulatorMissingError as error:
        pytest.skip(str(error))
    run_tool([verilator_root() / "bin" / "verilator", "--lint-only", "-Wno-fatal", "--top-module", "user", "user.v",
              "module.v"], environment=environment, directory=directory)


def yosys(directory):
    try:
        run_yosys("read_verilog user.v module.v; hierarchy -check -top user", directory)
    except ToolMissingError as error:
        pytest.skip(str(error))


@pytest.mark.parametrize(("tool", "cases"), [(icarus, WRONG), (verilator, WRONG), (yosys, WRONG[:1])],
                         ids=["icarus", "verilator", "yosys"])
def test_another_parameter_stops_a_tool(written, tmp_path, tool, cases):
    for module, parameter, right, wrong, message in cases:
        shutil.copyfile(written[THESIS_RTL_PORTS] / f"{module}.v", tmp_path / "module.v")
        (tmp_path / "user.v").write_text(instance(module, parameter, right), encoding="utf-8")
        tool(tmp_path)
        (tmp_path / "user.v").write_text(instance(module, parameter, wrong), encoding="utf-8")
        with pytest.raises(ToolError, match=message):
            tool(tmp_path)


# Errors.

MODULES = "INS_acc, INS_mag, INS_gyro, INS_quat, INS_matx, INS_euler, INS_atan, INS_top"


@pytest.mark.parametrize(("arguments", "message"), [
    (["--config", "flight"], f"the ports thesis-rtl exist for {MODULES}, not for INS_flight"),
    (["--config", "thesis_x8"], f"the ports thesis-rtl exist for {MODULES}, not for INS_top_x8"),
    (["INS_gyro", "--set", "inputs=kp"], "the ports thesis-rtl have no parameters: leave inputs empty"),
    (["INS_atan", "--set", "clock_enable=true"],
     "the ports thesis-rtl have no clock enable: leave clock_enable at False"),
])
def test_cores_without_such_ports_are_refused(tmp_path, arguments, message):
    command = ["generate", *arguments, "--ports", "thesis-rtl", "--output", str(tmp_path / "out")]
    result = CliRunner().invoke(main, command)
    assert (result.exit_code, result.stderr) == (2, f"strapdown: {message}\n")
    assert not (tmp_path / "out").exists()


def test_a_port_that_does_not_exist_cannot_be_renamed():
    system = ATTITUDE_CORES["INS_atan"](THESIS)
    with pytest.raises(ValueError, match=r"^INS_atan has no port 'in_c'$"):
        system.renamed({"in_c": "c"})
    with pytest.raises(ValueError, match=r"^INS_atan has two ports called 'in_b'$"):
        system.renamed({"in_a": "in_b"})
    assert leaves(system.renamed({"in_a": "a"}).inputs) == ["a", "in_b"]
