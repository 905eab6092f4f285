"""From a kernel to a circuit: trace, schedule, microprogram, engine; and the twin beside them."""
