"""The complementary attitude filter of the 2015 thesis: INS_acc to INS_top, and INS_top_x8 to INS_top_x64."""

from typing import ClassVar

from pydantic import Field

from strapdown.algorithms import attitude
from strapdown.algorithms.attitude import Update
from strapdown.algorithms.vector import root, scale
from strapdown.config import Axes, TunableConfig
from strapdown.kernel.operators import (
    Adder,
    Arctangent,
    Extremes,
    Multiplier,
    Selector,
    TableArctangent,
    TableReciprocal,
)
from strapdown.kernel.pool import MemoryStyle, Pool
from strapdown.kernel.system import System, matrix, vector

__all__ = ["ATTITUDE_CORES", "AttitudeConfig", "MAHONY", "THESIS", "THESIS_COMPACT", "THESIS_FAST", "THESIS_FAST_X16",
           "THESIS_X64", "THESIS_X8"]


class AttitudeConfig(TunableConfig):
    """Parameters of the complementary attitude filter (INS_acc … INS_top)."""

    kp: float = Field(ge=0, le=1e6, allow_inf_nan=False,
                      description="proportional gain Kp, rad/s per unit error")
    ki: float = Field(ge=0, le=1e6, allow_inf_nan=False,
                      description="integral gain Ki, rad/s² per unit error")
    magnetometer_axes: Axes = Field(description="sensor axes of the magnetometer that lie along body x, y and z")

    frame: ClassVar[str] = "NWU"
    tunable: ClassVar = ("kp", "ki")

    @property
    def gains(self) -> dict[str, float]:
        """Kp and Ki, by the kernels' names."""
        return {"kp": self.kp, "ki": self.ki}

    @property
    def gain_ports(self) -> dict[str, str]:
        """Maps the gains that are inputs to their ports."""
        return {name: f"in_{name}" for name in self.inputs}

    def systems(self):
        """The modules of the thesis, INS_top last."""
        return ATTITUDE_CORES


MEANINGS = {
    "a": "accelerometer (specific force), body axes, any unit",
    "m": "magnetometer, sensor axes, any unit",
    "g": "gyro, body axes, deg/s",
    "v": "third column of C: the vertical in body axes",
    "c": "C = C_n^b, navigation (north, west, up) to body",
    "q": "quaternion, body to navigation, scalar first",
    "s": "q0 - q2, q0 + q2, q1 + q3, q1 - q3 of the quaternion, times any factor",
    "e_a": "error of the vertical, body axes, sine of the angle",
    "e_m": "error against the horizontal field, body axes",
    "i": "integral of the error, body axes, rad/s",
    "omega": "corrected angular rate, body axes, rad/s",
    "angles": "degrees; yaw in [0, 360)",
    "cosine": "cosine, times any positive factor",
    "sine": "sine, times the same factor",
    "angle": "atan2(sine, cosine), rad",
}
"""Meaning, unit and frame of the ports, by the kernels' names."""

LIMIT = {"angles": "degrees; yaw in [0, 360), its error about 1e-5 degrees/cos(pitch): lost at a pitch of 90 degrees"}
"""Meaning of the angles of INS_euler. It does not get the elements of C that keep the yaw near a pitch of ±90°."""

KERNELS = (attitude.attitude_update, attitude.corrections, attitude.turn, attitude.pair_products,
           attitude.pair_angles, attitude.euler_angles)


def ins_acc(config):
    """System of INS_acc."""
    def equations(xp, a, v):
        return Update({"e_a": attitude.accelerometer_error(xp, a, v)})

    return System(
        "INS_acc", "error of the vertical, from the accelerometer", equations,
        kernels=(attitude.accelerometer_error,), meanings=MEANINGS,
        sections=("ACC",), start="in_acc_en", finish="out_acc_finish",
        inputs={"a": vector("in_acc{}"), "v": vector("in_c{}", ("13", "23", "33"))},
        outputs={"e_a": vector("out_e{}a")})


def ins_mag(config):
    """System of INS_mag."""
    def equations(xp, m, c):
        return Update({"e_m": attitude.magnetometer_error(xp, m, c, config.magnetometer_axes)})

    return System(
        "INS_mag", "error against the horizontal field, from the magnetometer", equations,
        kernels=(attitude.magnetometer_error,), meanings=MEANINGS,
        sections=("MAG",), start="in_mag_en", finish="out_mag_finish",
        inputs={"m": vector("in_mag{}"), "c": matrix("in_c{}")},
        outputs={"e_m": vector("out_e{}m")})


def ins_gyro(config):
    """System of INS_gyro."""
    def equations(xp, g, e_a, e_m, i, **gains):
        gain, integral_share = attitude.correction_gains(xp, **config.gains | gains, period=config.period_s)
        omega, i = attitude.rate_correction(
            g, scale(gain, e_m), scale(gain, e_a), i, 1 / attitude.DEGREES, integral_share)
        return Update({"i": i, "omega": omega})

    return System(
        "INS_gyro", "angular rate, corrected by both errors and their integral", equations,
        kernels=(attitude.rate_correction,), meanings=MEANINGS | config.input_meanings,
        sections=("GYRO",), start="in_gyro_en", finish="out_gyro_finish",
        inputs={"g": vector("in_gyro{}"), "e_a": vector("in_e{}a"), "e_m": vector("in_e{}m"),
                "i": vector("in_e{}i"), **config.gain_ports},
        outputs={"i": vector("out_e{}i"), "omega": vector("out_w{}")})


def ins_quat(config):
    """System of INS_quat."""
    def equations(xp, q, omega):
        return Update({"q": attitude.quaternion_update(xp, q, omega, config.period_s / 2)})

    return System(
        "INS_quat", "quaternion one sample period later", equations,
        kernels=(attitude.quaternion_update,), meanings=MEANINGS,
        sections=("QUAT",), start="in_quat_en", finish="out_quat_finish",
        inputs={"q": vector("in_q{}", "0123"), "omega": vector("in_w{}")},
        outputs={"q": vector("out_q{}", "0123")})


def ins_matx(config):
    """System of INS_matx."""
    def equations(xp, q):
        return Update({"c": attitude.matrix_from_quaternion(xp, q)})

    return System(
        "INS_matx", "matrix from quaternion", equations,
        kernels=(attitude.matrix_from_quaternion,), meanings=MEANINGS,
        sections=("MATX",), start="in_matx_en", finish="out_matx_finish",
        inputs={"q": vector("in_q{}", "0123")}, outputs={"c": matrix("out_c{}")})


def ins_euler(config):
    """System of INS_euler."""
    def equations(xp, c):
        c11, c12, c13, c23, c33 = c
        # Limited to zero or above: rounding may make c13 greater than one.
        cosine = root(xp, xp.maximum(1 - c13 * c13, 0.0))
        return Update({"angles": attitude.euler_angles(xp, c11, c12, c13, cosine, c23, c33)})

    return System(
        "INS_euler", "pitch, roll and yaw from the matrix", equations,
        kernels=(attitude.euler_angles,), meanings=MEANINGS | LIMIT,
        sections=("EULER",), start="in_euler_en", finish="out_euler_finish",
        inputs={"c": vector("in_c{}", ("11", "12", "13", "23", "33"))},
        outputs={"angles": vector("out_{}", ("pitch", "roll", "yaw"))})


def ins_atan(config):
    """System of INS_atan."""
    def equations(xp, cosine, sine):
        return Update({"angle": xp.atan2(sine, cosine)})

    return System(
        "INS_atan", "angle of a sine and a cosine", equations,
        kernels=(), meanings=MEANINGS,
        sections=("ATAN",), start="in_atan_en", finish="out_atan_finish",
        inputs={"cosine": "in_a", "sine": "in_b"}, outputs={"angle": "out_result"})


def ins_top(config):
    """System of INS_top: for several channels, the form of the update with the fewest operations."""
    fewest = config.channels > 1

    def equations(xp, **arguments):
        return attitude.attitude_update(xp, axes=config.magnetometer_axes, period=config.period_s, fewest=fewest,
                                        **config.gains | arguments)

    rows = matrix("c{}")
    if fewest:
        rows = tuple((row[0], row[-1]) for row in rows)
    return System(
        "INS_top", "attitude from accelerometer, magnetometer and gyro", equations,
        kernels=KERNELS if fewest else (*KERNELS, attitude.turn_rounded_once),
        meanings=MEANINGS | config.input_meanings,
        sections=("ACC_MAG", "GYRO", "QUAT", "MATX", "EULER"),
        start="in_data_en", finish="out_INS_finish",
        inputs={"a": vector("in_acc{}"), "m": vector("in_mag{}"), "g": vector("in_gyro{}"), **config.gain_ports},
        outputs={"c": matrix("out_c{}"), "angles": vector("out_{}", ("pitch", "roll", "yaw"))},
        state={"s": vector("s{}", ("a", "b", "d1", "d2")), "c": rows, "i": vector("i{}")},
        reset=dict.fromkeys(("sa", "sb", "c11", *(() if fewest else ("c22",)), "c33"), 1.0),
        status=("accelerometer_missing", "magnetometer_missing", "tilt_reversed", "heading_reversed"),
        status_port="out_status",
        status_order=("accelerometer_missing", "magnetometer_missing", "refused", "ignored", "restarted",
                      "tilt_reversed", "heading_reversed"))


ATTITUDE_CORES = {"INS_acc": ins_acc, "INS_mag": ins_mag, "INS_gyro": ins_gyro, "INS_quat": ins_quat,
                  "INS_matx": ins_matx, "INS_euler": ins_euler, "INS_atan": ins_atan, "INS_top": ins_top}
"""Maps each module name to the function that makes its System for an AttitudeConfig."""


TABLES = TableReciprocal(), TableArctangent(), Selector()

THESIS = AttitudeConfig(
    name="thesis",
    description="the 2015 thesis: 500 Hz, Kp 10, Ki·T 0.001, magnetometer turned by 90 degrees",
    sample_rate_hz=500, kp=10, ki=0.5, magnetometer_axes=("+y", "-x", "+z"),
    # Only INS_atan, whose angle is in radians, has the other arctangent.
    pool=Pool(operators=(Adder(latency=3, two_paths=True), Multiplier(latency=3), *TABLES, Arctangent()),
              side_memory=True))

THESIS_COMPACT = THESIS.replace(
    name="thesis_compact", description="the same, small: one operation after another, atan2 without an operator",
    pool=Pool(operators=(Adder(), Multiplier(), TableReciprocal(), Selector()),
              forwarding=False, private_ports=False, operand_memory=MemoryStyle.BLOCK, side_memory=False,
              horizontal=True))

THESIS_FAST = THESIS.replace(
    name="thesis_fast", description="the same, fast: two adders and two multipliers",
    pool=Pool(operators=(Adder(count=2, latency=3, two_paths=True), Multiplier(count=2), Extremes(), *TABLES,
                         Arctangent()), side_memory=True))

MAHONY = THESIS.replace(
    name="mahony",
    description="the same filter with Kp 0.5, Ki 0, all sensors along the body axes, any sample rate",
    kp=0.5, ki=0, magnetometer_axes=("+x", "+y", "+z"))

STREAM = Pool(operators=(Adder(latency=5), Multiplier(count=2, latency=4), TableReciprocal(latency=7),
                         TableArctangent(), Selector()),
              forwarding=False, operand_memory=MemoryStyle.BLOCK, side_memory=MemoryStyle.BLOCK, side_buses=2)
"""Operators for several channels: the clock rate matters here, not the latency of an operation."""

THESIS_X8 = THESIS.replace(
    name="thesis_x8", description="eight IMUs on one core, each with the filter of the 2015 thesis",
    channels=8, interval=67, pool=STREAM)

THESIS_X64 = THESIS_X8.replace(name="thesis_x64", description="the same for 64 IMUs", channels=64)

THESIS_FAST_X16 = THESIS_X8.replace(
    name="thesis_fast_x16", description="the same for 16 IMUs, fast: two adders and two multipliers",
    channels=16, interval=45, adders=2, adder_latency=6, table_reciprocal_latency=6, side_buses=3,
    read_ranks=2)
