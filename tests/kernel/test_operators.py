"""Operators that are not in the default pool: in a kernel, in the twin and in the circuit."""

from dataclasses import replace

import numpy as np
import pytest

from strapdown import kernel
from strapdown.algorithms.attitude import Update
from strapdown.cores.core import Core
from strapdown.export import write
from strapdown.fp import BINARY32, BINARY64, Subnormals
from strapdown.kernel import operators
from strapdown.kernel.operators import (
    Comparator,
    Converter,
    Extremes,
    Operator,
    ReciprocalRoot,
    SineCosine,
    TableArctangent,
    TableReciprocal,
)
from strapdown.kernel.pool import MemoryStyle, Pool
from strapdown.kernel.stream import StreamEngine
from strapdown.kernel.system import System
from strapdown_sim.drivers.core import CoreModel
from strapdown_sim.drivers.stream import StreamModel

MORE = (ReciprocalRoot(), SineCosine(), Extremes(), Comparator(), Converter())
POOL = Pool().with_operators(*MORE)
BITS = {"in_word": 16, "in_wide": 30}
COUNT = 400


def equations(xp, a, b, angle, word, wide, last):
    """Each operation once or twice; both modes of a unit occur in sequence."""
    sine, cosine = xp.sincos(angle)
    outputs = {"root": xp.rsqrt(a), "sine": sine, "cosine": cosine, "least": xp.minimum(b, word),
               "greatest": xp.maximum(b, word), "chosen": xp.select(b < word, sine, cosine), "word": word,
               "sum": wide + last}
    return Update(outputs, state={"last": xp.select(word > b, word, last)}, status={"below": b < word})


SYSTEM = System(
    "OPERATIONS", "every operator", equations, sections=("ONLY",), start="in_en", finish="out_finish",
    inputs={"a": "in_a", "b": "in_b", "angle": "in_angle", "word": "in_word", "wide": "in_wide"},
    outputs={name: f"out_{name}" for name in ("root", "sine", "cosine", "least", "greatest", "chosen", "word", "sum")},
    state={"last": "last"}, status=("below",), status_port="out_status", integers=BITS)


def stimulus(seed):
    rng = np.random.default_rng(seed)
    inputs = {"in_a": np.ldexp(rng.uniform(0.5, 1, COUNT), rng.integers(-60, 60, COUNT)),
              "in_b": rng.uniform(-40_000, 40_000, COUNT), "in_angle": rng.uniform(-200, 200, COUNT)}
    for port, bits in BITS.items():
        inputs[port] = rng.integers(-(1 << bits - 1), 1 << bits - 1, COUNT)
        inputs[port][:4] = -(1 << bits - 1), (1 << bits - 1) - 1, -1, 0
    return inputs


@pytest.mark.parametrize("format", [BINARY32, BINARY64], ids=lambda format: format.name)
def test_the_twin_is_float64_within_the_operators_bounds(format):
    pool = replace(POOL, format=format.with_subnormals(Subnormals.FLUSH))
    inputs = stimulus(1)
    numbers = {port: values if port in BITS else format.array(values).astype(float) for port, values in inputs.items()}
    exact = SYSTEM.update_float64(numbers, {"last": 5.0})
    twin = SYSTEM.update_twin(pool, numbers, {"last": 5.0})
    assert not twin["refused"].any()
    ulp = 2.0**-(format.precision - 1)
    # The error of float64's functions is less than an ulp of binary64.
    own = 2.0**-52
    relative = {"out_root": ulp / 2, "out_least": ulp / 2, "out_greatest": ulp / 2, "out_word": 0.0, "out_sum": ulp,
                **dict.fromkeys(("out_sine", "out_cosine", "out_chosen"), 0.8 * ulp)}
    for port, bound in relative.items():
        assert (np.abs(twin[port] - exact[port]) <= (bound + own) * np.abs(exact[port])).all(), port
    assert (twin["below"] == exact["below"]).all()


@pytest.mark.verilator
@pytest.mark.parametrize("pool", [POOL, replace(POOL, forwarding=False, operand_memory=MemoryStyle.BLOCK),
                                  replace(POOL, side_memory=True, side_registered=True)],
                         ids=["default", "block memory", "registered results aside"])
def test_the_circuit_is_the_twin_in_every_bit(models, tmp_path, pool):
    core = Core(SYSTEM, pool)
    model = CoreModel(core, write(core, tmp_path, command=""), models)
    inputs = stimulus(2)
    # An update with a number that is not finite is refused; one with negative integers is not.
    inputs["in_angle"][50], inputs["in_b"][60] = 300.0, np.inf
    result = model.update(inputs)
    assert set(result["cycles"]) == {core.latency}
    assert np.flatnonzero(result["out_status"] >> 1 & 1).tolist() == [50, 60]
    assert model.differing_bits(inputs, result) == 0
    kept, _ = SYSTEM.run(pool, inputs)
    assert all((kept[port].view(np.uint32) == result[port].view(np.uint32)).all() for port in SYSTEM.output_ports)


def table_equations(xp, a, b):
    """Both modes of the reciprocals, and the angles of all octants."""
    return Update({"reciprocal": xp.reciprocal(b), "root": xp.rsqrt(a), "angle": xp.atan2_degrees(b, a - 100)})


TABLES = System(
    "TABLES", "operators by tables", table_equations, sections=("ONLY",), start="in_en", finish="out_finish",
    inputs={"a": "in_a", "b": "in_b"}, outputs={name: f"out_{name}" for name in ("reciprocal", "root", "angle")})
TABLE_POOL = Pool().with_operators(TableReciprocal(), TableArctangent())


def test_the_twins_of_tables_are_float64_within_their_bounds():
    inputs = {port: POOL.format.array(stimulus(5)[port]).astype(float) for port in ("in_a", "in_b")}
    exact, twin = TABLES.update_float64(inputs), TABLES.update_twin(TABLE_POOL, inputs)
    # The angle also has the error of a - 100, at most 2^-24 of it. An angle changes by no greater part than an operand,
    # and 2^-24 of a number is at most a unit in the last place.
    relative = {"out_reciprocal": 0.88, "out_root": 0.88, "out_angle": 1.8 + 1}
    for port, ulps in relative.items():
        ulp = np.spacing(np.abs(exact[port]).astype(np.float32))
        assert (np.abs(twin[port] - exact[port]) <= ulps * ulp).all(), port


@pytest.mark.verilator
@pytest.mark.parametrize("pool", [TABLE_POOL, replace(TABLE_POOL, forwarding=False, operand_memory=MemoryStyle.BLOCK)],
                         ids=["default", "block memory"])
def test_the_circuit_with_tables_is_the_twin_in_every_bit(models, tmp_path, pool):
    core = Core(TABLES, pool)
    model = CoreModel(core, write(core, tmp_path, command=""), models)
    inputs = {port: stimulus(6)[port] for port in ("in_a", "in_b")}
    inputs["in_a"][:4], inputs["in_b"][:6] = (0.0, -1.0, np.inf, np.nan), (0.0, -0.0, np.inf, -np.inf, np.nan, 1e-40)
    result = model.update(inputs)
    assert set(result["cycles"]) == {core.latency}
    assert model.differing_bits(inputs, result) == 0


@pytest.mark.verilator
def test_the_stream_is_the_twin_in_every_bit(models, tmp_path):
    pool = replace(POOL, forwarding=False, operand_memory=MemoryStyle.BLOCK, microcode=MemoryStyle.DISTRIBUTED)
    core = Core(SYSTEM, pool, engine=StreamEngine, channels=4, interval=90)
    model = StreamModel(core, write(core, tmp_path, command=""), models)
    inputs = stimulus(3)
    channels = np.random.default_rng(4).integers(4, size=COUNT)
    result = model.update(channels, inputs, idle=0)
    assert model.differing_bits(inputs, result) == 0


def test_an_integer_port_must_be_an_input():
    with pytest.raises(ValueError, match=r"^integers names 'in_c', which is not an input port$"):
        replace(SYSTEM, integers={"in_c": 16})


def test_an_integer_port_has_two_bits_at_least():
    with pytest.raises(ValueError, match=r"^integer port in_word must have at least 2 bits, not 1$"):
        replace(SYSTEM, integers={"in_word": 1})


def test_an_integer_port_fits_a_word_of_the_memory():
    system = replace(SYSTEM, integers={"in_word": 31})
    with pytest.raises(ValueError, match=r"^integer port in_word must have at most 30 bits in binary32, not 31$"):
        system.trace(POOL)
    system.trace(replace(POOL, format=BINARY64))


def test_an_input_port_has_not_the_name_of_a_unit():
    system = replace(SYSTEM, inputs={**SYSTEM.inputs, "b": "divider_1"})
    with pytest.raises(ValueError, match=r"^input port divider_1 must not have the name of an operator of the pool$"):
        system.trace(POOL)


def test_the_kernel_package_has_all_operators():
    kinds = {name for name, each in vars(operators).items() if isinstance(each, type) and issubclass(each, Operator)}
    assert "Converter" in kinds
    assert kinds <= set(kernel.__all__)


def test_an_integer_port_needs_a_converter():
    pool = Pool().with_operators(*MORE[:-1])
    with pytest.raises(ValueError, match=r"^the pool has no operator for from_integer: add one to its operators$"):
        SYSTEM.trace(pool)
