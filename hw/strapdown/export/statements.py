"""Statements of registers and choices: made shorter, and those of several registers merged."""

from .netlist import part_of, width_of
from .rtlil import Assign, Bits, Switch

__all__ = ["condition_of", "conditions_of", "merged", "reset_of", "switch_key", "tidied"]


def tidied(body):
    """Statements without those that do nothing; neighbours with the same cases are one."""
    found: list = []
    for statement in body:
        if isinstance(statement, Switch):
            statement = _without_empty(statement)
            if not any(inner for _, inner in statement.cases):
                continue
            last = found[-1] if found else None
            if isinstance(last, Switch) and switch_key(last) == switch_key(statement):
                found.pop()
                statement = Switch(statement.selector, tuple(
                    (patterns, tidied((*before, *after)))
                    for (patterns, before), (_, after) in zip(last.cases, statement.cases, strict=True)))
        found.append(statement)
    return _with_default(found)


def _without_empty(statement):
    cases = tuple((patterns, tidied(inner)) for patterns, inner in statement.cases)
    if cases and not cases[-1][0] and not cases[-1][1]:
        cases = cases[:-1]
    exclusive = not any("-" in digits for patterns, _ in cases for digits in patterns)
    if exclusive and all(patterns for patterns, _ in cases):
        cases = tuple((patterns, inner) for patterns, inner in cases if inner)
    return Switch(statement.selector, cases)


def _with_default(body):
    """A value that is assigned before the cases becomes that of all other cases."""
    if len(body) == 2 and isinstance(body[0], Assign) and isinstance(body[1], Switch):
        first, switch = body
        labels = [digits for patterns, _ in switch.cases for digits in patterns]
        simple = all(len(inner) == 1 and isinstance(inner[0], Assign) and inner[0].target == first.target
                     for _, inner in switch.cases)
        if simple and all(patterns for patterns, _ in switch.cases) and not any("-" in digits for digits in labels):
            complete = len(set(labels)) == 1 << width_of(switch.selector)
            cases = switch.cases if complete else (*switch.cases, ((), (first,)))
            return (Switch(switch.selector, cases),)
    return tuple(body)


def condition_of(selector, patterns):
    """The bit that decides a case, and its level, if there is exactly one; else None."""
    if len(patterns) != 1 or len(level := patterns[0].replace("-", "")) != 1:
        return None
    (place,) = (place for place, digit in enumerate(reversed(patterns[0])) if digit != "-")
    return part_of(selector, place, 1), level


def conditions_of(switch):
    """The conditions of the cases, None for one that always matches; or None if a case has another pattern."""
    found = []
    for patterns, _ in switch.cases:
        condition = condition_of(switch.selector, patterns) if patterns else None
        if patterns and condition is None:
            return None
        found.append(condition)
    if len(found) == 2 and width_of(switch.selector) == 1:
        found[1] = None
    return found


def reset_of(body, register):
    """Condition, reset value and other statements of a register that a last statement resets, or None."""
    if body and isinstance(body[-1], Switch) and len(body[-1].cases) == 1:
        ((patterns, then),) = body[-1].cases
        if patterns == ("1",) and len(then) == 1 and isinstance(then[0], Assign) and then[0].target == register and \
                isinstance(then[0].value[0], Bits):
            return body[-1].selector, then, body[:-1]
    return None


def switch_key(switch):
    """What two switches share if their cases can stand together."""
    return switch.selector, tuple(patterns for patterns, _ in switch.cases)


def merged(bodies):
    """Statements of several registers; equal conditions stand once."""
    statements: list = []
    places: dict = {}
    for body in bodies:
        if len(body) == 1 and isinstance(body[0], Switch):
            key = switch_key(body[0])
            if key in places:
                statements[places[key]].append(body[0])
            else:
                places[key] = len(statements)
                statements.append([body[0]])
        else:
            statements += body
    return tuple(
        Switch(entry[0].selector, tuple((patterns, merged([switch.cases[index][1] for switch in entry]))
                                        for index, (patterns, _) in enumerate(entry[0].cases)))
        if isinstance(entry, list) else entry for entry in statements)
