"""Measure QUAT_direct over a million updates, and write the table into docs/quaternion.md.

The equations are turned into C, whose sums and products round as the circuit's do, and every
update is then compared with the twin, all at once: the script fails if a bit differs. Some
minutes; another number of updates, as its argument, only prints the table.
"""

import ctypes
import sys
import tempfile
from itertools import product
from pathlib import Path

import numpy as np

from strapdown.cores import QUATERNION_J2, quat_direct
from strapdown.fp import BINARY32, BINARY64, Subnormals
from strapdown.kernel.pool import Pool
from strapdown.kernel.value import Namespace, Value
from strapdown_lab.checkout import ROOT, write_blocks
from strapdown_sim.drivers.toolchain import run_tool
from strapdown_sim.reference import quaternion as exact
from strapdown_sim.twin import checked_twin

UPDATES = 1_000_000
RATES = ("in_p", "in_q", "in_r")
WORDS = ("e0", "e1", "e2", "e3")
C_TYPES = {32: "float", 64: "double"}
HEADER = """\
| format | rate, Hz | motion | j | renormalised | angle, deg | norm − 1 | thesis's first order, deg |
|---|---:|---|---:|---|---:|---:|---:|
"""
PROGRAM = """\
void run(long count, const {type} *omega, {type} *e)
{{
  {type} e0 = 1, e1 = 0, e2 = 0, e3 = 0;
  for (long k = 0; k < count; ++k) {{
    const {type} p = omega[3 * k], q = omega[3 * k + 1], r = omega[3 * k + 2];
    {lines}
    {stores}
  }}
}}
"""


class Expression(Value):
    """A value as an expression in C."""

    def __init__(self, namespace, text):
        super().__init__(namespace)
        self.text = text


class CCode(Namespace):
    """The namespace in which each operation of the equations writes a line of C, and conditions are known."""

    def __init__(self, pool):
        super().__init__(pool)
        self.type = C_TYPES[pool.format.width]
        self.lines: list[str] = []

    def symbol(self, text):
        """The value of an expression in C."""
        return Expression(self, text)

    def lift(self, number):
        return self.symbol(f"({self.type}){number.hex()}")

    def negate(self, a):
        return self.symbol(f"(-{a.text})")

    def apply(self, operation, *operands):
        name = f"t{len(self.lines)}"
        sign = {"add": " + ", "multiply": " * "}[operation]
        self.lines.append(f"const {self.type} {name} = {sign.join(operand.text for operand in operands)};")
        return self.symbol(name)

    def is_negative(self, a):
        raise TypeError("nothing is chosen by what is computed")

    def select(self, condition, a, b):
        return a if condition else b


def program(system, pool):
    """The equations without a load as a C function over many updates."""
    xp = CCode(pool)
    omega, e = (tuple(map(xp.symbol, names)) for names in ("pqr", WORDS))
    update = system.equations(xp, omega=omega, e=e, load=0.0, start=(0.0,) * 4)
    stores = [f"e[4 * k + {index}] = {value.text};" for index, value in enumerate(update.state["e"])]
    stores += [f"{word} = e[4 * k + {index}];" for index, word in enumerate(WORDS)]
    return PROGRAM.format(type=xp.type, lines="\n    ".join(xp.lines), stores="\n    ".join(stores))


def run(config, rates):
    """Quaternions after each update, shape (N, 4), from rates of shape (N, 3).

    Raises: RuntimeError if a bit differs from the twin's.
    """
    system, fmt = quat_direct(config), config.pool.format
    rates = np.ascontiguousarray(rates, fmt.dtype)
    q = np.empty((len(rates), 4), fmt.dtype)
    with tempfile.TemporaryDirectory() as folder:
        source, library = Path(folder, "run.c"), Path(folder, "run.so")
        source.write_text(program(system, config.pool), encoding="utf-8")
        # No fused multiply-add: the circuit rounds the product too.
        run_tool(["gcc", "-O2", "-ffp-contract=off", "-shared", "-fPIC", source, "-o", library])
        pointer = ctypes.c_void_p
        ctypes.CDLL(str(library)).run(ctypes.c_long(len(rates)), pointer(rates.ctypes.data), pointer(q.ctypes.data))
    before = np.concatenate((fmt.array([[1, 0, 0, 0]]), q[:-1]))
    inputs = dict(zip(RATES, rates.T, strict=True)) | dict.fromkeys(
        ("in_load_en", "in_e0", "in_e1", "in_e2", "in_e3"), fmt.array(np.zeros(len(rates))))
    states = (dict(zip(WORDS, columns.T, strict=True)) for columns in (before, q))
    checked_twin(system, config.pool, inputs, *states)
    return q.astype(float)


def motions(count, rate_hz):
    """Body rates, rad/s: constant, and turning about all axes, up to 2,000 deg/s."""
    t = np.arange(count) / rate_hz
    steady = np.tile(np.radians(2000) * np.array([0.48, -0.6, 0.64]), (count, 1))
    wild = np.stack([np.sin(2 * np.pi * 1.3 * t), np.sin(2 * np.pi * 0.7 * t + 1), np.cos(2 * np.pi * 0.31 * t)], -1)
    return {"constant": steady, "wild": wild * np.radians(2000) / np.sqrt(3)}


def rows(count):
    """Lines of the table, one after the other."""
    start = np.array([1.0, 0.0, 0.0, 0.0])
    for format, rate in product((BINARY32, BINARY64), (500, 8000)):
        pool = Pool(format=format.with_subnormals(Subnormals.FLUSH))
        for name, motion in motions(count, rate).items():
            rates = pool.format.array(motion)
            # In float64 the truth itself would be off by as much as the quaternion in binary64.
            wide = rates.astype(np.longdouble if format is BINARY64 else float)
            truth = exact.cumulative(start, exact.increment(wide, 1 / wide.dtype.type(rate)))
            first = exact.cumulative(start, exact.first_order_increment(rates, 1 / rate))
            old = np.degrees(exact.angle_between(first, truth).max())
            for order, renormalise in ((2, 0), (3, 0), (3, 1)):
                config = QUATERNION_J2.model_copy(update={
                    "sample_rate_hz": rate, "order": order, "renormalise_every": renormalise, "pool": pool})
                q = run(config, rates)
                angle = np.degrees(exact.angle_between(q, truth).max())
                drift = np.abs(np.linalg.norm(q, axis=1) - 1).max()
                yield (f"| {format.name} | {rate} | {name} | {order} | {'yes' if renormalise else 'no'} | {angle:.2g} "
                       f"| {drift:.2g} | {old:.3g} |")


def main():
    """Print the table line by line; after a million updates, put it into docs/quaternion.md."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else UPDATES
    lines = []
    for line in rows(count):
        print(line, flush=True)
        lines.append(line)
    if count == UPDATES:
        write_blocks(ROOT / "docs" / "quaternion.md", {"million updates": HEADER + "\n".join(lines)})


if __name__ == "__main__":
    main()
