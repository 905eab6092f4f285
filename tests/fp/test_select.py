"""Choice between two numbers: circuit in Amaranth's own simulator, and twin."""

import numpy as np
from amaranth.sim import Simulator

from strapdown.fp import BINARY16, FpSelect

from .support import numbers_for


def test_choices():
    select, rng = FpSelect(BINARY16), np.random.default_rng(1)
    assert (select.format, select.latency, select.interval) == (BINARY16, 1, 1)
    a = rng.permutation(numbers_for(BINARY16, rng))[:500]
    b, condition, start = rng.permutation(a), rng.random(500) < 0.5, rng.random(500) < 0.6
    wanted = BINARY16.to_bits(select.compute(BINARY16.from_bits(a), BINARY16.from_bits(b), condition))
    np.testing.assert_array_equal(wanted, np.where(condition, a, b))

    async def bench(ctx):
        for row in range(500):
            ctx.set(select.a, BINARY16.layout.from_bits(int(a[row])))
            ctx.set(select.b, BINARY16.layout.from_bits(int(b[row])))
            ctx.set(select.condition, int(condition[row]))
            ctx.set(select.start, int(start[row]))
            await ctx.tick()
            assert ctx.get(select.done) == start[row]
            if start[row]:
                assert ctx.get(select.result).as_bits() == wanted[row]

    simulator = Simulator(select)
    simulator.add_clock(1e-8)
    simulator.add_testbench(bench)
    simulator.run()
