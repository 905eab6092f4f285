"""The search of pools: its grid, its estimates, the front, the pick, and the command with invented tools."""

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from strapdown.cli import main
from strapdown.cli.common import named_configuration
from strapdown.cordic import TableAtan2
from strapdown.cores import CONFIGS, QUATERNION_J2, SINS, THESIS, system_of
from strapdown.fp import FpAdd
from strapdown.kernel import Pool
from strapdown.tools import ToolError
from strapdown_lab.docs import own_operator
from strapdown_lab.explore import plan, search
from strapdown_lab.explore.command import explore
from strapdown_lab.explore.estimate import estimate
from strapdown_lab.explore.front import Wish, expected, front, measured, pick, spread, staircase
from strapdown_lab.explore.grid import Grid, grid_of, pool_key, settings_of
from strapdown_lab.explore.page import explore_picture
from strapdown_lab.explore.search import MARGIN, siblings
from strapdown_lab.synthesis import Ecp5Placement, Xc7Resources
from strapdown_sim.cache import Cache

UNITS = {"adder": {"lut": 369, "dsp": 0, "bram": 0, "mhz": 108.0}, "multiplier": {"lut": 86, "dsp": 2, "bram": 0,
         "mhz": 111.0}, "selector": {"lut": 32, "dsp": 0, "bram": 0, "mhz": 200.0}}
"""Operators of QUATERNION_J2: LUTs and MHz as in docs/report/operators.json; a selector is a multiplexer of 32 bits."""


def row(cycles, lut, dsp=2, bram=1, mhz=100.0, names=()):
    return {"key": f"{cycles} {lut} {dsp} {bram}", "cycles": cycles, "names": list(names), "settings": {},
            "estimate": {"lut": lut, "dsp": dsp, "bram": bram, "mhz": mhz},
            "xc7": {"lut": lut, "ff": 2 * lut, "dsp": dsp, "bram": bram}, "ecp5": {"fmax_mhz": mhz}}


# The grid.

def quaternion_grid(**options):
    return grid_of(QUATERNION_J2, system_of("QUAT_direct", QUATERNION_J2), **options)


def test_axes_are_the_parameters_of_useful_operators():
    axes = quaternion_grid().axes
    # More buses and ranks are for several channels.
    assert set(Pool().parameters) - set(axes) == {"dividers", "divider_bits_per_cycle", "arctangents",
                                                  "arctangent_steps_per_cycle", "side_buses", "read_ranks"}
    assert axes["adders"] == (1, 2, 3)
    assert axes["adder_latency"] == tuple(range(1, len(FpAdd.PIPELINE.cuts) + 1))
    # One of many latencies: from the least to the greatest, which is the default.
    ranks = grid_of(THESIS, system_of("INS_top", THESIS)).axes["table_arctangent_latency"]
    assert (len(ranks), ranks[0], ranks[-1]) == (8, 2, len(TableAtan2.PIPELINE.cuts))
    # A comparison can be the sign of a difference: the operator can be absent.
    assert axes["comparators"][0] == 0
    assert "adder_latency" not in quaternion_grid(timing=False).axes


def test_a_kind_of_a_user_joins_the_grid(root, tmp_path):
    """The operator of docs/kernels.md, which nothing else lists."""
    page = (root / "docs" / "kernels.md").read_text(encoding="utf-8")
    (tmp_path / "my_operator.py").write_text(own_operator(page), encoding="utf-8")
    config = named_configuration(f"{tmp_path / 'my_operator.py'}:PERIMETER")
    axes = grid_of(config, system_of("PERIMETER_top", config)).axes
    assert axes["distances"] == (1, 2, 3)
    assert axes["distance_latency"] == axes["adder_latency"]


def test_a_kind_that_a_kernel_can_use_is_found_by_its_fallback():
    axes = grid_of(SINS, system_of("SINS_top", SINS)).axes
    assert "reciprocal_roots" not in SINS.engine_pool.parameters
    assert axes["reciprocal_roots"][0] == 0
    assert axes["dividers"][0] == 1


def test_size_is_the_number_of_pools():
    vary = {"arctangents": ("0", "1", "2"), "arctangent_steps_per_cycle": ("1", "2"), "adders": ("1", "2"),
            "private_ports": ()}
    grid = grid_of(THESIS, system_of("INS_top", THESIS), vary=vary)
    pools = list(grid)
    assert len({pool_key(pool) for pool in pools}) == len(pools) == grid.size() == (1 + 2 * 2) * 2 * 2


def test_neighbours_differ_in_one_field():
    grid = quaternion_grid()
    base = grid.base.parameters
    for other in grid.neighbours(grid.base):
        changed = {name for name in {*base, *other.parameters} if base.get(name) != other.parameters.get(name)}
        assert len({name.partition("_")[0].rstrip("s") for name in changed}) == 1, changed


def test_a_value_beside_the_axis_has_all_as_neighbours():
    grid = Grid({"adder_latency": (2, 7)}, Pool())
    assert {pool.parameters["adder_latency"] for pool in grid.neighbours(Pool())} == {2, 7}


def test_settings_make_the_pool():
    grid = grid_of(THESIS, system_of("INS_top", THESIS))
    pools = [*grid.neighbours(grid.base), *(other.engine_pool for other in siblings(THESIS).values())]
    for pool in pools:
        made = THESIS.replace(**settings_of(pool, grid.base)).engine_pool
        assert pool_key(made) == pool_key(pool)


def test_siblings_differ_in_their_pool_only():
    assert set(siblings(THESIS)) == {"thesis", "thesis_compact", "thesis_fast"}
    assert list(siblings(THESIS.replace(kp=3, name="own"))) == ["own"]
    assert set(siblings(CONFIGS["mahony"])) == {"mahony"}


# The front.

def test_front_is_that_of_all_comparisons():
    rng = np.random.default_rng(7)
    rows = [row(*(int(value) for value in rng.integers(1, 6, 4))) for _ in range(200)]

    def beaten(own, other):
        mine, theirs = ([measured(each)[name] for name in ("time", "lut", "dsp", "bram")] for each in (own, other))
        return all(a >= b for a, b in zip(mine, theirs, strict=True)) and mine != theirs

    wanted = {each["key"] for each in rows if not any(beaten(each, other) for other in rows)}
    found = [each["key"] for each in front(rows, measured)]
    assert set(found) == wanted
    assert len(found) == len(wanted)


def test_a_margin_keeps_what_may_be_on_the_front():
    rows = [row(100, 1000), row(110, 1050), row(110, 1200)]
    assert [each["estimate"]["lut"] for each in front(rows, expected, 0.1)] == [1000, 1050]
    assert front(rows, expected) == rows[:1]


def test_staircase_ignores_dsp_blocks():
    fast, same, small = row(100, 2000, dsp=4), row(120, 2500, dsp=2), row(200, 1000)
    assert staircase([same, small, fast], measured) == [fast, small]


def test_spread_takes_the_ends_first():
    rows = [row(100 + 10 * k, 2000 - 100 * k) for k in range(11)]
    assert spread(rows, 3, measured) == [rows[0], rows[10], rows[5]]
    assert spread(rows, 2, measured, [rows[4]]) == [rows[4], rows[0]]


@pytest.mark.parametrize(("limits", "wanted", "rule"), [
    ({}, (160, 1100), "the least product of time and LUTs"),
    ({"us": 1.7}, (160, 1100), "the fewest LUTs with at most 1.7 µs"),
    ({"lut": 2500, "dsp": 4}, (100, 2400), "the shortest update with at most 2,500 LUT and at most 4 DSP"),
    ({"cycles": 150, "lut": 3000}, (100, 2400), "the fewest LUTs with at most 150 cycles and at most 3,000 LUT"),
    ({"mhz": 110}, (250, 1000), "the shortest update with at least 110 MHz"),
    ({"dsp": 1}, None, "the shortest update with at most 1 DSP"),
])
def test_a_wish_picks_one(limits, wanted, rule):
    rows = [row(100, 2400, dsp=4), row(160, 1100), row(250, 1000, mhz=120.0)]
    chosen = pick(rows, Wish(**limits), measured)
    assert (chosen and (chosen["cycles"], chosen["xc7"]["lut"])) == wanted
    assert Wish(**limits).rule == rule


# The estimate.

def test_the_estimate_of_a_measured_core(root, tmp_path):
    """Within the margin by which the search lets it err."""
    figures = plan.planned(lambda: QUATERNION_J2, "QUAT_direct", {}, Cache(tmp_path))
    found = estimate(figures, UNITS)
    report = json.loads((root / "docs" / "report" / "cores.json").read_text(encoding="utf-8"))
    known = next(entry for entry in report["cores"] if entry["config"] == "quaternion_j2")["xc7"]
    assert abs(found["lut"] / known["lut"] - 1) <= MARGIN
    assert (found["dsp"], found["bram"], found["mhz"]) == (known["dsp"], known["bram"], 108.0)


def test_block_memory_takes_blocks_in_place_of_luts(tmp_path):
    plans = [plan.planned(lambda: QUATERNION_J2, "QUAT_direct", {"forwarding": "false", "operand_memory": style},
                          Cache(tmp_path)) for style in ("auto", "block")]
    distributed, block = (estimate(figures, UNITS) for figures in plans)
    assert distributed["lut"] > block["lut"]
    assert block["bram"] == distributed["bram"] + 4 * 0.5  # two pairs of read ports


# The command.

@pytest.fixture
def tools(monkeypatch, tmp_path):
    """Invented results of the tools; jobs run in threads."""
    def synthesised(verilog, top, cache):
        return Xc7Resources(lut=900 + 10 * len(verilog), memory_lut=0, ff=1, dsp=2, bram=1)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("strapdown_sim.jobs._Processes", ThreadPoolExecutor)
    monkeypatch.setattr(search, "circuit", lambda configured, module, settings: json.dumps(settings))
    monkeypatch.setattr(search, "to_verilog", lambda component, name: name)
    monkeypatch.setattr(search, "synthesise_xc7", synthesised)
    monkeypatch.setattr(search, "place_ecp5", lambda verilog, top, cache, seeds: Ecp5Placement(
        1, 1, 0, 0, tuple(100.0 + seed for seed in seeds), ("a", "b")))
    monkeypatch.setattr("strapdown_lab.report.measure.tool_versions", lambda *packages: dict.fromkeys(packages, "1"))


VARY = "quaternion_j2 --vary adders=1,2 --vary multipliers=1,2 --jobs 1"


def written(suffix):
    """Text of a file of the command."""
    return Path(f"build/explore/quaternion_j2/explore.{suffix}").read_text(encoding="utf-8")


def run(arguments, status=0):
    result = CliRunner().invoke(main, ["explore", *arguments.split()])
    assert result.exit_code == status, result.output
    return result.output.splitlines()


def test_the_command_picks_a_pool_that_generate_makes(tools):
    lines = run(f"{VARY} --cycles 61 --routes 4")
    result = json.loads(written("json"))
    assert (result["grid"], result["scheduled"], result["refused"]) == (4, 4, 0)
    assert [each["names"] for each in result["pools"] if each["names"]] == [["quaternion_j2"]]
    chosen = next(each for each in result["pools"] if each["picked"])
    complete = [each for each in result["pools"] if "ecp5" in each and each["cycles"] <= 61]
    assert chosen["xc7"]["lut"] == min(each["xc7"]["lut"] for each in complete)
    assert chosen["ecp5"]["fmax_mhz"] == 102.0  # the median of three seeds
    command = next(line for line in lines if line.startswith("strapdown generate"))
    made = CliRunner().invoke(main, [*command.split()[1:], "--output", "made"])
    assert made.output.split()[1:] == [str(chosen["cycles"]), "cycles"]
    page = written("md")
    assert command in page
    assert "the grid has 4 pools; 4 were scheduled, those of the named configurations among them; " \
        "the engine refused 0" in page


def test_a_second_run_schedules_nothing(tools, monkeypatch):
    run(f"{VARY} --no-place")
    monkeypatch.setattr(plan, "_figures", lambda module, config: pytest.fail("a schedule was made again"))
    run(f"{VARY} --no-place")


def test_pictures_are_equal_for_equal_figures(tools, tmp_path):
    run(VARY)
    result = json.loads(written("json"))
    for name in "12":
        explore_picture(tmp_path / name, result)
    assert (tmp_path / "1").read_bytes() == (tmp_path / "2").read_bytes() == (
        tmp_path / "build/explore/quaternion_j2/explore.png").read_bytes()


def test_a_large_grid_is_walked_within_the_limit(tools):
    lines = run("quaternion_j2 --pools 9 --syntheses 3 --routes 2 --jobs 1")
    result = json.loads(written("json"))
    assert result["grid"] > 1000
    assert result["scheduled"] == 9
    assert sum("xc7" in each for each in result["pools"]) == 3
    assert sum("ecp5" in each for each in result["pools"]) == 2
    told = any(line.endswith("were not measured: raise --syntheses and --routes") for line in lines)
    assert told == (result["left"] > 0)


def refusing(monkeypatch, tool, refused):
    """Lets a tool fail on what ``refused`` says of a circuit and its top module."""
    found = getattr(search, tool)

    def fails(verilog, top, cache, **options):
        if refused(verilog, top):
            raise ToolError("yosys", 1, "ERROR: no room")
        return found(verilog, top, cache, **options)

    monkeypatch.setattr(search, tool, fails)


FAILED = "2 failed in a tool: yosys failed with status 1: ERROR: no room"


@pytest.mark.parametrize(("tool", "refused"), [
    # Circuits are the settings in JSON here, operators their own names.
    ("synthesise_xc7", lambda verilog, top: top == "QUAT_direct" and "adders" in verilog),
    ("place_ecp5", lambda verilog, top: top == "QUAT_direct" and "adders" in verilog)])
def test_a_pool_that_a_tool_refuses_is_a_row_that_says_why(tools, monkeypatch, tool, refused):
    refusing(monkeypatch, tool, refused)
    lines = run(f"{VARY} --routes 4")
    assert FAILED in lines
    assert lines[-2].startswith("strapdown generate")
    rows = [line for line in written("md").splitlines() if "| failed |" in line]
    assert len(rows) == 2
    assert all(line.endswith(": yosys failed with status 1: ERROR: no room |") and "adders 2" in line for line in rows)
    pools = json.loads(written("json"))["pools"]
    assert ["failed" in pool for pool in pools] == [False, False, True, True]
    assert not any(pool["front"] or pool["picked"] for pool in pools[2:])


def test_a_pool_whose_operator_a_tool_refuses(tools, monkeypatch):
    """The operator fails alone, before the pool. The other latency works."""
    monkeypatch.setattr(search, "to_verilog", lambda component, name: f"{name} {component.latency}")
    refusing(monkeypatch, "synthesise_xc7", lambda verilog, top: verilog == "FpMultiply 3")
    lines = run("quaternion_j2 --vary multipliers=1,2 --vary multiplier_latency=2,3 --jobs 1")
    assert FAILED in lines
    assert sum("failed" in pool for pool in json.loads(written("json"))["pools"]) == 2


def test_nothing_is_left_of_the_grid(tools, monkeypatch):
    refusing(monkeypatch, "synthesise_xc7", lambda verilog, top: top == "QUAT_direct")
    assert run("quaternion_j2 --vary adders=1 --jobs 1", 2)[-1] == \
        "strapdown: no pool went through the tools: yosys failed with status 1: ERROR: no room"


@pytest.mark.parametrize(("arguments", "message"), [
    ("thesis --no-place --us 2", "--us and --mhz need the clock frequency: omit --no-place"),
    ("thesis --vary dividers=1 --vary foo", "configuration thesis: the grid of its pools has no field 'foo': choose "
     "from adders, adder_latency, "),
    ("quaternion_j2 --vary adder_latency=99", "configuration quaternion_j2: latency must be from 1 to 8, not 99"),
    ("optical_tcd1304 --module OPT_top", "OPT_top has no equations of its own: choose "),
    ("thesis --module FOO", "configuration thesis has INS_acc, "),
])
def test_errors_are_one_line(tools, arguments, message):
    (line,) = run(arguments, 2)
    assert line.startswith(f"strapdown: {message}")


def test_a_wish_that_no_pool_meets(tools):
    line = run(f"{VARY} --cycles 5", 2)[-1]
    assert line.startswith("strapdown: no pool has at most 5 cycles: the fastest has 0.")
    assert written("md").count("No pool has") == 1


def test_the_command_is_found():
    assert main.get_command(None, "explore") is explore
