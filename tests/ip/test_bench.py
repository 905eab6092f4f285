"""The self-checking bench of a package, in simulators, from the folder of the package alone."""

import subprocess

import pytest

from strapdown.ip.vectors import STREAM, UPDATES, Op
from strapdown_sim.drivers.toolchain import icarus_missing, run_tool, verilator_environment, verilator_root

PASS = f"PASS: {UPDATES} updates equal the software twin in every bit"


def in_icarus(package):
    """Exit status and lines of the bench in Icarus Verilog."""
    if missing := icarus_missing():
        pytest.skip(missing)
    places = package.places
    run_tool(["iverilog", "-g2001", "-Wall", "-Wno-timescale", "-o", "tb", places.verilog, places.bench],
             directory=package.folder)
    done = subprocess.run(["vvp", "-N", "tb"], cwd=package.folder, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout.splitlines()


@pytest.mark.icarus
@pytest.mark.parametrize(("name", "options"), [
    ("quaternion_j3", {}),
    pytest.param("quaternion_j3", {"streams": False, "error_response": "okay"}, marks=pytest.mark.ip),
    *(pytest.param(name, {}, marks=pytest.mark.ip) for name in ("thesis", "thesis_x8", "flight", "sins"))])
def test_bench_passes_in_icarus(packages, name, options):
    assert in_icarus(packages(name, **options)) == (0, [PASS])


@pytest.mark.verilator
def test_bench_in_verilator(package, tmp_path):
    """It passes, and it fails with other vectors."""
    places = package.places
    run_tool([verilator_root() / "bin" / "verilator", "--binary", "--timing", "--quiet", "-Wno-fatal",
              "--output-split", "0", "-CFLAGS", "-fcoroutines -O0", "--Mdir", "verilated",
              "--top-module", f"{places.name}_tb", places.lint, places.verilog, places.bench],
             directory=package.folder, environment=verilator_environment())
    program = package.folder / "verilated" / f"V{places.name}_tb"
    assert run_tool([program], directory=package.folder).splitlines()[0] == PASS
    _, lines = flipped(package)
    (tmp_path / "other.hex").write_text(lines, encoding="utf-8")
    done = subprocess.run([program, "+vectors=other.hex"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert done.stdout.startswith("FAIL: update 7, ")


def flipped(package):
    """The expected bits of the first output of the seventh update, and the vectors with one of these bits flipped."""
    address = package.top.component.table.outputs[0].registers[0].address
    lines = (package.folder / package.places.vectors).read_text(encoding="utf-8").splitlines()
    index = [index for index, line in enumerate(lines) if line.startswith(f"{Op.READ:02x}{address:04x}")][6]
    right = int(lines[index][6:14], 16)
    lines[index] = f"{lines[index][:6]}{right ^ 0x100:08x}{lines[index][14:]}"
    return right, "\n".join(lines) + "\n"


@pytest.mark.icarus
def test_a_flipped_bit_of_an_output_is_the_first_difference(package, tmp_path):
    changed = package.copy(tmp_path)
    right, lines = flipped(package)
    (changed.folder / package.places.vectors).write_text(lines, encoding="utf-8")
    register = package.top.component.table.outputs[0].registers[0]
    assert in_icarus(changed) == (1, [
        f"FAIL: update 7, {register.name} (address {register.address:04x}): {right:08x} instead of "
        f"{right ^ 0x100:08x}, answer 0"])


FAULTS = {
    "m_axis_tdata": ("[31:0] ", "^ 32'h1", f"FAIL: update {STREAM}, OUT_E0 "),
    "m_axis_tlast": ("", "& 1'b0", f"FAIL: update {UPDATES}, SNAPSHOT_STATUS (address 0034): wrong TLAST"),
    "s_axi_rdata": ("[31:0] ", "^ 32'h80000000", "FAIL: update 0, IDENTITY "),
    "s_axi_rresp": ("[1:0] ", "& 2'd0", "FAIL: update 0, no register "),
    "s_axi_bvalid": ("", "& 1'b0", "FAIL: update 0, SCRATCH (address 000c): no answer in "),
    "irq": ("", "& 1'b0", "FAIL: update 1, INTERRUPT_FLAGS (address 001c): no answer in "),
}
"""Faults at ports of the core: range and fault of the port, and what the bench prints."""


@pytest.mark.icarus
@pytest.mark.parametrize("port", FAULTS)
def test_faults_at_the_ports_are_found(package, port, tmp_path):
    bits, fault, message = FAULTS[port]
    changed = package.copy(tmp_path)
    bench = changed.places.bench
    changed.change(bench, f"  wire {bits}{port};", f"  wire {bits}right;\n  wire {bits}{port} = right {fault};")
    changed.change(bench, f".{port}({port})", f".{port}(right)")
    status, (printed,) = in_icarus(changed)
    assert status == 1
    assert printed.startswith(message)


@pytest.mark.icarus
def test_bench_without_vectors_fails(package, tmp_path):
    changed = package.copy(tmp_path)
    (changed.folder / package.places.vectors).unlink()
    status, printed = in_icarus(changed)
    assert status == 1
    assert printed[-1].startswith("FAIL: ")
