"""The attitude cores of the 2015 thesis: which equations stand behind which module and ports."""

from strapdown.algorithms import attitude
from strapdown.algorithms.attitude import Update
from strapdown.algorithms.vector import scale
from strapdown.kernel.system import System

__all__ = ["ATTITUDE_CORES"]


def _vector(pattern, names="xyz"):
    return tuple(pattern.format(name) for name in names)


def _matrix(pattern):
    return tuple(tuple(pattern.format(f"{row}{column}") for column in "123") for row in "123")


MEANINGS = {
    "a": "accelerometer (specific force), body axes, any unit",
    "m": "magnetometer, sensor axes, any unit",
    "g": "gyro, body axes, deg/s",
    "v": "third column of C: the vertical in body axes",
    "c": "C = C_n^b, navigation (north, west, up) to body",
    "q": "quaternion, body to navigation, scalar first",
    "e_a": "error of the vertical, body axes, sine of the angle",
    "e_m": "error against the horizontal field, body axes",
    "i": "integral of the error, body axes, rad/s",
    "omega": "corrected angular rate, body axes, rad/s",
    "angles": "degrees; yaw in [0, 360)",
    "cosine": "cosine, times any length",
    "sine": "sine, times the same length",
    "angle": "atan2(sine, cosine), rad",
}
"""Meaning, unit and frame of the ports, by the kernels' names."""

KERNELS = (attitude.accelerometer_error, attitude.magnetometer_error, attitude.rate_correction,
           attitude.quaternion_update, attitude.matrix_from_quaternion, attitude.euler_angles)


def ins_acc(config):
    """System of INS_acc."""
    def equations(xp, a, v):
        e_a, _ = attitude.accelerometer_error(xp, a, v)
        return Update({"e_a": e_a})

    return System(
        "INS_acc", "error of the vertical, from the accelerometer", equations,
        kernels=(attitude.accelerometer_error,), meanings=MEANINGS,
        sections=("ACC",), start="in_acc_en", finish="out_acc_finish",
        inputs={"a": _vector("in_acc{}"), "v": _vector("in_c{}", ("13", "23", "33"))},
        outputs={"e_a": _vector("out_e{}a")})


def ins_mag(config):
    """System of INS_mag."""
    def equations(xp, m, c):
        e_m, _ = attitude.magnetometer_error(xp, m, c, config.magnetometer_axes)
        return Update({"e_m": e_m})

    return System(
        "INS_mag", "error against the horizontal field, from the magnetometer", equations,
        kernels=(attitude.magnetometer_error,), meanings=MEANINGS,
        sections=("MAG",), start="in_mag_en", finish="out_mag_finish",
        inputs={"m": _vector("in_mag{}"), "c": _matrix("in_c{}")},
        outputs={"e_m": _vector("out_e{}m")})


def ins_gyro(config):
    """System of INS_gyro."""
    def equations(xp, g, e_a, e_m, i):
        gain, integral_share = attitude.correction_gains(config.kp, config.ki, config.period_s)
        omega, i = attitude.rate_correction(
            g, scale(gain, e_a), scale(gain, e_m), i, 1 / attitude.DEGREES, integral_share)
        return Update({"i": i, "omega": omega})

    return System(
        "INS_gyro", "angular rate, corrected by both errors and their integral", equations,
        kernels=(attitude.rate_correction,), meanings=MEANINGS,
        sections=("GYRO",), start="in_gyro_en", finish="out_gyro_finish",
        inputs={"g": _vector("in_gyro{}"), "e_a": _vector("in_e{}a"), "e_m": _vector("in_e{}m"),
                "i": _vector("in_e{}i")},
        outputs={"i": _vector("out_e{}i"), "omega": _vector("out_w{}")})


def ins_quat(config):
    """System of INS_quat."""
    def equations(xp, q, omega):
        return Update({"q": attitude.quaternion_update(xp, q, omega, config.period_s / 2)})

    return System(
        "INS_quat", "quaternion one sample period later", equations,
        kernels=(attitude.quaternion_update,), meanings=MEANINGS,
        sections=("QUAT",), start="in_quat_en", finish="out_quat_finish",
        inputs={"q": _vector("in_q{}", "0123"), "omega": _vector("in_w{}")},
        outputs={"q": _vector("out_q{}", "0123")})


def ins_matx(config):
    """System of INS_matx."""
    def equations(xp, q):
        return Update({"c": attitude.matrix_from_quaternion(xp, q)})

    return System(
        "INS_matx", "matrix from quaternion", equations,
        kernels=(attitude.matrix_from_quaternion,), meanings=MEANINGS,
        sections=("MATX",), start="in_matx_en", finish="out_matx_finish",
        inputs={"q": _vector("in_q{}", "0123")}, outputs={"c": _matrix("out_c{}")})


def ins_euler(config):
    """System of INS_euler."""
    def equations(xp, c):
        c11, c12, c13, c23, c33 = c
        # Held at zero or above: rounding may take c13 past one.
        cosine = xp.sqrt(xp.maximum(1 - c13 * c13, 0.0))
        return Update({"angles": attitude.euler_angles(xp, c11, c12, c13, cosine, c23, c33)})

    return System(
        "INS_euler", "pitch, roll and yaw from the matrix", equations,
        kernels=(attitude.euler_angles,), meanings=MEANINGS,
        sections=("EULER",), start="in_euler_en", finish="out_euler_finish",
        inputs={"c": _vector("in_c{}", ("11", "12", "13", "23", "33"))},
        outputs={"angles": _vector("out_{}", ("pitch", "roll", "yaw"))})


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
    """System of INS_top."""
    def equations(xp, **arguments):
        return attitude.attitude_update(xp, axes=config.magnetometer_axes, period=config.period_s,
                                        kp=config.kp, ki=config.ki, **arguments)

    state = {"q": _vector("q{}", "0123"), "c": _matrix("c{}"), "i": _vector("i{}")}
    reset = dict.fromkeys((*state["q"], *(word for row in state["c"] for word in row), *state["i"]), 0.0)
    return System(
        "INS_top", "attitude from accelerometer, magnetometer and gyro", equations,
        kernels=KERNELS, meanings=MEANINGS,
        sections=("ACC_MAG", "GYRO", "QUAT", "MATX", "EULER"),
        start="in_data_en", finish="out_INS_finish",
        inputs={"a": _vector("in_acc{}"), "m": _vector("in_mag{}"), "g": _vector("in_gyro{}")},
        outputs={"c": _matrix("out_c{}"), "angles": _vector("out_{}", ("pitch", "roll", "yaw"))},
        state=state, reset=reset | dict.fromkeys(("q0", "c11", "c22", "c33"), 1.0),
        status=("accelerometer_missing", "magnetometer_missing"), status_port="out_status")


ATTITUDE_CORES = {"INS_acc": ins_acc, "INS_mag": ins_mag, "INS_gyro": ins_gyro, "INS_quat": ins_quat,
                  "INS_matx": ins_matx, "INS_euler": ins_euler, "INS_atan": ins_atan, "INS_top": ins_top}
"""Module name to the function that makes its System for an AttitudeConfig."""
