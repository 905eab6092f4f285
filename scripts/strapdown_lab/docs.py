"""Write the generated figures into README.md and docs/, the operators' pages, and the picture of the demo.

`make docs` runs this module, after `make demo`. The tests compare the files with the same functions. The figures of
docs/report.md and docs/flight.md come from docs/report, where `make report` and `make accuracy` write them.
"""

import json
import math
import re
import shutil
from contextlib import chdir
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory

from click.testing import CliRunner

from strapdown.cli import main as main_command
from strapdown.cores import (
    ATTITUDE_CORES,
    CONFIGS,
    FLIGHT,
    OPTICAL_TCD1304,
    QUATERNION_J2,
    QUATERNION_J3,
    SINS,
    SINS_DAMPED,
    THESIS,
    main_module,
    make_core,
    make_module,
    modules_of,
    title_of,
)
from strapdown.cores.operators import VENDOR_OPERATORS, VendorOperator
from strapdown.design import METHODS
from strapdown.link import OPTICAL_ATTITUDE
from strapdown.markdown import markdown_table

from .checkout import ROOT, write_blocks
from .faults.tables import cores_table, places_tables
from .guides import index_table as guides_table
from .guides import write_guides
from .report.families import family_lines, family_table
from .report.measure import cycles_of
from .report.optical_diagram import draw_optical
from .report.pages import PAGES, flags_table, index_table, page_text
from .report.sensors import sensor_blocks, write_waves
from .report.tables import anchor_table, bus_table, core_table, flow_lines, microseconds, operator_tables, path_table
from .studies.accuracy import figure_table, means
from .studies.airliner import airliner_table
from .studies.attitude_binary32 import table as attitude_binary32_table
from .studies.calibration import errors_table, fields_table
from .studies.calibration import picture as calibration_picture
from .studies.compact_forms import table as compact_forms_table
from .studies.flight_cases import cases_table
from .studies.flight_cross import cross_tables
from .studies.flight_magnet import magnet_tables
from .studies.flight_options import options_table
from .studies.flight_parts import parts_table
from .studies.optical import flights_table, geometry_lines, positions_table
from .studies.optical_pins import pins_table, rules_table
from .studies.peers import peers_blocks
from .studies.pole import POLE_CORES, pole_errors


def _figures(name):
    """Figures of a study or a report in docs/report."""
    return json.loads((ROOT / "docs" / "report" / f"{name}.json").read_text(encoding="utf-8"))


def modules_block(make_core=make_core):
    """Table of the modules with their latency. ``make_core`` may cache cores."""
    cores = {name: make_core(name, THESIS) for name in ATTITUDE_CORES}
    return markdown_table(["module", "what it computes", "cycles:", "µs at 100 MHz:"], [
        [f"`{name}`", core.system.title, core.latency, f"{core.latency / 100:.2f}"] for name, core in cores.items()])


def configurations_block(make_module=make_module):
    """Table of the configurations: top module, cycles, and measured figures. ``make_module`` may cache modules."""
    report = ROOT / "docs" / "report" / "cores.json"
    figures = json.loads(report.read_text(encoding="utf-8")) if report.exists() else {"cores": []}
    measured = {row["config"]: row for row in figures["cores"]}
    rows = []
    for config in CONFIGS.values():
        module = main_module(config)
        cells = [cycles_of(make_module(module, config)), *"–––––"]
        if row := measured.get(config.name):
            cells[1:4] = [f"{row['xc7']['lut']:,}", row["xc7"]["dsp"], f"{row['xc7']['bram']:g}"]
            if "ecp5" in row:
                cells[4:] = [f"{row['ecp5']['fmax_mhz']:.0f}", f"{microseconds(row):.2f}"]
        rows.append([f"`{config.name}`", f"`{module}`", config.description, *cells])
    return markdown_table(["configuration", "module", "what it is", "cycles:", "LUT:", "DSP:", "BRAM:", "MHz:", "µs:"],
                          rows)


def pole_block():
    """Table of the errors of the Euler angles near a pitch of ±90°."""
    return markdown_table(
        ["distance of the pitch from ±90°:", *(f"`{name}`:" for name in POLE_CORES)],
        [[f"{distance:.6f}".rstrip("0").rstrip(".") + "°", *(f"{error:.{6 if error < 1 else 0}f}°" for error in errors)]
         for distance, *errors in pole_errors()])


def channels_block(make_core=make_core):
    """Table of the configurations with several channels. ``make_core`` may keep the cores it has made."""
    cores = {config.name: make_core(main_module(config), config) for config in CONFIGS.values() if config.channels > 1}
    return markdown_table(
        ["configuration", "module", "channels:", "interval, cycles:", "latency, cycles:", "updates in flight:"],
        [[f"`{name}`", f"`{core.system.name}`", core.engine.channels, core.engine.interval, core.latency,
          core.engine.program.schedule.stages] for name, core in cores.items()])


def bounds_block(make_core=make_core):
    """Table of some systems in eight channels: the interval that the scheduler finds, and what bounds it."""
    rows = []
    for config in FLIGHT, QUATERNION_J3, SINS:
        eight = config.replace(channels=8)
        schedule = make_core(main_module(eight), eight).engine.program.schedule
        bound = max(schedule.bounds.values())
        rows.append([f"`{config.name}`", schedule.interval, bound,
                     ", ".join(name for name, cycles in schedule.bounds.items() if cycles == bound)])
    return markdown_table(["8 channels of", "interval:", "bound:", "limited by"], rows)


def operations(config, make_core=make_core):
    """Number of operations of an update, and the core's cycles from start to finish."""
    core = make_core(main_module(config), config)
    return [sum(core.engine.program.schedule.graph.count().values()), core.latency]


QUATERNION_OPTIONS: tuple[tuple[str, dict], ...] = (
    ("j = 2", {}), ("j = 3", {"order": 3}),
    ("j = 3, renormalised in every update", {"order": 3, "renormalise_every": 1}),
    ("j = 3, renormalised every 100 updates", {"order": 3, "renormalise_every": 100}),
    ("j = 2, coning", {"coning": True}),
    ("j = 3, coning, renormalised in every update", {"order": 3, "coning": True, "renormalise_every": 1}))
"""Rows of a table: a name, and the fields that differ from QUATERNION_J2."""


def quaternion_blocks(make_core=make_core):
    """Tables of docs/quaternion.md, by the name of their block, except that of a million updates."""
    config = QUATERNION_J2
    largest_angle = math.radians(config.rate_max_deg_s) * config.period_s
    errors = []
    for order in 2, 3:
        (squares, _), (angle, norm) = (METHODS[name](order, largest_angle).worst()
                                       for name in ("least-squares", "minimax"))
        errors.append([f"{1000 * config.period_s:g} ms", order, f"{squares:.1e} rad", f"{angle:.1e} rad",
                       f"{norm:.1e}"])
    return {
        "options": markdown_table(["option", "operations:", "cycles:"], [
            [name, *operations(config.replace(**changes), make_core)] for name, changes in QUATERNION_OPTIONS]),
        "coefficients": markdown_table(
            ["T:", "j:", "angle, least squares:", "angle, minimax:", "norm, minimax:"], errors)}


def sins_block(make_core=make_core):
    """Table of the configurations of SINS_top with their operations."""
    return markdown_table(["configuration", "what it is", "operations:", "cycles:"], [
        [f"`{config.name}`", config.description, *operations(config, make_core)] for config in (SINS, SINS_DAMPED)])


def vendor_block():
    """Table of the vendor's operators with their latencies."""
    return markdown_table(
        ["module", "result", "operands", "default latency:", "least latency:",
         "register ranks at the output by default:"],
        [[f"`{name}`", vendor.kind.title, "; ".join(f"`{port.name}`: {port.meaning}" for port in vendor.kind.operands),
          vendor.latency, vendor.kind.least_latency, vendor.extra_ranks]
         for name, vendor in ((name, VendorOperator(name)) for name in VENDOR_OPERATORS)])


def demo_block(summary):
    """Table of the summary of a replay."""
    difference = summary["against_float64_reference_deg"]
    return markdown_table(
        ["samples:", "cycles per update:", "µs at 100 MHz:", "largest rotation angle to float64:",
         "RMS rotation angle:", "bits that differ from the twin:"],
        [[f"{summary['samples']:,}", summary["cycles_per_update"],
          f"{summary['microseconds_per_update_at_100_mhz']:.2f}", f"{difference['max']:.6f}°",
          f"{difference['rms']:.6f}°", summary["bits_differing_from_twin"]]])


def own_operator(page):
    """The file of the example of an operator in docs/kernels.md: the first block of Python of its section."""
    section = page[page.index("\n## An operator of your own\n"):]
    return re.findall(r"```python\n(.*?)```", section, re.DOTALL)[0]


def own_kernel(page):
    """The file of the example in docs/kernels.md: its first two blocks of Python."""
    section = page[page.index("\n## A kernel of your own\n"):]
    return "\n\n".join(re.findall(r"```python\n(.*?)```", section, re.DOTALL)[:2])


def compass_block():
    """Output of the commands for the example in docs/kernels.md."""
    lines = ["```text"]
    with TemporaryDirectory() as folder, chdir(folder):
        Path("my_core.py").write_text(own_kernel((ROOT / "docs" / "kernels.md").read_text(encoding="utf-8")),
                                      encoding="utf-8")
        for command in ("generate my_core.py:COMPASS", "explain my_core.py:COMPASS --line my_core.py:tilt"):
            result = CliRunner().invoke(main_command, command.split(), catch_exceptions=False)
            lines += [f"$ strapdown {command}", *result.output.splitlines()]
    return "\n".join([*lines, "```"])


def report_blocks():
    """Tables of docs/report.md, by the name of their block."""
    cores, buses, operators = map(_figures, ("cores", "buses", "operators"))
    return {"flow": flow_lines(cores), "cores": core_table(cores), "paths": path_table(cores["cores"]),
            "public cores": anchor_table(),
            "buses": bus_table(buses, cores), "bus flow": flow_lines(buses),
            "operators": operator_tables(operators)}


def family_blocks(report):
    """Tables of docs/families.md, by the name of their block."""
    return {"families": family_table(report), "family flows": family_lines(report)}


def accuracy_blocks(result):
    """Tables of docs/flight.md, by the name of their block."""
    return {f"{figure} error": figure_table(result, figure) for figure in ("total", "inclination")}


def flight_line(result):
    """The mean errors of the flight filter and of VQF, for the list in README.md."""
    others, tuned = (means(result, 9, tuned) for tuned in (False, True))
    return ("  Its mean RMS error is {:.2f}° on recordings that it was not tuned on (VQF: {:.2f}°), and {:.2f}° on "
            "those that its\n  parameters were chosen on ({:.2f}°);").format(
                *(figures[name]["total"] for figures in (others, tuned) for name in ("flight", "vqf")))


def faults_blocks():
    """Tables of docs/faults.md, by the name of their block; none without figures."""
    files = [ROOT / "docs" / "faults" / f"{name}.json" for name in CONFIGS]
    reports = [json.loads(file.read_text(encoding="utf-8")) for file in files if file.exists()]
    return {"cores": cores_table(reports), "places": places_tables(reports)} if reports else {}


def optical_blocks(result):
    """Tables of the accuracy in docs/optical.md, by the name of their block."""
    return {"flights": flights_table(result), "positions": positions_table(result), "geometry": geometry_lines(result)}


def optical_pin_blocks(result):
    """Tables of the runs from the pins in docs/optical.md, by the name of their block."""
    return {"pins": pins_table(result), "rules": rules_table()}


def optical_module_blocks():
    """Tables of the modules in docs/optical.md, by the name of their block."""
    modules = {name: make_module(name, OPTICAL_TCD1304) for name in modules_of(OPTICAL_TCD1304)}
    ports = [port for port in modules["OPT_top"].ports if port.name not in ("clk", "rst_n")]
    same = groupby(ports, lambda port: (port.direction, port.width, port.meaning))
    return {
        "modules": markdown_table(["module", "what it does", "cycles:"], [
            [f"`{name}`", title_of(name, OPTICAL_TCD1304), module.latency or "–"] for name, module in modules.items()]),
        "ports": markdown_table(["port of `OPT_top`", "direction", "bits:", "meaning"], [
            [", ".join(f"`{port.name}`" for port in group), direction, width, meaning]
            for (direction, width, meaning), group in same]),
        "frame": markdown_table(["offset:", "number", "unit", "meaning"], [
            [4 * place, f"`{number.name}`", number.unit, number.meaning]
            for place, number in enumerate(OPTICAL_ATTITUDE.quantities)])}


def calibration_blocks():
    """Tables of docs/calibration.md, by the name of their block."""
    return {"calibration errors": errors_table(), "calibration fields": fields_table()}


def operator_pages():
    """Pages of docs/operators, by the name of their operator, with measured resources if available."""
    figures = ROOT / "docs" / "report" / "operators.json"
    report = json.loads(figures.read_text(encoding="utf-8")) if figures.exists() else None
    return {name: page_text(page, report) for name, page in PAGES.items()}


def operator_index_blocks():
    """Tables of docs/operators/README.md, by the name of their block."""
    return {"operators": index_table(), "flags": flags_table()}


STUDIES = (
    ("families", "docs/families.md", family_blocks),
    ("accuracy", "docs/flight.md", accuracy_blocks),
    ("accuracy", "README.md", lambda result: {"flight accuracy": flight_line(result)}),
    ("attitude_binary32", "docs/cores.md", lambda result: {"attitude binary32": attitude_binary32_table(result)}),
    ("compact_forms", "docs/cores.md", lambda result: {"compact forms": compact_forms_table(result)}),
    ("airliner", "docs/sins.md", lambda result: {"airliner": airliner_table(result)}),
    ("optical", "docs/optical.md", optical_blocks),
    ("optical_pins", "docs/optical.md", optical_pin_blocks),
    ("flight_parts", "docs/flight.md", lambda result: {"parts": parts_table(result)}),
    ("flight_options", "docs/flight.md", lambda result: {"options": options_table(result)}),
    ("flight_cases", "docs/flight.md", lambda result: {"cases": cases_table(result)}),
    ("flight_cross", "docs/flight.md", cross_tables),
    ("flight_magnet", "docs/flight.md", magnet_tables),
    ("peers", "docs/report.md", lambda result: peers_blocks(result, _figures("cores"))))
"""Name of a file of docs/report, a page, and the function that makes blocks of the page from the file's figures."""


def study_blocks(name, blocks):
    """Blocks of one of ``STUDIES``; none without figures."""
    return blocks(_figures(name)) if (ROOT / "docs" / "report" / f"{name}.json").exists() else {}


def main():
    """Update README.md and docs/attitude.png from build/demo, docs/operators, and other pages from docs/report."""
    summary = json.loads((ROOT / "build" / "demo" / "summary.json").read_text(encoding="utf-8"))
    write_blocks(ROOT / "README.md", {"demo": demo_block(summary), "modules": modules_block(),
                                      "configurations": configurations_block()})
    write_blocks(ROOT / "docs" / "notation.md", {"pole": pole_block()})
    write_blocks(ROOT / "docs" / "cores.md", {"channels": channels_block()})
    write_blocks(ROOT / "docs" / "kernels.md", {"compass": compass_block(), "bounds": bounds_block()})
    write_blocks(ROOT / "docs" / "quaternion.md", quaternion_blocks())
    write_blocks(ROOT / "docs" / "sins.md", {"configurations": sins_block()})
    write_blocks(ROOT / "docs" / "operators.md", {"vendor operators": vendor_block()})
    write_blocks(ROOT / "docs" / "sensors.md", sensor_blocks())
    list(write_waves(ROOT / "docs" / "sensors"))
    write_blocks(ROOT / "docs" / "calibration.md", calibration_blocks())
    calibration_picture(ROOT / "docs" / "calibration.png")
    write_blocks(ROOT / "docs" / "optical.md", optical_module_blocks())
    draw_optical(ROOT / "docs" / "optical.svg")
    shutil.copyfile(ROOT / "build" / "demo" / "attitude.png", ROOT / "docs" / "attitude.png")
    for name, text in operator_pages().items():
        (ROOT / "docs" / "operators" / f"{name}.md").write_text(text, encoding="utf-8")
    write_blocks(ROOT / "docs" / "operators" / "README.md", operator_index_blocks())
    write_blocks(ROOT / "docs" / "faults.md", faults_blocks())
    write_blocks(ROOT / "docs" / "guides.md", {"guides": guides_table()})
    figures = ROOT / "docs" / "report"
    if (figures / "cores.json").exists() and (figures / "number_format.json").exists():
        list(write_guides(ROOT / "docs" / "guides"))
    if (figures / "operators.json").exists() and (figures / "cores.json").exists():
        write_blocks(ROOT / "docs" / "report.md", report_blocks())
    for name, page, blocks in STUDIES:
        write_blocks(ROOT / page, study_blocks(name, blocks))


if __name__ == "__main__":
    main()
