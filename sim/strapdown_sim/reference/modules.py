"""The textbook models of the thesis's modules without state, by the names of their inputs and outputs."""

from collections.abc import Callable

import numpy as np

from . import attitude

__all__ = ["reference_outputs"]


def reference_outputs(module, inputs, *, kp, ki, period_s, mag_axes):
    """Outputs of a module in float64, from the thesis's equations.

    Parameters
    ----------
    module : str
        INS_acc, INS_mag, INS_gyro, INS_quat, INS_matx, INS_euler or INS_atan.
    inputs : dict
        Maps each name to numbers of shape (...) or, for vectors and matrices, (..., 3), (..., 4) and (..., 3, 3):
        ``a``, ``m``, ``g``, ``v`` (third column of C), ``c`` (C_n^b; INS_euler: its elements 11, 12, 13, 23, 33),
        ``q``, ``e_a``, ``e_m``, ``i``, ``omega``, ``cosine``, ``sine``, in the units of ``docs/notation.md``.
    kp, ki, period_s, mag_axes : as in ComplementaryFilter

    Returns
    -------
    dict
        Maps names to float64 numbers: ``e_a``, ``e_m``, ``i``, ``omega``, ``q``, ``c``, ``angles`` (pitch, roll, yaw,
        degrees) and ``angle`` (rad). Raises: ValueError for another module.
    """
    given = {name: np.asarray(values, dtype=float) for name, values in inputs.items()}

    def acc(a, v):
        c_n2b = np.zeros((*v.shape, 3))
        c_n2b[..., 2] = v
        return {"e_a": attitude.acc_error(a, c_n2b)}

    def mag(m, c):
        return {"e_m": attitude.mag_error(m @ attitude.axis_matrix(mag_axes).T, c)}

    def gyro(g, e_a, e_m, i):
        omega, integral = attitude.gyro_correction(g, e_a, e_m, i, kp=kp, ki=ki, period_s=period_s)
        return {"i": integral, "omega": omega}

    def quat(q, omega):
        return {"q": attitude.quaternion_step(q, omega, period_s)}

    def matx(q):
        return {"c": attitude.matrix_from_quaternion(q)}

    def euler(c):
        # Section 5.2.6 and table 5-6, whose figures are those of the four-quadrant arctangent.
        c11, c12, c13, c23, c33 = np.moveaxis(c, -1, 0)
        pitch, roll, yaw = (np.degrees(np.arctan2(y, x)) for y, x in (
            (-c13, np.sqrt(np.maximum(1 - c13 * c13, 0))), (c23, c33), (c12, c11)))
        return {"angles": np.stack([pitch, roll, attitude.full_turn(yaw)], axis=-1)}

    def atan(cosine, sine):
        return {"angle": np.arctan2(sine, cosine)}

    models: dict[str, Callable] = {
        "INS_acc": acc, "INS_mag": mag, "INS_gyro": gyro, "INS_quat": quat, "INS_matx": matx, "INS_euler": euler,
        "INS_atan": atan}
    if module not in models:
        raise ValueError(f"module must be one of {', '.join(models)}, not {module!r}")
    return models[module](**given)
