# amaranth: UnusedElaboratable=no
# A core tells its latency and its ports without being elaborated.
"""SINS_top: strapdown inertial navigation from body rates and specific force (source 002)."""

import math
from typing import Literal

import pydantic
from pydantic import BaseModel, ConfigDict, Field

from strapdown.algorithms import sins
from strapdown.algorithms.quaternion import polynomial
from strapdown.design import METHODS
from strapdown.fp import BINARY64, Subnormals
from strapdown.kernel.pool import Pool
from strapdown.kernel.system import System, leaves

from .core import Core

__all__ = ["SINS", "SINS_CONFIGS", "SINS_DAMPED", "SinsConfig", "sins_core", "sins_top"]

EARTHS = {"source": sins.SOURCE_EARTH, "wgs84": sins.WGS84}
ORDER = 3
"""Order of the attitude's polynomials: at 50 Hz and 400 deg/s they turn by 1e-14 rad too far in an update."""


class SinsConfig(BaseModel):
    """Parameters of SINS_top."""

    model_config = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)

    name: str = Field(pattern="^[a-z][a-z0-9_]*$", description="name of the configuration, and of its output folder")
    description: str = Field(description="one line for people")
    sample_rate_hz: float = Field(gt=0, le=1000, allow_inf_nan=False, description="samples per second, 1/T")
    earth: Literal["source", "wgs84"] = Field(default="source", description="constants of the earth")
    alignment_samples: int = Field(default=3000, ge=2, le=1_000_000,
                                   description="samples that a coarse alignment averages")
    damping_s: float = Field(default=0, ge=0, le=1e5, allow_inf_nan=False,
                             description="time constant of the vertical loop, s; 0: free, without altitude input")
    rate_max_deg_s: float = Field(default=400, gt=0, allow_inf_nan=False,
                                  description="largest rate, for which coefficients are designed; beyond: out of range")
    force_max_m_s2: float = Field(default=160, gt=0, allow_inf_nan=False,
                                  description="largest specific force; beyond: out of range")
    pool: pydantic.InstanceOf[Pool] = Field(default=Pool(format=BINARY64.with_subnormals(Subnormals.FLUSH)),
                                            description="operators of the engine")

    @property
    def period_s(self):
        """Sample period T in seconds."""
        return 1 / self.sample_rate_hz


SINS = SinsConfig(name="sins", description="50 Hz, free vertical channel", sample_rate_hz=50)
SINS_DAMPED = SinsConfig(name="sins_damped", description="50 Hz, vertical channel damped by an altitude, 100 s",
                         sample_rate_hz=50, damping_s=100)
SINS_CONFIGS = {config.name: config for config in (SINS, SINS_DAMPED)}

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


def sins_core(config):
    """SINS_top for a SinsConfig: a Core, ready to be elaborated."""
    return Core(sins_top(config), config.pool)
