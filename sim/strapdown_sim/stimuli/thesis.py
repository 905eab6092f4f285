"""Tables 5-1 to 5-7 of the 2015 thesis: the inputs of each module, and the printed "Matlab" results.

Misprints are corrected: table 5-2 has the rows (1,1,1), (2,2,2), (3,3,3) of C, although the text
says that all elements are one.
"""

__all__ = ["TABLES", "TABLE_5_7", "TABLE_5_7_INPUT"]

TABLES: dict[str, tuple[dict, dict]] = {
    "INS_acc": (
        {"a": (1, 2, 3), "v": (3, 2, 1)},
        {"e_a": (-1.06904, 2.13809, -1.06904)}),
    "INS_mag": (
        {"m": (2, 2, 2), "c": ((1, 1, 1), (2, 2, 2), (3, 3, 3))},
        {"e_m": (-8.04738, -3.21895, 4.82843)}),
    "INS_gyro": (
        {"g": (1, 2, 3), "e_a": (1, 2, 3), "e_m": (1, 2, 3), "i": (1, 2, 3)},
        {"i": (1.0020, 2.0040, 3.0060), "omega": (21.0195, 42.0389, 63.0584)}),
    "INS_quat": (
        {"q": (1, 2, 3, 4), "omega": (1, 2, 3)},
        {"q": (0.178921, 0.365511, 0.547719, 0.731022)}),
    "INS_matx": (
        {"q": (1, 2, 3, 4)},
        {"c": ((-49, 20, 10), (4, -39, 28), (22, 20, -25))}),
    "INS_euler": (
        {"c": (2, -1, -0.5, -2, 1)},
        {"angles": (30.0000, -63.4349, 333.4349)}),
}
"""Maps each module to (inputs, printed outputs), by the kernel's names; tables 5-1 to 5-6."""

TABLE_5_7_INPUT = {"a": (1, 1, 1), "m": (1, 1, 1), "g": (1, 1, 1)}
"""Input of every update of table 5-7."""

TABLE_5_7 = ((-0.5027, 0.2793, 0.5410), (-0.9968, 0.5572, 1.0762), (-1.4821, 0.8338, 1.6058),
             (-1.9589, 1.1092, 2.1299), (-2.4272, 1.3835, 2.6488))
"""Pitch, roll and yaw in degrees after each of five updates from reset, table 5-7."""
