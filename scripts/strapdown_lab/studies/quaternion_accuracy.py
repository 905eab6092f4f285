"""Measure QUAT_direct over a million updates, and write the table into docs/quaternion.md.

The compiled twin computes one update after another. The twin then computes all updates again in one call, and the
script fails if a bit differs. It takes some minutes. With a number of updates as its argument it only prints
the table.
"""

import sys
from itertools import product

import numpy as np

from strapdown.cores import QUATERNION_J2, quat_direct
from strapdown.fp import BINARY32, BINARY64, Subnormals
from strapdown.kernel.native import NativeTwin
from strapdown.kernel.pool import Pool
from strapdown.markdown import markdown_table
from strapdown_lab.checkout import ROOT, write_blocks
from strapdown_sim.reference import quaternion as exact

UPDATES = 1_000_000
HEAD = ["format", "rate, Hz:", "motion", "j:", "renormalised", "angle, deg:", "norm − 1:",
        "thesis's first order, deg:"]


def run(config, rates):
    """Quaternions after each update, shape (N, 4), from rates of shape (N, 3).

    Raises: RuntimeError if a bit differs from the twin's.
    """
    system, fmt = quat_direct(config), config.pool.format
    inputs = system.bind(omega=fmt.array(rates), load=0.0, start=np.zeros(4))
    result, _ = NativeTwin(system, config.pool).run(inputs)
    q = system.read(result, system.state)["e"]
    before = np.concatenate((fmt.array([[1, 0, 0, 0]]), q[:-1]))
    twin = system.read(system.update_twin(config.pool, inputs, system.bind_state(e=before)))["e"]
    if differing := int((fmt.to_bits(twin) != fmt.to_bits(q)).any(axis=1).sum()):
        raise RuntimeError(f"{differing} of {len(q)} updates are not the twin's")
    return q.astype(float)


def motions(count, rate_hz):
    """Body rates, rad/s: constant, and about all axes, up to 2,000 deg/s."""
    t = np.arange(count) / rate_hz
    steady = np.tile(np.radians(2000) * np.array([0.48, -0.6, 0.64]), (count, 1))
    wild = np.stack([np.sin(2 * np.pi * 1.3 * t), np.sin(2 * np.pi * 0.7 * t + 1), np.cos(2 * np.pi * 0.31 * t)], -1)
    return {"constant": steady, "wild": wild * np.radians(2000) / np.sqrt(3)}


def rows(count):
    """Rows of the table, one after the other."""
    start = np.array([1.0, 0.0, 0.0, 0.0])
    for format, rate in product((BINARY32, BINARY64), (500, 8000)):
        pool = Pool(format=format.with_subnormals(Subnormals.FLUSH))
        for name, motion in motions(count, rate).items():
            rates = pool.format.array(motion)
            # In float64 the error of the truth itself would be as large as that of the quaternion in binary64.
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
                yield [format.name, rate, name, order, "yes" if renormalise else "no", f"{angle:.2g}", f"{drift:.2g}",
                       f"{old:.3g}"]


def main():
    """Print the table row by row; after a million updates, put it into docs/quaternion.md."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else UPDATES
    table = []
    for row in rows(count):
        print(*row, flush=True)
        table.append(row)
    if count == UPDATES:
        write_blocks(ROOT / "docs" / "quaternion.md", {"million updates": markdown_table(HEAD, table)})


if __name__ == "__main__":
    main()
