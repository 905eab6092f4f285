"""The operators under the vendor cores' names; RTL in the style of the thesis instantiates all ten."""

import json
import os
import re
import subprocess
import sys
from collections import deque
from pathlib import Path

import numpy as np
import pytest
from amaranth.lib.wiring import In
from click.testing import CliRunner

from strapdown.cli import main
from strapdown.cores.operators import VENDOR_OPERATORS, VendorOperator
from strapdown.export import verilog_text
from strapdown_sim.drivers.toolchain import SimulatorMissingError, icarus_missing, run_tool
from strapdown_sim.drivers.verilated import Interface, VerilatedModel

SEED = 20150601
ROWS = 4000

# The thesis's latencies, with the default for atan; the least; others, with fewer and more register ranks.
LATENCIES = {
    "default": {"add": 11, "sub": 11, "mult": 6, "div": 28, "sqrt": 28, "equl": 2, "less": 2, "fl32tofi16": 6,
                "fi16tofl32": 6, "atan": 20},
    "least": {"add": 1, "sub": 1, "mult": 1, "div": 3, "sqrt": 3, "equl": 1, "less": 1, "fl32tofi16": 1,
              "fi16tofl32": 1, "atan": 1},
    "other": {"add": 4, "sub": 17, "mult": 9, "div": 10, "sqrt": 31, "equl": 5, "less": 3, "fl32tofi16": 2,
              "fi16tofl32": 4, "atan": 7},
}

CONTROL = {"clk": ("input", 1), "sclr": ("input", 1), "ce": ("input", 1), "rdy": ("output", 1)}
FLOATS = {"operation_nd": ("input", 1), **CONTROL, "a": ("input", 32)}
PORTS = {
    **dict.fromkeys(("add", "sub", "mult", "div"), FLOATS | {"b": ("input", 32), "result": ("output", 32)}),
    **dict.fromkeys(("equl", "less"), FLOATS | {"b": ("input", 32), "result": ("output", 1)}),
    "sqrt": FLOATS | {"result": ("output", 32)},
    "fl32tofi16": FLOATS | {"result": ("output", 16)},
    "fi16tofl32": FLOATS | {"a": ("input", 16), "result": ("output", 32)},
    "atan": {"nd": ("input", 1), **CONTROL, "x_in": ("input", 16), "y_in": ("input", 16), "phase_out": ("output", 16)},
}

USER_RTL = Path(__file__).with_name("operators_user.v")
BENCH = Path(__file__).with_name("operators_bench.v")


def cli(*arguments):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The ten files, as `strapdown operators` writes them."""
    folder = tmp_path_factory.mktemp("operators")
    result = cli("operators", folder)
    assert result.exit_code == 0, result.output
    return folder


@pytest.fixture(scope="module", params=LATENCIES)
def bank(request, folder, tmp_path_factory, models):
    """Latencies, and the user's module with all ten operators as a function."""
    latencies = LATENCIES[request.param]
    if request.param != "default":
        folder = tmp_path_factory.mktemp(request.param)
        options = [option for name, latency in latencies.items() for option in ("--latency", f"{name}={latency}")]
        assert cli("operators", folder, *options).exit_code == 0
        command = json.loads((folder / "add.json").read_text(encoding="utf-8"))["command_line"]
        assert command == f"strapdown operators DIRECTORY --latency add={latencies['add']}"
    source = folder / "user_and_operators.sv"
    files = USER_RTL, *(folder / f"{name}.v" for name in VENDOR_OPERATORS)
    source.write_text("".join(file.read_text(encoding="utf-8") for file in files), encoding="utf-8")
    interface = Interface(
        "user", ("nd", "ce", "sclr", "a", "b", "fixed", "x", "y"),
        tuple(f"{name}_{port}" for name in VENDOR_OPERATORS for port in ("rdy", "out")), reset="")
    try:
        return latencies, VerilatedModel(source, interface, models)
    except SimulatorMissingError as error:
        pytest.skip(str(error))


def stimulus(rows):
    """Operands as encodings: all of binary32, close pairs, specials, subnormals; short and long vectors."""
    rng = np.random.default_rng(SEED)
    specials = np.array([0, 1, 0x7FFFFF, 0x800000, 0x800001, 0x3F7FFFFF, 0x3F800000, 0x3F800001, 0x3FFFFE00, 0x40000000,
                         0x7F7FFFFF, 0x7F800000, 0x7F800001, 0x7FC00000, 0x7FFFFFFF], dtype=np.uint32)
    signed_specials = np.concatenate([specials, specials | np.uint32(1 << 31)])
    a, b = (rng.integers(0, 1 << 32, rows, dtype=np.uint32) for _ in range(2))
    # Exponents around 1, so that sums cancel and conversions stay in range.
    near = np.arange(rows) % 2 == 0
    exponents = rng.integers(110, 130, (2, rows), dtype=np.uint32)
    a, b = (np.where(near, bits & 0x807FFFFF | exponent << 23, bits)
            for bits, exponent in zip((a, b), exponents, strict=True))
    b = np.where(rng.random(rows) < 0.05, a ^ rng.integers(0, 2, rows, dtype=np.uint32) << 31, b)
    # Products and quotients around the least normal number.
    tiny = rng.random(rows) < 0.05
    a = np.where(tiny, a & 0x807FFFFF | 64 << 23, a)
    b = np.where(tiny, b & 0x807FFFFF | rng.choice([62, 63, 190, 191], rows).astype(np.uint32) << 23, b)
    count = len(signed_specials)
    a[:count * count] = np.repeat(signed_specials, count)
    b[:count * count] = np.tile(signed_specials, count)
    order = rng.permutation(rows)
    shorts = [rng.integers(-1 << 15, 1 << 15, rows) >> rng.integers(0, 16, rows) for _ in range(3)]
    fixed, x, y = ((values & 0xFFFF).astype(np.uint16) for values in shorts)
    return {"a": a[order], "b": b[order], "fixed": fixed, "x": x, "y": y}


def operands(name, rows):
    """Operands for ``compute`` from encodings."""
    if name == "atan":
        return rows["x"].view(np.int16), rows["y"].view(np.int16)
    if name == "fi16tofl32":
        return (rows["fixed"].view(np.int16),)
    return tuple(rows[port].view(np.float32) for port in ("a", "b")[:len(VENDOR_OPERATORS[name].operands)])


def encoded(name, results):
    """Encodings of the results of ``compute``."""
    if VENDOR_OPERATORS[name].result.width == 32:
        assert results.dtype == np.float32
        return results.view(np.uint32).astype(np.uint64)
    return results.astype(np.int64).astype(np.uint64) & np.uint64((1 << VENDOR_OPERATORS[name].result.width) - 1)


def computed(name, rows, **options):
    return encoded(name, VendorOperator(name, **options).compute(*operands(name, rows)))


def expected(name, rows):
    """Encodings of the results from NumPy's float64; the second rounding does not change them."""
    if name == "fi16tofl32":
        return (rows["fixed"].view(np.int16) / np.float32(8192)).view(np.uint32).astype(np.uint64)
    with np.errstate(all="ignore"):
        a, b = (rows[port].view(np.float32).astype(np.float64) for port in ("a", "b"))
        a, b = (np.where(np.abs(value) < 2.0 ** -126, np.copysign(0, value), value) for value in (a, b))
        if name in ("equl", "less"):
            return (a == b if name == "equl" else a < b).astype(np.uint64)
        if name == "fl32tofi16":
            fixed = np.where(np.isnan(a), -32768, np.clip(np.rint(a * 2 ** 14), -32768, 32767))
            return fixed.astype(np.int64).astype(np.uint64) & np.uint64(0xFFFF)
        exact = {"add": lambda: a + b, "sub": lambda: a - b, "mult": lambda: a * b, "div": lambda: a / b,
                 "sqrt": lambda: np.sqrt(a)}[name]()
        result = np.where(np.abs(exact) < 2.0 ** -126, np.copysign(0, exact), exact).astype(np.float32)
    return np.where(np.isnan(result), np.uint32(0xFFC00000), result.view(np.uint32)).astype(np.uint64)


# Ports and files.

@pytest.mark.parametrize("name", PORTS)
def test_ports_are_those_of_the_vendor_core(folder, name):
    assert set(PORTS) == set(VENDOR_OPERATORS)
    members = VendorOperator(name).signature.members
    assert {port: ("input" if member.flow is In else "output", member.shape) for port, member in members.items()} \
        == PORTS[name]
    text = (folder / f"{name}.v").read_text(encoding="utf-8")
    head = re.search(rf"^module {name} \((.*?)\n\);", text, re.MULTILINE | re.DOTALL)[1]
    declared = re.findall(r"^  (input|output) (?:wire|reg) (?:\[(\d+):0\] )?(\w+)", head, re.MULTILINE)
    assert {port: (flow, int(high or 0) + 1) for flow, high, port in declared} == PORTS[name]
    assert len(declared) == head.count(",") + 1


@pytest.mark.parametrize("name", ["equl", "less"])
@pytest.mark.parametrize("latency", [2, 5])
def test_a_bit_of_result_is_a_vector_of_one(name, latency):
    top = verilog_text(VendorOperator(name, latency=latency)).split("endmodule")[0]
    assert re.search(r"^  output (wire|reg) \[0:0\] result\b", top, re.MULTILINE)


def test_folder_holds_ten_files_with_descriptions(folder):
    names = {path.name for path in folder.iterdir() if path.suffix in (".v", ".json")}
    assert names == {f"{name}{suffix}" for name in PORTS for suffix in (".v", ".json")}
    for name, ports in PORTS.items():
        text = json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))
        assert text["module"] == name
        assert text["latency_cycles"] == LATENCIES["default"][name]
        assert {port["name"]: (port["direction"], port["width"]) for port in text["ports"]} == ports
        assert all(port["meaning"] for port in text["ports"])
        assert text["command_line"] == "strapdown operators DIRECTORY"
        header = (folder / f"{name}.v").read_text(encoding="utf-8").split("\nmodule ")[0]
        assert header.isascii()
        assert f"result {text['latency_cycles']} edges" in re.sub(r"\n//\s+", " ", header)


def test_two_runs_give_equal_bytes(folder, tmp_path):
    # A second process with another hash seed: no order may depend on a hash.
    names = ("add", "less", "atan")
    script = ("import sys; from pathlib import Path; from strapdown.export import write;"
              "from strapdown.cores.operators import VendorOperator\n"
              "for name in sys.argv[2:]: write(VendorOperator(name), Path(sys.argv[1]), command="
              "'strapdown operators DIRECTORY')")
    subprocess.run([sys.executable, "-c", script, str(tmp_path), *names], check=True,
                   env=os.environ | {"PYTHONHASHSEED": "42"})
    for name in names:
        for suffix in ".v", ".json":
            assert (tmp_path / f"{name}{suffix}").read_bytes() == (folder / f"{name}{suffix}").read_bytes()


def test_table_in_the_documents(root):
    """docs/operators.md lists every operator with its latencies."""
    text = (root / "docs" / "operators.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \|.*\| (\d+) \| (\d+) \| (\d+) \|$", text, re.MULTILINE)
    assert [(name, *map(int, numbers)) for name, *numbers in rows] == [
        (kind.name, kind.latency, kind.least_latency, VendorOperator(kind.name).extra_ranks)
        for kind in VENDOR_OPERATORS.values()]


# Results.

@pytest.mark.parametrize("name", [name for name in PORTS if name != "atan"])
def test_twin_agrees_with_numpy(name):
    rows = stimulus(ROWS)
    np.testing.assert_array_equal(computed(name, rows), expected(name, rows))


# Timing.

@pytest.mark.verilator
def test_one_operation_takes_exactly_its_latency(bank):
    latencies, model = bank
    rows = {name: values[:100] for name, values in stimulus(ROWS).items()}
    nd = np.zeros(100)
    nd[[3, 40]] = 1
    answer = model.stream({"nd": nd, "ce": np.ones(100), **rows})
    for name, latency in latencies.items():
        ready = [cycle + latency for cycle in (3, 40)]
        assert np.flatnonzero(answer[f"{name}_rdy"]).tolist() == ready, name
        wanted = computed(name, rows, latency=latency)
        np.testing.assert_array_equal(answer[f"{name}_out"][ready], wanted[[3, 40]], err_msg=name)


@pytest.mark.verilator
def test_one_operation_a_cycle(bank):
    latencies, model = bank
    rows = stimulus(ROWS)
    answer = model.stream({"nd": np.ones(ROWS), "ce": np.ones(ROWS), **rows})
    for name, latency in latencies.items():
        np.testing.assert_array_equal(answer[f"{name}_rdy"], np.arange(ROWS) >= latency, err_msg=name)
        wanted = computed(name, rows, latency=latency)
        np.testing.assert_array_equal(answer[f"{name}_out"][latency:], wanted[:-latency], err_msg=name)


@pytest.mark.verilator
def test_stalls_and_clears(bank):
    """Against a model queue: ce advances it; sclr cancels the operations, with ce high or low, and advances nothing."""
    latencies, model = bank
    rng = np.random.default_rng(SEED)
    rows = stimulus(ROWS)
    nd, ce = (rng.random(ROWS) < share for share in (0.7, 0.75))
    sclr = rng.random(ROWS) < 0.02
    assert (sclr & ~ce).any()
    assert (sclr & ce & nd).any()
    answer = model.stream({"nd": nd, "ce": ce, "sclr": sclr, **rows})
    for name, latency in latencies.items():
        ready, result = answer[f"{name}_rdy"].tolist(), answer[f"{name}_out"].tolist()
        wanted = computed(name, rows, latency=latency).tolist()
        queue = deque([None] * latency)
        for cycle in range(ROWS):
            assert ready[cycle] == (queue[-1] is not None), (name, cycle)
            if queue[-1] is not None:
                assert result[cycle] == queue[-1], (name, cycle)
            if cycle and not ce[cycle - 1]:
                assert result[cycle] == result[cycle - 1], (name, cycle)
            if ce[cycle]:
                queue.pop()
                queue.appendleft(wanted[cycle] if nd[cycle] else None)
            if sclr[cycle]:
                queue = deque([None] * latency)


# The user's RTL.

@pytest.mark.icarus
def test_user_rtl_with_all_ten_operators_in_icarus(folder, tmp_path):
    if missing := icarus_missing():
        pytest.skip(missing)
    sources = [folder / f"{name}.v" for name in PORTS]
    rows = {"a": np.array([0x40490FDB], dtype=np.uint32), "b": np.array([0xC02DF854], dtype=np.uint32),
            "fixed": np.array([-12345], dtype=np.int16), "x": np.array([-9000], dtype=np.int16),
            "y": np.array([7000], dtype=np.int16)}
    macros = [f"-D{name.upper()}={8 * value.itemsize}'h{int(value[0]) & (1 << 8 * value.itemsize) - 1:x}"
              for name, value in rows.items()]
    warnings = run_tool(["iverilog", "-g2001", "-Wall", "-Wno-timescale", "-s", "bench", "-o", tmp_path / "bench.vvp",
                         *macros, BENCH, USER_RTL, *sources])
    assert warnings == ""
    lines = run_tool(["vvp", "-n", tmp_path / "bench.vvp"]).splitlines()
    got = {name: (int(cycle), int(result, 16)) for name, cycle, result in map(str.split, lines)}
    assert len(lines) == len(got)
    assert got == {name: (latency, int(computed(name, rows)[0])) for name, latency in LATENCIES["default"].items()}


# Errors.

@pytest.mark.parametrize(("arguments", "message"), [
    (["--latency", "add=0"], "latency of add must be from 1 to 64, not 0"),
    (["--latency", "mult=65"], "latency of mult must be from 1 to 64, not 65"),
    (["--latency", "div=2"], "latency of div must be from 3 to 64, not 2"),
    (["--latency", "sqrt=-1"], "latency of sqrt must be from 3 to 64, not -1"),
    (["--latency", "power=3"], "operator must be one of add, sub, mult, div, sqrt, equl, less, fl32tofi16, fi16tofl32, "
                               "atan, not 'power'"),
    (["--latency", "add=fast"], "--latency takes OPERATOR=N, as in --latency add=8, not 'add=fast'"),
])
def test_user_errors_are_one_line_and_status_2(tmp_path, arguments, message):
    result = cli("operators", tmp_path / "out", *arguments)
    assert result.exit_code == 2
    assert result.stderr == f"strapdown: {message}\n"
    assert not (tmp_path / "out").exists()


def test_folder_that_cannot_be_written_is_a_user_error(tmp_path):
    (tmp_path / "file").touch()
    result = cli("operators", tmp_path / "file" / "folder")
    assert result.exit_code == 2
    assert result.stderr.startswith("strapdown: cannot write to")
