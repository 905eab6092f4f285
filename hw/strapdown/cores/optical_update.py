"""The update of the optical attitude sensor as a System: OPT_attitude, and the same inside OPT_top."""

import math

import numpy as np

from strapdown.algorithms import optical
from strapdown.algorithms.optical import Calibration, Inertial, Settings
from strapdown.kernel.system import System, vector

__all__ = ["FRACTION", "STATUS", "counted", "opt_attitude", "opt_update", "placed"]

STATUS = ("roll_missing", "pitch_missing", "refused", "ignored", "several", "saturated", "edge", "uncompensated")
"""Status bits, lowest first."""

FRACTION = 23
"""Bits of the fraction in binary32."""

MEANINGS = {
    "px": "position of the spot, pixels, the first pixel is 0",
    "position": "position of the spot, as by placed",
    "counted_peak": "largest light of the spot above black, counts, as by counted",
    "cycles": "exposure, cycles of clk, as by counted",
    "samples": "number of samples, as by counted",
    "n0": "position of the spot at angle zero, pixels",
    "scale": "pixel pitch over distance pivot to CCD; negative where pixels count the other way",
    "tilt": "slope of the CCD towards the pivot",
    "c3": "cubic correction for the cover glass",
    "h": "sideways place of the pitch CCD over its distance from the pivot",
    "k": "mass times offset of its centre over angular momentum, s/m",
    "angles": "degrees; roll right side down, pitch nose up",
    "measured": "degrees, of the body against the rotor axis",
    "peak": "largest light of the spot above black, counts",
    "exposure": "exposure of the roll CCD, us",
}
"""Meaning, unit and frame of the ports, by the kernel's names."""

INERTIAL = {"f": "accelerometer (specific force), body axes (forward, right, down), m/s^2",
            "yaw_rate": "rate of the heading, clockwise from above, rad/s"}
"""Of those that are means over the line period in OPT_attitude, and samples in OPT_top."""


def counted(integers):
    """Integers below 2²³ as the inputs of ``opt_update`` take them: 2²³ + i, an array of float64."""
    return 2.0**FRACTION + np.asarray(integers)


def placed(positions):
    """Positions, integers of 24 bits, 12 of them fraction, as ``opt_update`` takes them: an array of shape (..., 2).

    A negative position stands for no spot until now.
    """
    positions = np.asarray(positions)
    low, high = positions & (1 << FRACTION) - 1, positions >> FRACTION
    number = 2.0**11 + low * 2.0**-12
    return np.stack([np.where(positions < 0, -number, number), np.where(high == 0, 2.0**11, 0.0)], axis=-1)


def _pair(pattern):
    """Names of the ports of the roll and the pitch CCD."""
    return vector(pattern, "rp")


def _settings(config):
    return Settings(config.period_s, config.compensation, config.erection_s,
                    math.radians(config.erection_limit_deg_min / 60))


def _calibration_ports(config):
    """Ports of the Calibration, by its fields."""
    ports: dict[str, object] = {"n0": _pair("in_n0_{}"), "scale": _pair("in_scale_{}"), "tilt": _pair("in_tilt_{}"),
                                "c3": _pair("in_c3_{}"), "h": "in_h"}
    return ports if config.compensation == "none" else ports | {"k": "in_k"}


def _inertial_ports(config):
    """Ports of the Inertial, by its fields; only those that the compensation needs."""
    ports: dict[str, object] = {} if config.compensation == "none" else {"f": vector("in_acc{}")}
    return ports if config.compensation != "exact" else ports | {"yaw_rate": "in_yaw_rate"}


def _system(config, name, title, equations, inputs, outputs, kernels, inertial):
    """A System whose state and angles are those of ``optical_update``; ``inertial`` says what ``INERTIAL`` are."""
    state: dict[str, object] = {
        "none": {},
        "patent": {"drift": _pair("drift_{}"), "step": "step"},
        "exact": {"n": vector("n{}"), "roll": ("sine_roll", "cosine_roll"), "pitch": ("sine_pitch", "cosine_pitch"),
                  "measured": ("roll_measured", "pitch_measured")},
    }[config.compensation]
    kernels = [*kernels, optical.slope, optical.light, optical.measured_angles]
    if config.compensation == "patent":
        kernels.append(optical.patent_angles)
    elif config.compensation == "exact":
        kernels += [optical.level, *([optical.erection] if config.erection_s else []), optical.precession,
                    optical.angles_of_rotor, optical.onward]
    angles = {"angles": ("out_roll", "out_pitch"), "measured": ("out_roll_measured", "out_pitch_measured")}
    return System(
        name, title, equations, kernels=tuple(kernels),
        meanings=MEANINGS | {quantity: f"{meaning}, {inertial}" for quantity, meaning in INERTIAL.items()},
        sections=("LIGHT", "ROTOR", "ANGLES") if "n" in state else ("LIGHT", "ANGLES"),
        start="in_line_en", finish="out_attitude_finish", inputs=inputs, outputs=angles | outputs,
        state=state, reset={"nz": 1.0} if "n" in state else {},
        status_port="out_status", status_order=STATUS)


def opt_attitude(config):
    """System of OPT_attitude for an OpticalConfig."""
    settings = _settings(config)

    def equations(xp, *, px, n0, scale, tilt, c3, h, k=None, f=None, yaw_rate=None, **state):
        return optical.optical_update(xp, px, Calibration(n0, scale, tilt, c3, h, k), Inertial(f, yaw_rate), settings,
                                      **state)

    return _system(config, "OPT_attitude", "roll and pitch from the spots on both CCDs", equations,
                   {"px": ("in_roll_px", "in_pitch_px")} | _inertial_ports(config) | _calibration_ports(config), {}, (),
                   "mean over the line period")


def opt_update(config):
    """System of the update inside OPT_top: its inputs are what the circuits around it count and sum.

    Integers come as numbers, by ``counted`` and ``placed``. Specific force and yaw rate are sums of ``in_samples``
    samples, zero if there was no sample; the ports of OPT_top with these names take the samples. The outputs are those
    of a frame, of which OPT_top shows the angles.
    """
    settings = _settings(config)
    compensates = config.compensation != "none"

    def equations(xp, *, position, counted_peak, cycles, n0, scale, tilt, c3, h, k=None, f=None, yaw_rate=None,
                  samples=None, **state):
        with xp.section("LIGHT"):
            px = tuple(optical.pixels(xp, *values) for values in zip(position, n0, strict=True))
            share = follows = 1.0
            if compensates:
                number = optical.integer(samples)
                share, follows = 1 / xp.maximum(number, 1.0), xp.minimum(number, 1.0)
        update = optical.optical_update(xp, px, Calibration(n0, scale, tilt, c3, h, k),
                                        Inertial(f, yaw_rate, share, follows), settings, **state)
        return update._replace(outputs=update.outputs | {
            "px": px, "peak": tuple(optical.integer(number) for number in counted_peak),
            "exposure": optical.integer(cycles) * (1e6 / config.clock_hz)})

    inputs: dict[str, object] = {
        "position": (("in_roll_position", "in_roll_base"), ("in_pitch_position", "in_pitch_base")),
        "counted_peak": ("in_roll_peak", "in_pitch_peak"), "cycles": "in_exposure_r"}
    if compensates:
        inputs["samples"] = "in_samples"
    return _system(config, "OPT_top", "from the pins of both CCDs to roll and pitch", equations,
                   inputs | _inertial_ports(config) | _calibration_ports(config),
                   {"px": ("out_roll_px", "out_pitch_px"), "peak": ("out_roll_peak", "out_pitch_peak"),
                    "exposure": "out_exposure_r"}, (optical.pixels, optical.integer),
                   "a sample").restarting(config.restart_after)
