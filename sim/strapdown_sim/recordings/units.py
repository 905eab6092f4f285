"""Units of recorded quantities: their spellings, and the factors to the units of a Log."""

import re

import numpy as np

from .recording import STANDARD_GRAVITY

__all__ = ["UNITS", "factor", "listed", "quantity", "unit_of_force"]

UNITS: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0},
    "gyro": {"deg/s": 1.0, "rad/s": float(np.degrees(1.0)), "mdeg/s": 1e-3, "mrad/s": float(np.degrees(1e-3))},
    "accel": {"g": STANDARD_GRAVITY, "m/s^2": 1.0, "mg": STANDARD_GRAVITY / 1000, "ug": STANDARD_GRAVITY / 1e6},
    "mag": {"uT": 1.0, "G": 100.0, "mG": 0.1, "nT": 0.001, "T": 1e6, "mT": 1e3, "a.u.": 1.0},
    "pressure": {"Pa": 1.0, "hPa": 100.0, "kPa": 1e3, "mbar": 100.0, "bar": 1e5},
    "attitude": {"": 1.0},
}
"""Factor from each unit of a file to s, deg/s, m/s^2, uT and Pa. A field in units of the device (a.u.) stays."""

_CHARACTERS = str.maketrans({
    "\N{MICRO SIGN}": "u", "\N{GREEK SMALL LETTER MU}": "u", "\N{SUPERSCRIPT TWO}": "^2", "\N{DEGREE SIGN}": "deg",
    "\N{SUPERSCRIPT ONE}": "1", "\N{SUPERSCRIPT MINUS}": "^-", "\N{MINUS SIGN}": "-", " ": "", "_": "", "*": "",
    "\N{MIDDLE DOT}": "", "\N{DOT OPERATOR}": ""})

_SPELLINGS = {
    "time": {"sec": "s", "secs": "s", "second": "s", "seconds": "s", "msec": "ms", "millis": "ms",
             "milliseconds": "ms", "usec": "us", "micros": "us", "microseconds": "us", "nsec": "ns", "nanos": "ns",
             "nanoseconds": "ns"},
    "gyro": {"dps": "deg/s", "degs": "deg/s", "deg/sec": "deg/s", "degs-1": "deg/s", "degs^-1": "deg/s",
             "degrees/s": "deg/s", "degree/s": "deg/s", "degrees/sec": "deg/s", "degpersec": "deg/s",
             "d/s": "deg/s", "degps": "deg/s", "degsec": "deg/s", "radps": "rad/s", "rps": "rad/s", "radsec": "rad/s",
             "rads": "rad/s", "rad/sec": "rad/s", "rads-1": "rad/s", "rads^-1": "rad/s", "radians/s": "rad/s",
             "mdps": "mdeg/s", "mrads": "mrad/s"},
    "accel": {"gs": "g", "gee": "g", "m/s2": "m/s^2", "m/s/s": "m/s^2", "ms^-2": "m/s^2", "ms-2": "m/s^2",
              "mps2": "m/s^2", "mps^2": "m/s^2", "m/sec^2": "m/s^2", "m/sec2": "m/s^2", "mss": "m/s^2", "ms2": "m/s^2",
              "m/ss": "m/s^2", "m/(s^2)": "m/s^2", "m/(ss)": "m/s^2", "milli-g": "mg", "micro-g": "ug", "gforce": "g"},
    "mag": {"gauss": "g", "gs": "g", "ga": "g", "mgauss": "mg", "mga": "mg", "milligauss": "mg", "tesla": "t",
            "microtesla": "ut", "microteslas": "ut", "nanotesla": "nt", "millitesla": "mt", "au": "a.u.",
            "localflux": "a.u."},
    "pressure": {"pascal": "pa", "millibar": "mbar"},
    "attitude": {},
}


def factor(kind: str, unit: str) -> tuple[float, str] | None:
    """Factor and usual spelling of a unit of a quantity ("time", "gyro", ...), or None if it is not known.

    A number before the unit, as in 0.061mg, is the size of a count; a negative one turns an axis.
    """
    counted = re.match(r"\s*(-?\d*\.?\d+(?:[eE][-+]?\d+)?)(?=\s*[^\d\s])", unit)
    number = counted[1] if counted else ""
    unit = unit[counted.end():] if counted else unit
    plain = re.sub(r"\^\{?(-?\d)\}?", r"^\1", unit.translate(_CHARACTERS)).casefold()
    plain = _SPELLINGS[kind].get(plain, plain).casefold()
    known = {name.casefold(): name for name in UNITS[kind]}
    if plain not in known:
        return None
    return UNITS[kind][known[plain]] * float(number or 1), known[plain]


def quantity(unit: str) -> str | None:
    """The quantity that has a unit, of those that a sensor measures along axes, and time; None if there is none.

    Of acceleration and field, which both have a G, it is the acceleration.
    """
    return next((kind for kind in ("time", "gyro", "accel", "mag") if factor(kind, unit)), None)


NEAR = 1.3
"""Ratio of a median specific force to one g, up to which it is one g."""


def unit_of_force(values: np.ndarray) -> str | None:
    """Unit of a specific force, shape (N, 3), that makes its median one g; None if none does."""
    force = np.linalg.norm(values, axis=1)
    median = np.median(force[force > 0]) if (force > 0).any() else np.nan
    return next((unit for unit in ("m/s^2", "g", "mg")
                 if 1 / NEAR < median * UNITS["accel"][unit] / STANDARD_GRAVITY < NEAR), None)


def listed(kind: str) -> str:
    """The units of a quantity, for messages."""
    return ", ".join(UNITS[kind])
