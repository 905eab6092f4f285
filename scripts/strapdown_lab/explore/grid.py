"""The grid of pools for a kernel: an axis for each parameter of a pool that can make a difference."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from enum import Enum
from itertools import product
from types import UnionType
from typing import Any, get_args, get_type_hints

from strapdown.config import Config, ConfigError
from strapdown.fp import FloatFormat
from strapdown.kernel.operators import KINDS, Operator
from strapdown.kernel.pool import MemoryStyle, Pool
from strapdown.kernel.system import System

__all__ = ["MOST_UNITS", "Grid", "grid_of", "pool_key", "settings_of"]

MOST_UNITS = 3
"""Greatest number of operators of a kind."""

MOST_VALUES = 8
"""Greatest number of values of a parameter of an operator."""

GREATEST_VALUE = 64
"""Greatest value of it that is tried."""


def pool_key(pool: Pool) -> str:
    """A text that is the same for equal parameters."""
    return json.dumps(_plain(pool.parameters), sort_keys=True)


def _plain(parameters):
    return {name: value.value if isinstance(value, Enum) else value for name, value in parameters.items()}


def settings_of(pool: Pool, base: Pool) -> dict[str, str]:
    """The values of ``--set`` that make a pool of ``base``, by the names of their fields."""
    own, before = _plain(pool.parameters), _plain(base.parameters)
    gone = {f"{each.name}s": 0 for each in base.operators
            if each.name not in {other.name for other in pool.operators} and fields(each)}
    changed = {name: value for name, value in own.items() if name not in before or before[name] != value}
    # The number of an operator adds it, and must come with its other parameters.
    return {name: _word(name, value) for name, value in (gone | changed).items()}


def _word(name, value):
    """A value as it is on a command line."""
    if name.endswith("_memory") and value is False:
        return "none"
    return str(value).lower() if isinstance(value, bool) else str(value)


@dataclass(frozen=True)
class Grid:
    """The pools of a kernel.

    Attributes
    ----------
    axes : dict
        Maps the names of parameters of a pool to their values, in order.
    base : Pool
        The pool whose other parameters all have.
    """

    axes: Mapping[str, tuple]
    base: Pool

    def size(self) -> int:
        """Number of pools. An operator of a pool without it has no other parameters."""
        total = 1
        for kind, own in self._by_kind().items():
            timings = 1
            for name in own:
                timings *= len(self.axes[name])
            counts = self.axes.get(f"{kind}s")
            if counts is not None:
                timings = sum(timings // len(counts) if count else 1 for count in counts)
            total *= timings
        return total

    def _by_kind(self):
        """Names of the axes by the kind of their operator, or by themselves."""
        known = self.base.known_parameters
        found: dict[str, list[str]] = {}
        for name in self.axes:
            owner = known[name][0]
            found.setdefault(name if owner is Pool else owner.name, []).append(name)
        return found

    def __iter__(self) -> Iterator[Pool]:
        seen = set()
        for values in product(*self.axes.values()):
            pool = self._changed(self.base, dict(zip(self.axes, values, strict=True)))
            if pool and (key := pool_key(pool)) not in seen:
                seen.add(key)
                yield pool

    def neighbours(self, pool: Pool) -> Iterator[Pool]:
        """The pools that differ from ``pool`` by one step on one axis; from a value beside the axis, by any."""
        parameters = _plain(pool.parameters)
        for name, values in self.axes.items():
            plain = [value.value if isinstance(value, Enum) else value for value in values]
            if name in parameters:
                present = parameters[name]
            elif name in self._counts():
                present = 0
            else:
                continue
            if present in plain:
                place = plain.index(present)
                steps = values[max(place - 1, 0):place] + values[place + 1:place + 2]
            else:
                steps = values
            for value in steps:
                if other := self._changed(pool, {name: value}):
                    yield other

    def _counts(self):
        return {name for name, (owner, parameter) in self.base.known_parameters.items()
                if owner is not Pool and parameter.name == "count"}

    def _changed(self, pool, values):
        """The pool with other parameters; None if there is none. Timing of operators that it lacks is left out."""
        known, counts = pool.known_parameters, self._counts()
        present = {each.name for each in pool.operators}

        def there(name):
            owner = known[name][0]
            return owner is Pool or name in counts or values.get(f"{owner.name}s", owner.name in present)

        try:
            return pool.with_parameters(**{name: value for name, value in values.items() if there(name)})
        except (TypeError, ValueError):
            return None


def grid_of(config: Config, system: System, *, timing: bool = True, vary: Mapping[str, tuple[str, ...]] | None = None,
            ) -> Grid:
    """The grid of a configuration's kernel.

    Its axes are the parameters of the operators that the kernel can use, and those of the pool itself. An operator can
    be absent if other operators can compute its operations.

    Parameters
    ----------
    config : Config
    system : System
        The kernel.
    timing : bool
        False: operators keep their timing, because without a clock frequency nothing tells which is better.
    vary : dict
        Maps the only fields that vary to their values as words; with no words, to all values of the grid.

    Raises: ConfigError for a field that the grid does not have, and for a value that the pool refuses.
    """
    base = config.engine_pool
    axes: dict[str, tuple] = {}
    for kind, (operator, least, most) in _useful(system, base).items():
        if any(parameter.name == "count" for parameter in fields(operator)):
            axes[f"{kind}s"] = tuple(range(least, max(min(most, MOST_UNITS), 1) + 1))
        for parameter in fields(operator):
            if parameter.name != "count" and (timing or vary):
                axes[f"{kind}_{parameter.name}"] = _timings(operator, parameter.name, base.format)
    for name, hint in get_type_hints(Pool).items():
        if name in base.parameters:
            axes[name] = _choices(hint, getattr(base, name))
    if vary:
        axes = {name: _given(config, name, words, axes) for name, words in vary.items()}
    return Grid({name: values for name, values in axes.items() if len(values) > 1 or vary}, base)


def _given(config, name, words, axes):
    """Values of an axis from their words on a command line."""
    if name not in axes:
        raise ConfigError(f"configuration {config.name}: the grid of its pools has no field {name!r}: choose from "
                          f"{', '.join(axes)}")
    if not words:
        return axes[name]

    def value(word):
        if word == "0" and name in {f"{kind}s" for kind in KINDS}:
            return 0
        return config.replace(**({f"{_kind_of(config, name)}s": 1} if _absent(config, name) else {}),
                              **{name: word}).engine_pool.parameters[name]

    return tuple(value(word) for word in words)


def _kind_of(config, name):
    owner, _ = config.pool.known_parameters[name]
    return "" if owner is Pool else owner.name


def _absent(config, name):
    """Whether a field is the timing of an operator that the pool does not have."""
    kind = _kind_of(config, name)
    return bool(kind) and name != f"{kind}s" and kind not in {each.name for each in config.pool.operators}


def _useful(system, base):
    """Maps kinds that the kernel can use to an operator, 0 if it can do without, else 1, and the most operations."""
    own = {each.name: each for each in base.operators}
    offered = {}
    for name, kind in {**KINDS, **{name: type(each) for name, each in own.items()}}.items():
        try:
            offered[name] = own[name] if name in own else kind()
            offered[name].make(base.format)
        except (TypeError, ValueError):
            offered.pop(name, None)  # Not for this format, or with parameters that have no default.
    found: dict[str, int] = {}
    without: set[str] = set()
    waiting, seen = [frozenset(offered)], set()
    while waiting:
        present = waiting.pop()
        if present in seen:
            continue
        seen.add(present)
        if rivals := _rivals(offered, present):
            waiting += [present - {name} for name in rivals]
            continue
        try:
            pool = replace(base, operators=tuple(offered[name] for name in offered if name in present))
            counts = system.trace(pool).count()
        except ValueError:
            continue
        without |= offered.keys() - present
        for name in present:
            used = sum(counts.get(each.name, 0) for each in offered[name].operations)
            found[name] = max(found.get(name, 0), used)
            if used and any(each.fallback for each in offered[name].operations):
                waiting.append(present - {name})
    return {name: (offered[name], int(name not in without), found[name])
            for name in offered if found.get(name) and fields(offered[name])}


def _rivals(offered, present):
    """Two kinds that offer the same operation, of which a pool has one at most; none if there are no such kinds."""
    kinds: dict[str, str] = {}
    for name in sorted(present):
        for operation in offered[name].operations:
            if kinds.setdefault(operation.name, name) != name:
                return kinds[operation.name], name
    return ()


def _timings(operator: Operator, name: str, format: FloatFormat) -> tuple:
    """Values of a parameter of an operator: those of its type, or of the whole numbers that it takes, from the least to
    the greatest. A number that changes neither latency nor interval is left out."""
    hint = get_type_hints(type(operator))[name]
    if hint is not int:
        return _choices(hint, getattr(operator, name))
    values: dict[tuple, int] = {}
    for value in range(1, GREATEST_VALUE + 1):
        try:
            made = replace(operator, **{name: value}).make(format)
        except (TypeError, ValueError):
            if values:
                break
            continue
        values.setdefault((made.latency, made.interval), value)
    last, steps = len(values) - 1, min(len(values), MOST_VALUES) - 1
    return tuple(list(values.values())[last * step // max(steps, 1)] for step in range(steps + 1))


def _choices(hint: Any, present: Any) -> tuple:
    """Values of a type, of which there are few. Open settings of a pool have been decided; of the memories, either the
    kind that the synthesis tool chooses stands in the grid or LUT RAM."""
    kinds = get_args(hint) if isinstance(hint, UnionType) else (hint,)
    values: list[Any] = []
    if bool in kinds:
        values += [False] if MemoryStyle in kinds else [False, True]
    for kind in kinds:
        if kind is MemoryStyle:
            small = MemoryStyle.AUTO if present in (MemoryStyle.AUTO, False) else MemoryStyle.DISTRIBUTED
            values += [small, MemoryStyle.BLOCK]
        elif isinstance(kind, type) and issubclass(kind, Enum):
            values += list(kind)
    return tuple(values) or (present,)
