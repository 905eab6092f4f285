"""Reference pages of the operators: docs/operators, from docstrings, signatures and twins."""

import inspect
import re
from enum import Enum
from itertools import product

from amaranth.hdl import Shape
from amaranth.lib.wiring import In, Out

from strapdown.fp import BINARY16, BINARY32, BINARY64, FLAGS, FloatFormat
from strapdown.markdown import markdown_table
from strapdown_lab import special_values as special
from strapdown_lab.operators import OPERATORS

from .diagram import diagram, iterative_timing, pipelined_timing
from .tables import operator_tables

__all__ = ["PAGES", "flags_table", "index_table", "page_text"]

PAGES = {entry.name: entry for entry in OPERATORS}
"""The operators by the name of their page."""


# Docstrings.

_LABELS = "Latency|Accuracy|Special values|Special values and flags|Flags|Raises|Source"


def _docstring(component):
    """Summary, parameters and members as tuples of head, type and text, and the labelled paragraphs as a dict."""
    summary, _, rest = (inspect.getdoc(component) or "").partition("\n\n")
    parts = re.split(rf"^({_LABELS}): ", rest, flags=re.MULTILINE)
    sections = dict(re.findall(r"^(Parameters|Members)\n-+\n(.*?)(?=\n\n|\Z)", parts[0], re.DOTALL | re.MULTILINE))
    entries = {name: re.findall(r"^(\S[^:\n]*) : ([^\n]*)\n((?:    .*\n?)*)", body, re.MULTILINE)
               for name, body in sections.items()}
    return (summary, entries.get("Parameters", []), entries["Members"],
            dict(zip(parts[1::2], parts[2::2], strict=True)))


def _markdown(text, own=""):
    """Docstring text as Markdown on one line: literals, powers, and links to other pages."""
    text = " ".join(text.split()).replace("``", "`")
    pieces = re.split(r"(`[^`]*`)", text)
    for index, piece in enumerate(pieces):
        name = piece.strip("`")
        if not piece.startswith("`"):
            pieces[index] = re.sub(r"\*\*(-?\w+)", lambda power: f"<sup>{power[1].replace('-', '−')}</sup>", piece)
        elif name == "Flags":
            pieces[index] = "[`Flags`](README.md#flags)"
        elif name in PAGES and name != own:
            pieces[index] = f"[{piece}]({name}.md)"
    return "".join(pieces)


def _value(value):
    """A parameter's value in the form of Python code."""
    match value:
        case FloatFormat():
            return value.name.upper() + ("" if value.gradual else '.with_subnormals("flush")')
        case Enum():
            return f"{type(value).__name__}.{value.name}"
        case str():
            return f'"{value}"'
    return repr(value)


def _default(page, name):
    default = inspect.signature(page.component.__init__).parameters[name].default
    if default is inspect.Parameter.empty:
        return "–"
    if name == "latency":
        default = page.make().pipeline.default_latency
    return f"`{_value(default)}`"


def _call(component, parameters):
    accepted = inspect.signature(component.__init__).parameters
    words = [_value(value) if accepted[name].kind is not inspect.Parameter.KEYWORD_ONLY else f"{name}={value}"
             for name, value in parameters.items()]
    return f"{component.__name__}({', '.join(words)})"


# Sections.

def _parameters(page, entries):
    rows = [[_names(heads), kind, _default(page, heads.partition(",")[0]), _markdown(text)]
            for heads, kind, text in entries]
    return markdown_table(["parameter", "type", "default", "meaning"], rows)


def _names(heads):
    return ", ".join(f"`{name}`" for name in heads.split(", "))


def _ports(page, members):
    component = page.component
    options = {name: True for name in ("flags", "magnitude")
               if name in inspect.signature(component.__init__).parameters}
    rows = [["`clk`", "in", 1, "clock, rising edge"], ["`rst`", "in", 1, "synchronous reset, active high"]]
    for name, member in page.make(**options).signature.members.items():
        note = f"only with `{name}=True`" if name in options else ""
        rows.append([f"`{name}`", "in" if member.flow is In else "out", Shape.cast(member.shape).width,
                     ", ".join(filter(None, [_form(member.shape), note]))])
    meanings = [f"- {_names(heads)}: {_markdown(text)}" for heads, _, text in members]
    return "\n\n".join([f"Of `{_call(component, page.parameters)}`:",
                        markdown_table(["port", "direction", "width:", "form"], rows), "\n".join(meanings)])


def _form(shape):
    if shape is FLAGS:
        return "[flags](README.md#flags)"
    for fmt in BINARY16, BINARY32:
        if shape in (fmt.layout, fmt.with_subnormals("flush").layout):
            return fmt.name
    return "two's complement" if Shape.cast(shape).signed else "bit"


def _timing(page):
    operator = page.make()
    data = {name: member.flow for name, member in operator.signature.members.items() if name not in ("start", "done")}
    rows = [", ".join(name for name, flow in data.items() if flow is wanted) for wanted in (In, Out)]
    variants = [page.make(iterative=value) for value in (operator.iterative, not operator.iterative)] \
        if "iterative" in page.choices else [operator]
    return "\n\n".join(_timing_diagram(variant, *rows) for variant in variants)


def _timing_diagram(operator, operands, results):
    if operator.interval == 1:
        timing = pipelined_timing(operator.latency)
        text = (f"Pipelined, `latency` = {operator.latency}: A and B in consecutive cycles, C after a cycle without a "
                "start. A blank value has no meaning.")
    else:
        timing = iterative_timing(operator.latency, operator.interval)
        text = (f"Iterative, `latency` = {operator.latency}, `interval` = {operator.interval}: X comes while A is in "
                f"flight and is ignored; B, {operator.interval} cycles after A, is the earliest accepted operation. "
                "`(busy)` is not a port.")
    return f"{text}\n\n```\n{diagram(timing, operands, results)}\n```"


def _latencies(page):
    component, default = page.component, page.make()
    priority = default.pipeline.priority if hasattr(default, "pipeline") else ()
    rows = []
    choices = page.page_choices()
    for values in product(*choices.values()):
        parameters = dict(zip(choices, values, strict=True))
        operator = page.make(**parameters)
        is_default = all(getattr(default, name) == value for name, value in parameters.items())
        latency = f"**{operator.latency}**" if is_default else operator.latency
        row = [_choice(value) for name, value in parameters.items() if name != "latency"]
        row += [latency, operator.interval]
        if priority:
            row.append(", ".join(cut for cut in operator.pipeline.cuts if cut in priority[:operator.latency]))
        rows.append(row)
    head = [*(f"`{name}`:" if name.endswith("cycle") else f"`{name}`" for name in page.choices if name != "latency"),
            "latency:", "interval:", *(["register ranks after"] if priority else [])]
    return f"Cycles of `{_call(component, page.parameters)}`; bold is the default.\n\n{markdown_table(head, rows)}"


def _choice(value):
    return f"{value.name}, {value.subnormals.value}" if isinstance(value, FloatFormat) else value


def _accuracy(page, text):
    parts = [_sentence(_markdown(text, page.name))]
    if hasattr(page.component, "error_bound_ulp"):
        bounds = [name for name in ("error_bound_ulp", "magnitude_error_bound_ulp") if hasattr(page.component, name)]
        rows = []
        for fmt in (BINARY16, BINARY32, BINARY64):
            operator = page.make(format=fmt, **({"magnitude": True} if len(bounds) > 1 else {}))
            rows.append([fmt.name, operator.width, operator.iterations,
                         *(f"{getattr(operator, name):.3f}" for name in bounds)])
        parts.append("With `magnitude=True`:" if len(bounds) > 1 else "By default:")
        parts.append(markdown_table(["format", "`width`:", "`iterations`:", *(f"`{name}`:" for name in bounds)], rows))
    return "\n\n".join(parts)


def _twin(component):
    lines = []
    for name in ("compute", "compute_flags"):
        if method := getattr(component, name, None):
            arguments = [parameter for parameter in inspect.signature(method).parameters.values()
                         if parameter.name != "self"]
            summary = (inspect.getdoc(method) or "").partition("\n\n")[0]
            lines.append(f"- `{name}({', '.join(map(str, arguments))})`: {_markdown(summary)}")
    return "\n".join(lines)


def page_text(page, report=None):
    """The Markdown of a page; ``report`` is the contents of operators.json, if available."""
    component = page.component
    summary, parameters, members, paragraphs = _docstring(component)
    module = component.__module__.rpartition(".")[0]
    parts = [f"# `{page.name}`", _markdown(summary, page.name),
             f"```python\nfrom {module} import {page.name}\n\n"
             f"{page.name}{_signature(component)}\n```"]

    def section(title, *texts):
        parts.extend([f"## {title}", *filter(None, texts)])

    section("Parameters", _parameters(page, parameters),
            f"Raises {_markdown(paragraphs['Raises'], page.name)}" if "Raises" in paragraphs else "")
    section("Ports", _ports(page, members))
    section("Timing", _timing(page))
    section("Latency and interval", _markdown(paragraphs["Latency"], page.name),
            _latencies(page) if page.choices else "")
    section("Accuracy", _accuracy(page, paragraphs["Accuracy"]))
    values = paragraphs.get("Special values") or paragraphs.get("Special values and flags")
    flags = f"Flags: {_markdown(paragraphs['Flags'], page.name)}" if "Flags" in paragraphs else ""
    tables = page.special_values()
    section("Special values", _sentence(_markdown(values, page.name)) if values else "", flags, tables,
            special.legend(tables))
    section("Software twin", _twin(component))
    operators = {variants.title for variants in page.measured}
    if report and operators:
        section("Resources", operator_tables(report, operators), "[report.md](../report.md) describes the measurement.")
    if "Source" in paragraphs:
        section("Source", _markdown(paragraphs["Source"], page.name))
    return "\n\n".join([*parts, "[All operators](README.md)"]) + "\n"


def _sentence(text):
    """The text with a capital letter, unless it starts with an expression."""
    return text[0].upper() + text[1:] if re.match(r"[a-z]{2,}[ ,;.]", text) else text


def _signature(component):
    words = []
    for name, parameter in list(inspect.signature(component.__init__).parameters.items())[1:]:
        if parameter.kind is inspect.Parameter.KEYWORD_ONLY and "*" not in words:
            words.append("*")
        words.append(name if parameter.default is inspect.Parameter.empty else f"{name}={_value(parameter.default)}")
    return f"({', '.join(words)})"


# The index.

def index_table():
    """All operators: what they compute, latency and interval by default."""
    rows = []
    for page in PAGES.values():
        operator = page.make()
        rows.append([f"[`{page.name}`]({page.name}.md)", _markdown(_docstring(page.component)[0], page.name),
                     operator.latency, operator.interval])
    return markdown_table(["component", "what it computes", "latency:", "interval:"], rows)


def flags_table():
    """Bits of the output ``flags``."""
    return markdown_table(["bit:", "exception", "in tables"], [
        [flag.bit_length() - 1, str(flag.name).lower().replace("_", " "), f"`{name}`"]
        for flag, name in sorted(special.FLAG_NAMES.items())])
