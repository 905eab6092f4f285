"""Stimuli, expectations and circuits for the tests of the floating-point operators.

Numbers are encodings, uint64 arrays. Expected results are computed here from the definition of the
formats, in float64, and share no code with the operators' ``compute``. A sum, product, quotient
or root that is rounded to float64, and then to a precision p with 2p + 2 <= 53, is correctly rounded
(S. A. Figueroa, When is double rounding innocuous?, 1995). For binary64, NumPy computes them.
"""

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from amaranth import *
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out

from strapdown.export.backend import to_verilog
from strapdown.fp import BINARY16, BINARY32, BINARY64, FloatFormat
from strapdown_sim.drivers.toolchain import SimulatorMissingError
from strapdown_sim.drivers.verilated import Interface, VerilatedModel

VECTORS = Path(__file__).resolve().parents[3] / "shared" / "vectors" / "testfloat"

FLOAT8 = FloatFormat(4, 3)
# The exponent range is so small that even a square root may be subnormal.
NARROW = FloatFormat(3, 4)
BFLOAT16 = FloatFormat(8, 7)
FORMATS = {f"{name}_{policy}": fmt.with_subnormals(policy)
           for name, fmt in (("float8", FLOAT8), ("narrow", NARROW), ("bfloat16", BFLOAT16),
                             ("binary16", BINARY16), ("binary32", BINARY32), ("binary64", BINARY64))
           for policy in ("gradual", "flush")}


# Formats, from their definition.

def sign_bit(fmt):
    return np.uint64(1 << (fmt.width - 1))


def magnitude(fmt, encodings):
    return encodings & (sign_bit(fmt) - np.uint64(1))


def is_nan(fmt, encodings):
    return magnitude(fmt, encodings) > np.uint64(fmt.infinity)


def canonical(fmt, encodings):
    """Every NaN replaced by the format's NaN."""
    return np.where(is_nan(fmt, encodings), np.uint64(fmt.nan), encodings)


def flushed(fmt, encodings):
    """Operands after flushing, if that is the policy."""
    tiny = magnitude(fmt, encodings) < np.uint64(fmt.least_normal)
    return np.where(tiny & (not fmt.gradual), encodings & sign_bit(fmt), encodings)


def decode(fmt, encodings):
    """Operands after flushing, as float64."""
    encodings = flushed(fmt, np.asarray(encodings, dtype=np.uint64))
    if fmt.width == 64:
        return encodings.view(np.float64)
    fraction = (encodings & np.uint64((1 << fmt.fraction_width) - 1)).astype(np.int64)
    exponent = (magnitude(fmt, encodings) >> np.uint64(fmt.fraction_width)).astype(np.int64)
    significand = fraction + ((exponent > 0) << fmt.fraction_width)
    number = np.ldexp(significand.astype(float), np.maximum(exponent, 1) - fmt.bias - fmt.fraction_width)
    special = np.where(fraction == 0, np.inf, np.nan)
    number = np.where(exponent == fmt.exponent_special, special, number)
    return np.where(encodings & sign_bit(fmt), -number, number)


def encode(fmt, numbers):
    """float64 numbers rounded to nearest, ties to even, and flushed if that is the policy."""
    sign = np.signbit(numbers).astype(np.uint64) << np.uint64(fmt.width - 1)
    size = np.abs(numbers)
    exponent = np.where(size == 0, 1, np.maximum(np.frexp(size)[1].astype(np.int64) - 1 + fmt.bias, 1))
    with np.errstate(all="ignore"):
        ulps = np.rint(np.ldexp(size, fmt.bias + fmt.fraction_width - exponent))
        # The ulps are added to the first encoding of the binade, so a carry leads into the next binade.
        result = ((exponent - 1) << fmt.fraction_width) + np.where(np.isfinite(ulps), ulps, 0).astype(np.int64)
    result = np.where(np.isinf(size) | (result > fmt.infinity), fmt.infinity, result)
    if not fmt.gradual:
        result = np.where(size < 2.0 ** (1 - fmt.bias), 0, result)
    return np.where(np.isnan(numbers), np.uint64(fmt.nan), result.astype(np.uint64) | sign)


def expected(fmt, operation, *operands, exact=None):
    """Encodings of ``operation`` on the operands' numbers.

    For binary64, NumPy computes them. If a result was rounded to the least normal number, ``exact``,
    the operation on Fractions, decides on which side of it the exact result lies.
    """
    numbers = [decode(fmt, operand) for operand in operands]
    with np.errstate(all="ignore"):
        result = operation(*numbers)
    if fmt.width < 64:
        return encode(fmt, result)
    encodings = canonical(fmt, result.view(np.uint64))
    if not fmt.gradual:
        encodings = flushed(fmt, encodings)
        for index in np.flatnonzero(magnitude(fmt, encodings) == fmt.least_normal):
            size = abs(exact(*(Fraction(float(number[index])) for number in numbers)))
            if size < Fraction(2) ** (1 - fmt.bias):
                encodings[index] &= sign_bit(fmt)
    return encodings


# Stimuli.

def specials(fmt):
    """Zeros, ends of the ranges of subnormals and normals, infinities, NaNs, one and its neighbours."""
    one = fmt.bias << fmt.fraction_width
    positive = [0, 1, 2, fmt.least_normal - 1, fmt.least_normal, fmt.least_normal + 1, one - 1, one, one + 1,
                one + fmt.least_normal, fmt.infinity - 1, fmt.infinity, fmt.infinity + 1, fmt.nan,
                (1 << fmt.width - 1) - 1]
    return np.array([sign << (fmt.width - 1) | value for sign in (0, 1) for value in positive], dtype=np.uint64)


def random_numbers(fmt, count, rng):
    """Random encodings: uniform, near the subnormal range, of few significant bits, and special."""
    uniform = rng.integers(0, 1 << fmt.width, count, dtype=np.uint64) if fmt.width < 64 else \
        rng.integers(0, 1 << 64, count, dtype=np.uint64)
    small = uniform & (sign_bit(fmt) | np.uint64((4 << fmt.fraction_width) - 1))
    kept = rng.integers(0, fmt.fraction_width, count, endpoint=True, dtype=np.uint64)
    short = uniform >> kept << kept
    kind = rng.choice(4, count, p=(0.5, 0.15, 0.25, 0.1))
    return np.choose(kind, (uniform, small, short, rng.choice(specials(fmt), count)))


def with_exponent(fmt, encodings, exponent):
    """The same signs and fractions with other biased exponents, limited to those of finite numbers."""
    kept = encodings & (sign_bit(fmt) | np.uint64(fmt.least_normal - 1))
    limited = np.clip(exponent, 0, fmt.exponent_special - 1).astype(np.uint64)
    return kept | limited << np.uint64(fmt.fraction_width)


def random_pairs(fmt, count, rng):
    """Random pairs: independent, all pairs of special numbers, pairs near cancellation, and pairs whose sums,
    products or quotients are near the ends of the range."""
    a, b = random_numbers(fmt, count, rng), random_numbers(fmt, count, rng)
    corner = specials(fmt)
    crossed = np.array(np.meshgrid(corner, corner)).reshape(2, -1)[:, :count]
    near = a ^ sign_bit(fmt) ^ rng.integers(0, 4, count, dtype=np.uint64)
    exponent = (magnitude(fmt, a) >> np.uint64(fmt.fraction_width)).astype(np.int64)
    jitter = rng.integers(-2, 3, count)
    wide = rng.integers(-fmt.precision - 4, fmt.precision + 5, count)
    kinds = [
        b,
        near,
        with_exponent(fmt, b, exponent + wide),                          # bits meet in a sum
        with_exponent(fmt, b, fmt.bias + 1 - exponent - jitter),         # product near underflow
        with_exponent(fmt, b, fmt.bias - exponent + np.minimum(wide, 1)),
        with_exponent(fmt, b, 3 * fmt.bias - exponent + jitter),         # product near overflow
        with_exponent(fmt, b, exponent + fmt.bias + jitter),             # quotient near underflow
        with_exponent(fmt, b, exponent + fmt.bias + wide),
        with_exponent(fmt, b, exponent - fmt.bias + jitter),             # quotient near overflow
    ]
    b = np.choose(rng.choice(len(kinds), count, p=(0.28, *(0.09,) * 8)), kinds)
    a[:crossed.shape[1]], b[:crossed.shape[1]] = crossed
    return a, b


CASES = {16: 200_000, 32: 1_000_000, 64: 200_000}


def numbers_for(fmt, rng):
    """All numbers of a format, or many."""
    if fmt.width <= 16:
        return np.arange(1 << fmt.width, dtype=np.uint64)
    return random_numbers(fmt, CASES.get(fmt.width, CASES[64]), rng)


def pairs_for(fmt, rng):
    """All pairs of a format's numbers, or many."""
    if fmt.width <= 8:
        a, b = np.meshgrid(*2 * (np.arange(1 << fmt.width, dtype=np.uint64),))
        return a.ravel(), b.ravel()
    return random_pairs(fmt, CASES[fmt.width], rng)


def vectors(name):
    """The vectors of one TestFloat operation: dict of arrays."""
    file = VECTORS / f"{name}.npz"
    if not file.exists():
        pytest.skip("The TestFloat vectors are not here: results are checked by the other tests only.")
    with np.load(file) as arrays:
        return {key: rows.astype(np.uint64) for key, rows in arrays.items()}


# Circuits.

class Bank(wiring.Component):
    """Several operators in one Verilated model, with common operands and start.

    Parameters
    ----------
    operators : dict
        Name to operator; outputs of an operator are called ``name_member``.
    """

    def __init__(self, operators):
        self.operators = operators
        inputs, outputs = {}, {}
        for name, op in operators.items():
            for member, port in op.signature.members.items():
                width = Shape.cast(port.shape).width
                if port.flow is In:
                    inputs[member] = max(width, inputs.get(member, 0))
                else:
                    outputs[f"{name}_{member}"] = width
        super().__init__({**{name: In(width) for name, width in inputs.items()},
                          **{name: Out(width) for name, width in outputs.items()}})
        self._inputs, self._outputs = tuple(inputs), tuple(outputs)

    def elaborate(self, platform):
        m = Module()
        for name, op in self.operators.items():
            m.submodules[name] = op
            for member, port in op.signature.members.items():
                inner = Value.cast(getattr(op, member))
                if port.flow is In:
                    m.d.comb += inner.eq(getattr(self, member))
                else:
                    m.d.comb += getattr(self, f"{name}_{member}").eq(inner)
        return m

    def build(self, models, directory):
        """Translate and compile into ``models``; skips the test if that is not possible."""
        source = directory / "bank.v"
        source.write_text(to_verilog(self, "bank"), encoding="utf-8")
        interface = Interface("bank", self._inputs, self._outputs, reset="rst", reset_active=1)
        try:
            self._model = VerilatedModel(source, interface, models)
        except SimulatorMissingError as error:
            pytest.skip(str(error))
        return self

    def cycles(self, stimulus):
        """Every output in every cycle: name to member to array."""
        answer = self._model.stream(stimulus)
        return {name: {member: answer[f"{name}_{member}"] for member, port in op.signature.members.items()
                       if port.flow is Out}
                for name, op in self.operators.items()}

    def run(self, **operands):
        """Every operator's results for rows of operands, started as often as the slowest operator allows.

        Asserts ``done`` in every cycle: neither early nor late. Operands are inverted between starts.
        Returns name to member to array.
        """
        interval = max(op.interval for op in self.operators.values())
        tail = -(-max(op.latency for op in self.operators.values()) // interval)
        pieces = []
        for part in _pieces(operands, (1 << 18) // interval):
            rows = len(next(iter(part.values())))
            start = np.zeros((rows + tail, interval), dtype=np.uint64)
            start[:rows, 0] = 1
            stimulus = {"start": start.ravel()}
            for name, values in part.items():
                lanes = np.zeros((rows + tail, interval), dtype=np.uint64)
                lanes[:rows] = np.asarray(values).astype(np.uint64)[:, None]
                lanes[:, 1:] = ~lanes[:, 1:]
                stimulus[name] = lanes.ravel() & np.uint64((1 << len(getattr(self, name))) - 1)
            answer = self.cycles(stimulus)
            for name, op in self.operators.items():
                done = answer[name].pop("done")
                np.testing.assert_array_equal(done, delayed(stimulus["start"], op.latency))
                answer[name] = {member: values[op.latency::interval][:rows]
                                for member, values in answer[name].items()}
            pieces.append(answer)
        return {name: {member: np.concatenate([piece[name][member] for piece in pieces])
                       for member in pieces[0][name]} for name in self.operators}

    def check(self, fmt, wanted, flags=None, **operands):
        """Compare the results of circuits and twins with encodings, for all operators of this
        format that have exactly these operands. With ``flags``, also compare the flags of the
        operators that have them."""
        results = self.run(**operands)
        chosen = {name: op for name, op in self.operators.items()
                  if op.format == fmt and inputs(op) == {*operands, "start"}}
        assert chosen
        numbers = {member: fmt.from_bits(rows) if member in ("a", "b") else rows.astype(bool)
                   for member, rows in operands.items()}
        for name, op in chosen.items():
            assert_equal(name, results[name]["result"], wanted, operands)
            assert_equal(f"{name}, twin", fmt.to_bits(op.compute(**numbers)), wanted, operands)
            if flags is not None and "flags" in results[name]:
                assert_equal(f"{name}, flags", results[name]["flags"], flags, operands)
                assert_equal(f"{name}, flags of twin", op.compute_flags(**numbers), flags, operands)

    def check_handshake(self, rng, **operands):
        """Random starts, with operands that change in every cycle: assert ``done`` and the results.

        An iterative operator must ignore a start while it is busy; its result holds.
        """
        start = (rng.random(len(next(iter(operands.values())))) < 0.6).astype(np.uint64)
        results = self.run(**operands)
        answer = self.cycles({"start": start, **operands})
        for name, op in self.operators.items():
            accepted, free = np.zeros_like(start), 0
            for cycle in np.flatnonzero(start):
                if cycle >= free:
                    accepted[cycle], free = 1, cycle + op.interval
            done = delayed(accepted, op.latency)
            np.testing.assert_array_equal(answer[name].pop("done"), done, err_msg=name)
            # The row of the result at the output, from the latest done; none before the first done.
            latest = np.maximum.accumulate(np.where(done, np.arange(len(done)), -1))
            seen = latest >= 0 if op.interval > 1 else done.astype(bool)
            for member, values in answer[name].items():
                wanted = results[name][member][latest[seen] - op.latency]
                np.testing.assert_array_equal(values[seen], wanted, err_msg=name)


def inputs(op):
    return {member for member, port in op.signature.members.items() if port.flow is In}


def delayed(values, cycles):
    return np.concatenate([np.zeros_like(values[:cycles]), values[:-cycles]])


def _pieces(operands, size):
    count = len(next(iter(operands.values())))
    for first in range(0, count, size):
        yield {name: values[first:first + size] for name, values in operands.items()}


def assert_equal(name, got, wanted, operands):
    """Equal integers, or the first differences in hexadecimal."""
    wrong = np.flatnonzero(got != wanted)
    rows = "\n".join(f"{got[row]:#x}, not {wanted[row]:#x}, from " + ", ".join(
        f"{member} {values[row]:#x}" for member, values in operands.items()) for row in wrong[:5])
    assert not wrong.size, f"{name}: {wrong.size} of {got.size} wrong\n{rows}"
