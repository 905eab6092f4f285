"""Kernels as C: the software twin of a system for long runs, in which each update needs the previous one."""

import ctypes
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from .pool import Pool
from .system import REFUSALS, System
from .trace import Node

__all__ = ["NativeError", "NativeTwin"]

C_TYPES = {32: ("float", "uint32_t"), 64: ("double", "uint64_t")}

# Where subnormals are flushed, a product that equals the least normal number may be the rounded form of a smaller
# exact value, which must be flushed, too. Sums do not have this case, because they are exact near the least normal
# number. Quotients do not have it either: a quotient below a power of two is more than half a unit below it.
OPERATORS = """\
#include <math.h>
#include <stdint.h>
#include <string.h>

typedef {real} real;
typedef {word} word;

static inline word bits_of(real x) {{ word w; memcpy(&w, &x, sizeof w); return w; }}
static inline real from_bits(word w) {{ real x; memcpy(&x, &w, sizeof x); return x; }}
static const word SIGN = (word)1 << (8 * sizeof(word) - 1);

static inline real least(void) {{ return from_bits({least_normal}u); }}
static inline int is_negative(real x) {{ return bits_of(x) >> (8 * sizeof(word) - 1); }}
static inline real negate(real x) {{ return from_bits(bits_of(x) ^ SIGN); }}
static inline real zero_of(real x) {{ return from_bits(bits_of(x) & SIGN); }}

static inline real operand(real x) {{ return {flush} && fabs(x) < least() ? zero_of(x) : x; }}
static inline real result(real x) {{ return x != x ? from_bits({nan}u) : operand(x); }}

static inline real add(real a, real b) {{ return result(operand(a) + operand(b)); }}

static real multiply(real a, real b)
{{
  a = operand(a), b = operand(b);
  const real product = result(a * b);
  if ({flush} && fabs(product) == least()) {{
    /* The smaller factor is scaled, so that the difference from the least normal number is exact enough. */
    const real x = fabs(a) < fabs(b) ? fabs(a) : fabs(b), y = fabs(a) < fabs(b) ? fabs(b) : fabs(a);
    const real scale = ldexp(1, {scale});
    if ({fma}(x * scale, y, -least() * scale) < 0)
      return zero_of(product);
  }}
  return product;
}}

static inline real divide(real a, real b) {{ return result(operand(a) / operand(b)); }}
static inline real square_root(real a) {{ return result({sqrt}(operand(a))); }}
"""

CALLS = {"add": "add({})", "multiply": "multiply({})", "divide": "divide({})", "sqrt": "square_root({})", "copy": "{}"}
"""Maps each operation of a graph to the C expression of its operands; ``select`` is handled separately."""

SUPPORTED = sorted([*CALLS, "select"])


class NativeError(RuntimeError):
    """A system cannot be expressed in C, or the C compiler is missing or fails; the message is one line."""


def _operand(names, operand):
    name = names[operand.node]
    return f"negate({name})" if operand.negated else name


def _expression(names, node):
    if node.operation == "select":
        a, b = (_operand(names, operand) for operand in node.arguments)
        return f"is_negative({_operand(names, node.condition)}) ? {a} : {b}"
    return CALLS[node.operation].format(", ".join(_operand(names, operand) for operand in node.operands))


def _program(graph, fmt, refuses, restart_after):
    """C code of ``run(count, inputs, held, results)``, with one row per update.

    ``held`` has outputs, state words and the count of refusals; the function replaces them by those after the last
    update. A row of results has outputs, state words, status, 1 if the update was refused, and 1 if the state starts
    again after it: after as many refusals as ``restart_after``, or never if that is 0.
    """
    real, word = C_TYPES[fmt.width]
    short = fmt.width == 32
    head = OPERATORS.format(
        real=real, word=word, least_normal=hex(fmt.least_normal), nan=hex(fmt.nan), flush=int(not fmt.gradual),
        scale=100 if short else 600, fma="fmaf" if short else "fma", sqrt="sqrtf" if short else "sqrt")
    if short:
        head = head.replace("fabs(", "fabsf(").replace("ldexp(", "ldexpf(")
    names: dict[Node, str] = {}
    state, lines = list(graph.state), []
    for node in graph.nodes:
        names[node] = f"v{len(names)}"
        if node.operation == "input":
            value = f"in[{graph.inputs.index(node.label)}]"
        elif node.operation == "state":
            value = f"held[{len(graph.outputs) + state.index(node.label)}]"
        elif node.operation == "constant":
            value = f"from_bits({hex(int(fmt.to_bits(node.value)))}u)"
        else:
            value = _expression(names, node)
        lines.append(f"const real {names[node]} = {value};")
    numbers = [names[node] for node in graph.nodes if node.computed and node.operation not in ("select", "copy")]
    checked = [*(f"in[{index}]" for index in range(len(graph.inputs))), *numbers]
    refused = " || ".join(f"!isfinite({name})" for name in checked) if refuses else "0"
    foreign = " || ".join(f"!isfinite({name})" for name in checked[:len(graph.inputs)])
    kept = [names[node] for node in (*graph.outputs.values(), *(graph.next_state[word] for word in state))]
    status = [f"!refused && is_negative({_operand(names, operand)})" for operand in graph.status.values()]
    resets = [f"from_bits({hex(int(fmt.to_bits(value)))}u)" for value in graph.state.values()]
    lines += [f"const int refused = {refused};", f"real *count = held + {len(kept)};", "if (!refused) {",
              *(f"  held[{index}] = {value};" for index, value in enumerate([*kept, "0"])), "}",
              f"else if (!({foreign})) ++*count;",
              f"const int restarted = {restart_after} && *count == {restart_after};", "if (restarted) {",
              *(f"  held[{len(graph.outputs) + index}] = {value};" for index, value in enumerate(resets)),
              "  *count = 0;", "}",
              f"memcpy(out, held, {len(kept)} * sizeof(real));",
              *(f"out[{len(kept) + index}] = {value};"
                for index, value in enumerate([*status, "refused", "restarted"]))]
    body = "\n    ".join(lines)
    return f"""{head}
void run(long count, const real *in, real *held, real *out)
{{
  for (long k = 0; k < count; ++k, in += {len(graph.inputs)}, out += {len(kept) + len(status) + 2}) {{
    {body}
  }}
}}
"""


class NativeTwin:
    """A system's software twin as compiled C, bit for bit equal to ``System.run`` and to the circuit.

    It takes about one microsecond per update; NumPy takes about a hundred.

    Parameters
    ----------
    system : System
    pool : Pool
        Its units name the operations, its format is binary32 or binary64, with or without subnormals.

    Raises: NativeError if the graph has operations that are not supported (supported are add, copy, divide,
    multiply, select and sqrt), for another format, and if the C compiler ``cc`` is missing or fails.
    """

    def __init__(self, system: System, pool: Pool) -> None:
        fmt = pool.format
        if fmt.width not in C_TYPES or not fmt.is_native:
            raise NativeError(f"compiled kernels have the format binary32 or binary64, not {fmt.name}")
        self._graph = system.trace(pool)
        if unknown := sorted(set(self._graph.count()) - set(SUPPORTED)):
            raise NativeError(f"compiled kernels have no {', '.join(unknown)}: only {', '.join(SUPPORTED)}")
        self._format, self._system = fmt, system
        compiler = shutil.which("cc")
        if compiler is None:
            raise NativeError("the C compiler cc is missing (Debian: apt-get install gcc)")
        with tempfile.TemporaryDirectory() as folder:
            source, library = Path(folder, "kernel.c"), Path(folder, "kernel.so")
            text = _program(self._graph, fmt, bool(system.status_port), system.restart_after)
            source.write_text(text, encoding="utf-8")
            # No fused multiply-add: the circuit rounds the product too.
            command = [compiler, "-O2", "-ffp-contract=off", "-shared", "-fPIC", str(source), "-o", str(library), "-lm"]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode:
                raise NativeError(f"cc failed with status {done.returncode}: {done.stderr.strip()[-1000:]}")
            self._run = ctypes.CDLL(str(library)).run

    def run(self, inputs: Mapping[str, ArrayLike],
            state: Mapping[str, ArrayLike] | None = None) -> tuple[dict, dict]:
        """Updates in order, each from the state after the previous update.

        Parameters
        ----------
        inputs : dict
            Input port to numbers of shape (N,), rounded to the format.
        state : dict, optional
            State before the first sample, for example from an earlier ``run``; the reset state by default.

        Returns
        -------
        result, state : dict
            As in ``System.run``.
        """
        graph, fmt = self._graph, self._format
        rows = np.stack(np.broadcast_arrays(*(fmt.from_bits(fmt.to_bits(inputs[port])) for port in graph.inputs)), -1)
        rows = np.ascontiguousarray(rows)
        names = [*graph.outputs, *graph.state]
        start = graph.reset_outputs | graph.state | (state or {})
        held = np.array([*(fmt.array(start[name]) for name in names), start.get(REFUSALS, 0)], dtype=fmt.dtype)
        flags = [*graph.status, "refused", "restarted"]
        answer = np.empty((len(rows), len(names) + len(flags)), fmt.dtype)
        self._run(ctypes.c_long(len(rows)), *(ctypes.c_void_p(array.ctypes.data) for array in (rows, held, answer)))
        result = dict(zip([*names, *flags], np.ascontiguousarray(answer.T), strict=True))
        result |= {name: result[name] != 0 for name in flags}
        after = dict(zip(names, held, strict=False))
        if not self._system.status_port:
            del result["refused"]
        if not self._system.restart_after:
            del result["restarted"]
            return result, after
        return result, after | {REFUSALS: int(held[-1])}
