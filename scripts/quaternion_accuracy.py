"""Measure QUAT_direct over a million updates: rows of the table in docs/quaternion.md.

The run is made with NumPy scalars, whose sums and products round as the circuit's do, and every
update of it is then compared with the twin, all at once: the last column counts bits that differ.
"""

import sys

import numpy as np
from strapdown_sim.reference import quaternion as exact

from strapdown.config import QUATERNION_J2
from strapdown.cores import quat_direct
from strapdown.fp import BINARY32, BINARY64, Subnormals
from strapdown.kernel.numeric import Float64
from strapdown.kernel.pool import Pool

UPDATES = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
RATES = ("in_p", "in_q", "in_r")
WORDS = ("e0", "e1", "e2", "e3")


class Scalars(Float64):
    """Scalars of one type, so that a choice is one."""

    @staticmethod
    def select(condition, a, b):
        return a if condition else b


def motions(rate_hz):
    """Body rates, rad/s: constant, and turning about all axes, up to 2,000 deg/s."""
    t = np.arange(UPDATES) / rate_hz
    steady = np.tile(np.radians(2000) * np.array([0.48, -0.6, 0.64]), (UPDATES, 1))
    wild = np.stack([np.sin(2 * np.pi * 1.3 * t), np.sin(2 * np.pi * 0.7 * t + 1), np.cos(2 * np.pi * 0.31 * t)], -1)
    return {"constant": steady, "wild": wild * np.radians(2000) / np.sqrt(3)}


def run(config, rates):
    """Quaternions after each update, shape (N, 4), and how many of their bits are not the twin's."""
    system, fmt = quat_direct(config), config.pool.format
    number, e = fmt.dtype.type, tuple(map(fmt.dtype.type, (1, 0, 0, 0)))
    q = np.empty((UPDATES, 4), fmt.dtype)
    load, start = number(0), (number(0),) * 4
    for k, omega in enumerate(zip(*(list(axis) for axis in rates.T), strict=True)):
        e = system.equations(Scalars, omega=omega, e=e, load=load, start=start).state["e"]
        q[k] = e
    before = np.concatenate((fmt.array([[1, 0, 0, 0]]), q[:-1]))
    inputs = dict(zip(RATES, rates.T, strict=True)) | dict.fromkeys(
        ("in_load_en", "in_e0", "in_e1", "in_e2", "in_e3"), fmt.array(np.zeros(UPDATES)))
    twin = system.update_twin(config.pool, inputs, dict(zip(WORDS, before.T, strict=True)))
    bits = sum(int(np.bitwise_count(fmt.to_bits(twin[word]) ^ fmt.to_bits(q[:, k])).sum())
               for k, word in enumerate(WORDS))
    return q.astype(float), bits


def main():
    start = np.array([1.0, 0.0, 0.0, 0.0])
    for format in (BINARY32, BINARY64):
        pool = Pool(format=format.with_subnormals(Subnormals.FLUSH))
        for rate in (500, 8000):
            for name, rates in motions(rate).items():
                rates = pool.format.array(rates)
                truth = exact.cumulative(start, exact.increment(rates, 1 / rate))
                first = exact.cumulative(start, exact.first_order_increment(rates, 1 / rate))
                old = np.degrees(exact.angle_between(first, truth).max())
                for order, renormalise in ((2, 0), (3, 0), (3, 1)):
                    config = QUATERNION_J2.model_copy(update={
                        "sample_rate_hz": rate, "order": order, "renormalise_every": renormalise, "pool": pool})
                    q, bits = run(config, rates)
                    angle = np.degrees(exact.angle_between(q, truth).max())
                    drift = np.abs(np.linalg.norm(q, axis=1) - 1).max()
                    norm = "yes" if renormalise else "no"
                    print(f"| {format.name} | {rate} | {name} | {order} | {norm} | {angle:.2g} "
                          f"| {drift:.2g} | {old:.3g} | {bits} |", flush=True)


if __name__ == "__main__":
    main()
