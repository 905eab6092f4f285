"""A reader for RTLIL, the text in which Amaranth describes a circuit to other tools.

It reads what Amaranth writes: modules with wires, memories, cells, processes and connections.
"""

import re
from dataclasses import dataclass, field
from typing import NamedTuple

__all__ = ["Assign", "Bits", "Cell", "Memory", "Module", "SignedBits", "Slice", "Switch", "Wire", "parse"]


class Slice(NamedTuple):
    """Neighbouring bits of a wire."""

    wire: str
    low: int
    width: int


class Bits(NamedTuple):
    """A constant: its bits as characters 0 and 1, the highest first; ``width`` is their number."""

    digits: str

    @property
    def width(self):
        return len(self.digits)


class SignedBits(NamedTuple):
    """A signed parameter: its bits in two's complement, as those of Bits."""

    digits: str


class Assign(NamedTuple):
    """A statement: bits of the wire that the process drives take a value, a tuple of Slice and Bits."""

    target: Slice
    value: tuple


class Switch(NamedTuple):
    """A statement: the first case with a pattern that matches the selector is carried out.

    ``cases`` holds tuples of patterns and a body; patterns are strings of 0, 1 and -, and a case without patterns
    always matches.
    """

    selector: tuple
    cases: tuple


@dataclass
class Wire:
    """``port`` is "input" or "output" for a port of the module; ``attributes`` hold strings and integers."""

    name: str
    width: int
    port: str | None
    attributes: dict


@dataclass
class Memory:
    """``rows`` hold the initial contents."""

    name: str
    width: int
    depth: int
    attributes: dict
    rows: list = field(default_factory=list)


@dataclass
class Cell:
    """An operator, a register, a port of a memory, or a submodule.

    ``ports`` map names to values, tuples of Slice and Bits with the lowest bits first; ``outputs`` are the names of
    ports that drive a whole wire.
    """

    kind: str
    name: str
    parameters: dict = field(default_factory=dict)
    ports: dict = field(default_factory=dict)
    outputs: set = field(default_factory=set)


@dataclass
class Module:
    """``processes`` hold lists of statements, ``connections`` tuples of a wire and its value."""

    name: str
    wires: dict = field(default_factory=dict)
    memories: dict = field(default_factory=dict)
    cells: list = field(default_factory=list)
    processes: list = field(default_factory=list)
    connections: list = field(default_factory=list)


def parse(text):
    """The modules of an RTLIL text, a list of Module, the top first.

    Raises: ValueError for a line that Amaranth does not write.
    """
    lines = (stripped for line in text.splitlines() if (stripped := line.strip()))
    modules: list[Module] = []
    attributes: dict = {}
    for line in lines:
        word, _, rest = line.partition(" ")
        if word == "attribute":
            name, _, value = rest.partition(" ")
            attributes[name.removeprefix("\\")] = _constant(value)
            continue
        if word == "module":
            modules.append(Module(_plain(rest)))
        elif word == "wire":
            wire = _wire(rest.split(), attributes)
            modules[-1].wires[wire.name] = wire
        elif word == "memory":
            _, width, _, depth, name = rest.split()
            modules[-1].memories[_plain(name)] = Memory(_plain(name), int(width), int(depth), attributes)
        elif word == "cell":
            modules[-1].cells.append(_cell(rest.split(), lines, modules[-1].wires))
        elif word == "process":
            modules[-1].processes.append(_statements(lines, modules[-1].wires)[0])
        elif word == "connect":
            name, _, value = rest.partition(" ")
            modules[-1].connections.append((_plain(name), _value(value, modules[-1].wires)))
        elif word != "end":
            raise ValueError(f"RTLIL line not known: {line}")
        attributes = {}
    return modules


def _plain(name):
    """A name without the backslash of public names; those that Amaranth numbers begin with $."""
    return name.removeprefix("\\")


def _wire(words, attributes):
    width, port = int(words[1]), next((word for word in words if word in ("input", "output")), None)
    return Wire(_plain(words[-1]), width, port, attributes)


def _cell(words, lines, wires):
    cell = Cell(*map(_plain, words))
    for line in lines:
        word, _, rest = line.partition(" ")
        if word == "end":
            return cell
        *kind, name, value = rest.split(" ", 2 if rest.startswith(("signed ", "real ")) else 1)
        if word == "parameter":
            constant = _constant(value)
            if kind == ["real"]:
                constant = float(constant)
            elif kind == ["signed"]:
                constant = SignedBits(constant.digits)
            cell.parameters[_plain(name)] = constant
        else:
            cell.ports[_plain(name)] = _value(value, wires)
            if re.fullmatch(r"[\\$]\S+", value):
                cell.outputs.add(_plain(name))
    raise ValueError(f"Cell without end: {cell.name}")


def _statements(lines, wires):
    """Statements up to the line that ends them, and that line."""
    body: list = []
    for line in lines:
        word, _, rest = line.partition(" ")
        if word == "assign":
            name, _, value = rest.partition(" ")
            if value.startswith("["):
                bits, _, value = value.partition(" ")
                name = f"{name} {bits}"
            (part,) = _value(name, wires)
            body.append(Assign(part, _value(value, wires)))
        elif word == "switch":
            cases = []
            end = next(lines)
            while end != "end":
                labels = end.removeprefix("case").split(", ")
                patterns = tuple(label.partition("'")[2] for label in labels if label)
                inner, end = _statements(lines, wires)
                cases.append((patterns, inner))
            if rest == "{}":
                body += cases[0][1]
            else:
                body.append(Switch(_value(rest, wires), tuple(cases)))
        else:
            return tuple(body), line
    raise ValueError("Process without end")


def _constant(text):
    """An integer, a string, or Bits for a number with a width."""
    if text.startswith('"'):
        return text[1:-1].encode("ascii", "backslashreplace").decode("unicode_escape")
    return Bits(text.partition("'")[2]) if "'" in text else int(text)


def _value(text, wires):
    """A signal as a tuple of Slice and Bits, the lowest bits first."""
    parts: list = []
    words = text.strip("{} ").split()
    for word in words:
        if word[0] == "[":
            high, _, low = word[1:-1].partition(":")
            parts[-1] = Slice(parts[-1].wire, int(low or high), int(high) - int(low or high) + 1)
        elif word[0] in "\\$":
            name = _plain(word)
            parts.append(Slice(name, 0, wires[name].width))
        else:
            parts.append(Bits(word.partition("'")[2] if "'" in word else f"{int(word):b}"))
    return tuple(reversed([part for part in parts if part.width]))
