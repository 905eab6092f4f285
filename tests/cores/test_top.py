"""Wrappers around engines, defined in these tests, and exported and run like a core."""

import contextlib
import json
import re
from types import SimpleNamespace

import numpy as np
import pytest
from amaranth import *
from amaranth.lib.wiring import In

from strapdown.cores import QUATERNION_J3, THESIS, Port, Top, Wrapper
from strapdown.export import write
from strapdown.kernel.description import Section
from strapdown_sim.drivers.toolchain import SimulatorMissingError
from strapdown_sim.drivers.verilated import Interface, VerilatedModel


@pytest.fixture(scope="module")
def example(root, tmp_path_factory):
    """The names that the example of docs/cores.md defines, and the folder in which it ran."""
    section = (root / "docs" / "cores.md").read_text(encoding="utf-8").split("## From an engine to a module")[1]
    source, = re.findall(r"^```python\n(.*?)^```", section, re.MULTILINE | re.DOTALL)
    folder, names = tmp_path_factory.mktemp("example"), {"__name__": "status_word"}
    with contextlib.chdir(folder):
        exec(source, names)
    return SimpleNamespace(**names, folder=folder)


class StartOnEdge(Wrapper):
    """A wrapper that starts at each change of an input, in place of a high level."""

    def __init__(self, engine):
        super().__init__(engine, name=f"{engine.name}_edge", hidden=(engine.system.start,),
                         added=(Port("in_change", In, 1, "each change starts an update"),))

    def elaborate(self, platform):
        m = super().elaborate(platform)
        before = Signal()
        m.d.sync += before.eq(self.in_change)
        m.d.comb += getattr(self.engine, self.system.start).eq(self.in_change ^ before)
        return m


@pytest.mark.verilator
@pytest.mark.parametrize(("module", "config"), [("INS_top", THESIS), ("QUAT_direct", QUATERNION_J3)])
def test_a_wrapper_runs(example, make_core, models, tmp_path, module, config):
    top = Top(example.StatusWord(make_core(module, config).engine))
    if module == "QUAT_direct":
        top = Top(StartOnEdge(top.component))
    path = write(top, tmp_path, command="as in this test", config=config)
    engine, system = make_core(module, config).engine, make_core(module, config).system
    added = "in_change" if "in_change" in top.signature.members else None
    start = added or system.start
    try:
        model = VerilatedModel(path, Interface(top.component.name, (start, *system.input_ports),
                                               (*system.output_ports, "out_word")), models)
    except SimulatorMissingError as error:
        pytest.skip(str(error))

    # Two updates, the second refused; the inputs are valid at their starts only.
    taken = np.array([5, 5 + engine.latency + 20])
    cycles = np.arange(taken[1] + engine.latency + 10)
    rng = np.random.default_rng(7)
    stimulus = {start: ((cycles[:, None] >= taken).sum(1) % 2 if added else np.isin(cycles, taken))}
    # Positive numbers set no status bit.
    numbers = {port: np.float32(np.abs(rng.standard_normal(2))) for port in system.input_ports}
    numbers[system.input_ports[0]][1] = np.nan
    for port, values in numbers.items():
        stimulus[port] = np.zeros(len(cycles), dtype=np.uint64)
        stimulus[port][taken] = values.view(np.uint32)
    answer = model.stream(stimulus)

    finish = np.zeros(len(cycles), dtype=int)
    status = np.zeros(len(cycles), dtype=int)
    begun, done = taken + 1, taken + 1 + engine.latency
    finish[done[0]:begun[1]] = 1
    finish[done[1]:] = 1
    status[done[1]:] = 1 << engine.status_names.index("refused")
    np.testing.assert_array_equal(answer["out_word"][1:], (finish + 2 * status)[:-1])
    reset = {word: np.float32([value]) for word, value in system.reset.items()}
    twin = system.update_twin(config.pool, {port: values[:1] for port, values in numbers.items()}, reset)
    for port in system.output_ports:
        assert answer[port][done[0]] == answer[port][-1] == twin[port].view(np.uint32)[0], port


def test_the_example_of_the_document_writes_a_module(example, make_core):
    files = {path.name for path in (example.folder / "build" / "verilog" / "thesis").iterdir()}
    assert files == {"INS_top_word.v", "INS_top_word.json", "INS_top_word.vlt"}


class Described(Wrapper):
    """A wrapper with additional sections and facts."""

    def __init__(self, engine):
        super().__init__(engine, name="INS_matx_more", title="more of it",
                         hidden=("in_q3", "out_c11", "out_matx_finish"),
                         added=(Port("in_unused", In, 5, "nothing"),))

    @property
    def sections(self):
        return *super().sections, Section("MORE", paragraphs=("A sentence.",), rows=((1, "row"), (22, "rows")))

    @property
    def facts(self):
        return super().facts | {"more": [1, 2]}


def test_a_wrapper_describes_itself(make_core, tmp_path):
    top = Top(Described(make_core("INS_matx", THESIS).engine))
    path = write(top, tmp_path, command="as in this test", config=THESIS)
    header, verilog = path.read_text(encoding="utf-8").split("\nmodule ", 1)
    told = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))
    assert path.name == f"{told['module']}.v" == "INS_matx_more.v"
    assert header.startswith("// INS_matx_more: more of it\n")
    assert "\n// EQUATIONS\n//   matrix_from_quaternion: " in header
    assert re.search(r"^//   kp +10", header, re.MULTILINE)
    # The engine's own sections, then the wrapper's.
    assert re.findall(r"^// ([A-Z]+)", header, re.MULTILINE)[-5:] == [
        "TIMING", "SEQUENCER", "OPERATORS", "MICROPROGRAM", "MORE"]
    assert header.endswith("\n// MORE\n//   A sentence.\n//   1   row\n//   22  rows\n")
    assert told["more"] == [1, 2]
    assert told["latency_cycles"] == top.latency == make_core("INS_matx", THESIS).latency
    ports = re.findall(r"^  (input|output) (?:wire|reg) (?:\[(\d+):0\] )?(\w+)(?: = [^,\s]+)?,?$",
                       verilog.split("endmodule")[0], re.MULTILINE)
    assert sorted((direction, int(high or 0) + 1, name) for direction, high, name in ports) == sorted(
        (port["direction"], port["width"], port["name"]) for port in told["ports"])
    elements = [f"out_c{row}{column}" for row in "123" for column in "123"]
    assert [port["name"] for port in told["ports"]] == [
        "clk", "rst_n", "in_matx_en", "in_q0", "in_q1", "in_q2", *elements[1:], "in_unused"]
    for port in told["ports"]:
        assert re.search(rf"^//   {port['name']} +{port['direction']} {port['width']} +{re.escape(port['meaning'])}$",
                         header, re.MULTILINE)


def test_a_port_that_is_hidden_must_be_there(make_core):
    with pytest.raises(ValueError, match=r"^INS_atan has no port in_clock, in_other to hide$"):
        Wrapper(make_core("INS_atan", THESIS).engine, hidden=("in_other", "in_atan_en", "in_clock"))


@pytest.mark.parametrize(("name", "message"), [
    ("in_a", "INS_atan has two ports called 'in_a'"), ("clk", "INS_atan has two ports called 'clk'")])
def test_two_ports_of_one_name_are_refused(make_core, name, message):
    engine = make_core("INS_atan", THESIS).engine
    with pytest.raises(ValueError, match=rf"^{message}$"):
        Top(Wrapper(engine, added=(Port(name, In, 1, "another"),)))
