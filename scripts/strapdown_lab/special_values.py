"""Tables of the results for zeros, infinities, NaN and the ends of the range, computed by the twins."""

import re
from functools import partial
from operator import attrgetter

import numpy as np

from strapdown.fp import BINARY16, BINARY32, FixedToFp, Flags, FpSumOfProducts, FpToFixed, FpToFp, Subnormals
from strapdown.markdown import markdown_table

__all__ = ["FLAG_NAMES", "arctangent_tables", "binary_tables", "choice_table", "compare_tables",
           "fixed_arctangent_table", "flushed_table", "from_fixed_table", "legend", "number_text", "relation_table",
           "resize_tables", "sincos_table", "sum_of_products_table", "table_reciprocal_table", "to_fixed_table",
           "unary_table"]

FLUSHED = BINARY32.with_subnormals(Subnormals.FLUSH)
SIGNALLING = BINARY32.infinity + 1
TINY, MAX = 1, BINARY32.infinity - 1
MINUS = 1 << 31
ONE = BINARY32.encode(1)

UNARY = (0, MINUS, ONE, ONE | MINUS, BINARY32.encode(2), TINY, TINY | MINUS, BINARY32.least_normal, MAX, MAX | MINUS,
         BINARY32.infinity, BINARY32.infinity | MINUS, BINARY32.nan, SIGNALLING)
BINARY = (0, MINUS, ONE, ONE | MINUS, TINY, MAX, BINARY32.infinity, BINARY32.infinity | MINUS, BINARY32.nan,
          SIGNALLING)

NAMES = {"tiny": "the least subnormal, 2<sup>−149</sup>",
         "max": "the greatest number, (2 − 2<sup>−23</sup>) 2<sup>127</sup>",
         "sNaN": "a signalling NaN, 7f800001", "?": "unordered"}
FLAG_NAMES = {Flags.INVALID: "NV", Flags.DIVIDE_BY_ZERO: "DZ", Flags.OVERFLOW: "OF", Flags.UNDERFLOW: "UF",
              Flags.INEXACT: "NX"}


def legend(tables):
    """Meanings of the names in the cells of tables."""
    words = set(re.findall(r"[^\s|*−]+", tables))
    parts = [f"`{name}` is {meaning}" for name, meaning in NAMES.items() if name in words]
    if any(f"`{name}" in tables for name in FLAG_NAMES.values()):
        parts.append("the [flags](README.md#flags) that a result raises follow it")
    text = "; ".join(parts)
    return f"{text[:1].upper()}{text[1:]}." if parts else ""


def number_text(value, fmt=BINARY32):
    """A number of a format: by name, or with enough digits to distinguish it from every other number."""
    bits = int(fmt.to_bits(value))
    sign, magnitude = "−" if bits >> (fmt.width - 1) else "", bits & ((1 << (fmt.width - 1)) - 1)
    if magnitude > fmt.infinity:
        return "NaN" if bits == fmt.nan else "sNaN" if not bits & (1 << (fmt.fraction_width - 1)) else f"{bits:x}"
    if magnitude == 0:
        return f"{sign or '+'}0"
    if magnitude == fmt.infinity:
        return f"{sign or '+'}∞"
    if fmt is BINARY32 and magnitude in (TINY, MAX):
        return sign + ("tiny" if magnitude == TINY else "max")
    absolute = np.float32(abs(value))
    if absolute.is_integer() and absolute < 2**32:
        return f"{sign}{int(absolute):,}"
    digits = np.format_float_positional if 1e-3 <= absolute < 1e6 else np.format_float_scientific
    return sign + digits(absolute, trim="-")


def _cell(text, flags):
    raised = " ".join(name for flag, name in FLAG_NAMES.items() if int(flags) & flag)
    return f"{text} `{raised}`" if raised else text


def _numbers(encodings):
    return BINARY32.from_bits(np.array(encodings))


def _evaluate(operator, operands, text=number_text, outcome=np.asarray, **constants):
    """The cells of a table for arrays of operands that broadcast: results, and flags if any are raised.

    ``outcome`` turns the results of the twin into one array.
    """
    results = outcome(operator.compute(*operands, **constants))
    raised = operator.compute_flags(*operands, **constants) if hasattr(operator, "compute_flags") else 0
    raised = np.broadcast_to(raised, np.shape(results))
    cells = np.empty(np.shape(results), dtype=object)
    for index in np.ndindex(cells.shape):
        cells[index] = _cell(text(results[index]), raised[index])
    return cells


def _matrix(corner, numbers, cells):
    names = [number_text(number) for number in numbers]
    return markdown_table([corner, *names], [[f"**{name}**", *row] for name, row in zip(names, cells, strict=True)])


def binary_tables(component, title=None, names=("a", "b"), **options):
    """A table for an operator of two operands, and the cells that differ if subnormals are flushed."""
    numbers = _numbers(BINARY)
    operands = numbers[:, None], numbers[None, :]
    cells, flushed = (_evaluate(component(fmt), operands, **options) for fmt in (BINARY32, FLUSHED))
    different = [[number_text(numbers[i]), number_text(numbers[j]), cells[i, j], flushed[i, j]]
                 for i, j in np.argwhere(cells != flushed)]
    return "\n\n".join([
        *([f"{title}:"] if title else []), _matrix(f"{names[0]} ↓ {names[1]} →", numbers, cells),
        "These results differ if subnormals are flushed:", markdown_table([*names, "gradual", "flushed"], different)])


def flushed_table(component, names=("a", "b")):
    """A table for an operator of two operands that flushes subnormals."""
    numbers = _numbers(BINARY)
    return _matrix(f"{names[0]} ↓ {names[1]} →", numbers,
                   _evaluate(component(FLUSHED), (numbers[:, None], numbers[None, :])))


def unary_table(component, **constants):
    """A row for each operand of an operator with one operand; subnormals kept and flushed."""
    numbers = _numbers(UNARY)
    columns = [_evaluate(component(fmt), (numbers,), **constants) for fmt in (BINARY32, FLUSHED)]
    return markdown_table(["a", "result, gradual", "result, flushed"],
                          zip(map(number_text, numbers), *columns, strict=True))


def table_reciprocal_table(component):
    """A row for each operand of an operator with two functions of one operand."""
    numbers, operator = _numbers(UNARY), component(FLUSHED)
    columns = [_evaluate(operator, (numbers, square_root)) for square_root in (False, True)]
    return markdown_table(["a", "1 / a, `square_root` = 0", "1 / √a, `square_root` = 1"],
                          zip(map(number_text, numbers), *columns, strict=True))


def sum_of_products_table():
    """A row for each pair of products: zeros, cancellation, products out of range, infinities and NaN."""
    infinity = BINARY32.infinity
    rows = _numbers([
        [0, ONE, 0, ONE], [MINUS, ONE, MINUS, ONE], [0, ONE, MINUS, ONE], [ONE, MAX, ONE, MAX | MINUS],
        [MAX, MAX, MAX, MAX | MINUS], [MAX, MAX, ONE, ONE], [TINY, ONE, ONE, ONE], [TINY, TINY, 0, ONE],
        [TINY, ONE, TINY, ONE], [infinity, ONE, ONE, MAX], [infinity, ONE, infinity, ONE | MINUS],
        [infinity, 0, ONE, ONE], [BINARY32.nan, ONE, ONE, ONE], [SIGNALLING, ONE, ONE, ONE]])
    columns = [_evaluate(FpSumOfProducts(fmt), tuple(rows.T)) for fmt in (BINARY32, FLUSHED)]
    return markdown_table([*"abcd", "a b + c d, gradual", "a b + c d, flushed"],
                          [[*map(number_text, row), *cells] for row, *cells in zip(rows, *columns, strict=True)])


def relation_table(component, relations):
    """Values of the relations for operands that are less, equal, greater and unordered."""
    pairs = _numbers([[ONE, MAX], [ONE, ONE], [0, MINUS], [MAX, ONE], [BINARY32.nan, ONE], [SIGNALLING, ONE]])
    head = ["relation", *(f"{number_text(a)}, {number_text(b)}" for a, b in pairs)]
    rows = [[f"`{relation}`", *_evaluate(component(BINARY32, relation), (pairs[:, 0], pairs[:, 1]),
                                         lambda holds: str(int(holds)))] for relation in relations]
    return markdown_table(head, rows)


def compare_tables(component):
    """Relation of each pair of operands: less, equal, greater or unordered."""
    def relation(relations):
        return np.select([relations.less, relations.equal, relations.unordered], ["<", "=", "?"], ">")

    return binary_tables(component, text=str, outcome=relation)


def choice_table(component):
    """Encodings before and after a multiplexer, which passes all of them unchanged."""
    numbers = _numbers(UNARY)
    bits = BINARY32.to_bits(component.compute(numbers, np.float32(1), True))
    return markdown_table(["a", "encoding of a", "encoding of the result, condition = 1"],
                          [[number_text(number), f"{before:08x}", f"{after:08x}"]
                           for number, before, after in zip(numbers, UNARY, bits, strict=True)])


def to_fixed_table(width, fraction_bits):
    """Results for ties, for the ends of the range, and for numbers out of range."""
    operator = FpToFixed(BINARY32, width=width, fraction_bits=fraction_bits)
    unit, end = 2.0 ** -fraction_bits, 2.0 ** (width - 1 - fraction_bits)
    numbers = np.concatenate([
        _numbers(UNARY[:4]), np.array([0.5, 1.5, 2.5], "f4") * np.float32(unit),
        np.array([end - unit, end - unit / 2, end, -end, -end - unit / 2, -end - unit], "f4"), _numbers(UNARY[5:])])
    shown = [number_text(np.ldexp(number, fraction_bits)) if unit / 2 <= abs(number) < 2 * end else ""
             for number in numbers]
    return markdown_table(["a", f"a · 2<sup>{fraction_bits}</sup>", "result"],
                          zip(map(number_text, numbers), shown, _evaluate(operator, (numbers,), _integer), strict=True))


def from_fixed_table(width, fraction_bits):
    """Ends of the range, and ties."""
    operator = FixedToFp(BINARY32, width=width, fraction_bits=fraction_bits)
    operands = np.array([0, 1, -1, 2**24, 2**24 + 1, 2**24 + 2, 2**24 + 3, 2**31 - 1, -2**31])
    return markdown_table(["operand", "result"],
                          zip(map(_integer, operands), _evaluate(operator, (operands,)), strict=True))


def _integer(number):
    return f"{int(number):,}".replace("-", "−")


def resize_tables():
    """From binary32 to the narrower binary16, and back."""
    narrow, wide = FpToFp(BINARY32, BINARY16), FpToFp(BINARY16, BINARY32)
    numbers = np.concatenate([_numbers(UNARY[:4]), np.array([2**-25, 1.5 * 2**-25, 2**-24, 65504, 65519, 65520], "f4"),
                              _numbers(UNARY[5:])])
    half = BINARY16.from_bits(np.array([0, 0x8000, 1, 0x3FF, 0x400, 0x3C00, 0x7BFF, 0x7C00, 0xFC00, 0x7E00, 0x7C01]))
    return "\n\n".join([
        "From binary32 to binary16:",
        markdown_table(["a", "result"], zip(map(number_text, numbers), _evaluate(
            narrow, (numbers,), lambda value: number_text(value, BINARY16)), strict=True)),
        "From binary16 to binary32:",
        markdown_table(["a", "result"], zip((number_text(value, BINARY16) for value in half),
                                            _evaluate(wide, (half,)), strict=True))])


def arctangent_tables(component):
    """Angles in radians, and lengths."""
    polar = partial(component, magnitude=True)
    return "\n\n".join(binary_tables(polar, title, ("y", "x"), outcome=attrgetter(name))
                       for title, name in (("Angle, rad", "result"), ("Length", "magnitude")))


def sincos_table(component):
    """Results from the smallest angle to angles out of range."""
    limit = np.float32(component(BINARY32).limit)
    numbers = np.concatenate([_numbers(UNARY[:4]), np.array([np.pi / 6, np.pi / 2, np.pi, 2 * np.pi], "f4"),
                              [np.nextafter(limit, np.float32(0)), limit], _numbers(UNARY[5:-1])])
    rows = zip(numbers, *component(BINARY32).compute(numbers), strict=True)
    return markdown_table(["angle", "sin", "cos"], [[number_text(value) for value in row] for row in rows])


def fixed_arctangent_table(component):
    """Angles in units of 2**-13 rad at the axes, the diagonals and the ends of the range."""
    numbers = np.array([0, 1, -1, 2**15 - 1, -2**15])
    names = [_integer(number) for number in numbers]
    angles = component().compute(numbers[:, None], numbers[None, :])
    return markdown_table(["y_in ↓ x_in →", *names], [[f"**{name}**", *map(_integer, row)]
                                                      for name, row in zip(names, angles, strict=True)])
