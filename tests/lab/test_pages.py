"""Pages of docs/operators are up to date and complete, and their diagrams agree with the circuits."""

import inspect
import re

import numpy as np
import pytest
from amaranth.hdl import Value
from amaranth.lib.wiring import Component
from amaranth.sim import Simulator

from strapdown import cordic, fp
from strapdown.cordic import CordicAtan2, CordicSinCos
from strapdown.fp import BINARY16, BINARY32, FpAdd, FpDivide, FpDivideSquareRoot, FpReciprocalSquareRoot
from strapdown_lab import docs
from strapdown_lab.checkout import block
from strapdown_lab.report.diagram import diagram, iterative_timing, pipelined_timing
from strapdown_lab.report.pages import PAGES, page_text
from strapdown_lab.special_values import number_text

NUMBERS = {"A": 1.5, "B": 2.25, "C": 3.5, "X": 7.0, "": 0.0}
CIRCUITS = {
    "add": (FpAdd(BINARY32), "a"),
    "divide, pipelined": (FpDivide(BINARY16), "a"),
    "divide, iterative": (FpDivide(BINARY16, iterative=True), "a"),
    "divide and square root": (FpDivideSquareRoot(BINARY16), "a"),
    "reciprocal square root": (FpReciprocalSquareRoot(BINARY16), "a"),
    "arctangent, iterative": (CordicAtan2(BINARY16), "y"),
    "arctangent, pipelined": (CordicAtan2(BINARY16, iterative=False), "y"),
    "sine and cosine": (CordicSinCos(BINARY16), "angle"),
}


def test_every_operator_has_a_page():
    exported = {name for module in (fp, cordic) for name, member in vars(module).items()
                if inspect.isclass(member) and issubclass(member, Component)}
    assert exported == set(PAGES)


def test_pages_are_those_of_this_commit(root):
    pages = {path.stem: path.read_text(encoding="utf-8") for path in (root / "docs" / "operators").glob("*.md")}
    index = pages.pop("README")
    written = docs.operator_pages()
    assert pages.keys() == written.keys()
    assert [name for name in pages if pages[name] != written[name]] == [], "make docs writes them again"
    for name, content in docs.operator_index_blocks().items():
        assert block(index, name)[1].strip() == content


def test_linked_files_exist(root):
    for page in (root / "docs" / "operators").glob("*.md"):
        for target in re.findall(r"\]\(([^)#]+)", page.read_text(encoding="utf-8")):
            assert (page.parent / target).exists(), f"{page.name}: {target}"


def test_page_shows_what_was_measured_of_its_operator_only():
    row = {"component": "X", "formats": ["binary32"], "subnormals": "flush", "latency": 5, "interval": 1,
           "parameters": {"latency": 5}, "xc7": {"lut": 321, "ff": 77, "dsp": 0}}
    other = {**row, "operator": "multiply", "xc7": {"lut": 54, "ff": 77, "dsp": 0}}
    report = {"operators": [{**row, "operator": "add"}, other]}
    text = page_text(PAGES["FpAdd"], report)
    assert "| 321 | 77 | 0 |" in text
    assert "| 54 |" not in text
    assert "## Resources" not in page_text(PAGES["FpAdd"])


@pytest.mark.parametrize("name", CIRCUITS)
def test_diagrams_show_what_circuits_do(name):
    circuit, operand = CIRCUITS[name]
    pipelined = circuit.interval == 1
    timing = pipelined_timing(circuit.latency) if pipelined else iterative_timing(circuit.latency, circuit.interval)
    one, result = circuit.format.encode(1), "sin" if hasattr(circuit, "sin") else "result"
    done, results = [], []

    async def testbench(ctx):
        for other in ("x", "b"):
            if hasattr(circuit, other):
                ctx.set(Value.cast(getattr(circuit, other)), one)
        for operation in timing.operands:
            ctx.set(circuit.start, bool(operation))
            ctx.set(Value.cast(getattr(circuit, operand)), circuit.format.encode(NUMBERS[operation]))
            done.append(bool(ctx.get(circuit.done)))
            results.append(ctx.get(Value.cast(getattr(circuit, result))))
            await ctx.tick()

    simulator = Simulator(circuit)
    simulator.add_clock(1e-6)
    simulator.add_testbench(testbench)
    simulator.run()
    assert done == timing.done
    assert results_of(circuit, timing.results) == {
        cycle: results[cycle] for cycle, operation in enumerate(timing.results) if operation}


def results_of(circuit, operations):
    """Encodings of the twin's results for operations, by cycle."""
    others = 1 if hasattr(circuit, "x") or hasattr(circuit, "b") else None
    encodings = {}
    for cycle, operation in enumerate(operations):
        if operation:
            number = circuit.format.array(NUMBERS[operation])
            arguments = [number] if others is None else [number, circuit.format.array(others)]
            if isinstance(circuit, FpDivideSquareRoot):
                arguments.append(False)
            value = circuit.compute(*arguments)
            encodings[cycle] = int(circuit.format.to_bits(value.sin if hasattr(circuit, "sin") else value))
    return encodings


def test_long_waits_are_left_out_of_a_diagram():
    assert diagram(iterative_timing(9, 8), "a", "result").splitlines() == [
        "clk     /‾\\_/‾\\_/‾\\_/‾\\_ .. /‾\\_/‾\\_/‾\\_/‾\\_ .. /‾\\_/‾\\_/‾\\_",
        "cycle   0   1   2   3       7   8   9   10      16  17  18",
        "start   /‾‾‾\\___/‾‾‾\\____.._____/‾‾‾\\________.._____________",
        "a       ‹A ›    ‹X ›            ‹B ›",
        "(busy)  ____/‾‾‾‾‾‾‾‾‾‾‾‾..‾‾‾‾‾‾‾‾‾‾‾‾‾‾‾‾‾‾..‾‾‾‾‾\\_______",
        "done    _________________.._________/‾‾‾\\____.._____/‾‾‾\\___",
        "result                              ‹      A       ›‹  B   ›"]


@pytest.mark.parametrize(("bits", "text"), [
    (0x80000000, "−0"), (0x3F800000, "1"), (0xFF800000, "−∞"), (0x7FC00000, "NaN"), (0x7F800001, "sNaN"), (1, "tiny"),
    (0xFF7FFFFF, "−max"), (0x3F490FDB, "0.7853982"), (0x4B800000, "16,777,216"), (0x00800000, "1.1754944e-38")])
def test_numbers_are_written_with_digits_enough(bits, text):
    assert number_text(BINARY32.from_bits(np.array(bits))) == text
