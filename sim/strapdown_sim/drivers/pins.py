"""Modules with models of line sensors and ADCs at their pins, in Verilator: light goes in at the sensors."""

import os
import struct
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from amaranth.lib.wiring import In

from strapdown.kernel.description import Port

from ..instrument.pins import ADCS, SENSORS
from .toolchain import run_tool
from .verilated import Interface, VerilatedModel

__all__ = ["Line", "PinDriver", "PinRun", "Violation", "bench_text"]

SIDES = "r", "p"
"""Roll and pitch, as in port names."""

FAULTS = {"lost_clock": 1, "stuck": 2, "stuck_word": 12}
"""Inputs of the bench that put faults between the pins, and their bits. ``lost_clock``: the sensor clock stays low.
``stuck``: the data pins of the ADC of roll (bit 0) or pitch (bit 1) are ``stuck_word``, or its lowest bit; so are the
words that it seems to sample."""

PICO = 10**12
"""Picoseconds in a second."""

TIMESCALE = "`timescale 1ps / 1ps\n"


@dataclass(frozen=True)
class Violation:
    """Rules of a data sheet that were broken.

    Attributes
    ----------
    cycle : int
        Clock cycle.
    model : str
        Sensor or ADC, with its side.
    rules : tuple of str
        All rules that this model has found broken until then.
    count : int
        Violations in this cycle.
    """

    cycle: int
    model: str
    rules: tuple[str, ...]
    count: int


@dataclass
class Line:
    """A line of one sensor.

    Attributes
    ----------
    ccd, number : int
        Sensor: 0 for roll, 1 for pitch; number of the line, the first is 0.
    cycle : int
        Clock cycle in which it was moved into the register.
    opened_ps, closed_ps : int
        Start and end of the exposure, in picoseconds since the run began. The start is zero if nothing marked it.
    image : ndarray of uint16, shape (pixels,)
        The light, in counts.
    """

    ccd: int
    number: int
    cycle: int
    opened_ps: int
    closed_ps: int
    image: np.ndarray = field(default_factory=lambda: np.zeros(0, np.uint16))

    @property
    def exposure_s(self):
        """Length of the exposure in seconds."""
        return (self.closed_ps - self.opened_ps) / PICO

    @property
    def middle_s(self):
        """Middle of the exposure, in seconds since the run began."""
        return (self.closed_ps + self.opened_ps) / (2 * PICO)


@dataclass
class PinRun:
    """What happened in a run.

    Attributes
    ----------
    lines : tuple of list of Line
        Lines of the roll and of the pitch sensor.
    events : dict
        Each output to its values at the events, shape (N,) of uint64; and ``cycle``.
    words, slots : ndarray of uint16, shape (2, N, pixels)
        Last words that the ADCs of roll and pitch have sampled before each event, with the slots of the sensors at that
        time.
    line_of_event : ndarray of int, shape (2, N)
        Number of the last Line of each sensor before the first of these samples; -1 if there was none.
    bytes : bytes
        What the serial line has sent.
    middles : ndarray of int
        Cycles in which the strobe ``out_middle`` rose.
    violations : list of Violation
    """

    lines: tuple[list[Line], list[Line]]
    events: dict[str, np.ndarray]
    words: np.ndarray
    slots: np.ndarray
    line_of_event: np.ndarray
    bytes: bytes
    middles: np.ndarray
    violations: list[Violation]


def _stacked(rows, pixels):
    """Rows of both sensors as one array; zeros before those that are short."""
    return np.array([[np.pad(row, (pixels - len(row), 0)) for row in own] for own in rows],
                    dtype=np.uint16).reshape(2, -1, pixels)


@dataclass(frozen=True)
class PinInterface(Interface):
    """Ports of a bench.

    Parameters
    ----------
    sensor : PinModel
        Model of the line sensors.
    pixels : int
        Pixels of a line.
    event : str or None
        Output whose high level, or whose rise if ``event_rises``, is an event.
    middle, uart : str or None
        Outputs: strobe in the middle of an exposure; serial line, with ``divisor`` cycles a bit.
    period_ps : int
        Clock period.
    """

    sensor: str = ""
    pixels: int = 0
    event: str | None = None
    event_rises: bool = True
    middle: str | None = None
    uart: str | None = None
    divisor: int = 0
    period_ps: int = 10_000

    def access(self):
        return f'public_flat_rd -module "{self.sensor}" -var "image"\n'

    def header(self):
        lines = [f"#define IMAGE_{side.upper()} {self.top}__DOT__ccd_{side}__DOT__image" for side in SIDES]
        lines += [f"#define PIXELS {self.pixels}", f"#define PERIOD_PS {self.period_ps}",
                  f"#define EVENT_RISES {int(self.event_rises)}"]
        lines += [f"#define {macro} {port}" for macro, port in (
            ("EVENT_PORT", self.event), ("MIDDLE_PORT", self.middle), ("UART_PORT", self.uart)) if port]
        if self.uart:
            lines.append(f"#define UART_DIVISOR {self.divisor}")
        return super().header() + "\n".join(lines) + "\n"


def bench_text(name: str, modules: dict[str, Sequence[Port]], sensor: str, adc: str, *, lines: int = 1,
               adc_latency: int = 1) -> tuple[str, list[str], list[str]]:
    """Verilog of a bench: modules, two sensors and two ADCs.

    Pins of sensors and ADCs connect to the models. An input ``in_x`` of one module connects to the output ``out_x`` of
    another. All other ports are ports of the bench.

    Parameters
    ----------
    name : str
        Name of the bench.
    modules : dict
        Maps modules to their ports.
    sensor, adc : str
        Names in SENSORS and ADCS.
    lines : int
        Lines in the memory of a sensor.
    adc_latency : int
        Of a parallel ADC.

    Returns
    -------
    text : str
        Text of the bench, without the modules.
    inputs, outputs : list of str
        Its ports, without the clock.
    """
    ports = {port.name: port for own in modules.values() for port in own}
    made = {port.name for port in ports.values() if port.member.flow != In}
    inside = {port: f"out_{port[3:]}" for port in ports if port.startswith("in_") and f"out_{port[3:]}" in made}
    pins = {port: ports[port] for port in ports if port.startswith(("ccd_", "adc_"))}
    inputs = {port: spec.width for port, spec in ports.items()
              if spec.member.flow == In and port not in {*inside, *pins, "clk"}}
    inputs |= FAULTS
    outputs = {port: spec.width for port, spec in ports.items() if port in made and port not in pins}
    watched = {"transfers": 32, "opened": 64, "closed": 64, "slot": 16, "ccd_violated": 16, "ccd_violations": 32,
               "word": 12, "samples": 32, "adc_violated": 16, "adc_violations": 32}

    def declared(kind, width, port):
        return f"{kind} {f'[{width - 1}:0] ' if width > 1 else ''}{port}"

    listed = ["input clk", *(declared("input", width, port) for port, width in inputs.items()),
              *(declared("output", width, port) for port, width in outputs.items()),
              *(declared("output", width, f"{port}_{side}") for side in SIDES for port, width in watched.items())]
    text = [TIMESCALE, f"module {name} (\n  ", ",\n  ".join(listed), "\n);\n"]
    text += [f"  {declared('wire', spec.width, port)};\n" for port, spec in pins.items()]
    text += [f"  wire [11:0] level_{side};\n  wire changed_{side};\n" for side in SIDES]
    for module, own in modules.items():
        wires = ", ".join(f".{port.name}({inside.get(port.name, port.name)})" for port in own)
        text.append(f"  {module} {module} ({wires});\n")
    text.append("  wire lit_clock = ccd_clk & ~lost_clock;\n")
    model, converter = SENSORS[sensor], ADCS[adc]
    for bit, side in enumerate(SIDES):
        clocks = ({"phi_m": "lit_clock", "sh": f"ccd_sh_{side}", "icg": "ccd_icg"} if "ccd_icg" in pins else
                  {"clk": "lit_clock", "st": f"ccd_st_{side}"})
        text.append(model.instance(f"ccd_{side}", clocks | {
            "level": f"level_{side}", "changed": f"changed_{side}", "slot": f"slot_{side}",
            "transfers": f"transfers_{side}", "opened": f"opened_{side}", "closed": f"closed_{side}",
            "violated": f"ccd_violated_{side}", "violations": f"ccd_violations_{side}"}, LINES=lines))
        data, bits, stuck = ("sdata", 1, "{12{stuck_word[0]}}") if adc == "spi" else ("data", 12, "stuck_word")
        text.append(f"  wire [{bits - 1}:0] sent_{side};\n  wire [11:0] sample_{side};\n"
                    f"  assign adc_{data}_{side} = stuck[{bit}] ? stuck_word[{bits - 1}:0] : sent_{side};\n"
                    f"  assign word_{side} = stuck[{bit}] ? {stuck} : sample_{side};\n")
        serial = {"cs_n": "adc_cs_n", "sclk": "adc_sclk"} if adc == "spi" else {"clk": "adc_clk"}
        text.append(converter.instance(f"adc_{side}", serial | {
            "observe": "clk", "level": f"level_{side}", "changed": f"changed_{side}",
            "quiet": f"ccd_sh_{side}" if "ccd_icg" in pins else "1'b0", data: f"sent_{side}",
            "word": f"sample_{side}", "samples": f"samples_{side}", "violated": f"adc_violated_{side}",
            "violations": f"adc_violations_{side}"},
            SETTLE_MIN=model.settle_ns, GUARD_MIN=model.guard_ns,
            **({} if adc == "spi" else {"LATENCY": adc_latency})))
    return "".join([*text, "endmodule\n"]), list(inputs), list(outputs)


HEAD = struct.Struct("<IIQQ")
TRANSFER, SAMPLES, EVENT, BYTE, VIOLATION, MIDDLE = range(6)
"""Kinds of records, as in pins.cpp."""


ICARUS = """
module test;
  reg clk;
  integer cycle, status, file, index;
  reg [63:0] at, value;
  {declarations}
  bench bench (.clk(clk), {ports});
  task set;
    case (index)
      {cases}
    endcase
  endtask
  initial begin
    clk = 0;
    {initial}
    $readmemh("image_r", bench.ccd_r.image);
    $readmemh("image_p", bench.ccd_p.image);
    file = $fopen("actions", "r");
    status = $fscanf(file, "%d %d %h", at, index, value);
    for (cycle = 0; cycle < {cycles}; cycle = cycle + 1) begin
      while (status == 3 && at == cycle) begin
        set;
        status = $fscanf(file, "%d %d %h", at, index, value);
      end
      clk = 0;
      #{half} clk = 1;
      #{half};
    end
    $finish;
  end
  always @(posedge {event}) if (cycle > 0) $strobe("{form}", cycle, {values});
endmodule
"""
"""A bench that does the same as pins.cpp with light that does not depend on the exposure."""


class PinDriver(VerilatedModel):
    """Modules with sensors and ADCs, Verilated.

    Parameters
    ----------
    verilog : str
        Text of the modules.
    modules : dict
        Maps each module to its ports.
    build : Path
        Folder for compiled models.
    sensor, adc : str
        Names in SENSORS and ADCS.
    adc_latency : int
        Of a parallel ADC.
    pixels : int
        Pixels of a line.
    **fields
        Further fields of PinInterface.

    Raises: as VerilatedModel.
    """

    DRIVER = files(__package__) / "pins.cpp"

    def __init__(self, verilog: str, modules: dict[str, Sequence[Port]], build: str | os.PathLike, *, sensor: str,
                 adc: str, adc_latency: int, pixels: int, **fields: Any) -> None:
        self.sensor, self.adc = SENSORS[sensor], ADCS[adc]
        self._verilog, self._modules = verilog, modules
        self._options: dict[str, Any] = {"sensor": sensor, "adc": adc, "adc_latency": adc_latency}
        bench, inputs, outputs = bench_text("bench", modules, **self._options)
        interface = PinInterface("bench", tuple(inputs), tuple(outputs), sensor=self.sensor.module, pixels=pixels,
                                 reset="", **fields)
        with TemporaryDirectory() as folder:
            path = Path(folder) / "bench.v"
            path.write_text(bench + self.sensor.text + self.adc.text + verilog, encoding="utf-8")
            super().__init__(path, interface, build)

    def run(self, actions: Sequence[tuple[int, str, int]], image: Callable[[Line], np.ndarray], *,
            cycles: int, delay: int = 0, progress: Callable[[int], object] | None = None) -> PinRun:
        """A run from power-up.

        Parameters
        ----------
        actions : sequence of (int, str, int)
            Clock cycle, input, and the value that it has from this cycle on. Inputs are zero at first.
        image : callable
            Gives the pixels of a Line, integers of 12 bits, when it is moved into the register.
        cycles : int
            Clock cycles after which the run ends.
        delay : int
            Cycles from the last sample of a line to the event.
        progress : callable or None
            Called with the clock cycle at each line.

        Returns: PinRun.
        """
        interface = self.interface
        assert isinstance(interface, PinInterface)
        rows = self._rows(actions)
        lines: tuple[list[Line], list[Line]] = ([], [])
        found: list[np.ndarray] = []
        cycles_of: dict[int, list[int]] = {EVENT: [], MIDDLE: []}
        received = bytearray()
        violations: list[Violation] = []
        words: tuple[list[np.ndarray], list[np.ndarray]] = ([], [])
        slots: tuple[list[np.ndarray], list[np.ndarray]] = ([], [])
        line_of: tuple[list[int], list[int]] = ([], [])
        waiting = [np.zeros(0, np.uint64)] * 2
        with subprocess.Popen([self._executable], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
            assert process.stdin is not None
            assert process.stdout is not None
            try:
                process.stdin.write(b"".join((len(rows).to_bytes(8, "little"), rows.tobytes(),
                                              cycles.to_bytes(8, "little"))))
                process.stdin.flush()
                while head := process.stdout.read(HEAD.size):
                    kind, number, cycle, count = HEAD.unpack(head)
                    row = np.frombuffer(process.stdout.read(8 * count), dtype="<u8")
                    if kind == TRANSFER:
                        total, opened, closed = row.tolist()
                        line = Line(number, total - 1, cycle, opened, closed)
                        line.image = np.ascontiguousarray(image(line), dtype="<u2")
                        lines[number].append(line)
                        process.stdin.write(line.image.tobytes())
                        process.stdin.flush()
                        if progress:
                            progress(cycle)
                    elif kind == SAMPLES:
                        taken = np.concatenate([waiting[number], row])
                        count = int(np.searchsorted(taken >> 28, cycle - delay, side="right"))
                        used, waiting[number] = taken[max(count - interface.pixels, 0):count], taken[count:]
                        words[number].append((used & 0xFFF).astype(np.uint16))
                        slots[number].append((used >> 12 & 0xFFFF).astype(np.uint16))
                        begun = int(used[0]) >> 28 if len(used) else 0
                        line_of[number].append(next((line.number for line in reversed(lines[number])
                                                     if line.cycle < begun), -1))
                    elif kind == VIOLATION:
                        violations.append(self._violation(cycle, number, *row.tolist()))
                    elif kind == BYTE:
                        received.append(number >> 1 & 0xFF)
                    else:
                        cycles_of[kind].append(cycle)
                        if kind == EVENT:
                            found.append(row)
            except BaseException:
                process.kill()
                raise
        if process.returncode:
            raise RuntimeError(f"the bench ended early, status {process.returncode}")
        values = np.array(found, dtype=np.uint64).reshape(-1, len(interface.outputs))
        answer = {name: values[:, column] for column, name in enumerate(interface.outputs)}
        return PinRun(lines, {"cycle": np.array(cycles_of[EVENT]), **answer}, _stacked(words, interface.pixels),
                      _stacked(slots, interface.pixels), np.array(line_of), bytes(received),
                      np.array(cycles_of[MIDDLE]), violations)

    def _rows(self, actions: Sequence[tuple[int, str, int]]) -> np.ndarray:
        """Actions as rows of cycle, number of the input, and value, in order."""
        numbers = {port: index for index, port in enumerate(self.interface.inputs)}
        return np.array(sorted((cycle, numbers[port], value) for cycle, port, value in actions),
                        dtype="<u8").reshape(-1, 3)

    def _violation(self, cycle: int, number: int, rules: int, count: int) -> Violation:
        model, side = (self.sensor, self.adc)[number // 2], ("roll", "pitch")[number % 2]
        return Violation(cycle, f"{model.module} {side}",
                         tuple(rule for place, rule in enumerate(model.rules, 1) if rules >> place & 1), count)

    def events_in_icarus(self, actions: Sequence[tuple[int, str, int]], run: PinRun, folder: Path, *,
                         cycles: int) -> dict[str, np.ndarray]:
        """The events of a run in Icarus Verilog with the actions and the light of ``run``; as in ``PinRun.events``.

        ``folder`` takes the files of the simulation. The event must be the rise of an output. Raises: ToolError if
        Icarus fails.
        """
        interface = self.interface
        assert isinstance(interface, PinInterface)
        depth = max(len(lines) for lines in run.lines)
        bench, inputs, outputs = bench_text("bench", self._modules, lines=depth, **self._options)
        width = {port.name: port.width for own in self._modules.values() for port in own} | FAULTS
        text = ICARUS.format(
            declarations="\n  ".join(f"{kind} [{width[name] - 1}:0] {name};" for kind, names in (
                ("reg", inputs), ("wire", outputs)) for name in names),
            ports=", ".join(f".{name}({name})" for name in (*inputs, *outputs)),
            cases="\n      ".join(f"{index}: {name} = value;" for index, name in enumerate(inputs)),
            initial="\n    ".join(f"{name} = 0;" for name in inputs), cycles=cycles, half=interface.period_ps // 2,
            event=interface.event, form=" ".join(["event %0d", *("%h" for _ in outputs)]), values=", ".join(outputs))
        for side, lines in zip(SIDES, run.lines, strict=True):
            (folder / f"image_{side}").write_text("\n".join(
                f"{count:x}" for line in lines for count in line.image.tolist()), encoding="utf-8")
        (folder / "actions").write_text("".join(
            f"{cycle} {number} {value:x}\n" for cycle, number, value in self._rows(actions).tolist()), encoding="utf-8")
        (folder / "bench.v").write_text(TIMESCALE + text + bench + self.sensor.text + self.adc.text + self._verilog,
                                        encoding="utf-8")
        run_tool(["iverilog", "-g2001", "-s", "test", "-o", folder / "bench.vvp", folder / "bench.v"])
        rows = [line.split()[1:] for line in run_tool(["vvp", "-n", "bench.vvp"], directory=folder).splitlines()
                if line.startswith("event")]
        cycles_of = np.array([int(cycle) for cycle, *_ in rows])
        return {"cycle": cycles_of} | {
            name: np.array([int(row[column], 16) for row in rows], dtype=np.uint64)
            for column, name in enumerate(outputs, 1)}
