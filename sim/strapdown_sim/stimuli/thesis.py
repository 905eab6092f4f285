"""Tables 5-1 to 5-7 of the 2015 thesis: what goes into each module, and the printed "Matlab" results.

Misprints are corrected: table 5-2 has the rows (1,1,1), (2,2,2), (3,3,3) of C, where the text
says all ones.
"""

__all__ = ["TABLES", "TABLE_5_7", "TABLE_5_7_INPUT"]

TABLES: dict[str, tuple[dict[str, float], dict[str, float]]] = {
    "INS_acc": (
        {"in_accx": 1, "in_accy": 2, "in_accz": 3, "in_c13": 3, "in_c23": 2, "in_c33": 1},
        {"out_exa": -1.06904, "out_eya": 2.13809, "out_eza": -1.06904}),
    "INS_mag": (
        {"in_magx": 2, "in_magy": 2, "in_magz": 2, "in_c11": 1, "in_c12": 1, "in_c13": 1, "in_c21": 2, "in_c22": 2,
         "in_c23": 2, "in_c31": 3, "in_c32": 3, "in_c33": 3},
        {"out_exm": -8.04738, "out_eym": -3.21895, "out_ezm": 4.82843}),
    "INS_gyro": (
        {f"in_{name}": value for triple in (("gyrox", "gyroy", "gyroz"), ("exa", "eya", "eza"),
                                            ("exm", "eym", "ezm"), ("exi", "eyi", "ezi"))
         for name, value in zip(triple, (1, 2, 3), strict=True)},
        {"out_exi": 1.0020, "out_eyi": 2.0040, "out_ezi": 3.0060,
         "out_wx": 21.0195, "out_wy": 42.0389, "out_wz": 63.0584}),
    "INS_quat": (
        {"in_q0": 1, "in_q1": 2, "in_q2": 3, "in_q3": 4, "in_wx": 1, "in_wy": 2, "in_wz": 3},
        {"out_q0": 0.178921, "out_q1": 0.365511, "out_q2": 0.547719, "out_q3": 0.731022}),
    "INS_matx": (
        {"in_q0": 1, "in_q1": 2, "in_q2": 3, "in_q3": 4},
        {"out_c11": -49, "out_c12": 20, "out_c13": 10, "out_c21": 4, "out_c22": -39, "out_c23": 28,
         "out_c31": 22, "out_c32": 20, "out_c33": -25}),
    "INS_euler": (
        {"in_c11": 2, "in_c12": -1, "in_c13": -0.5, "in_c23": -2, "in_c33": 1},
        {"out_pitch": 30.0000, "out_roll": -63.4349, "out_yaw": 333.4349}),
}
"""Module to (inputs, printed outputs), by port; tables 5-1 to 5-6."""

TABLE_5_7_INPUT = {f"in_{sensor}{axis}": 1 for sensor in ("acc", "mag", "gyro") for axis in "xyz"}
"""Input of every update of table 5-7."""

TABLE_5_7 = ((-0.5027, 0.2793, 0.5410), (-0.9968, 0.5572, 1.0762), (-1.4821, 0.8338, 1.6058),
             (-1.9589, 1.1092, 2.1299), (-2.4272, 1.3835, 2.6488))
"""Pitch, roll and yaw in degrees after each of five updates from reset, table 5-7."""
