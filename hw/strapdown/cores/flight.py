"""INS_flight: the flight attitude filter, with the ports of INS_top and more outputs."""

from typing import ClassVar, Literal

from pydantic import Field

from strapdown.algorithms import attitude, flight
from strapdown.algorithms.flight import Parameters
from strapdown.config import Axes, Gain, Positive, RightHandedAxes, TunableConfig
from strapdown.kernel.system import System, matrix, vector

__all__ = ["FLIGHT", "FLIGHT_6AXIS", "FlightConfig", "ins_flight"]


class FlightConfig(TunableConfig):
    """Parameters of the flight attitude filter (INS_flight); see docs/flight.md."""

    frame: Literal["NWU", "ENU", "NED"] = Field(default="NWU", description="navigation frame")
    magnetometer: bool = Field(default=True, description="whether there is a magnetometer: 9 axes, else 6")
    accelerometer_axes: RightHandedAxes = Field(
        default=("+x", "+y", "+z"), description="sensor axes along body x, y and z")
    gyro_axes: RightHandedAxes = Field(
        default=("+x", "+y", "+z"), description="sensor axes along body x, y and z")
    magnetometer_axes: Axes = Field(default=("+x", "+y", "+z"), description="sensor axes along body x, y and z")
    period_input: bool = Field(default=False, description="whether the period of each sample is an input")
    mag_valid_input: bool = Field(default=False, description="whether an input says which field samples are valid")

    tunable: ClassVar = Parameters._fields

    accelerometer_gain: Positive = Field(default=0.5, description="correction of tilt, rad/s per rad")
    magnetometer_gain: Gain = Field(default=0.1, description="correction of heading, rad/s per rad")
    acceleration_time: Positive = Field(default=1.5, description="time constant of the earth-frame low-pass, s")
    rest_rate: Positive = Field(default=2.0, description="rest: largest deviation of the rate from its average, deg/s")
    rest_acceleration: Positive = Field(
        default=0.05, description="rest: largest deviation of the specific force from its average, g")
    rest_time: Gain = Field(default=1.5, description="time without motion after which the body is at rest, s")
    rest_average_time: Positive = Field(default=0.5, description="time constant of the gyro's average, s")
    bias_limit: Positive = Field(default=2.0, description="largest magnitude of the gyro's bias, deg/s")
    bias_gain: Gain = Field(default=0.04, description="gain of the bias before the first rest, rad/s² per rad")
    bias_gain_after_rest: Gain = Field(
        default=0.005, description="gain of the bias after the first rest, rad/s² per rad")
    field_tolerance: Positive = Field(
        default=0.16, description="relative deviation at which the weight of the field is zero")
    field_time: Positive = Field(default=20.0, description="time constant of the reference field, s")
    field_recovery_time: Positive = Field(
        default=60.0, description="time constant of the reference field while the weight is zero, s")
    ramp_gain: Gain = Field(default=10.0, description="addition to both gains at the start, rad/s per rad")
    ramp_time: Positive = Field(default=3.0, description="time in which this addition falls to zero, s")
    gyro_range: Positive = Field(default=2000.0, description="largest rate that the gyro measures, deg/s")
    accelerometer_range: Positive = Field(
        default=157.0, description="largest specific force that the accelerometer measures, in its unit")

    @property
    def parameters(self):
        """Gains, times and limits as strapdown.algorithms.flight.Parameters."""
        return Parameters(**{name: getattr(self, name) for name in Parameters._fields})

    @property
    def axes(self):
        """Axes of the sensors, by the kernel's names."""
        return {"a": self.accelerometer_axes, "g": self.gyro_axes, "m": self.magnetometer_axes}

    def systems(self):
        """INS_flight."""
        return {"INS_flight": ins_flight}

    def constant_inputs(self):
        """Period, magnetometer present, and the parameters that are inputs."""
        return {"period": self.period_s, "mag_valid": 1.0} | super().constant_inputs()


STATUS = ("accelerometer_missing", "magnetometer_missing", "starting", "at_rest", "magnetometer_rejected",
          "range_exceeded")
"""Status bits, lowest first; the 6-axis filter has none of the magnetometer."""

KERNELS = (flight.flight_update, flight.turned, flight.matrix_of_turn, flight.vertical, flight.low_pass,
           flight.tilt_correction, flight.gyro_average, flight.bias_update, flight.heading, flight.field_correction,
           attitude.euler_angles, attitude.matrix_angles)


def _meanings(config):
    frame = {"NWU": "north, west, up", "ENU": "east, north, up", "NED": "north, east, down"}[config.frame]
    return {
        "a": "accelerometer (specific force), sensor axes, any unit",
        "g": "gyro, sensor axes, deg/s",
        "m": "magnetometer, sensor axes, any unit; zero where there is no sample",
        "mag_valid": "1.0 where the magnetometer has a sample, else 0.0",
        "period": "sample period T, s, 0 to 0.1",
        "c": f"C = C_n^b, navigation ({frame}) to body",
        "angles": "degrees; yaw in [0, 360)",
        "q": "unit quaternion, body to navigation, scalar first",
        "bias": "bias of the gyro, body axes, deg/s",
        "earth": f"specific force, navigation axes ({frame}), unit of the accelerometer",
        "linear": "acceleration without gravity, body axes, unit of the accelerometer",
    } | config.input_meanings


def ins_flight(config):
    """System of INS_flight for a FlightConfig."""
    frame = flight.FRAMES[config.frame]

    def equations(xp, *, a, g, m=None, period=config.period_s, mag_valid=None, **arguments):
        parameters = config.parameters._replace(**{name: arguments.pop(name) for name in config.inputs})
        if mag_valid is not None:
            m = tuple(xp.select(mag_valid < 0.5, 0.0, x) for x in m)
        return flight.flight_update(xp, flight.Sensors(a, g, m), flight.State(**arguments),
                                    flight.Settings(period, parameters, frame, config.axes))

    inputs: dict = {"a": vector("in_acc{}")}
    state = {"q": vector("q{}", "0123"), "pending": vector("p{}"), "first": vector("f{}"), "second": vector("s{}"),
             "mean": vector("mean{}"), "bias": vector("bias{}"),
             "clock": "clock", "rest_clock": "rest_clock", "rested": "rested"}
    reset = {"q0": 1.0, "clock": -float(flight.ALIGNMENTS), "rested": -1.0}
    if config.magnetometer:
        inputs["m"] = vector("in_mag{}")
        state |= {"reference": ("field_level", "field_up"), "field_clock": "field_clock", "field_age": "field_age"}
        reset["field_clock"] = -float(flight.ALIGNMENTS)
    inputs["g"] = vector("in_gyro{}")
    if config.mag_valid_input and config.magnetometer:
        inputs["mag_valid"] = "in_mag_valid"
    if config.period_input:
        inputs["period"] = "in_period"
    inputs |= {name: f"in_{name}" for name in config.inputs}
    return System(
        "INS_flight", "flight attitude filter: " + ("9 axes" if config.magnetometer else "6 axes"), equations,
        kernels=KERNELS, meanings=_meanings(config),
        sections=("GYRO", "QUAT", "MATX", "ACC_MAG", "EULER"),
        start="in_data_en", finish="out_INS_finish", inputs=inputs,
        outputs={"c": matrix("out_c{}"), "angles": vector("out_{}", ("pitch", "roll", "yaw")),
                 "q": vector("out_q{}", "0123"), "bias": vector("out_bias{}"), "earth": vector("out_earth{}"),
                 "linear": vector("out_linear{}")},
        state=state, reset=reset,
        status=tuple(name for name in STATUS if config.magnetometer or not name.startswith("magnetometer")),
        status_port="out_status")


FLIGHT = FlightConfig(
    name="flight", description="9-axis flight filter: motion, shocks and magnetic disturbance, bias learnt",
    sample_rate_hz=500)

FLIGHT_6AXIS = FlightConfig(
    name="flight_6axis", description="the same without magnetometer: heading from the gyro only",
    sample_rate_hz=500, magnetometer=False)
