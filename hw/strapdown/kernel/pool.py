"""The pool of operators of an engine."""

import enum
import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from typing import Any

from strapdown.fp import BINARY32, FloatFormat, Subnormals

from .operators import KINDS, Adder, Arctangent, Divider, Multiplier, Operator, Selector

__all__ = ["SELDOM", "STYLES", "MemoryStyle", "Pool", "Unit"]

FLUSHED32 = BINARY32.with_subnormals(Subnormals.FLUSH)


@dataclass(frozen=True)
class Unit:
    """One operator of a pool, for numbers of its format.

    Attributes
    ----------
    name, kind : str
        Name of its instance in the Verilog, and name of its operator; several units may have the same kind.
    make : callable
        Makes a new component, with members ``start`` and ``result``.
    operations : dict
        Maps each kernel operation to its bit-exact twin on arrays.
    read_port : int
        The pair of memory read ports that feeds it.
    operands : tuple of str
        Members that take the operands, one or two.
    modes : dict
        Maps each kernel operation to the member that is high for it.
    direct : bool
        True if its results go directly to the result bus, and can be operands in the cycle in which they come out.
        Results of other units are registered once more on the way.
    takes_condition : bool
        True if it has a member ``condition``.
    latency, interval : int
        Cycles from start to result, and between two starts.
    """

    name: str
    kind: str
    make: Callable[[], Any]
    operations: dict[str, Callable]
    read_port: int
    operands: tuple[str, ...] = ("a", "b")
    modes: dict[str, str] = field(default_factory=dict)
    direct: bool = False
    takes_condition: bool = False
    latency: int = field(init=False)
    interval: int = field(init=False)

    def __post_init__(self):
        model = self.make()
        object.__setattr__(self, "latency", model.latency)
        object.__setattr__(self, "interval", model.interval)


class MemoryStyle(enum.Enum):
    """The kind of memory in the FPGA."""

    AUTO = "auto"
    """The synthesis tool chooses: the file has no attribute for the memory."""
    DISTRIBUTED = "distributed"
    """LUTs, in families that have such RAM."""
    BLOCK = "block"
    """Block RAM: its contents come out one cycle after the address."""

    def attributes(self, name):
        """Attributes of a memory in the Verilog; ``name`` is ram_style or rom_style."""
        if self is MemoryStyle.AUTO:
            return {}
        # Yosys makes no ROM of LUT RAM, and stops at "distributed". It reads rom_block first, which other tools ignore.
        yosys = {"rom_block": "logic"} if self is MemoryStyle.DISTRIBUTED and name == "rom_style" else {}
        return yosys | {name: self.value}


STYLES = "auto, distributed or block"
"""The values of a MemoryStyle in messages."""

SUITED: dict[str, tuple[Any, Any]] = {
    "forwarding": (True, False), "operand_memory": (MemoryStyle.AUTO, MemoryStyle.BLOCK),
    "side_memory": (False, MemoryStyle.AUTO)}
"""Maps each field of a Pool that may be None to its value for one channel, and its value for several."""

SELDOM = {"horizontal": False, "side_buses": 1, "side_registered": False, "read_ranks": 1, "adder_dsp_shifts": False,
          "adder_two_paths": False}
"""Maps parameters of a Pool that few configurations set to their defaults: a configuration lists other values only."""

RESERVED = {"input", "other", "bus", "memory", "side", "side2", "side3", "main", "operands", "signs", "microcode",
            "constant", "constants", "main_memory", "side_memory", "side2_memory", "side3_memory", "bank", "fresh",
            "current", "refusals"}
"""Names beside those of units in the engines: sources of operands and results, buses, memories and state."""


@dataclass(frozen=True)
class Pool:
    """The operators of an engine, their timing, and the memories that feed them.

    Parameters
    ----------
    format : FloatFormat
        Format of all numbers.
    operators : tuple of Operator
        The operators; a circuit contains only those that its equations use.
    forwarding : bool or None
        True if a result can be an operand in the cycle in which it comes out, without the memory. None: True for one
        channel, False for several.
    private_ports : bool
        True if every adder and every multiplier has its own pair of read ports.
    operand_memory : MemoryStyle or None
        The kind of the operand memory. None: auto for one channel, block for several. For one channel only a block
        memory is read with a clock edge; any other is LUT RAM, or flip-flops in families without LUT RAM.
    microcode : MemoryStyle
        The kind of the ROM.
    horizontal : bool
        True for horizontal microcode, for one channel without forwarding and side memory: a word has a bit for each
        input port that drives the result bus, and for each output that takes its value from it. The bus is an OR of
        results that are zero in all other cycles. This takes fewer LUTs, but more flip-flops and a wider ROM. No result
        is registered on the way to the bus if its operator can be quiet.
    side_memory : MemoryStyle, bool or None
        The kind of the memories of the side buses, for results of adders and multipliers and, with several channels,
        for inputs; False for one bus. True: auto. None: False for one channel, auto for several.
    side_buses : int
        Number of result buses with a side memory, 1 to 3; 1 for one channel. Without a side memory there is none.
    side_registered : bool
        True if the side bus of one channel takes constants, and results that are registered on the way, too. One of
        these can be on the buses in a cycle. With several channels, it has no effect.
    read_ranks : int
        Register ranks from an address to the choice among the memories, 1 or 2; 1 for one channel. A block RAM has one.

    A memory style may also be given as its value, "auto", "distributed" or "block".

    Raises: TypeError and ValueError for a field of a wrong type, for parameters that an operator refuses, for an object
    that is not an operator, for two operators that offer the same operation, for operators without a selector, for two
    units that take a condition, and for names of units that are equal or that the engines use.
    """

    format: FloatFormat = FLUSHED32
    operators: tuple[Operator, ...] = (Adder(), Multiplier(), Divider(count=2), Arctangent(), Selector())
    forwarding: bool | None = None
    private_ports: bool = True
    operand_memory: MemoryStyle | None = None
    microcode: MemoryStyle = MemoryStyle.BLOCK
    horizontal: bool = False
    side_memory: MemoryStyle | bool | None = None
    side_buses: int = 1
    side_registered: bool = False
    read_ranks: int = 1

    def __post_init__(self):
        self._check_types()
        offered: dict[str, str] = {}
        for each in self.operators:
            if not isinstance(each, Operator):
                raise TypeError(f"operators must be instances of Operator, not {each!r}")
            for operation in each.operations:
                if operation.name in offered:
                    raise ValueError(f"operators must offer {operation.name} once: "
                                     f"{offered[operation.name]} and {each.name} do")
                offered[operation.name] = each.name
        if "copy" not in offered:
            raise ValueError("operators must include a Selector, which copies numbers")
        self._check_units()  # each operator checks its parameters

    def _check_types(self):
        """Refuse fields of another type, and turn values of memory styles into MemoryStyle."""
        if not isinstance(self.format, FloatFormat):
            raise TypeError(f"format must be a FloatFormat, not {self.format!r}")
        if not isinstance(self.operators, tuple):
            raise TypeError(f"operators must be a tuple of operators, not {self.operators!r}")
        for name in "forwarding", "private_ports", "horizontal", "side_registered":
            value = getattr(self, name)
            if not isinstance(value, bool) and not (value is None and name in SUITED):
                raise TypeError(f"{name} must be True or False, not {value!r}")
        for name, most in ("side_buses", 3), ("read_ranks", 2):
            value = getattr(self, name)
            if type(value) is not int:
                raise TypeError(f"{name} must be a whole number, not {value!r}")
            if not 1 <= value <= most:
                raise ValueError(f"{name} must be from 1 to {most}, not {value!r}")
        if self.side_memory is True:
            object.__setattr__(self, "side_memory", MemoryStyle.AUTO)
        for name, kinds in ("operand_memory", STYLES), ("microcode", STYLES), ("side_memory", f"False, {STYLES}"):
            value = getattr(self, name)
            if (value is None and name in SUITED) or (value is False and name == "side_memory"):
                continue
            try:
                object.__setattr__(self, name, MemoryStyle(value))
            except ValueError:
                raise ValueError(f"{name} must be {kinds}, not {value!r}") from None

    def _check_units(self):
        """Refuse units that the engines cannot tell apart, or that need a second condition per cycle."""
        names = [unit.name for unit in self.units]
        for name in names:
            if not re.fullmatch("[A-Za-z][A-Za-z0-9_]*", name):
                raise ValueError(f"an operator must have letters, digits and underscores for a name, not {name!r}")
            if name in RESERVED:
                raise ValueError(f"an operator must not have the name {name}: the engines use it themselves")
        modes = [f"{unit.name}_{mode}" for unit in self.units for mode in unit.modes.values()]
        for kind, found in ("unit", names), ("mode", modes):
            if twice := [name for name, count in Counter(found).items() if count > 1]:
                raise ValueError(f"operators must have different names: there are two {kind}s {twice[0]}")
        if len(choosers := [unit.name for unit in self.units if unit.takes_condition]) > 1:
            raise ValueError(f"one unit of a pool can take a condition, not {' and '.join(choosers)}")

    def settled(self, channels):
        """This pool with values from SUITED in place of None, for an engine with this number of channels."""
        open_ones = [name for name in SUITED if getattr(self, name) is None]
        return replace(self, **{name: SUITED[name][channels > 1] for name in open_ones}) if open_ones else self

    def with_operators(self, *operators):
        """This pool with more operators; an operator replaces one of the same kind."""
        own = {each.name: each for each in (*self.operators, *operators)}
        return replace(self, operators=tuple(own.values()))

    @property
    def parameters(self):
        """All parameters but the format, by name. Those of operators have names like ``adders``, ``adder_latency``."""
        return {name: getattr(each, parameter.name) for each in (*self.operators, self)
                for name, parameter in _parameters_of(type(each)).items()}

    @property
    def known_parameters(self):
        """Maps each name that ``with_parameters`` takes to the class that has the parameter, and its field. The class
        is Pool or a kind of operator, which the pool need not have."""
        kinds = KINDS | {each.name: type(each) for each in self.operators}
        return {name: (owner, parameter) for owner in (*kinds.values(), Pool)
                for name, parameter in _parameters_of(owner).items()}

    def with_parameters(self, **values):
        """This pool with other values of some ``parameters``.

        The number of an operator that the pool does not have adds it, as in ``reciprocal_roots=1``; a number of 0
        removes one. Raises: ValueError for an unknown name, and for a parameter of an operator that the pool does not
        have; TypeError and ValueError as Pool.
        """
        known = self.known_parameters
        changes: dict[Any, dict[str, Any]] = {}
        for name, value in values.items():
            if name not in known:
                raise ValueError(f"a pool has no parameter {name!r}")
            owner, parameter = known[name]
            changes.setdefault(owner, {})[parameter.name] = value
        own = changes.pop(Pool, {})
        operators = {each.name: each for each in self.operators}
        for kind, change in changes.items():
            if change.get("count") == 0:
                operators.pop(kind.name, None)
            elif kind.name in operators:
                operators[kind.name] = replace(operators[kind.name], **change)
            elif "count" in change:
                operators[kind.name] = kind(**change)
            else:
                raise ValueError(f"the pool has no {kind.name}: {kind.name}s=1 adds one")
        return replace(self, operators=tuple(operators.values()), **own)

    @property
    def memory_delay(self):
        """Least number of cycles between a result and an operand that comes from memory."""
        return 2 if self.operand_memory is MemoryStyle.BLOCK else 1

    @cached_property
    def units(self):
        """All units of the pool, a tuple of Unit.

        Additions are on nearly every path, so an adder shares its pair of read ports only with pipelined
        operators that are seldom used. Iterative operators share the pair of a multiplier. If there are
        several of these, the operators beside them take the pairs in turn.
        """
        ports: dict[str, list[int]] = {}
        pairs = 0
        for each in self.operators:
            if not each.beside:
                ports[each.name] = list(range(pairs, pairs + each.count))
                pairs += each.count
        guests = dict.fromkeys(ports, 0)
        units = []
        for each in self.operators:
            quiet = self.horizontal and each.can_be_quiet
            make = partial(each.make, self.format, **({"quiet": True} if quiet else {}))
            component = make()
            host = each.beside or each.name
            for name in _numbered(each.name, each.count):
                pair = 0
                if self.private_ports and host in ports:
                    pair = ports[host][guests[host] % len(ports[host])]
                    guests[host] += 1
                units.append(Unit(
                    name, each.name, make,
                    {operation.name: partial(operation.twin, component) for operation in each.operations},
                    read_port=pair, operands=each.operands, direct=quiet if self.horizontal else each.direct,
                    modes={operation.name: operation.mode for operation in each.operations if operation.mode},
                    takes_condition=any(operation.takes_condition for operation in each.operations)))
        return tuple(units)

    @cached_property
    def operations(self):
        """Maps each kernel operation to the units that can compute it."""
        operations: dict[str, list[Unit]] = {}
        for unit in self.units:
            for operation in unit.operations:
                operations.setdefault(operation, []).append(unit)
        return operations

    def compute(self, operation, *arrays):
        """Result of the units for ``operation`` on arrays of the format's dtype, bit for bit."""
        return self.operations[operation][0].operations[operation](*arrays)


def _parameters_of(owner):
    """Maps the name of each parameter of Pool, or of a kind of operator, to its field."""
    if owner is Pool:
        return {parameter.name: parameter for parameter in fields(owner)
                if parameter.name not in ("format", "operators")}
    return {f"{owner.name}s" if parameter.name == "count" else f"{owner.name}_{parameter.name}": parameter
            for parameter in fields(owner)}


def _numbered(name, count):
    return [name] if count == 1 else [f"{name}_{index}" for index in range(count)]
