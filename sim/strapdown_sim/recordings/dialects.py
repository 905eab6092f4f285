"""What the headers of tables leave unsaid: units and axes of programs that are known, units that the values say."""

import re
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from .columns import NAMES, Columns
from .log import ACCEL, GYRO, MAG
from .table import Table
from .turning import AGREEMENT, RATIO, turning
from .units import UNITS, unit_of_force

__all__ = ["SI_UNITS", "Dialect", "dialect_of", "rate_unit", "units_of_values"]

SI_UNITS = {GYRO: "rad/s", ACCEL: "m/s^2", MAG: "uT"}
"""Units of phones, which files of Sensor Logger do not name, and of many programs."""

FRD = (1.0, -1.0, -1.0)


class Dialect(NamedTuple):
    """Tables of a program.

    Attributes
    ----------
    name : str
    header : tuple of str
        Regular expressions; each matches a cell of the header in lower case.
    units : dict
        Units of quantities whose columns name none that is known.
    signs : dict
        Factors of the axes of quantities, to those of a Log.
    """

    name: str
    header: tuple[str, ...]
    units: Mapping[str, str]
    signs: Mapping[str, tuple[float, float, float]]


DIALECTS = (
    Dialect("ROS", (r".*angular_velocity[._/]x", r".*linear_acceleration[._/]x"), SI_UNITS | {MAG: "T"}, {}),
    Dialect("ArduPilot", ("timeus", "gyrx", "accx"), SI_UNITS | {MAG: "mG"}, dict.fromkeys((GYRO, ACCEL, MAG), FRD)),
    Dialect("3-Space", ("chiptimeus", "rawgyrox", "rawaccelx"), {GYRO: "rad/s", ACCEL: "g", MAG: "G"}, {}),
    # Core Motion of iOS gives gravity less acceleration.
    Dialect("SensorLog", (r"loggingtime.*", r"accelerometeraccelerationx.*"), {}, {ACCEL: (-1.0, -1.0, -1.0)}),
    Dialect("Physics Toolbox", ("gfx", "wx"), SI_UNITS | {ACCEL: "g"}, {}),
    Dialect("MicroStrain", (r"x accel \[x8004\]", r"x gyro \[x8005\]"), {GYRO: "rad/s", ACCEL: "g", MAG: "G"}, {}),
)


def dialect_of(table: Table) -> Dialect | None:
    """The program that wrote a table, if it is known."""
    cells = [cell.strip().lower() for cell in table.header]
    return next((dialect for dialect in DIALECTS
                 if all(any(re.fullmatch(each, cell) for cell in cells) for each in dialect.header)), None)


FASTEST_RAD_S = 70.0
"""Above the range of any gyro, 4000 deg/s in rad/s: a larger number is no rate in rad/s."""


def units_of_values(table: Table, found: Columns, time_s: np.ndarray,
                    known: Mapping[str, str]) -> tuple[dict[str, str], list[str]]:
    """Units of sensors whose columns have none, as far as their values say them, and a note on each.

    The median specific force is one g. Rates in rad/s and deg/s differ in how fast the field, or the specific force,
    turns. The unit of a field does not matter.
    """
    units: dict[str, str] = {}
    notes: list[str] = []

    def values_of(kind):
        return table.values[:, [column.number for column in found.of[kind]]]

    open_kinds = [kind for kind in (ACCEL, GYRO, MAG) if kind in found.of and kind not in known
                  and not any(column.unit for column in found.of[kind])]
    if ACCEL in open_kinds and (of_force := unit_of_force(values_of(ACCEL))):
        units[ACCEL] = of_force
        notes.append(f"accelerometer: no unit in the header; {of_force} makes its median one g")
    if GYRO in open_kinds:
        fixed = next(kind for kind in (MAG, ACCEL) if kind in found.of)
        if of_rates := rate_unit(time_s, values_of(GYRO), values_of(fixed)):
            units[GYRO] = of_rates
            notes.append(f"gyro: no unit in the header; {of_rates} goes with the turning of the {NAMES[fixed].lower()}")
    if MAG in open_kinds:
        units[MAG] = "a.u."
        notes.append("magnetometer: no unit in the header; its direction is used")
    return units, notes


def rate_unit(time_s: np.ndarray, rates: np.ndarray, vectors: np.ndarray) -> str | None:
    """Unit of rates, shape (N, 3), deg/s or rad/s, with which vectors of the earth turn; None if none is sure."""
    if len(rates) and np.nanmax(np.abs(rates)) > FASTEST_RAD_S:
        return "deg/s"
    found = turning(time_s, rates, vectors)
    if found is None or found.agreement < AGREEMENT:
        return None
    return next((unit for unit in ("deg/s", "rad/s")
                 if 1 / RATIO < found.ratio / np.radians(UNITS[GYRO][unit]) < RATIO), None)
