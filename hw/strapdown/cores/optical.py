"""The configuration of the optical attitude sensor (source 004)."""

from typing import Any, Literal

import pydantic
from pydantic import Field, field_validator, model_validator

from strapdown.blocks import SENSORS, LineTiming
from strapdown.config import Config, Gain
from strapdown.kernel.operators import Adder, Divider, Multiplier, Selector
from strapdown.kernel.pool import Pool

from .optical_modules import capture, opt_send
from .optical_top import OPTICAL_ASSEMBLIES
from .optical_update import FRACTION, opt_attitude

__all__ = ["OPTICAL_ERECTED", "OPTICAL_S11639", "OPTICAL_TCD1304", "OpticalConfig"]

OPTICAL_POOL = Pool(operators=(Adder(latency=4), Multiplier(), Divider(bits_per_cycle=2), Selector()))
"""Arctangents are polynomials, because their operator would take a quarter of the LUTs. A faster adder and a faster
divider make up for the time."""


def preset(**limits: Any) -> Any:
    """A field that has a preset of the sensor: None only until the presets are filled in."""
    return Field(default=None, **limits)


class OpticalConfig(Config):
    """Parameters of the optical attitude sensor (OPT_timing to OPT_top); see docs/optical.md."""

    sensor: Literal["tcd1304", "s11639", "tsl1402"] = Field(default="tcd1304", description="line sensor")
    clock_hz: float = Field(default=100e6, ge=1e6, le=1e9, allow_inf_nan=False, description="frequency of clk")
    sensor_clock_hz: float = preset(gt=0, le=1e9, allow_inf_nan=False, description="frequency of the sensor's clock")
    line_clocks: int = preset(ge=1, le=100_000_000, description="clocks of the sensor from line to line")
    sample_rate_hz: float = preset(description="lines per second, 1/T: sensor_clock_hz/line_clocks")
    sample_at: int = preset(ge=1, description="cycles from the begin of a pixel to its sample")
    adc: Literal["spi", "parallel"] = preset(description="interface of the ADCs")
    adc_latency: int = Field(default=3, ge=1, le=16, description="clocks from a sample of a parallel ADC to its word")
    adc_sclk_hz: float = Field(default=20e6, gt=0, le=20e6, allow_inf_nan=False,
                               description="largest frequency of SCLK of an SPI ADC")
    trigger: Literal["internal", "external"] = Field(
        default="internal", description="what starts a line: the line before, or the port in_trigger")
    mode: Literal["streaming", "buffered"] = Field(
        default="streaming", description="whether spots are found during the read-out, or afterwards in a line buffer")
    compensation: Literal["none", "patent", "exact"] = Field(
        default="exact", description="what takes out the precession of the rotor: nothing, the formulas of the patent, "
                                     "or the equation of motion")
    erection_s: Gain = Field(default=0, description="time constant with which the rotor axis is drawn to the mean "
                                                    "specific force, s; 0: not at all")
    erection_limit_deg_min: Gain = Field(default=0.5, description="largest rate of the erection, deg/min")
    lo_min: int = Field(default=40, ge=1, le=1000, description="least threshold of a spot above black, counts")
    shift: int = Field(default=2, ge=1, le=6, description="the threshold is the peak of the line before, over 2**shift")
    gap: int = Field(default=5, ge=1, le=63, description="pixels below the threshold that end a spot")
    width_max: int = Field(default=1024, ge=2, le=1024, description="width of a spot, pixels, at which it is cut")
    exposure: Literal["auto", "fixed"] = Field(default="auto", description="whether the exposure follows the peak")
    exposure_min_us: float = preset(ge=0, allow_inf_nan=False, description="least exposure, us")
    exposure_max_us: float = preset(ge=0, allow_inf_nan=False, description="largest exposure, us")
    exposure_us: float = preset(ge=0, allow_inf_nan=False, description="first exposure, or the fixed one, us")
    baud_rate: int = Field(default=921_600, ge=1, description="bits per second on the serial line")
    send_every: int = Field(default=1, ge=1, le=65_535, description="lines from one frame to the next")
    pool: pydantic.InstanceOf[Pool] = Field(default=OPTICAL_POOL, description="operators of the engine")

    @field_validator("sample_rate_hz", mode="before")
    @classmethod
    def _rate_follows(cls, value: object) -> object:
        raise ValueError("must be left out: it is sensor_clock_hz/line_clocks")

    @field_validator("channels")
    @classmethod
    def _one_channel(cls, channels: int) -> int:
        if channels != 1:
            raise ValueError("must be 1: a core serves one sensor")
        return channels

    @field_validator("erection_s")
    @classmethod
    def _exact_only(cls, value: float, info: pydantic.ValidationInfo) -> float:
        if value and info.data.get("compensation") != "exact":
            raise ValueError("must be 0 unless compensation is exact")
        return value

    @model_validator(mode="after")
    def _presets(self) -> "OpticalConfig":
        """Fields that are not given get their presets, and components check what depends on several fields."""
        sensor, given, fields = SENSORS[self.sensor], self.model_fields_set, vars(self)
        fields |= {name: value for name, value in {
            "sensor_clock_hz": sensor.clock_hz, "line_clocks": sensor.line_clocks, "adc": sensor.adc}.items()
            if name not in given}
        fields["sample_rate_hz"] = self.sensor_clock_hz / self.line_clocks
        timing = self.timing()
        if self.pool.format.width != 32:
            raise ValueError(f"pool must be in binary32, not {self.pool.format.name}")
        if timing.line_cycles >= 1 << FRACTION:
            raise ValueError(f"a line must take less than {1 << FRACTION} cycles, not {timing.line_cycles}")
        fields["sample_at"] = timing.sample_at
        fields["exposure_min_us"], fields["exposure_max_us"] = (
            1e6 * cycles / self.clock_hz for cycles in timing.exposure_range)
        if "exposure_us" not in given:
            fields["exposure_us"] = min(max(1e5 / self.sample_rate_hz, self.exposure_min_us), self.exposure_max_us)
        if not self.exposure_min_us <= self.exposure_us <= self.exposure_max_us:
            raise ValueError(f"exposure_us must be from {self.exposure_min_us:g} to {self.exposure_max_us:g}, "
                             f"not {self.exposure_us:g}")
        capture(self, timing)
        opt_send(self)
        return self

    def timing(self) -> LineTiming:
        """The timing of the sensors. Raises: ValueError if they cannot work so."""
        range_s = (self.exposure_min_us, self.exposure_max_us)
        return LineTiming(
            SENSORS[self.sensor], clock_hz=self.clock_hz, sensor_clock_hz=self.sensor_clock_hz,
            line_clocks=self.line_clocks, sample_at=self.sample_at, trigger=self.trigger,
            exposure_s=tuple(None if value is None else value / 1e6 for value in range_s))

    def systems(self):
        """OPT_attitude."""
        return {"OPT_attitude": opt_attitude}

    def assemblies(self):
        """OPT_timing to OPT_top."""
        return OPTICAL_ASSEMBLIES


OPTICAL_TCD1304 = OpticalConfig(
    name="optical_tcd1304", description="TCD1304 at 135 Hz, SPI ADC, exact compensation", sensor="tcd1304")
OPTICAL_S11639 = OpticalConfig(
    name="optical_s11639", description="S11639 at 2 kHz, parallel ADC, exact compensation", sensor="s11639")
OPTICAL_ERECTED = OPTICAL_TCD1304.replace(
    name="optical_erected", description="TCD1304 at 135 Hz, the rotor axis erected in 30 s", erection_s=30)
