"""The twin in place of a Verilated circuit, so that no compiler is needed; other tests compare the two."""

from pathlib import Path

import numpy as np

__all__ = ["TwinModel"]


class TwinModel:
    """In place of a CoreModel; it keeps no waves."""

    def __init__(self, core, verilog, build, *, waves=False):
        assert not waves
        assert Path(verilog).exists()
        self.core = core

    def update(self, inputs, *, waves, progress):
        system, engine = self.core.system, self.core.engine
        result, _ = system.run(engine.program.schedule.pool, inputs)
        count = len(next(iter(inputs.values())))
        status = sum(np.asarray(result.get(name, np.zeros(count, bool))).astype(int) << bit
                     for bit, name in enumerate(engine.status_names))
        progress(count)
        return result | {"cycles": np.full(count, self.core.latency), system.status_port: status}

    def differing_bits(self, inputs, result):
        return 0
