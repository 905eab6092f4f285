"""Figures of public cores and operators, for comparison with ours.

Figures of operators were measured with the flow of ``strapdown_lab.synthesis.xc7``; those of the vendor's operators
were counted in its netlists. Figures of attitude cores are those of their authors.
"""

from dataclasses import dataclass

__all__ = ["CORE_ANCHORS", "OPERATOR_ANCHORS", "CoreAnchor", "OperatorAnchor", "best_known"]


@dataclass(frozen=True)
class OperatorAnchor:
    """A public operator on binary32 numbers, or a public CORDIC operator on 16-bit numbers.

    Attributes
    ----------
    operator : str
        Its operation, by the titles of ``strapdown_lab.operators``.
    design : str
        Name of the project.
    lut, ff, dsp : int
        7-series resources, shift registers among the LUTs.
    latency : int or None
        Cycles; the least number if it depends on the data; None if it is not known.
    pipelined : bool
        True if it takes an operation in every cycle.
    gradual : bool
        True if it keeps subnormal numbers.
    """

    operator: str
    design: str
    lut: int
    ff: int
    dsp: int
    latency: int | None
    pipelined: bool
    gradual: bool


@dataclass(frozen=True)
class CoreAnchor:
    """A public attitude core.

    Attributes
    ----------
    design, algorithm : str
        Name of the project, and its algorithm.
    lut, ff, dsp : int or None
        Its resources; all None for software.
    microseconds : float
        Time of an update at its own clock.
    basis : str
        "routed", "estimate" (of a high-level synthesis, before routing), "quoted" (basis unknown), or "software".
    """

    design: str
    algorithm: str
    lut: int | None
    ff: int | None
    dsp: int | None
    microseconds: float
    basis: str


def _of(design, gradual, rows):
    return tuple(OperatorAnchor(operator, design, lut, ff, dsp, latency, pipelined, gradual)
                 for operator, (lut, ff, dsp), latency, pipelined in rows)


OPERATOR_ANCHORS = (
    *_of("vendor v5.0", False, [
        ("add", (281, 303, 2), 11, True), ("multiply", (117, 82, 3), 6, True), ("divide", (766, 1296, 0), 28, True),
        ("square root", (464, 772, 0), 28, True), ("compare", (62, 9, 0), 2, True),
        ("to fixed, 16 bits", (111, 151, 0), 6, True), ("from fixed, 16 bits", (110, 110, 0), 6, True)]),
    *_of("vendor v4.0", False, [("arctangent, 16 bits", (1045, 1015, 0), None, True)]),
    *_of("dawsonjon/fpu", True, [
        ("add", (429, 285, 0), 13, False), ("multiply", (271, 269, 2), 14, False),
        ("divide", (439, 386, 0), 114, False), ("to fixed, 32 bits", (126, 145, 0), 4, False),
        ("from fixed, 32 bits", (160, 181, 0), 4, False)]),
    *_of("verilog-math", True, [
        ("add", (666, 313, 0), 7, True), ("multiply", (843, 358, 4), 9, True), ("divide", (2065, 1809, 0), 36, True),
        ("compare", (618, 306, 0), 7, True), ("to fixed, 32 bits", (179, 98, 0), 2, True),
        ("from fixed, 32 bits", (262, 198, 0), 5, True)]),
    *_of("HardFloat", True, [
        ("add", (874, 100, 0), 2, True), ("multiply", (669, 100, 2), 2, True), ("divide", (772, 133, 0), 26, False),
        ("square root", (639, 110, 0), 26, False), ("compare", (347, 70, 0), 2, True),
        ("to fixed, 32 bits", (363, 67, 0), 2, True), ("from fixed, 32 bits", (242, 65, 0), 2, True)]),
    *_of("cvfpu", True, [
        ("add", (1222, 355, 2), 4, True), ("multiply", (745, 352, 2), 4, True), ("divide", (1371, 213, 0), 17, False),
        ("square root", (1234, 206, 0), 17, False), ("compare", (64, 71, 0), 2, True),
        ("to fixed, 32 bits", (479, 133, 0), 3, True), ("from fixed, 32 bits", (461, 123, 0), 3, True)]),
    *_of("FloPoCo", False, [("add", (416, 282, 0), 9, True), ("multiply", (78, 37, 2), 1, True)]),
    *_of("amaranth-fp", False, [
        ("add", (437, 464, 0), 7, True), ("multiply", (58, 193, 2), 5, True), ("divide", (1330, 311, 0), 6, True),
        ("square root", (1547, 213, 0), 5, True), ("compare", (42, 72, 0), 1, True)]),
    *_of("ZipCPU", False, [
        ("arctangent, 16 bits", (1561, 876, 0), 15, True), ("arctangent, 16 bits", (1896, 1129, 0), 18, True),
        ("arctangent, 16 bits", (403, 166, 0), 16, False)]),
    *_of("freecores", False, [("arctangent, 16 bits", (1620, 993, 0), 20, True)]),
)
"""cvfpu's adder and multiplier are its fused multiply-add. FloPoCo's numbers have 34 bits, the extra two for
zero, infinity and NaN. ZipCPU's and freecores' arctangents also give the length of the vector."""

CORE_ANCHORS = (
    CoreAnchor("the 2015 thesis", "complementary, 9 axes, binary32; matrix and Euler angles", 15111, 20172, 40, 40.0,
               "quoted"),
    CoreAnchor("madgwick-zybo-hls", "Madgwick, 9 axes, binary32; quaternion", 977, 1452, 5, 29.4, "routed"),
    CoreAnchor("open_hardware_AHRS", "Madgwick, 9 axes, binary32", 16499, 10001, 64, 2.76, "estimate"),
    CoreAnchor("Madgwick_Quaternion_Filter_Unit", "Madgwick, 6 axes, Q2.14; quaternion", 1349, 488, 75, 1.36, "routed"),
    CoreAnchor("Betaflight on an STM32H7", "Mahony", None, None, None, 3.0, "software"),
    CoreAnchor("VQF on a 280 MHz H7", "VQF", None, None, None, 21.0, "software"),
)


def best_known(operator, *, latency, interval, gradual):
    """The public operator with the fewest LUTs that could replace one of ours, or None.

    It computes the same, is at least as fast in latency, takes an operation in every cycle if ours does, and
    keeps subnormals if ours does.
    """
    return min((anchor for anchor in OPERATOR_ANCHORS
                if anchor.operator == operator and anchor.latency is not None and anchor.latency <= latency
                and (anchor.pipelined or interval > 1) and (anchor.gradual or not gradual)),
               key=lambda anchor: anchor.lut, default=None)
