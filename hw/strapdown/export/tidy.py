"""Amaranth's Verilog made readable: plain identifiers, named slices, no unused wires.

The passes work on text. They recognise only the few forms in which the Verilog backend writes
declarations and assignments, and leave everything else unchanged.
"""

import re
from collections import Counter

__all__ = ["tidy"]

# Keywords of Verilog and of SystemVerilog, because many tools read .v files as either.
KEYWORDS = frozenset(re.findall(r"\w+", """
    accept_on alias always always_comb always_ff always_latch and assert assign assume automatic before begin
    bind bins binsof bit break buf bufif0 bufif1 byte case casex casez cell chandle checker class clocking cmos
    config const constraint context continue cover covergroup coverpoint cross deassign default defparam design
    disable dist do edge else end endcase endchecker endclass endclocking endconfig endfunction endgenerate
    endgroup endinterface endmodule endpackage endprimitive endprogram endproperty endsequence endspecify
    endtable endtask enum event eventually expect export extends extern final first_match for force foreach
    forever fork forkjoin function generate genvar global highz0 highz1 if iff ifnone ignore_bins illegal_bins
    implements implies import incdir include initial inout input inside instance int integer interconnect
    interface intersect join join_any join_none large let liblist library local localparam logic longint
    macromodule matches medium modport module nand negedge nettype new nexttime nmos nor noshowcancelled not
    notif0 notif1 null or output package packed parameter pmos posedge primitive priority program property
    protected pull0 pull1 pulldown pullup pulsestyle_ondetect pulsestyle_onevent pure rand randc randcase
    randsequence rcmos real realtime ref reg reject_on release repeat restrict return rnmos rpmos rtran rtranif0
    rtranif1 s_always s_eventually s_nexttime s_until s_until_with scalared sequence shortint shortreal
    showcancelled signed small soft solve specify specparam static string strong strong0 strong1 struct super
    supply0 supply1 sync_accept_on sync_reject_on table tagged task this throughout time timeprecision timeunit
    tran tranif0 tranif1 tri tri0 tri1 triand trior trireg type typedef union unique unique0 unsigned until
    until_with untyped use uwire var vectored virtual void wait wait_order wand weak weak0 weak1 while wildcard
    wire with within wor xnor xor
    """))

# Base and digits of a number, as in 6'b??1; they are not names.
LITERAL = r"'[sS]?[bodhBODH][\w?]+"
WIRE = re.compile(r"^(  wire (?:\[-?\d+:\d+\] )?(\w+);\n)", re.MULTILINE)
ASSIGN = re.compile(r"^(  assign (\w+) = (.*);\n)", re.MULTILINE)
PORT = re.compile(r"^  (?:input|output) (?:\[\d+:\d+\] )?(\w+);\n", re.MULTILINE)


def tidy(text):
    """The text of the backend, made readable.

    ``\\word.start.adder `` becomes word_start_adder, and ``\\$12 `` becomes n12. A name that is in use
    gets a number. A submodule is named after the top and its place in it.
    """
    text = re.sub(r"^/\*.*?\*/\n+", "", text, flags=re.DOTALL)
    text = re.sub(r"^\s*\(\*(?! (?:r[ao]m_style|ASYNC_REG|fsm_encoding)).*?\*\)\n", "", text, flags=re.MULTILINE)
    modules = re.split(r"(?<=endmodule)\n", text)
    submodules = {escaped: escaped.replace(".", "_") for escaped in re.findall(r"^module \\(\S+)", text, re.MULTILINE)}
    return "\n".join(_tidy_module(module, submodules) for module in modules)


def _tidy_module(text, submodules):
    for step in (lambda text: _plain_identifiers(text, submodules), _named_slices, _without_aliases, _without_unread):
        text = step(text)
    return text


def _plain_identifiers(text, submodules):
    """Replace escaped identifiers by plain ones, and keywords of either language by other names."""
    declared = set(re.findall(r"^  (?:wire|reg) (?:signed )?(?:\[\d+:\d+\] )?(?!signed )(\w+)", text, re.MULTILINE))
    for keyword in sorted(declared & KEYWORDS):
        text = re.sub(rf"(?<![\\\w.$])\b{keyword}\b", f"\\\\{keyword} ", text)
    taken = set(re.findall(r"(?<![\\\w$.])[A-Za-z_]\w*", text)) | KEYWORDS | set(submodules.values())
    names = dict(submodules)

    def plain(match):
        escaped = match[1]
        if escaped not in names:
            name = re.sub(r"^\$auto\$.*", "initial_trigger", escaped)
            name = re.sub(r"\W+", "_", re.sub(r"^\$(?=\d)", "n", name)).strip("_")
            candidate, number = name, 1
            while candidate in taken:
                number += 1
                candidate = f"{name}_{number}"
            taken.add(candidate)
            names[escaped] = candidate
        return names[escaped]

    # The space that ends an escaped identifier is removed, unless it separates two words.
    text = re.sub(r"\\(\S+) (?=[\w(])", lambda match: plain(match) + " ", text)
    return re.sub(r"\\(\S+) ", plain, text)


def _named_slices(text):
    """Replace slices of signals by their names, if they have one."""
    names: dict[str, str] = {}
    for _, name, value in ASSIGN.findall(text):
        if re.fullmatch(r"\w+\[\d+(:\d+)?\]", value):
            names.setdefault(value, name)

    def named(match):
        head, expression = match[1], match[2]
        target = re.fullmatch(r"  assign (\w+) = ", head)
        return head + re.sub(
            r"\b[A-Za-z_]\w*\[\d+(?::\d+)?\]",
            lambda part: part[0] if target and target[1] == names.get(part[0]) else names.get(part[0], part[0]),
            expression)

    # Only where values are read: on the right side of an assignment, and in conditions.
    return re.sub(r"^( *(?:.*? <?= |(?:else )?if (?=\()|casez (?=\()))(.*)$", named, text, flags=re.MULTILINE)


def _without_aliases(text):
    """Keep one of two names for the same value: that of a port, else the more informative one."""
    ports = set(PORT.findall(text))
    while True:
        wires = {name: line for line, name in WIRE.findall(text)}
        for line, target, value in ASSIGN.findall(text):
            if not re.fullmatch(r"[A-Za-z_]\w*", value) or target not in wires or target in ports:
                continue
            goes, stays = target, value
            if value not in ports and _telling(target) > _telling(value):
                goes, stays = value, target
            text = text.replace(line, "", 1).replace(wires[target], "", 1)
            text = _renamed(text, goes, stays)
            break
        else:
            return text


def _renamed(text, old, new):
    """Text with another name for a signal; literals, and ports of submodules, may have the same letters."""
    return re.sub(rf"{LITERAL}|(?<!\.)\b{old}\b", lambda part: part[0] if part[0].startswith("'") else new, text)


def _telling(name):
    """How informative a name is; least if the backend invented or numbered it."""
    return (not re.fullmatch(r"n\d+|_\d+_", name), not re.search(r"_\d+$|__", name), len(name))


def _without_unread(text):
    """Remove unused wires."""
    while True:
        uses = Counter(re.findall(r"[A-Za-z_]\w*", re.sub(LITERAL, "", text)))
        assigned = {name: line for line, name, _ in ASSIGN.findall(text)}
        declared = {name: line for line, name in WIRE.findall(text)}
        unread = [name for name in declared if uses[name] == 1 + (name in assigned)]
        if not unread:
            return text
        lines = {declared[name] for name in unread} | {assigned[name] for name in unread if name in assigned}
        text = "".join(line for line in text.splitlines(keepends=True) if line not in lines)
