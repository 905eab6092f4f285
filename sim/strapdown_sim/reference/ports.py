"""The textbook model under the port names of the modules, so that it can stand beside a circuit."""

import numpy as np

from . import attitude

__all__ = ["reference_outputs"]


def reference_outputs(module, inputs, *, kp, ki, period_s, mag_axes):
    """What a module's outputs are in float64, after the thesis's equations.

    Parameters
    ----------
    module : str
        INS_acc, INS_mag, INS_gyro, INS_quat, INS_matx, INS_euler or INS_atan.
    inputs : dict
        Input port to numbers of any one shape.
    kp, ki, period_s, mag_axes : as of ComplementaryFilter

    Returns
    -------
    dict
        Output port to float64 numbers of that shape.
    """
    def vector(*ports):
        return np.stack([np.asarray(inputs[port], dtype=float) for port in ports], axis=-1)

    def matrix():
        return vector(*(f"in_c{row}{column}" for row in "123" for column in "123")).reshape(
            *np.shape(inputs["in_c11"]), 3, 3)

    def named(ports, values):
        return dict(zip(ports, np.moveaxis(values, -1, 0), strict=True))

    if module == "INS_acc":
        c_n2b = np.zeros((*np.shape(inputs["in_c13"]), 3, 3))
        c_n2b[..., 2] = vector("in_c13", "in_c23", "in_c33")
        error = attitude.acc_error(vector("in_accx", "in_accy", "in_accz"), c_n2b)
        return named(("out_exa", "out_eya", "out_eza"), error)
    if module == "INS_mag":
        m_b = vector("in_magx", "in_magy", "in_magz") @ attitude.axis_matrix(mag_axes).T
        return named(("out_exm", "out_eym", "out_ezm"), attitude.mag_error(m_b, matrix()))
    if module == "INS_gyro":
        omega, integral = attitude.gyro_correction(
            vector("in_gyrox", "in_gyroy", "in_gyroz"), vector("in_exa", "in_eya", "in_eza"),
            vector("in_exm", "in_eym", "in_ezm"), vector("in_exi", "in_eyi", "in_ezi"),
            kp=kp, ki=ki, period_s=period_s)
        return named(("out_exi", "out_eyi", "out_ezi"), integral) | named(("out_wx", "out_wy", "out_wz"), omega)
    if module == "INS_quat":
        q = attitude.quaternion_step(vector("in_q0", "in_q1", "in_q2", "in_q3"), vector("in_wx", "in_wy", "in_wz"),
                                     period_s)
        return named(("out_q0", "out_q1", "out_q2", "out_q3"), q)
    if module == "INS_matx":
        c_n2b = attitude.matrix_from_quaternion(vector("in_q0", "in_q1", "in_q2", "in_q3"))
        return {f"out_c{row + 1}{column + 1}": c_n2b[..., row, column] for row in range(3) for column in range(3)}
    if module == "INS_euler":
        c_n2b = np.zeros((*np.shape(inputs["in_c11"]), 3, 3))
        for row, column in ((1, 1), (1, 2), (1, 3), (2, 3), (3, 3)):
            c_n2b[..., row - 1, column - 1] = inputs[f"in_c{row}{column}"]
        return dict(zip(("out_pitch", "out_roll", "out_yaw"), attitude.euler_angles(c_n2b), strict=True))
    if module == "INS_atan":
        return {"out_result": np.arctan2(np.asarray(inputs["in_b"], float), np.asarray(inputs["in_a"], float))}
    raise ValueError(f"module must be one of the INS_ modules without state, not {module!r}")
