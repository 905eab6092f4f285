import json
import os
import re
import subprocess
import sys
from collections import Counter

import pytest

from strapdown.algorithms.attitude import Update
from strapdown.cores import ATTITUDE_CORES, CONFIGS, MAHONY, SINS, THESIS, Core, main_module, uart_core
from strapdown.cores.operators import VENDOR_OPERATORS, VendorOperator
from strapdown.export import verilog_text, write, write_core
from strapdown.export.keywords import KEYWORDS
from strapdown.kernel.operators import Adder, Selector
from strapdown.kernel.pool import Pool
from strapdown.kernel.system import System
from strapdown_sim.drivers.toolchain import icarus_missing, run_tool, verilator_environment, verilator_root

DECLARED = re.compile(r"^ +(?:(?:input|output) )?(?:wire|reg) (?:\[\d+:0\] )?(\w+)", re.MULTILINE)
"""The name in each declaration."""


@pytest.fixture(scope="module")
def folder(make_core, tmp_path_factory):
    """All modules of configuration thesis, written like `make verilog`."""
    folder = tmp_path_factory.mktemp("thesis")
    for name in ATTITUDE_CORES:
        write_core(make_core(name, THESIS), THESIS, folder, f"strapdown generate --config thesis --module {name}")
    return folder


@pytest.mark.parametrize("name", ATTITUDE_CORES)
def test_file_is_self_contained_verilog_2001(folder, name):
    if missing := icarus_missing():
        pytest.skip(missing)
    warnings = run_tool(["iverilog", "-g2001", "-Wall", "-Wno-timescale", "-s", name, "-o", folder / f"{name}.vvp",
                         folder / f"{name}.v"])
    assert warnings == ""


@pytest.mark.parametrize("name", ATTITUDE_CORES)
def test_verilator_reads_it_as_verilog_2001_and_as_systemverilog(folder, name):
    for language in "1364-2001", "1800-2017":
        run_tool([verilator_root() / "bin" / "verilator", "--lint-only", "-Wno-fatal", "--default-language", language,
                  "--top-module", name, folder / f"{name}.v"], environment=verilator_environment())


def test_all_modules_go_into_one_project(folder):
    if missing := icarus_missing():
        pytest.skip(missing)
    run_tool(["iverilog", "-g2001", "-o", folder / "all.vvp", *sorted(folder.glob("*.v"))])


@pytest.mark.parametrize("name", ATTITUDE_CORES)
def test_names_are_plain(folder, name):
    code = re.sub(r"//.*", "", (folder / f"{name}.v").read_text(encoding="utf-8"))
    assert "\\" not in code
    assert "$" not in code.replace("$signed(", "")
    # Attributes tell what a memory is made of, which registers sample the reset, and which codes of a state are to
    # stay: Vivado, ISE and Yosys know these.
    assert set(re.findall(r"\(\*.*?\*\)", code)) <= {
        '(* rom_style = "block" *)', '(* ASYNC_REG = "TRUE" *)',
        '(* fsm_encoding = "none" *)'}
    declared = set(DECLARED.findall(code))
    assert declared
    assert not declared & KEYWORDS
    modules = re.findall(r"^module (\w+)", code, re.MULTILINE)
    assert modules[0] == name
    assert all(module.startswith(f"{name}_") for module in modules[1:])


@pytest.mark.parametrize("name", ATTITUDE_CORES)
def test_file_is_ascii(folder, name):
    assert (folder / f"{name}.v").read_text(encoding="utf-8").isascii()


@pytest.mark.parametrize("name", ATTITUDE_CORES)
def test_nothing_is_declared_and_never_read(folder, name):
    code = re.sub(r"//.*", "", (folder / f"{name}.v").read_text(encoding="utf-8"))
    for module in code.split("endmodule")[:-1]:
        inner = module.partition("\n);")[2]
        for wire in DECLARED.findall(inner):
            assigned = re.findall(rf"^ +(?:[\w', ]+: |initial )?{wire}(?:\[[^]]*\])? <?= ", inner, re.MULTILINE)
            assert len(re.findall(rf"(?<!\.)\b{wire}\b", inner)) > 1 + len(assigned), wire


ALL = [(config, main_module(config)) for config in CONFIGS.values()]


@pytest.fixture(scope="module", params=[*ALL, "link", *VENDOR_OPERATORS],
                ids=[*(config.name for config, _ in ALL), "link", *VENDOR_OPERATORS])
def text(request, text_of):
    """The Verilog of the main module of a configuration, of the serial link, or of an operator."""
    if request.param == "link":
        return verilog_text(uart_core(SINS, clock_hz=100e6, baud_rate=921600))
    if isinstance(request.param, str):
        return verilog_text(VendorOperator(request.param))
    config, module = request.param
    return text_of(module, config)


def test_a_text_that_was_written_before_is_of_the_same_operators(text_of, make_core):
    """What other tests take, for configurations that differ in an operator only."""
    for config in (THESIS, THESIS.replace(adder_latency=3)):
        assert text_of("INS_acc", config) == verilog_text(make_core("INS_acc", config), config)


def test_most_names_say_something(text):
    names = DECLARED.findall(text)
    assert sum(bool(re.fullmatch(r"n\d+", name)) for name in names) < 0.2 * len(names)


def test_lines_are_short(text):
    assert max(map(len, text.splitlines())) < 160


def test_no_two_wires_are_the_same(text):
    for module in re.sub(r"//.*", "", text).split("endmodule"):
        sides = Counter(re.findall(r"^  (?:assign|wire)[^=]* = (.*?);", re.sub(r"\n {6,}", " ", module), re.MULTILINE))
        assert [side for side, count in sides.items() if count > 1] == []


@pytest.mark.parametrize("name", ATTITUDE_CORES)
def test_nothing_names_the_machine(folder, name):
    for suffix in ".v", ".json":
        text = (folder / f"{name}{suffix}").read_text(encoding="utf-8")
        assert not re.search(r"(^|[\s\"'(])/[a-z]+/", text)
        assert str(folder) not in text


def test_two_runs_give_equal_bytes(folder, tmp_path):
    # A second process with another hash seed: no order may depend on a hash.
    script = ("import sys; from pathlib import Path; from strapdown.cli import main;"
              "main(['generate', '--module', 'INS_top', '--module', 'INS_mag', '--output', sys.argv[1]])")
    subprocess.run([sys.executable, "-c", script, str(tmp_path)], check=True, stdout=subprocess.DEVNULL,
                   env=os.environ | {"PYTHONHASHSEED": "42"})
    for name in "INS_top", "INS_mag":
        for suffix in ".v", ".json":
            assert (tmp_path / f"{name}{suffix}").read_bytes() == (folder / f"{name}{suffix}").read_bytes()


def test_header_tells_equation_configuration_latency_and_program(folder, make_core):
    core = make_core("INS_top", THESIS)
    header = (folder / "INS_top.v").read_text(encoding="utf-8").split("\nmodule ")[0]
    assert "corrections: Both error vectors" in header
    assert re.search(r"kp +10\.0", header)
    assert f"rises {core.latency} cycles later" in header
    assert re.search(r"algorithms/attitude\.py:\d+ corrections", header)
    listed = [line for line in header.splitlines() if re.match(r"//\s+\d+ .*(\||:=|: )", line)]
    assert len(listed) > core.engine.program.length / 2


def test_description_tells_ports_latency_configuration_versions_and_command(folder, make_core):
    core = make_core("INS_top", THESIS)
    text = json.loads((folder / "INS_top.json").read_text(encoding="utf-8"))
    assert text["latency_cycles"] == core.latency
    assert text["configuration"]["kp"] == 10
    assert text["command_line"] == "strapdown generate --config thesis --module INS_top"
    assert set(text["versions"]) == {"strapdown", "amaranth"}
    verilog = (folder / "INS_top.v").read_text(encoding="utf-8")
    declared = re.search(r"^module INS_top \((.*?)\n\);", verilog, re.MULTILINE | re.DOTALL)[1]
    found = re.findall(r"^  (input|output) (?:wire|reg) (?:\[(\d+):0\] )?(\w+)(?: = \S+)?$", declared.replace(",", ""),
                       re.MULTILINE)
    assert sorted((port["direction"], port["width"], port["name"]) for port in text["ports"]) \
        == sorted((direction, int(high or 0) + 1, name) for direction, high, name in found)
    assert len(found) == declared.count(",") + 1
    assert all(port["meaning"] for port in text["ports"])


@pytest.mark.icarus
def test_word_holds_the_line_that_the_header_says(folder, make_core, tmp_path):
    if missing := icarus_missing():
        pytest.skip(missing)
    assert "engine.word holds the line of the microprogram whose number is engine.cycle - 2" in re.sub(
        r"\n// +", " ", (folder / "INS_atan.v").read_text(encoding="utf-8"))
    system, program = make_core("INS_atan", THESIS).system, make_core("INS_atan", THESIS).engine.program
    (tmp_path / "bench.v").write_text((folder / "INS_atan.v").read_text(encoding="utf-8") + f"""
module bench;
  reg clk = 0, start = 0;
  INS_atan dut(.clk(clk), .rst_n(1'b1), .{system.start}(start));
  always #1 clk = ~clk;
  initial begin
    #20 start = 1;
    #2 start = 0;
    repeat ({program.length}) #2 if (dut.engine.cycle > 1)
      $display("%0d %h %h", dut.engine.cycle, dut.engine.word, dut.engine.next_word);
    $finish;
  end
endmodule
""", encoding="utf-8")
    run_tool(["iverilog", "-g2001", "-s", "bench", "-o", tmp_path / "bench.vvp", tmp_path / "bench.v"])
    rows = [line.split() for line in run_tool(["vvp", "-n", tmp_path / "bench.vvp"]).splitlines() if line[0].isdigit()]
    seen = [(int(cycle), int(word, 16), int(next_word, 16)) for cycle, word, next_word in rows]
    # After the last line the ROM gives zeros.
    lines = [*(program.layout.const(word).as_bits() for word in program.words), 0]
    assert len(seen) > program.length / 2
    assert [(word, next_word) for _, word, next_word in seen] == [
        (lines[cycle - 2], lines[cycle - 1]) for cycle, _, _ in seen]


def test_configuration_is_in_the_file(folder, make_core):
    assert (folder / "INS_mag.v").read_text(encoding="utf-8") != verilog_text(make_core("INS_mag", MAHONY), MAHONY)


def body(text):
    return re.sub(r"^//.*\n", "", text, flags=re.MULTILINE)


STRANGE = ("Höhe 😀 ω", "ends with \\", "a\nmodule live;\nendmodule", "a\rb\vc\fd\x1ce\x85f\u2028wire live;",
           "\x1b[31mred\x00")
"""Texts that must not harm the file: an umlaut, an emoji, line breaks of all kinds, control characters."""


@pytest.mark.parametrize("text", STRANGE)
def test_no_text_gets_out_of_the_header(make_core, text, tmp_path):
    config = THESIS.model_copy(update={"description": text})
    path = write_core(make_core("INS_atan", THESIS), config, tmp_path, f"strapdown generate --set 'description={text}'")
    written = path.read_bytes()
    assert all(byte == 10 or 32 <= byte < 127 for byte in written)
    header, _, rest = written.decode("ascii").partition("\nmodule ")
    assert all(line.startswith("//") for line in header.splitlines() if line)
    assert "module " + rest == body(verilog_text(make_core("INS_atan", THESIS), THESIS)).lstrip("\n")
    run_tool([verilator_root() / "bin" / "verilator", "--lint-only", "-Wno-fatal", "--top-module", "INS_atan", path],
             environment=verilator_environment())
    if not icarus_missing():
        run_tool(["iverilog", "-g2001", "-o", tmp_path / "out.vvp", path])


def test_letters_outside_ascii_become_plain_letters_or_escapes(make_core):
    config = THESIS.model_copy(update={"description": "Höhe 😀, 90°, γs − Δθ₁ of Φ, 2²³"})
    text = verilog_text(make_core("INS_atan", THESIS), config)
    assert "configuration thesis (Hohe \\U0001f600, 90 deg, gamma_s - Delta_theta_1 of Phi, 2^23)." in text


def test_header_tells_licence_versions_and_command(folder):
    header = (folder / "INS_mag.v").read_text(encoding="utf-8").split("\nmodule ")[0]
    facts = json.loads((folder / "INS_mag.json").read_text(encoding="utf-8"))
    assert "\n// SPDX-License-Identifier: BSD-2-Clause\n" in header
    assert f"\n// Command: {facts['command_line']}\n" in header
    for name, number in facts["versions"].items():
        assert f"{name} {number}" in header


def written_out(xp, a):
    return Update({"y": a + a})


def documented(xp, a):
    """y = 2 a"""


@pytest.mark.parametrize(("kernels", "expected"), [
    ((), ["   def written_out(xp, a):", '       return Update({"y": a + a})']),
    ((documented,), ["   documented: y = 2 a"]),
    ((eval("lambda xp, a: a"),), ["   <lambda>: see the microprogram below"]),
])
def test_equations_are_never_empty(kernels, expected):
    system = System("sum", "a title", written_out, kernels=kernels, inputs={"a": "a"}, outputs={"y": "y"},
                    sections=("Y",), start="start", finish="finish")
    header = verilog_text(Core(system, Pool(operators=(Adder(), Selector())))).split("\nmodule ")[0]
    assert header.split("\n// EQUATIONS\n")[1].split("\n//\n")[0].splitlines() == [f"//{line}" for line in expected]


def test_files_of_before_stay_if_writing_fails(make_core, tmp_path, monkeypatch):
    core = make_core("INS_atan", THESIS)
    write(core, tmp_path, command="first", config=THESIS)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(ValueError, match="JSON"):
        write(core, tmp_path, command="second", config=THESIS.model_copy(update={"kp": float("nan")}))
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
