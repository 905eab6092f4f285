"""The models of sensors and ADCs at their pins, in Icarus Verilog: what they show, and which timing they refuse."""

import re

import pytest

from strapdown_sim.drivers.toolchain import icarus_missing, run_tool
from strapdown_sim.instrument.pins import ADCS, SENSORS

pytestmark = pytest.mark.icarus

BENCH = """
`timescale 1ps / 1ps
module bench;
  reg [63:0] at;
  reg [{last}:0] pins, next;
  reg [8*200:1] name;
  integer file, status;
  wire [11:0] out, held;
  wire [63:0] opened, closed;
  wire [31:0] count, violations;
  wire [15:0] violated;
{instance}
  {image}
  initial begin
    if (!$value$plusargs("edges=%s", name)) $finish;
    file = $fopen(name, "r");
    status = $fscanf(file, "%d %b", at, next);
    while (status == 2) begin
      #(at - $time) pins = next;
      status = $fscanf(file, "%d %b", at, next);
    end
    $display("violated %b %0d", violated, violations);
    $finish;
  end
  always @({watched}) if ($time) $display("{word} %0d %0d %0d {more}", $time, out, count{values});
endmodule
"""

CASES = {
    # Model, its parameters, its pins, how the bench reads it.
    "tcd1304": ({"PIXELS": 6, "LEAD": 4, "SLOTS": 12}, ("phi_m", "sh", "icg")),
    "s11639": ({"PIXELS": 6, "LINE_MIN": 120}, ("clk", "st")),
    "tsl1402": ({"PIXELS": 6, "LINE_MIN": 7}, ("clk", "st")),
    "spi": ({"GUARD_MIN": 50, "SETTLE_MIN": 100}, ("cs_n", "sclk", "changed", "quiet")),
    "parallel": ({"LATENCY": 3, "GUARD_MIN": 50, "SETTLE_MIN": 100}, ("clk", "changed", "quiet")),
}
IMAGE = (100, 200, 300, 400, 500, 4095)
LEVEL = 0xA5C


@pytest.fixture(scope="module")
def programs(tmp_path_factory):
    if missing := icarus_missing():
        pytest.skip(missing)
    folder = tmp_path_factory.mktemp("pins")
    for name, (parameters, pins) in CASES.items():
        ports = {pin: f"pins[{place}]" for place, pin in enumerate(pins)}
        ports |= {"violated": "violated", "violations": "violations"}
        if name in SENSORS:
            model, image = SENSORS[name], " ".join(f"initial dut.image[{i}] = {v};" for i, v in enumerate(IMAGE))
            ports |= {"level": "out", "transfers": "count", "opened": "opened", "closed": "closed"}
            words = {"watched": "dut.changed", "word": "level", "more": "%0d %0d", "values": ", opened, closed"}
        else:
            model, image = ADCS[name], ""
            words = {"watched": "count", "word": "sample", "more": "", "values": ""}
            ports |= {"observe": "1'b0", "level": f"{LEVEL}", "word": "out", "samples": "count"}
        text = BENCH.format(last=len(pins) - 1, instance=model.instance("dut", ports, **parameters), image=image,
                            **words)
        (folder / f"{name}.v").write_text(text + model.text, encoding="utf-8")
        warnings = run_tool(["iverilog", "-g2001", "-Wall", "-s", "bench", "-o", folder / f"{name}.vvp",
                             folder / f"{name}.v"])
        assert warnings == ""
    return folder


def clock(period, count, *, start=0, high=None, skipped=()):
    """Edges of a clock that begins with a rising edge."""
    return [(start + k * period + (high or period // 2) * (not level), "clock", level)
            for k in range(count) if k not in skipped for level in (1, 0)]


def pulse(pin, start, width, level=1):
    return [(start, pin, level), (start + width, pin, 1 - level)]


def play(programs, name, edges, *, first=0, rename=None):
    """Play edges (ns, pin, level); returns the numbers of the rules broken, and the other lines as numbers."""
    pins = CASES[name][1]
    rename = {"clock": pins[0]} | (rename or {})
    state, rows = first, [f"0 {first:0{len(pins)}b}"]
    moments: dict = {}
    for time, pin, level in edges:
        moments.setdefault(round(1000 * time), []).append((pins.index(rename.get(pin, pin)), level))
    for time, changes in sorted(moments.items()):
        for place, level in changes:
            state = state & ~(1 << place) | level << place
        rows.append(f"{time} {state:0{len(pins)}b}")
    (programs / "edges").write_text("\n".join([*rows, f"{max(moments) + 1000} {state:0{len(pins)}b}"]) + "\n",
                                    encoding="utf-8")
    printed = run_tool(["vvp", "-n", programs / f"{name}.vvp", f"+edges={programs / 'edges'}"])
    violated = re.search(r"violated (\d+)", printed)[1]
    rules = {place for place, digit in enumerate(violated[::-1]) if digit == "1"}
    return rules, [[int(word) for word in line.split()[1:]] for line in printed.splitlines()
                   if re.match("level|sample", line)]


# phiM, SH and ICG.

def sh_icg(*, period=500, exposure=20_000, icg_sh=500, sh=2000, sh_icg=5000, shift=0, second=False, skipped=(),
           early=False):
    """Two lines of the TCD1304 model; ICG rises 50 ns, and ``shift``, after phiM."""
    start = 30_000
    lines = []
    for begin in (start, start + (18_000 if early else 100 * period)):
        rises, falls = begin + icg_sh, begin + icg_sh + sh
        sh_icg += -(falls + sh_icg - 50) % period
        lines += pulse("sh", falls - exposure - 2000, 2000)
        lines += pulse("sh", rises, sh)
        if second:
            lines += pulse("sh", falls + 1100, 1000)
        lines += pulse("icg", begin, falls + sh_icg + shift - begin, level=0)
    return clock(period, 300, skipped=skipped) + lines


ICG_HIGH = 0b100


def test_lines_of_sh_and_icg(programs):
    rules, levels = play(programs, "tcd1304", sh_icg(), first=ICG_HIGH)
    assert rules == set()
    first = levels[:13]
    # ICG rises 50 ns after phiM; slots begin at rising edges, four phiM apart.
    begin = 30_000 + 500 + 2000 + 5050
    assert [row[0] for row in first] == [1000 * (begin if j == 0 else begin - 50 + 2000 * j) for j in range(13)]
    assert [row[1] for row in first] == [*[4095] * 4, *[4095 - v for v in IMAGE], *[4095] * 3]
    assert {tuple(row[2:]) for row in first} == {(1, 12_500_000, 32_500_000)}
    assert [row[2] for row in levels[13:]] == [2] * 13


@pytest.mark.parametrize(("rule", "changes"), [
    (1, {"period": 240, "exposure": 15_000}), (1, {"period": 1300}), (1, {"skipped": (120, 121)}), (2, {"icg_sh": 90}),
    (2, {"icg_sh": 1010}), (3, {"sh": 900}), (4, {"sh": 2080, "sh_icg": 950}), (5, {"shift": 250}),
    (6, {"exposure": 9_900}), (7, {"early": True, "exposure": 10_500}), (8, {"second": True})])
def test_sh_and_icg_out_of_their_limits(programs, rule, changes):
    rules, _ = play(programs, "tcd1304", sh_icg(**changes), first=ICG_HIGH)
    assert rules == {rule}


def test_no_sh_while_icg_is_low(programs):
    rules, levels = play(programs, "tcd1304", clock(500, 60) + pulse("icg", 5000, 3000, level=0), first=ICG_HIGH)
    assert (rules, levels) == ({8}, [])


# CLK and ST.

def st_clk(*, period=200, high=100, wide=4000, low=26_000, lines=2, setup=50, skipped=()):
    """Lines of the S11639 model; ST changes ``setup`` before rising edges."""
    edges = clock(period, 20 + lines * (wide + low) // period, high=high, skipped=skipped)
    for line in range(lines):
        edges += pulse("st", 2000 - setup + line * (wide + low), wide)
    return edges


def test_lines_of_st_that_falls(programs):
    rules, levels = play(programs, "s11639", st_clk())
    assert rules == set()
    fell = 2000 - 50 + 4000
    first = [row for row in levels if row[2] == 1]
    assert len(first) == 88 + 6
    # Slot j begins at the j-th rising edge after ST falls; pixel 1 at the 88th.
    assert [row[0] for row in first] == [1000 * (fell + 50 + 200 * j) for j in range(88 + 6)]
    assert [row[1] for row in first] == [*[0] * 87, *IMAGE, 0]
    assert first[0][3:] == [1_950_000, 1000 * (fell + 48 * 200)]


@pytest.mark.parametrize(("rule", "changes"), [
    (1, {"period": 90, "high": 45}), (1, {"period": 5100, "high": 2000, "wide": 51_000, "low": 663_000}),
    (1, {"skipped": range(60, 90)}), (3, {"wide": 1100}), (4, {"low": 19_800, "wide": 8000}),
    (6, {"low": 20_200, "wide": 3000})])
def test_st_that_falls_out_of_its_limits(programs, rule, changes):
    rules, _ = play(programs, "s11639", st_clk(**changes))
    assert rules == {rule}


def si_clk(*, period=200, high=100, si=((2000, 200), (72_000, 200)), setup=50):
    """Lines of the TSL1402 model; SI changes ``setup`` before rising edges."""
    edges = clock(period, 100_000 // period, high=high)
    for begin, wide in si:
        edges += pulse("st", begin - setup, wide)
    return edges


def test_lines_of_si(programs):
    rules, levels = play(programs, "tsl1402", si_clk())
    assert rules == set()
    first, second = ([row for row in levels if row[2] == line] for line in (1, 2))
    assert [row[:2] for row in first] == [[1000 * (2000 + 200 * j), v] for j, v in enumerate((*IMAGE, 0))]
    # The exposure begins 18 clocks after SI has risen, and ends when it rises again.
    assert second[0][3:] == [1000 * (1950 + 18 * 200), 71_950_000]


@pytest.mark.parametrize(("rule", "changes"), [
    (1, {"period": 120, "high": 60, "si": ((1200, 120), (72_000, 120))}), (2, {"high": 40}), (2, {"high": 160}),
    (5, {"setup": 10}), (5, {"si": ((2100, 40),)}), (6, {"si": ((2000, 200), (23_000, 200))})])
def test_si_out_of_its_limits(programs, rule, changes):
    rules, _ = play(programs, "tsl1402", si_clk(**changes))
    assert rules == {rule}


# ADCs.

IDLE = 0b0011


def conversion(begin, *, lead=20, sclk=60, high=None, clocks=16, tail=30):
    """A conversion of the AD7476A model; CS rises ``tail`` after the last SCLK has fallen."""
    high = sclk // 2 if high is None else high
    edges = [(begin, "cs_n", 0), (begin + lead + sclk * (clocks - 1) + tail, "cs_n", 1)]
    for k in range(clocks):
        falls = begin + lead + k * sclk
        edges += [(falls, "sclk", 0), (falls + sclk - high, "sclk", 1)]
    return edges


def spi(*, gap=1100, video=500, disturbed=500, **changes):
    """Two conversions; the video changes ``video`` before each sample, SH ``disturbed`` before."""
    edges = [(0, "sclk", 1)]
    for number in range(2):
        begin = 2000 + number * gap
        edges += conversion(begin, **changes)
        edges += [(begin - video, "changed", 1 - number), (begin - disturbed, "quiet", 1 - number)]
    return edges


def test_samples_of_the_serial_adc(programs):
    rules, samples = play(programs, "spi", spi(), first=IDLE)
    assert rules == set()
    assert [row[:3] for row in samples] == [[2_000_000, LEVEL, 1], [3_100_000, LEVEL, 2]]


@pytest.mark.parametrize(("rule", "changes"), [
    (1, {"sclk": 48, "high": 24, "gap": 1200}), (2, {"high": 15}), (2, {"high": 45}), (3, {"lead": 5}),
    (4, {"lead": 80, "tail": 56, "gap": 1040}), (5, {"lead": 80, "tail": 20, "gap": 1020}),
    (6, {"gap": 990, "sclk": 52}), (7, {"clocks": 15}),
    (8, {"video": 90}), (9, {"video": -5}), (10, {"disturbed": 40}), (10, {"disturbed": -40})])
def test_the_serial_adc_out_of_its_limits(programs, rule, changes):
    rules, _ = play(programs, "spi", spi(**changes), first=IDLE)
    assert rules == {rule}


def parallel(*, period=200, high=100, video=150, disturbed=150):
    edges = clock(period, 20, start=1000, high=high)
    return [*edges, (3000 - video, "changed", 1), (3000 - disturbed, "quiet", 1)]


def test_samples_of_the_parallel_adc(programs):
    rules, samples = play(programs, "parallel", parallel())
    assert rules == set()
    assert [row[:3] for row in samples] == [[1000 * (1000 + 200 * k), LEVEL, k + 1] for k in range(20)]


@pytest.mark.parametrize(("rule", "changes"), [
    (1, {"period": 90, "high": 45}), (2, {"high": 30}), (2, {"high": 170}), (3, {"video": 90}), (4, {"video": -2}),
    (5, {"disturbed": 40}), (5, {"disturbed": -40})])
def test_the_parallel_adc_out_of_its_limits(programs, rule, changes):
    rules, _ = play(programs, "parallel", parallel(**changes))
    assert rules == {rule}
