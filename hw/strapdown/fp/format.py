"""Binary floating-point formats: widths, encodings and the one policy for subnormals and NaN."""

import enum
import math
import operator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from amaranth.lib import data

from .rounding import Rounding, round_encoding

__all__ = ["Subnormals", "FloatFormat", "BINARY16", "BINARY32", "BINARY64"]


class Subnormals(enum.Enum):
    """Policy of circuits and twins for numbers below the least normal number."""

    GRADUAL = "gradual"
    """IEEE 754: subnormal operands and results are supported."""
    FLUSH = "flush"
    """Subnormal operands count as zero of the same sign; a result whose exact value lies below
    the least normal number becomes zero of the same sign, in all rounding directions."""


@dataclass(frozen=True)
class FloatFormat:
    """A binary interchange format of IEEE 754-2019, 3.4, with a hidden leading bit.

    Parameters
    ----------
    exponent_width : int
        Bits of the biased exponent, at least 2.
    fraction_width : int
        Bits of the stored fraction, at least 1.
    subnormals : Subnormals
        Policy of every circuit and twin made for this format.
    negative_nan : bool
        Sign of ``nan``: False as in RISC-V and Arm, True as in x86 and in older vendor cores.

    Every NaN that a circuit or a twin produces is ``nan``, the quiet NaN of this sign and of
    empty payload. Circuits support every format; twins support those that fit into binary64.

    Raises: TypeError and ValueError for unusable widths or policies.
    """

    exponent_width: int
    fraction_width: int
    subnormals: Subnormals = Subnormals.GRADUAL
    negative_nan: bool = False

    def __post_init__(self):
        for field, least in ("exponent_width", 2), ("fraction_width", 1):
            value = operator.index(getattr(self, field))
            if value < least:
                raise ValueError(f"{field} must be at least {least}, not {value!r}")
        if not isinstance(self.subnormals, Subnormals):
            raise TypeError(f"subnormals must be a Subnormals policy, not {self.subnormals!r}")
        if not isinstance(self.negative_nan, bool):
            raise TypeError(f"negative_nan must be True or False, not {self.negative_nan!r}")

    def with_subnormals(self, policy):
        """The same format under another subnormal policy (a ``Subnormals`` or its value)."""
        return replace(self, subnormals=Subnormals(policy))

    @property
    def name(self):
        """A name like ``binary32`` if the standard has these widths, else ``floatE_F``."""
        widths = (self.exponent_width, self.fraction_width)
        return _STANDARD_NAMES.get(widths, "float{}_{}".format(*widths))

    @property
    def gradual(self):
        """True if subnormals are kept."""
        return self.subnormals is Subnormals.GRADUAL

    @property
    def width(self):
        """Bits of the whole encoding."""
        return 1 + self.exponent_width + self.fraction_width

    @property
    def precision(self):
        """Bits of the significand with its hidden bit."""
        return 1 + self.fraction_width

    @property
    def decimal_digits(self):
        """Decimal digits that distinguish any two numbers."""
        return math.ceil(1 + self.precision * math.log10(2))

    @property
    def bias(self):
        """Offset of the stored exponent."""
        return (1 << (self.exponent_width - 1)) - 1

    @property
    def exponent_special(self):
        """The stored exponent of infinities and NaNs."""
        return (1 << self.exponent_width) - 1

    @cached_property
    def layout(self):
        """Layout of a Signal that holds a number: fraction (low bits), exponent, sign."""
        return data.StructLayout({
            "fraction": self.fraction_width, "exponent": self.exponent_width, "sign": 1})

    # Encodings, as integers.

    @property
    def infinity(self):
        """Encoding of +infinity."""
        return self.exponent_special << self.fraction_width

    @property
    def nan(self):
        """Encoding of the NaN that circuits and twins produce."""
        return self.infinity | 1 << (self.fraction_width - 1) | self.negative_nan << (self.width - 1)

    @property
    def least_normal(self):
        """Encoding of the least positive normal number."""
        return 1 << self.fraction_width

    def encode(self, value):
        """Encoding of one number, rounded to the format, as an int."""
        return int(self.to_bits(self.array(value)))

    # The NumPy side.

    @property
    def is_native(self):
        """True if NumPy has a type, and so arithmetic, of exactly these widths."""
        return (self.exponent_width, self.fraction_width) in _DTYPES

    @cached_property
    def _container(self):
        """Widths of the smallest NumPy type that holds all numbers of the format."""
        for widths in _DTYPES:
            if self.exponent_width <= widths[0] and self.fraction_width <= widths[1]:
                return FloatFormat(*widths)
        raise ValueError(f"{self.name} has no software twin: formats up to binary64 have "
                         "(exponent_width 11, fraction_width 52)")

    @property
    def dtype(self):
        """The smallest NumPy floating-point type that holds all numbers of the format.

        Raises: ValueError if float64 is too small.
        """
        return np.dtype(_DTYPES[self._container.exponent_width, self._container.fraction_width])

    @property
    def bits_dtype(self):
        """The smallest unsigned NumPy integer that holds an encoding, of 64 bits at most."""
        return np.min_scalar_type((1 << self.width) - 1)

    def array(self, values):
        """``values`` rounded to this format, subnormals flushed if that is the policy."""
        with np.errstate(all="ignore"):
            return self.flush(self.from_bits(self.to_bits(values)))

    def flush(self, values):
        """Subnormals replaced by zeros of the same sign if that is the policy, else unchanged."""
        if self.gradual:
            return values
        tiny = np.abs(values) < self.from_bits(self.least_normal)
        return np.where(tiny, np.copysign(values.dtype.type(0), values), values)

    def canonical(self, values):
        """Every NaN replaced by ``nan``."""
        return np.where(np.isnan(values), self.from_bits(self.nan), values)

    def from_bits(self, bits):
        """Encodings (integers, any shape) to numbers of ``dtype``, NaN payloads included."""
        bits = np.asarray(bits, dtype=self.bits_dtype)
        if self.is_native:
            return bits.view(self.dtype)
        holder = self._container
        bits = bits.astype(holder.bits_dtype)
        sign, magnitude = bits >> (self.width - 1), bits & ((1 << (self.width - 1)) - 1)
        aligned = magnitude << (holder.fraction_width - self.fraction_width)
        special = magnitude >= self.infinity
        # The aligned encoding is the number with the other bias.
        numbers = np.where(special, 0, aligned).view(self.dtype)
        scaled = np.ldexp(numbers, holder.bias - self.bias).view(holder.bits_dtype)
        encoded = np.where(special, aligned | holder.bits_dtype.type(holder.infinity), scaled)
        return (encoded | sign << (holder.width - 1)).view(self.dtype)

    def to_bits(self, values):
        """Numbers to encodings of ``bits_dtype``, any shape; NaN payloads are kept.

        They are rounded to the format first, to nearest, ties to even; subnormals are not flushed.
        If NumPy does not have the format, values of another type than ``dtype`` are taken as float64.
        """
        if self.is_native:
            with np.errstate(all="ignore"):
                encodings = np.ascontiguousarray(values, dtype=self.dtype).view(self.bits_dtype)
            return encodings.reshape(np.shape(values))
        values = np.asarray(values)
        holder = self._container if values.dtype == self.dtype else BINARY64
        wide, numbers = holder.to_bits(values), np.asarray(values, dtype=holder.dtype)
        finite = np.isfinite(numbers)
        fraction, exponent = np.frexp(np.abs(np.where(finite, numbers, 0)).astype(np.float64))
        encoded, _ = round_encoding(
            self.with_subnormals(Subnormals.GRADUAL), np.signbit(numbers), exponent.astype(np.int64) - 53,
            np.ldexp(fraction, 53).astype(np.int64), Rounding.NEAREST_EVEN)
        # A NaN that loses its payload becomes quiet; otherwise it would become infinite.
        payload = wide >> (holder.fraction_width - self.fraction_width) & ((1 << self.fraction_width) - 1)
        becomes_quiet = np.isnan(numbers) & (payload == 0)
        special = np.where(becomes_quiet, 1 << (self.fraction_width - 1), payload) | self.infinity
        special = special | wide >> (holder.width - 1) << (self.width - 1)
        return np.where(finite, encoded, special).astype(self.bits_dtype)


_STANDARD_NAMES = {(5, 10): "binary16", (8, 23): "binary32", (11, 52): "binary64", (8, 7): "bfloat16"}
_DTYPES = {(5, 10): "f2", (8, 23): "f4", (11, 52): "f8"}

BINARY16 = FloatFormat(5, 10)
BINARY32 = FloatFormat(8, 23)
BINARY64 = FloatFormat(11, 52)
