"""Binary floating-point formats: widths, encodings and the one policy for subnormals and NaN."""

import enum
import math
import operator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from amaranth.lib import data

__all__ = ["Subnormals", "FloatFormat", "BINARY16", "BINARY32", "BINARY64"]


class Subnormals(enum.Enum):
    """What circuits and twins do with numbers below the least normal one."""

    GRADUAL = "gradual"
    """IEEE 754: subnormal operands and results are exact citizens."""
    FLUSH = "flush"
    """Subnormal operands count as zero of their sign; a result whose exact value lies below
    the least normal number becomes zero of its sign (tininess is detected before rounding)."""


@dataclass(frozen=True)
class FloatFormat:
    """A binary interchange format of IEEE 754-2019, 3.4, with hidden leading bit.

    Parameters
    ----------
    exponent_width : int
        Bits of the biased exponent, at least 2.
    fraction_width : int
        Bits of the stored fraction, at least 1.
    subnormals : Subnormals
        Policy of every circuit and twin made for this format.

    Every NaN that a circuit or a twin produces is ``nan``, the quiet NaN of positive sign and
    empty payload. Rounding is to nearest, ties to even.

    Raises: TypeError and ValueError for unusable widths or policy.
    """

    exponent_width: int
    fraction_width: int
    subnormals: Subnormals = Subnormals.GRADUAL

    def __post_init__(self):
        for field, least in ("exponent_width", 2), ("fraction_width", 1):
            value = operator.index(getattr(self, field))
            if value < least:
                raise ValueError(f"{field} must be at least {least}, not {value!r}")
        if not isinstance(self.subnormals, Subnormals):
            raise TypeError(f"subnormals must be a Subnormals policy, not {self.subnormals!r}")

    def with_subnormals(self, policy):
        """The same format under another subnormal policy (a ``Subnormals`` or its value)."""
        return replace(self, subnormals=Subnormals(policy))

    @property
    def name(self):
        """``binary32`` and its like where the standard names the widths, else ``floatE_F``."""
        widths = (self.exponent_width, self.fraction_width)
        return _STANDARD_NAMES.get(widths, "float{}_{}".format(*widths))

    @property
    def gradual(self):
        """Whether subnormals are kept."""
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
        """Decimal digits that tell any two numbers apart."""
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
        """Encoding of the one NaN that is ever produced."""
        return self.infinity | 1 << (self.fraction_width - 1)

    @property
    def least_normal(self):
        """Encoding of the least positive normal number."""
        return 1 << self.fraction_width

    def encode(self, value):
        """Encoding of one number, rounded to the format, as an int."""
        return int(self.to_bits(self.array(value)))

    # The NumPy side.

    @property
    def dtype(self):
        """The NumPy type with these widths; ValueError if NumPy has none."""
        try:
            return np.dtype(_DTYPES[self.exponent_width, self.fraction_width][0])
        except KeyError:
            raise ValueError(f"NumPy has no floating-point type for {self.name}") from None

    @property
    def bits_dtype(self):
        """The unsigned NumPy integer of the same size as ``dtype``."""
        return np.dtype(_DTYPES[self.exponent_width, self.fraction_width][1])

    def array(self, values):
        """``values`` rounded to this format, subnormals flushed if that is the policy."""
        with np.errstate(all="ignore"):
            return self.flush(np.asarray(values, dtype=self.dtype))

    def flush(self, values):
        """Subnormals replaced by zeros of their sign if that is the policy, else unchanged."""
        if self.gradual:
            return values
        tiny = np.abs(values) < self.from_bits(self.least_normal)
        return np.where(tiny, np.copysign(values.dtype.type(0), values), values)

    def canonical(self, values):
        """Every NaN replaced by ``nan``."""
        return np.where(np.isnan(values), self.from_bits(self.nan), values)

    def from_bits(self, bits):
        """Encodings (integers, any shape) to numbers of ``dtype``."""
        return np.asarray(bits, dtype=self.bits_dtype).view(self.dtype)

    def to_bits(self, values):
        """Numbers (rounded to the format first) to encodings of ``bits_dtype``."""
        with np.errstate(all="ignore"):
            encodings = np.ascontiguousarray(values, dtype=self.dtype).view(self.bits_dtype)
        return encodings.reshape(np.shape(values))


_STANDARD_NAMES = {(5, 10): "binary16", (8, 23): "binary32", (11, 52): "binary64", (8, 7): "bfloat16"}
_DTYPES = {(5, 10): ("f2", "u2"), (8, 23): ("f4", "u4"), (11, 52): ("f8", "u8")}

BINARY16 = FloatFormat(5, 10)
BINARY32 = FloatFormat(8, 23)
BINARY64 = FloatFormat(11, 52)
