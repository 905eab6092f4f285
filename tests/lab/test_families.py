"""Cores in several FPGA families: what is counted, what fits, and that Yosys finds a mapping for every memory."""

import json

import pytest

from strapdown.cores import THESIS, main_module
from strapdown.tools import ToolError
from strapdown_lab.report.families import circuit, family_lines, family_table, variants
from strapdown_lab.report.measure import core_circuit
from strapdown_lab.synthesis import FAMILIES, families, synthesise
from strapdown_sim.cache import Cache

NAMED = {family.name: family for family in FAMILIES}


def test_what_yosys_counts_is_compared_with_the_part(monkeypatch, tmp_path):
    def measured(cells, **options):
        monkeypatch.setattr(families, "cell_counts", lambda *given: cells)
        return synthesise(NAMED["iCE40"], "", "top", Cache(tmp_path), **options)

    cells = {"SB_LUT4": 5280, "SB_DFFESR": 7, "SB_DFF": 3, "SB_CARRY": 900, "SB_MAC16": 4, "SB_RAM40_4K": 12}
    assert measured(cells, place=False) == {"lut": 5280, "ff": 10, "dsp": 4, "bram": 12, "fits": True}
    assert measured({**cells, "SB_LUT4": 5281})["fits"] is False
    assert measured({**cells, "SB_RAM40_4K": 31})["fits"] is False
    with pytest.raises(ValueError, match=r"^cells of no known size: SB_SPRAM256KA$"):
        measured({"SB_SPRAM256KA": 1})


def test_what_fits_is_routed_and_a_router_that_fails_is_told(monkeypatch, tmp_path):
    monkeypatch.setattr(families, "cell_counts", lambda *given: {"LUT4": 10})
    monkeypatch.setattr(families, "wrapped_netlist", lambda *given, **options: tmp_path)
    speeds = {1: 80.0, 2: 90.0, 3: 85.0}
    monkeypatch.setattr(families, "routed", lambda netlist, package, options, seed, cache, pins: {
        "fmax": {"clk": {"achieved": speeds[seed]}}})
    found = synthesise(NAMED["ECP5"], "", "top", Cache(tmp_path))
    assert (found["mhz"], found["mhz_of_seeds"]) == (85.0, [80.0, 90.0, 85.0])

    def fail(*given, **options):
        raise ToolError("nextpnr", 1, "Info: packing\nERROR: no more pins\n1 error")

    monkeypatch.setattr(families, "routed", fail)
    found = synthesise(NAMED["ECP5"], "", "top", Cache(tmp_path))
    assert found["failed"] == "nextpnr failed with status 1: ERROR: no more pins"
    assert "mhz" not in found


def test_the_table_tells_what_fits_and_how_fast():
    amounts = {"lut": 5054, "ff": 2, "dsp": 3.5, "bram": 12}
    facts = {"part": "X1", "capacity": {"lut": 5280.0, "bram": 30}, "command": "synth_x"}
    report = {"families": {"A": {**facts, "router": "nextpnr-x --up", "seeds": [1]}, "B": facts}, "cores": [
        {"config": "thesis", "operand_memory": "", "cycles": 250,
         "families": {"A": {**amounts, "fits": True, "mhz": 43.6}, "B": {**amounts, "fits": False}}},
        {"config": "thesis", "operand_memory": "block", "cycles": 256,
         "families": {"A": {**amounts, "fits": True, "failed": "ERROR"}, "B": {**amounts, "fits": True}}},
        {"config": "sins", "operand_memory": "block", "cycles": 564, "families": {"B": {**amounts, "fits": True}}}],
        "versions": {"yosys": "1"}}
    cells = "5,054 / 3.5 / 12"
    assert family_table(report).splitlines()[2:] == [
        f"| `thesis` | 250 | {cells}, 44 MHz | {cells}, too large |",
        f"| `thesis`, operand memory in block RAM | 256 | {cells}, not routed | {cells}, fits |",
        f"| `sins`, operand memory in block RAM | 564 |  | {cells}, fits |"]
    assert family_lines(report).splitlines() == [
        "- A: X1 (5,280 LUT, 30 BRAM); `synth_x`; `nextpnr-x --up`, seed 1", "- B: X1 (5,280 LUT, 30 BRAM); `synth_x`",
        "- yosys 1"]


def test_families_without_lut_ram_have_rows_with_operands_in_block_ram():
    plain, in_block = (next(variant for variant in variants() if (variant.config.name, variant.in_block) == key)
                       for key in (("thesis_fast", False), ("thesis_fast", True)))
    assert [family.name for family in plain.families(FAMILIES)] == list(NAMED)
    assert [family.name for family in in_block.families(FAMILIES)] == ["iCE40", "GateMate", "Efinix"]
    # Flip-flops as the operand memory are counted, but not routed.
    assert [family.name for family in FAMILIES if plain.routed(family)] == ["7-series", "ECP5", "Gowin", "Nexus"]
    assert all(in_block.routed(family) for family in FAMILIES)
    several = next(variant for variant in variants() if variant.config.name == "thesis_x8")
    assert all(several.routed(family) for family in FAMILIES)
    assert {family.name for family in FAMILIES} == {
        "7-series", "ECP5", "iCE40", "Gowin", "Nexus", "GateMate", "Efinix"}


@pytest.mark.parametrize(("family", "memory"), [
    ("iCE40", "auto"), ("GateMate", "auto"), ("GateMate", "block"), ("Efinix", "auto")])
def test_every_memory_has_a_mapping_without_lut_ram(family, memory, make_core, yosys, cache):
    config = THESIS.replace(operand_memory=memory, side_memory="none")
    found = synthesise(NAMED[family], core_circuit(make_core("INS_atan", config), config), "INS_atan",
                       cache, place=False)
    assert found["fits"]
    assert found["bram"] > 0


@pytest.mark.parametrize("family", ["7-series", "Gowin"])
def test_a_microprogram_in_luts_has_a_mapping(family, make_core, yosys, cache):
    # Of the ROMs of INS_atan, those of the arctangent stay in block RAM.
    found = {style: synthesise(NAMED[family], core_circuit(make_core("INS_atan", config), config), "INS_atan", cache,
                               place=False)
             for style in ("block", "distributed") for config in [THESIS.replace(microcode=style)]}
    assert found["distributed"]["bram"] < found["block"]["bram"]


@pytest.fixture(scope="module")
def figures(root):
    """The figures in docs/."""
    path = root / "docs" / "report" / "families.json"
    if not path.exists():
        pytest.skip("docs/report/families.json is not there yet: make families writes it.")
    return json.loads(path.read_text(encoding="utf-8"))


def test_figures_are_of_these_circuits(figures, make_module, circuit_of, monkeypatch):
    monkeypatch.setattr("strapdown_lab.report.families.core_circuit",
                        lambda core, config: circuit_of(main_module(config), config))
    known = [{key: value for key, value in row.items() if key != "families"} for row in figures["cores"]]
    assert known == [circuit(variant, make_module)[0] for variant in variants()], "make families measures them again"


def test_figures_are_of_these_families(figures):
    assert list(figures["families"]) == list(NAMED)
    assert all(list(row["families"]) == [family.name for family in variant.families(FAMILIES)]
               for row, variant in zip(figures["cores"], variants(), strict=True))
