"""Operators whose results are zero while ``done`` is low, beside the same operators with results that stay."""

import numpy as np
import pytest
from amaranth import *
from amaranth.sim import Simulator

from strapdown.fp import BINARY16, FpAdd, FpMultiply, FpSelect, FpTableReciprocal

FLUSHED = BINARY16.with_subnormals("flush")

OPERATORS = {
    "add_1": (FpAdd, {"latency": 1}), "add_5": (FpAdd, {"latency": 5}), "add_flags": (FpAdd, {"flags": True}),
    "multiply": (FpMultiply, {}), "select": (FpSelect, {}), "table_reciprocal": (FpTableReciprocal, {}),
    # The only rank is that of the table.
    "table_reciprocal_1": (FpTableReciprocal, {"latency": 1}),
}


@pytest.mark.parametrize("name", OPERATORS)
def test_results_come_once_and_are_those_of_the_other_operator(name):
    make, parameters = OPERATORS[name]
    loud, quiet = make(FLUSHED, **parameters), make(FLUSHED, **parameters, quiet=True)
    assert (loud.quiet, quiet.quiet, loud.latency) == (False, True, quiet.latency)
    names = [member for member in loud.signature.members if member not in ("start", "result", "flags", "done")]
    outputs = [member for member in ("result", "flags") if member in loud.signature.members]
    rng = np.random.default_rng(5)
    m = Module()
    m.submodules += [loud, quiet]
    m.d.comb += [Value.cast(getattr(quiet, member)).eq(Value.cast(getattr(loud, member)))
                 for member in (*names, "start")]
    quiet_cycles, results = 0, set()

    async def bench(ctx):
        nonlocal quiet_cycles
        for _ in range(400):
            for member in names:
                port = Value.cast(getattr(loud, member))
                ctx.set(port, int(rng.integers(1 << len(port))))
            ctx.set(loud.start, int(rng.random() < 0.6))
            await ctx.tick()
            done = ctx.get(loud.done)
            assert ctx.get(quiet.done) == done
            for output in outputs:
                value = ctx.get(Value.cast(getattr(quiet, output)))
                assert value == (ctx.get(Value.cast(getattr(loud, output))) if done else 0)
                results.add(value)
            quiet_cycles += 1 - done

    simulator = Simulator(m)
    simulator.add_clock(1e-8)
    simulator.add_testbench(bench)
    simulator.run()
    assert quiet_cycles > 100
    assert len(results) > 50
