"""Errors of the Euler angles near a pitch of ±90°: the rotation between the angles and their matrix."""

from collections.abc import Callable
from functools import partial

import numpy as np

from strapdown.cores import FLIGHT, THESIS, system_of
from strapdown_sim.stimuli.pole import DISTANCES_DEG, angle_error, pole_grid, update_at

__all__ = ["POLE_CORES", "pole_errors"]


def core_error(module, config, q):
    """Errors of a core that has an attitude, at the attitudes q: degrees, shape (N,)."""
    system = system_of(module, config)
    return angle_error(*update_at(q, system, partial(system.update_twin, config.pool)))


def ins_euler_error(q):
    """Errors of INS_euler on the matrices of INS_matx at the attitudes q: degrees, shape (N,)."""
    system, matx = system_of("INS_euler", THESIS), system_of("INS_matx", THESIS)
    c = matx.read(matx.update_twin(THESIS.pool, matx.bind(q=q)))["c"].astype(float)
    elements = np.stack([c[:, 0, 0], c[:, 0, 1], c[:, 0, 2], c[:, 1, 2], c[:, 2, 2]], axis=-1)
    return angle_error(system.read(system.update_twin(THESIS.pool, system.bind(c=elements)))["angles"], c)


POLE_CORES: dict[str, Callable] = {
    "INS_top": partial(core_error, "INS_top", THESIS), "INS_flight": partial(core_error, "INS_flight", FLIGHT),
    "INS_euler": ins_euler_error}
"""Maps each module with Euler angles to the function from attitudes to errors."""


def pole_errors():
    """Rows of (distance from ±90°, largest error of each of POLE_CORES on a grid of roll and yaw), degrees."""
    for distance in DISTANCES_DEG:
        _, q = pole_grid(step_deg=15, distances_deg=[distance])
        yield distance, *(float(errors(q).max()) for errors in POLE_CORES.values())
