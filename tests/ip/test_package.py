"""The package as a whole: its files, equal bytes, the command that writes it, and the driver as Vitis builds it."""

import re
import shutil
import subprocess
from xml.etree import ElementTree

import pytest
from click.testing import CliRunner
from lxml import etree

from strapdown.cli import main
from strapdown.cores import QUATERNION_J3, axi_core
from strapdown.ip import write_package
from strapdown.ip.scripts import tcl_word

from .packages import memory_map, schema

FILES = {
    "LICENSE", "README.md", "component.xml", "example.tcl", "fusesoc_generator.py", "generator.core", "ise.tcl",
    "package_ip.tcl", "strapdown.core", "bench/QUAT_direct_axi_tb.hex", "bench/QUAT_direct_axi_tb.v",
    "constraints/QUAT_direct_axi_ooc.xdc", "drivers/QUAT_direct_axi_v1_0/data/QUAT_direct_axi.mdd",
    "drivers/QUAT_direct_axi_v1_0/data/QUAT_direct_axi.tcl", "drivers/QUAT_direct_axi_v1_0/src/Makefile",
    "drivers/QUAT_direct_axi_v1_0/src/QUAT_direct_axi.h", "drivers/QUAT_direct_axi_v1_0/src/strapdown.c",
    "drivers/QUAT_direct_axi_v1_0/src/strapdown.h", "drivers/QUAT_direct_axi_v1_0/src/strapdown_registers.h",
    "doc/QUAT_direct_axi.md", "doc/QUAT_direct_axi.svg",
    "hdl/QUAT_direct_axi.json", "hdl/QUAT_direct_axi.v", "hdl/QUAT_direct_axi.vlt",
    "linux/QUAT_direct_axi.dtsi", "linux/strapdown_uio.c", "linux/strapdown_uio.h",
    "registers/QUAT_direct_axi.h", "registers/QUAT_direct_axi.md", "registers/QUAT_direct_axi.rdl",
    "registers/QUAT_direct_axi.xml", "registers/QUAT_direct_axi_map.py", "xgui/QUAT_direct_axi_v1_0.tcl"}


def contents(folder):
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_two_packages_have_equal_bytes(tmp_path):
    for name in "first", "second":
        write_package(axi_core(QUATERNION_J3), QUATERNION_J3, tmp_path / name, command="")
    first = contents(tmp_path / "first")
    assert set(first) == FILES
    assert contents(tmp_path / "second") == first
    assert [name for name, text in first.items() if not text.isascii() and not name.startswith("doc/")] == []


def test_memory_map_by_peakrdl(package):
    path = package.folder / package.places.peakrdl
    assert schema().validate(etree.parse(str(path))), schema().error_log
    assert memory_map(ElementTree.parse(path).getroot()) == memory_map(package.component)


@pytest.fixture
def run(tmp_path, monkeypatch):
    """The command in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return lambda *words: CliRunner().invoke(main, ["ip", *words])


def test_command_without_peakrdl_names_the_installation(run, tmp_path, monkeypatch):
    monkeypatch.setattr("strapdown.ip.peakrdl.installed", lambda: False)
    result = run("quaternion_j2", "--no-streams")
    assert (result.exit_code, result.stdout) == (0, "build/ip/quaternion_j2\n")
    assert result.stderr == "strapdown: without registers/*.xml, which PeakRDL makes: pip install 'strapdown[ip]'\n"
    assert [path.name for path in (tmp_path / "build").rglob("*.xml")] == ["component.xml"]
    verilog = (tmp_path / "build/ip/quaternion_j2/hdl/QUAT_direct_axi.v").read_text(encoding="utf-8")
    assert "// Command: strapdown ip quaternion_j2 --no-streams\n" in verilog


@pytest.mark.parametrize(("words", "message"), [
    (["optical_tcd1304"], "OPT_top has no equations of its own"),
    (["quaternion"], "no configuration is called 'quaternion'"),
    (["quaternion_j2", "--set", "clock_enable=true"], "clock_enable must be false"),
    (["quaternion_j2", "--set", "kp"], "--set takes FIELD=VALUE")])
def test_errors_of_the_command_are_one_line(run, words, message):
    result = run(*words)
    assert (result.exit_code, result.stdout) == (2, "")
    assert re.fullmatch(f"strapdown: .*{re.escape(message)}.*\n", result.stderr)


def test_a_place_that_cannot_be_written_is_one_line(run, tmp_path):
    (tmp_path / "file").touch()
    result = run("quaternion_j2", "--output", "file/inside")
    assert (result.exit_code, result.stderr) == (2, "strapdown: cannot write to file/inside: Not a directory\n")


def test_driver_is_built_into_a_library(package, tmp_path):
    """By the Makefile that Vitis calls, with the compiler of this machine."""
    if not (shutil.which("gcc") and shutil.which("make")):
        pytest.skip("gcc or make is missing: the driver is not built.")
    copied = package.copy(tmp_path)
    for folder in "lib", "include":
        (copied.folder / folder).mkdir()
    sources = copied.folder / copied.places.sources
    for target in "include", "libs":
        done = subprocess.run(["make", "COMPILER=gcc", "ARCHIVER=ar", target], cwd=sources, capture_output=True,
                              text=True, check=False)
        assert done.returncode == 0, done.stderr
    assert {path.name for path in (copied.folder / "include").iterdir()} == {
        "QUAT_direct_axi.h", "strapdown.h", "strapdown_registers.h"}
    members = subprocess.run(["ar", "t", "lib/libxil.a"], cwd=copied.folder, capture_output=True, text=True,
                             check=True).stdout
    assert members == "strapdown.o\n"


@pytest.mark.ip
@pytest.mark.parametrize("text", ["plain", 'a "quoted" [exit] $name {open \\ é', "}{"])
def test_any_text_is_one_word_of_tcl(text, tmp_path):
    (tmp_path / "words.tcl").write_text(f"puts [list {tcl_word(text)}]\nputs {tcl_word(text)}\n", encoding="utf-8")
    done = subprocess.run(["tclsh", "-encoding", "utf-8", "words.tcl"], cwd=tmp_path, capture_output=True, text=True,
                          check=True, encoding="utf-8")
    assert done.stdout.splitlines()[1] == text
