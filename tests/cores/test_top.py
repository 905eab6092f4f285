"""Wrappers around engines, written here and nowhere else: exported and run like a core."""

import json
import re

import numpy as np
import pytest
from amaranth import *
from amaranth.lib.wiring import In, Out

from strapdown.cores import QUATERNION_J3, THESIS, Top, Wrapper
from strapdown.export import write
from strapdown.kernel.description import Port, Section
from strapdown_sim.drivers.toolchain import SimulatorMissingError
from strapdown_sim.drivers.verilated import Interface, VerilatedModel

WORD = 8


class StatusWord(Wrapper):
    """An engine whose finish and status, if it has one, come as one word, a cycle later."""

    def __init__(self, engine):
        self.packed = tuple(filter(None, (engine.system.finish, engine.system.status_port)))
        super().__init__(
            engine, name=f"{engine.name}_word", title=f"{engine.title}, finish and status in a word",
            hidden=self.packed,
            added=(Port("out_word", Out, WORD, "bit 0: finish; bits 1 and above: status"),))

    @property
    def sections(self):
        return *super().sections, Section("WORD", paragraphs=("The word follows the engine by a cycle.",))

    @property
    def facts(self):
        return super().facts | {"word_bits": WORD}

    def elaborate(self, platform):
        m = super().elaborate(platform)
        m.d.sync += self.out_word.eq(Cat(getattr(self.engine, port) for port in self.packed))
        return m


class StartOnEdge(Wrapper):
    """Something that starts at each change of an input, instead of at a high level."""

    def __init__(self, engine):
        super().__init__(engine, name=f"{engine.name}_edge", hidden=(engine.system.start,),
                         added=(Port("in_change", In, 1, "each change starts an update"),))

    def elaborate(self, platform):
        m = super().elaborate(platform)
        before = Signal()
        m.d.sync += before.eq(self.in_change)
        m.d.comb += getattr(self.engine, self.system.start).eq(self.in_change ^ before)
        return m


def wrapped(make_core, module, config, wrap, folder):
    top = Top(wrap(make_core(module, config).engine))
    return top, write(top, folder, command="as in this test", config=config)


@pytest.mark.verilator
@pytest.mark.parametrize(("module", "config", "wrap"), [
    ("INS_top", THESIS, StatusWord),
    ("QUAT_direct", QUATERNION_J3, lambda engine: StartOnEdge(StatusWord(engine))),
])
def test_a_wrapper_runs(make_core, models, tmp_path, module, config, wrap):
    top, path = wrapped(make_core, module, config, wrap, tmp_path)
    engine, system = make_core(module, config).engine, make_core(module, config).system
    added = "in_change" if "in_change" in top.signature.members else None
    start = added or system.start
    try:
        model = VerilatedModel(path, Interface(top.component.name, (start, *system.input_ports),
                                               (*system.output_ports, "out_word")), models)
    except SimulatorMissingError as error:
        pytest.skip(str(error))

    # Two updates, the second refused; the inputs are there at their starts only.
    taken = np.array([5, 5 + engine.latency + 20])
    cycles = np.arange(taken[1] + engine.latency + 10)
    rng = np.random.default_rng(7)
    stimulus = {start: ((cycles[:, None] >= taken).sum(1) % 2 if added else np.isin(cycles, taken))}
    numbers = {port: np.float32(rng.standard_normal(2)) for port in system.input_ports}
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


def test_a_wrapper_describes_itself(make_core, tmp_path):
    top, path = wrapped(make_core, "INS_matx", THESIS, StatusWord, tmp_path)
    header, verilog = path.read_text().split("\nmodule ", 1)
    told = json.loads(path.with_suffix(".json").read_text())
    assert path.name == f"{told['module']}.v" == "INS_matx_word.v"
    assert header.startswith("// INS_matx_word: matrix from quaternion, finish and status in a word\n")
    assert "\n// EQUATIONS\n//   matrix_from_quaternion: " in header
    assert re.search(r"^//   kp +10", header, re.MULTILINE)
    # The engine's own sections, then the wrapper's.
    assert re.findall(r"^// ([A-Z]+)", header, re.MULTILINE)[-5:] == [
        "TIMING", "SEQUENCER", "OPERATORS", "MICROPROGRAM", "WORD"]
    assert told["word_bits"] == WORD
    assert told["latency_cycles"] == top.latency == make_core("INS_matx", THESIS).latency
    ports = re.findall(r"^  (input|output) (?:\[(\d+):0\] )?(\w+);", verilog.split("endmodule")[0], re.MULTILINE)
    assert sorted((direction, int(high or 0) + 1, name) for direction, high, name in ports) == sorted(
        (port["direction"], port["width"], port["name"]) for port in told["ports"])
    names = [port["name"] for port in told["ports"]]
    assert names[:4] == ["clk", "rst_n", "in_matx_en", "in_q0"]
    assert names[-2:] == ["out_c33", "out_word"]
    for port in told["ports"]:
        assert re.search(rf"^//   {port['name']} +{port['direction']} {port['width']} +{re.escape(port['meaning'])}$",
                         header, re.MULTILINE)


def test_a_port_that_is_hidden_must_be_there(make_core):
    with pytest.raises(ValueError, match=r"^INS_atan has no port in_clock, in_other to hide$"):
        Wrapper(make_core("INS_atan", THESIS).engine, hidden=("in_other", "in_atan_en", "in_clock"))
