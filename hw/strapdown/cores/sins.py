"""SINS_top: strapdown inertial navigation from body rates and specific force (source 002)."""

import math

from strapdown.algorithms import sins
from strapdown.algorithms.quaternion import polynomial
from strapdown.design import METHODS
from strapdown.kernel.system import System, leaves

__all__ = ["SINS_CORES", "sins_top"]

EARTHS = {"source": sins.SOURCE_EARTH, "wgs84": sins.WGS84}
ORDER = 3
"""Order of the attitude's polynomials: at 50 Hz and 400 deg/s they turn by 1e-14 rad too far in an update."""

MEANINGS = {
    "omega": "angular rate against inertial space, body axes (right, forward, up), rad/s, mean over the sample period",
    "f": "specific force, body axes (right, forward, up), m/s^2, mean over the sample period",
    "altitude": "altitude that damps the vertical channel, m",
    "load": "1.0: take the start values with this sample; 0.0: go on",
    "align": "with the load 1.0: begin an alignment at rest; 0.0: the attitude is the start quaternion",
    "place": "start position: sine and cosine of latitude and of longitude",
    "start_v": "start velocity east, north, up, m/s; zero for an alignment",
    "start_h": "start height, m",
    "start_q": "start attitude: quaternion body to east-north-up, scalar first, any length",
    "attitude": "pitch (nose up), roll (right side down), true heading (clockwise from north, [0, 360)), degrees",
    "velocity": "velocity east, north, up, m/s",
    "position": "latitude and longitude, degrees",
    "height": "height above the ellipsoid, m",
    "wander": "wander angle, degrees, anticlockwise from east-north to the platform",
}
"""Meaning, unit and frame of the ports, by the kernel's names."""

KERNELS = (sins.earth_and_transport_rate, polynomial, sins.attitude_quaternion, sins.matrix_of_quaternion,
           sins.velocity_half_change, sins.vertical_loop, sins.position_matrix, sins.start_position,
           sins.alignment_quaternion, sins.navigation_angles, sins.north_east_velocity)


def _vector(pattern, names="xyz"):
    return tuple(pattern.format(name) for name in names)


def _matrix(pattern):
    return tuple(tuple(pattern.format(f"{row}{column}") for column in "123") for row in "123")


def sins_top(config):
    """System of SINS_top for a SinsConfig.

    Raises: ValueError if the largest rate turns too far in one sample period.
    """
    largest = math.radians(config.rate_max_deg_s)
    coefficients = METHODS["minimax"](ORDER, largest * config.period_s)

    def equations(xp, **arguments):
        return sins.sins_update(
            xp, **arguments, earth=EARTHS[config.earth], period=config.period_s, samples=config.alignment_samples,
            damping=config.damping_s, a0=coefficients.a0, d0=coefficients.d0, rate_max=largest,
            force_max=config.force_max_m_s2)

    inputs = {"omega": _vector("in_w{}"), "f": _vector("in_f{}"), "load": "in_load", "align": "in_align",
              "place": ("in_sin_lat", "in_cos_lat", "in_sin_lon", "in_cos_lon"),
              "start_v": _vector("in_v{}", ("east", "north", "up")), "start_h": "in_height",
              "start_q": _vector("in_q{}", "0123")}
    state = {"q": _vector("q{}", "0123"), "t": _matrix("t{}"), "c": _matrix("c{}"), "v": _vector("v{}"),
             "half": _vector("half_{}"), "h": "h", "before": _vector("before_{}"), "force": _vector("force_{}"),
             "left": "left"}
    if config.damping_s:
        inputs["altitude"], state["bias"] = "in_altitude", "bias"
    kernels = tuple(kernel for kernel in KERNELS if config.damping_s or kernel is not sins.vertical_loop)
    return System(
        "SINS_top", "attitude, velocity and position from body rates and specific force", equations,
        kernels=kernels, meanings=MEANINGS,
        sections=("MODE", "ALIGN", "RATES", "ATTITUDE", "VELOCITY", "POSITION", "OUTPUT"),
        start="in_data_en", finish="out_SINS_finish",
        inputs=inputs,
        outputs={"attitude": _vector("out_{}", ("pitch", "roll", "heading")),
                 "velocity": _vector("out_v{}", ("east", "north", "up")),
                 "position": ("out_latitude", "out_longitude"), "height": "out_height", "wander": "out_wander"},
        state=state,
        # At latitude and longitude zero, along east, north and up, waiting for a load.
        reset=dict.fromkeys(leaves(state), 0.0) | dict.fromkeys(("q0", "t11", "t22", "t33", "c12", "c23", "c31"), 1.0),
        status=("aligning", "navigating", "out_of_range"), status_port="out_status")


SINS_CORES = {"SINS_top": sins_top}
"""Module name to the function that makes its System for a SinsConfig."""
