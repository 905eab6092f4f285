"""Single faults in operators and engines that tests must detect: the place, the fragment, and the effect."""

from dataclasses import dataclass

__all__ = ["MUTANTS", "Mutant"]


@dataclass(frozen=True)
class Mutant:
    """One fault.

    Attributes
    ----------
    file : str
        Source file, below hw/strapdown.
    fragment, replacement : str
        Text that occurs exactly once in the file, and its replacement.
    breaks : str
        The effect of the fault.
    tests : str
        The test file that must fail, below tests/; empty for the one of the same name.
    select : str
        An expression for ``pytest -k`` that selects a few quick tests that are sufficient; empty for all.
    """

    file: str
    fragment: str
    replacement: str
    breaks: str
    tests: str = ""
    select: str = ""

    @property
    def test_file(self):
        """The test file, below tests/."""
        folder, _, name = self.file.partition("/")
        return self.tests or f"{folder}/test_{name}"


def _of(file, *rows, **options):
    return [Mutant(file, *row, **options) for row in rows]


MUTANTS = (
    *_of("fp/add.py",
         ("b_sign = self.b.sign ^ self.subtract", "b_sign = self.b.sign", "subtraction adds"),
         ("cancels = a.is_infinite & b.is_infinite & opposite", "cancels = a.is_infinite & b.is_infinite",
          "∞ + ∞ becomes NaN"),
         ("sign=Mux(swap, s.b_sign, s.a_sign)", "sign=s.a_sign", "sign of the smaller operand"),
         ("near = Mux(swap, Cat(C(0, 2), s.a_significand)", "near = Mux(swap, Cat(C(0, 1), s.a_significand, C(0, 1))",
          "alignment of a is off by one"),
         ("sticky = (s.sticky | lost)", "sticky = s.sticky", "sticky bit of the far shift is lost"),
         ("lacks_unit = s.opposite & ~s.total[-1]", "lacks_unit = s.opposite", "sign of differences"),
         ("moves.eq(~value[-step:].any() & (room | here))", "moves.eq(~value[-step:].any())",
          "sums are normalised below the least exponent"),
         ('"sign": Mux(is_zero, s.zero_sign, s.sign)', '"sign": s.sign', "sign of an exact zero"),
         ("is_infinite=s.is_infinite | (s.overflow & away)", "is_infinite=s.is_infinite", "overflow")),
    *_of("fp/multiply.py",
         ('"sign": a.sign ^ b.sign', '"sign": a.sign | b.sign', "(−a)(−b) is negative"),
         ("undefined = (a.is_infinite & b.is_zero) |", "undefined =", "∞ · 0 is no NaN"),
         ("swap, levels = ~b.significand[-1]", "swap, levels = ~a.significand[-1]",
          "a subnormal operand is not normalised"),
         (" | (carry & s.product[-fmt.precision - 2])", "", "sticky bit of products from 2 on"),
         ("below.eq(1 - exponent - carry)", "below.eq(1 - exponent)", "subnormal products"),
         ("s.multiplier[low:low + SLICE]", "s.multiplier[low:low + SLICE - 1]", "a bit of each slice is lost")),
    *_of("fp/stages.py",
         ("number.exponent.eq(operand.exponent | (tiny & fmt.gradual))", "number.exponent.eq(operand.exponent)",
          "subnormal operands count half"),
         ("lost = value[:distance + 1].any()", "lost = value[1:distance + 1].any()", "sticky bit is lost in a shift"),
         ("number.is_zero.eq(tiny & empty if fmt.gradual else tiny)", "number.is_zero.eq(tiny & empty)",
          "subnormal operands are not flushed"),
         ("overflow = (number.exponent >= fmt.exponent_special)", "overflow = (number.exponent > fmt.exponent_special)",
          "results just beyond the range become NaN"),
         ("exponent, extended = Mux(tiny, 0, exponent)", "exponent, extended = exponent", "subnormal results"),
         tests="fp/test_resize.py"),
    *_of("fp/rounding.py",
         ("return guard & (sticky | odd)", "return guard & (sticky | ~odd)", "ties go to odd"),
         ("return (guard | sticky) & ~sign", "return guard & ~sign", "rounding up ignores the sticky bit"),
         tests="fp/test_exhaustive_8bit.py"),
    *_of("fp/pipeline.py",
         ("valid.eq(self.valid)", "valid.eq(self.valid | valid)", "done stays high"), tests="fp/test_min_max.py"),
    *_of("fp/compare.py",
         ("a.is_zero & b.is_zero, unordered", "C(0), unordered", "+0 and −0 differ"),
         ("Mux(s.a_sign, ~(s.less | s.equal), s.less)", "s.less", "negative numbers are in reverse order"),
         ("less=less & ~s.both_zero & ordered", "less=less & ~s.both_zero", "a NaN is less than a number"),
         ('"<=": lambda less, equal, unordered: less | equal', '"<=": lambda less, equal, unordered: less',
          "<= is <")),
    *_of("fp/min_max.py",
         ("choose_a=less ^ self.maximum", "choose_a=less", "the maximum is the minimum"),
         ("is_nan=a.is_nan | b.is_nan", "is_nan=a.is_nan", "a NaN in b is lost"),
         ("magnitude_is_less ^ a.sign, a.sign)", "magnitude_is_less, a.sign)", "order of negative numbers"),
         ("is_zero=Mux(s.choose_a, s.a_is_zero, s.b_is_zero)", "is_zero=C(0)", "subnormals are not flushed")),
    *_of("fp/select.py",
         ("Mux(self.condition, self.a, self.b)", "Mux(self.condition, self.b, self.a)", "the wrong one is chosen")),
    *_of("fp/resize.py",
         ("offset = fmt.bias - source.bias", "offset = fmt.bias - source.bias + 1", "results are doubled"),
         ("Cat(padded[:-fmt.precision - 1].any(), ", "Cat((padded[:-fmt.precision - 1] >> fmt.precision + 1).any(), ",
          "the lowest bit does not count as sticky"),
         ("least -= source.fraction_width", "least -= 1", "the range of exponents is too small for subnormals")),
    *_of("fp/convert.py",
         ("else a.sign & ~a.is_nan", "else a.sign", "a negative NaN becomes the least number"),
         ("sticky = s.aligned[:-self._width - 1].any()", "sticky = s.aligned[1:-self._width - 1].any()",
          "the lowest bit does not count as sticky"),
         ("s.saturates | (magnitude.all() & ~s.sign)", "s.saturates", "rounding up out of the range wraps round"),
         ("((up ^ s.sign) & ~stays)", "(up & ~stays)", "negative numbers are off by one"),
         ("Mux(self.operand < 0, -self.operand, self.operand)", "self.operand", "negative integers"),
         ("is_zero=~normalised[-1]", "is_zero=C(0)", "the integer 0 becomes a number")),
    *_of("fp/divide_square_root.py",
         ("scale = Mux(square_root, ~o.a_exponent[0], less)", "scale = Mux(square_root, o.a_exponent[0], less)",
          "roots of odd exponents"),
         ("taken_off.eq(o.b_exponent)", "taken_off.eq(o.b_exponent + 1)", "quotients are halved"),
         ("total = Cat(~negative, s.remainder)", "total = Cat(C(0, 1), s.remainder)",
          "subtractions lack their carry"),
         ("Mux(negative, s.place << 1, latest)", "latest", "a wrong root bit is not corrected"),
         ("(a.is_zero & b.is_zero)),", "C(0)),", "0 / 0 is no NaN"),
         ("s.quotient[-self._bits_per_cycle:].any()", "s.quotient[-self._bits_per_cycle - 1:].any()",
          "iterations end early"),
         ("accept.eq(self.start & (~busy | finishing))", "accept.eq(self.start)", "a start disturbs an operation")),
    *_of("fp/reciprocal_square_root.py",
         ("Mux(o.a_exponent[0], o.a_significand, o.a_significand << 1)", "o.a_significand", "roots of even exponents"),
         ("change = Mux(bit ^ negative,", "change = Mux(bit,", "the next trial"),
         ("trial.eq(x + (x << 2))", "trial.eq(x << 2)", "the first trial"),
         ("is_infinite=a.is_zero, is_zero", "is_infinite=C(0), is_zero", "the root of 0 is finite")),
    *_of("cordic/atan2.py",
         ("Mux(b.sign, 3, 1)", "Mux(b.sign, 1, 3)", "both infinite: the wrong quadrant"),
         ("subtract=swap ^ s.x_sign", "subtract=swap", "negative abscissae"),
         ("with m.Elif(b.is_zero | a.is_infinite):", "with m.Elif(b.is_zero):", "infinite ordinate"),
         ("s.y_sign & (s.kind != _NAN)", "s.y_sign", "NaN has a sign"),
         ("Mux(stop[1], 1, Mux(stop[2], 2, 3))", "Mux(stop[1], 1, 2)", "results with three leading zeros"),
         select="circuit and binary16"),
    *_of("cordic/sincos.py",
         ("digit & ~negative, addend", "digit, addend", "reduction of negative angles"),
         ("s.operand[-1] ^ negative ^ (turned & ~swap)", "negative ^ (turned & ~swap)", "the sine is even"),
         ("with m.Elif(s.tiny):", "with m.Elif(s.tiny & ~s.operand[-1]):", "tiny negative angles"),
         ("Mux(swap, sine, cosine), swap ^ negative", "Mux(swap, sine, cosine), negative", "sign of the cosine"),
         select="circuit and binary16"),
    *_of("cordic/fixed_atan2.py",
         ("Cat(signs[:divided], C(0, 1)) ^ s.x_negative.replicate(divided + 1)", "Cat(signs[:divided], C(0, 1))",
          "negative abscissae"),
         ("with m.If(~s.is_zero):", "with m.If(1):", "the angle of (0, 0)"),
         ("next_h.eq(h << step * times)", "next_h.eq(h)", "short vectors"),
         ("is_zero=~x[-2:].any()", "is_zero=~x[-1]", "vectors of length 1 count as zero"),
         ("(Cat(x, C(0, 1)) ^ negative)", "Cat(x, C(0, 1))", "every step turns the same way"),
         tests="cores/test_operators.py", select="one_operation_a_cycle and default"),
    *_of("kernel/engine.py",
         ("Mux(running, cycle + 1, taken)", "Mux(running, cycle + 1, Mux(taken, 1, cycle))",
          "the counter is not set while the engine is idle"),
         ("Mux(running, left - 1, program.length - 1)", "left - 1", "the remaining cycles are not set"),
         ("complete.eq(running & last & due)", "complete.eq(running & due)", "an END in another cycle is not refused"),
         ("Mux(due, END, Mux(last, IDLE + 1, state + word.advance))", "state + word.advance",
          "an update may never end"),
         ("taken.eq(idle & primed & start)", "taken.eq(start)", "a start disturbs an update"),
         tests="lab/proof/test_formal.py", select="QUAT_direct"),
    *_of("kernel/stream.py",
         ("check.eq(Mux(beginning, 0, check + 1))", "check.eq(slot)", "the counters are not compared"),
         ("beginning.eq(following == 0)", "beginning.eq(cycle == length - 1)", "an interval may never begin"),
         ("m.d.sync += stages.valid[-1].eq(0)", "pass", "an update finishes twice"),
         ("taken.eq(start & self.in_ready)", "taken.eq(start & beginning)", "two updates of a channel are in flight"),
         ("Mux(cycle == length - 1, 0, cycle + goes)", "Mux(cycle == length - 1, 0, cycle + 1)",
          "an engine without updates does not wait for a sample"),
         tests="lab/proof/test_formal.py", select="QUAT_direct"),
    *_of("blocks/spot.py",
         ("inside.eq(opened & ~first)", "inside.eq(opened)", "a run goes on into the next line"),
         ("(last | (below_now == self._gap)", "((below_now == self._gap)", "a run does not end with the line"),
         ("Mux(counts, 0, below + 1)", "Mux(begins, 0, below + 1)", "pixels below count together, not in a row"),
         ("| (length_now == self._width_max)))", "))", "a run is not cut"),
         ("is_valid & (run_sum > self.sum)", "is_valid & (run_sum >= self.sum)", "the last of equal runs wins"),
         ("end - ~quotient[FRACTION:]", "end + 1 - ~quotient[FRACTION:]", "positions are one pixel late"),
         ("Cat(C(1, 1), dividend[:integer - 1]", "Cat(C(0, 1), dividend[:integer - 1]",
          "positions are not rounded down"),
         ("self.edge.eq(starts_line | ends_line)", "self.edge.eq(ends_line)", "the first pixel is no edge"),
         ("fresh.eq((pixels.valid & pixels.p.first) | first_q)", "fresh.eq(first_q)",
          "the finish of a line comes during the next one"),
         ("starts.eq(first | place.all())", "starts.eq(place.all())", "the first block goes on from the line before"),
         ("counts & full", "full", "saturated pixels below the threshold count")),
    *_of("blocks/thresholds.py",
         ("larger.eq(self.lo + (self.lo >> 1))", "larger.eq(self.lo + (self.lo >> 2))", "hi is too low"),
         tests="blocks/test_capture.py"),
    *_of("blocks/exposure.py",
         ("self.peak < TOO_LOW):", "self.peak <= TOO_LOW):", "a peak at the limit"),
         ("Mux(changed > self._most, self._most, changed)", "changed", "exposures beyond the range"),
         tests="blocks/test_capture.py"),
    *_of("blocks/adc.py",
         ("wait.eq(self._lead - 1)", "wait.eq(self._lead)", "SCLK comes late"),
         ("~word if self._invert else word", "word", "video that falls with light"),
         ("self.sample | (running & (place", "self.sample | ((place", "the clock runs before the first sample"),
         tests="blocks/test_capture.py"),
    *_of("blocks/buffer.py",
         ("index.eq(Mux(pixels.p.first, 0, place))", "index.eq(place)", "a line that was given up shifts the next one"),
         ("self.line_ready.eq(ends)]", "self.line_ready.eq(1)]", "a line can be read before it has come out"),
         tests="blocks/test_capture.py"),
    *_of("blocks/timing.py",
         ("(ahead <= asked[ccd]) | latest", "(ahead <= asked[ccd])", "exposures below the range"),
         ("armed & places &", "armed &", "exposures that begin anywhere in a pixel"),
         ("remaining == taken[0] >> 1", "remaining == taken[0]", "the strobe is at the begin of the exposure"),
         ("with m.If(~goes & ~exposes):", "with m.If(~goes):", "the last exposed line is not read"),
         ("[slot.eq(0), reads.eq(exposes),", "[slot.eq(0), reads.eq(1),", "the first line is read"),
         ("pending.eq(self.run)", "pending.eq(0)", "an external trigger is lost")),
    *_of("algorithms/optical.py",
         ("return w + (c3 * w) * (w * w)", "return w", "the cover glass is left out"),
         ("return scale(1.5 - 0.5 * dot(m, m), m)", "return m", "the rotor axis grows"),
         ("near * y - turn * x)", "near * y + turn * x)", "a turn of the heading shears the rotor axis"),
         ("change < -bound, -bound, change)", "change < -bound, bound, change)", "the limit of the erection"),
         ("return xp.select(number < 0.0, n0, number - base)", "return number - base",
          "a spot that was never seen has an angle")),
    *_of("cores/inertial_sums.py",
         ("number.eq(begins)", "number.eq(0)", "a sample together with a take does not count"),
         ("(self.take | waiting) & idle)", "self.take & idle)", "a take while a sample is added is lost"),
         ("ends & ~Mux(self.take, self.counts, kept)", "ends & ~kept", "sums that do not count")),
    *_of("cores/optical_modules.py",
         ("chosen.eq(skipped == 0)", "chosen.eq(1)", "a frame for every update"),
         ("sender.frames.ready | ~chosen)", "sender.frames.ready)", "an update without a frame counts as overrun"),
         select="frames"),
    *_of("link/sender.py",
         ("with m.If(index == self.loading - 1)", "with m.If(index == self.loading - 2)",
          "the last word is that of the frame before"),
         tests="cores/test_optical_modules.py", select="frames"),
    *_of("cores/optical_top.py",
         ("shown = Mux(finish, Cat(now, line), held)", "shown = Cat(now, line)", "status and line number come early"),
         ("with m.If(line_ends & good[index])", "with m.If(line_ends)",
          "the position of a line without a spot is used"),
         tests="cores/test_optical_modules.py", select="change_together"),
)
"""Every fault, by source file."""
