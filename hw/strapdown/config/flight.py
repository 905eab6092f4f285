"""The flight attitude filter: INS_flight."""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from strapdown.algorithms.flight import Parameters

from .base import Axes, Config, Gain, Positive

__all__ = ["FLIGHT", "FLIGHT_6AXIS", "FlightConfig"]


def _parameter_names(names):
    if unknown := [name for name in names if name not in Parameters._fields]:
        raise ValueError(f"must name parameters of the filter, which {unknown[0]} is not")
    return names


class FlightConfig(Config):
    """Parameters of the flight attitude filter (INS_flight); see docs/flight.md."""

    frame: Literal["NWU", "ENU", "NED"] = Field(default="NWU", description="navigation frame")
    magnetometer: bool = Field(default=True, description="whether there is one: 9 axes, or 6")
    accelerometer_axes: Axes = Field(default=("+x", "+y", "+z"), description="sensor axes along body x, y and z")
    gyro_axes: Axes = Field(default=("+x", "+y", "+z"), description="sensor axes along body x, y and z")
    magnetometer_axes: Axes = Field(default=("+x", "+y", "+z"), description="sensor axes along body x, y and z")
    period_input: bool = Field(default=False, description="whether the period of each sample is an input")
    mag_valid_input: bool = Field(default=False, description="whether an input tells which field samples count")
    inputs: Annotated[tuple[str, ...], AfterValidator(_parameter_names)] = Field(
        default=(), description="parameters that are inputs at run time, not constants")

    accelerometer_gain: Positive = Field(default=0.5, description="correction of tilt, rad/s per rad")
    magnetometer_gain: Gain = Field(default=0.1, description="correction of heading, rad/s per rad")
    acceleration_time: Positive = Field(default=1.5, description="time constant of the earth-frame low-pass, s")
    rest_rate: Positive = Field(default=2.0, description="rest: rate about its own average, deg/s")
    rest_acceleration: Positive = Field(default=0.05, description="rest: specific force about its average, g")
    rest_time: Gain = Field(default=1.5, description="time without motion that counts as rest, s")
    rest_average_time: Positive = Field(default=0.5, description="time constant of the gyro's average, s")
    bias_limit: Positive = Field(default=2.0, description="longest bias vector of the gyro, deg/s")
    bias_gain: Gain = Field(default=0.04, description="learning of bias before the first rest, rad/s² per rad")
    bias_gain_after_rest: Gain = Field(default=0.005, description="the same after it")
    field_tolerance: Positive = Field(default=0.16, description="deviation at which a field is not believed at all")
    field_time: Positive = Field(default=20.0, description="time constant of the field's reference, s")
    field_recovery_time: Positive = Field(default=60.0, description="the same while the field is not believed, s")
    ramp_gain: Gain = Field(default=10.0, description="added to both gains at the start, rad/s per rad")
    ramp_time: Positive = Field(default=3.0, description="time in which that falls to zero, s")
    gyro_range: Positive = Field(default=2000.0, description="longest rate that the gyro measures, deg/s")
    accelerometer_range: Positive = Field(
        default=157.0, description="longest specific force that the accelerometer measures, in its own unit")

    @property
    def parameters(self):
        """Gains, times and limits as strapdown.algorithms.flight.Parameters."""
        return Parameters(**{name: getattr(self, name) for name in Parameters._fields})

    @property
    def axes(self):
        """Axes of the sensors by the kernel's names."""
        return {"a": self.accelerometer_axes, "g": self.gyro_axes, "m": self.magnetometer_axes}


FLIGHT = FlightConfig(
    name="flight", description="9-axis flight filter: motion, shocks and magnetic disturbance, bias learnt",
    sample_rate_hz=500)

FLIGHT_6AXIS = FlightConfig(
    name="flight_6axis", description="the same without magnetometer: heading is the gyro's alone",
    sample_rate_hz=500, magnetometer=False)
