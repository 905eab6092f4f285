"""SINS_top: strapdown inertial navigation from body rates and specific force (source 002)."""

import math
from typing import Literal

import pydantic
from pydantic import Field

from strapdown.algorithms import sine, sins
from strapdown.algorithms.vector import polynomial
from strapdown.config import Config
from strapdown.design import METHODS
from strapdown.fp import BINARY64, Subnormals
from strapdown.kernel.operators import Adder, Arctangent, Divider, Multiplier, Selector
from strapdown.kernel.pool import MemoryStyle, Pool
from strapdown.kernel.system import System, matrix, vector

__all__ = ["SINS", "SINS_DAMPED", "SinsConfig", "sins_top"]

EARTHS = {"source": sins.SOURCE_EARTH, "wgs84": sins.WGS84}
ORDER = 3
"""Order of the attitude's polynomials: at 50 Hz and 400 deg/s their error is 1e-14 rad per update."""

DOUBLE_POOL = Pool(format=BINARY64.with_subnormals(Subnormals.FLUSH),
                   operators=(Adder(latency=7), Multiplier(latency=4), Divider(bits_per_cycle=2), Arctangent(),
                              Selector()),
                   operand_memory=MemoryStyle.BLOCK)
"""Operators in binary64, with ranks for the clock frequency of the cores in binary32. The operands are in block RAM,
because there are too many for LUTs."""


class SinsConfig(Config):
    """Parameters of SINS_top."""

    sample_rate_hz: float = Field(gt=0, le=1000, allow_inf_nan=False, description="samples per second, 1/T")
    earth: Literal["source", "wgs84"] = Field(default="source", description="constants of the earth")
    alignment_samples: int = Field(default=3000, ge=2, le=1_000_000,
                                   description="number of samples that a coarse alignment averages")
    damping_s: float = Field(default=0, ge=0, le=1e5, allow_inf_nan=False,
                             description="time constant of the vertical loop, s; 0: free, without altitude input")
    rate_max_deg_s: float = Field(
        default=400, gt=0, allow_inf_nan=False,
        description="largest rate; the coefficients are designed for it, and a larger one is out of range")
    force_max_m_s2: float = Field(default=160, gt=0, allow_inf_nan=False,
                                  description="largest specific force; a larger one is out of range")
    restart_after: int = Field(
        default=0, ge=0, le=1_000,
        description="updates, refused in a row although every input was finite, after which the core waits for a load "
                    "as after a reset; 0: never, because it would lose its position")
    pool: pydantic.InstanceOf[Pool] = Field(default=DOUBLE_POOL, description="operators of the engine")

    def systems(self):
        """SINS_top."""
        return {"SINS_top": sins_top}


MEANINGS = {
    "omega": "angular rate against inertial space, body axes (right, forward, up), rad/s, mean over the sample period",
    "f": "specific force, body axes (right, forward, up), m/s^2, mean over the sample period",
    "altitude": "altitude that damps the vertical channel, m",
    "load": "1.0: load the start values with this sample; 0.0: navigate",
    "align": "with the load, 1.0: start an alignment at rest; 0.0: use the start quaternion",
    "place": "start position: latitude and longitude, degrees",
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
           sins.velocity_half_change, sins.vertical_loop, sins.position_matrix, sins.start_position, sine.sine_cosine,
           sins.alignment_quaternion, sins.horizontal_directions, sins.attitude_angles, sins.position_angles,
           sins.north_east_velocity)


def sins_top(config):
    """System of SINS_top for a SinsConfig.

    Raises: ValueError if the rotation in one sample period at the largest rate is too large.
    """
    largest = math.radians(config.rate_max_deg_s)
    coefficients = METHODS["minimax"](ORDER, largest * config.period_s)

    settings = sins.Settings(
        earth=EARTHS[config.earth], period=config.period_s, samples=config.alignment_samples, damping=config.damping_s,
        a0=coefficients.a0, d0=coefficients.d0, rate_max=largest, force_max=config.force_max_m_s2)

    def equations(xp, *, omega, f, load, align, place, start_v, start_h, start_q, altitude=None, **state):
        sample, start = sins.Sample(omega, f, altitude), sins.Start(load, align, place, start_v, start_h, start_q)
        return sins.sins_update(xp, sample, start, sins.State(**state), settings)

    inputs = {"omega": vector("in_w{}"), "f": vector("in_f{}"), "load": "in_load", "align": "in_align",
              "place": ("in_lat", "in_lon"),
              "start_v": vector("in_v{}", ("east", "north", "up")), "start_h": "in_height",
              "start_q": vector("in_q{}", "0123")}
    state = {"q": vector("q{}", "0123"), "t": matrix("t{}"), "c": matrix("c{}"), "v": vector("v{}"),
             "half": vector("half_{}"), "h": "h", "before": vector("before_{}"), "force": vector("force_{}"),
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
        outputs={"attitude": vector("out_{}", ("pitch", "roll", "heading")),
                 "velocity": vector("out_v{}", ("east", "north", "up")),
                 "position": ("out_latitude", "out_longitude"), "height": "out_height", "wander": "out_wander"},
        state=state,
        # At latitude and longitude zero, along east, north and up, waiting for a load.
        reset=dict.fromkeys(("q0", "t11", "t22", "t33", "c12", "c23", "c31"), 1.0),
        status=("aligning", "navigating", "out_of_range"), status_port="out_status")


SINS = SinsConfig(name="sins", description="50 Hz, free vertical channel", sample_rate_hz=50)
SINS_DAMPED = SinsConfig(name="sins_damped", description="50 Hz, vertical channel damped by an altitude, 100 s",
                         sample_rate_hz=50, damping_s=100)
