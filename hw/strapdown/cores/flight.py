"""INS_flight: the flight attitude filter, with the ports of INS_top and more outputs."""

from typing import ClassVar, Literal

from pydantic import Field

from strapdown.algorithms import attitude, flight
from strapdown.algorithms.flight import NO_CALIBRATION, Calibration, Parameters
from strapdown.config import Angle, Axes, Gain, Matrix, Positive, RightHandedAxes, TunableConfig, Vector
from strapdown.kernel.operators import Adder, Extremes, Multiplier, Selector, TableArctangent, TableReciprocal
from strapdown.kernel.pool import Pool
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

    external_input: bool = Field(
        default=False, description="whether an acceleration that is known from elsewhere is an input")
    stale_field: bool = Field(
        default=False, description="whether a field sample equal to the one before is no new sample")

    tunable: ClassVar = (*Parameters._fields, *Calibration._fields)
    removed: ClassVar = {
        "accelerometer_gain": "acceleration_time, because the tilt is corrected in full",
        "bias_gain": "bias_noise", "bias_gain_after_rest": "bias_noise and bias_drift",
        "ramp_gain": "heading_weighting"}

    magnetometer_gain: Gain = Field(default=0.1, description="correction of heading, rad/s per rad")
    acceleration_time: Positive = Field(default=2.97, description="time constant of the earth-frame low-pass, s")
    rest_rate: Positive = Field(default=2.0, description="rest: largest RMS deviation of the rate, deg/s")
    rest_acceleration: Positive = Field(
        default=0.05, description="rest: largest RMS deviation of the specific force, g")
    rest_time: Gain = Field(default=1.5, description="time without motion after which the body is at rest, s")
    rest_average_time: Positive = Field(default=0.5, description="time constant of the averages of gyro and force, s")
    bias_limit: Positive = Field(default=10.0, description="largest magnitude of the gyro's bias, deg/s")
    bias_deviation: Positive = Field(default=2.4, description="standard deviation of the bias at the start, deg/s")
    bias_drift: Gain = Field(default=0.03, description="random walk of the bias, deg/s/√s")
    bias_noise: Positive = Field(default=1.87, description="noise of the rate that the tilt needs, deg/s·√s")
    bias_learning: Gain = Field(
        default=0.62, description="fraction by which a sample in motion reduces the variance of the bias")
    bias_rest_deviation: Gain = Field(default=0.026, description="standard deviation of the bias at rest, deg/s")
    field_tolerance: Positive = Field(
        default=0.16, description="relative deviation at which the weight of the field is zero")
    field_time: Positive = Field(default=20.0, description="time constant of the reference field, s")
    field_recovery_time: Positive = Field(
        default=40.0, description="time constant of the reference field while the weight is zero, s")
    heading_weighting: Positive = Field(
        default=3.0, description="heading at the start: 1 for the mean, more for more weight on later samples")
    ramp_time: Positive = Field(default=6.0, description="time in which this mean ends, s")
    gyro_range: Positive = Field(default=2000.0, description="range of each axis of the gyro, deg/s")
    accelerometer_range: Positive = Field(
        default=157.0, description="range of each axis of the accelerometer, in its unit")
    magnetic_declination: Angle = Field(
        default=0.0, description="magnetic north from true north, east positive, deg")
    accelerometer_bias: Vector = Field(
        default=NO_CALIBRATION.accelerometer_bias, description="subtracted from the accelerometer, in its axes")
    accelerometer_matrix: Matrix = Field(
        default=NO_CALIBRATION.accelerometer_matrix, description="applied to the difference, by rows")
    gyro_bias: Vector = Field(
        default=NO_CALIBRATION.gyro_bias, description="subtracted from the gyro, in its axes, deg/s")
    gyro_matrix: Matrix = Field(
        default=NO_CALIBRATION.gyro_matrix, description="applied to the difference, by rows")
    magnetometer_bias: Vector = Field(
        default=NO_CALIBRATION.magnetometer_bias, description="subtracted from the magnetometer, in its axes")
    magnetometer_matrix: Matrix = Field(
        default=NO_CALIBRATION.magnetometer_matrix, description="applied to the difference, by rows")

    @property
    def parameters(self):
        """Gains, times and limits as strapdown.algorithms.flight.Parameters."""
        return Parameters(**{name: getattr(self, name) for name in Parameters._fields})

    @property
    def calibration(self):
        """Errors of the sensors as strapdown.algorithms.flight.Calibration."""
        return Calibration(**{name: getattr(self, name) for name in Calibration._fields})

    @property
    def axes(self):
        """Axes of the sensors, by the kernel's names."""
        return {"a": self.accelerometer_axes, "g": self.gyro_axes, "m": self.magnetometer_axes}

    def systems(self):
        """INS_flight."""
        return {"INS_flight": ins_flight}

    def constant_inputs(self):
        """Period, magnetometer present, no external acceleration, and the parameters that are inputs."""
        return {"period": self.period_s, "mag_valid": 1.0, "external": (0.0, 0.0, 0.0)} | super().constant_inputs()


STATUS = ("accelerometer_missing", "magnetometer_missing", "starting", "at_rest", "magnetometer_rejected",
          "range_exceeded", "bias_clipped", "magnetometer_stuck", "external_used")
"""Status bits, lowest first; the 6-axis filter has none of the magnetometer, and a core without ``external_input`` not
the last."""

KERNELS = (flight.flight_update, flight.corrected, flight.turned, flight.matrix_of_turn, flight.vertical,
           flight.low_pass, flight.tilt_correction, flight.rest, flight.bias_update, flight.heading,
           flight.field_correction, flight.field_moved, attitude.euler_angles, attitude.matrix_angles)

INPUT_PORTS = {"bias": lambda name: vector(f"in_{name}{{}}"), "matrix": lambda name: matrix(f"in_{name}{{}}")}
"""Maps the last word of a calibration's name to the function that makes its ports."""


def _meanings(config):
    frame = {"NWU": "north, west, up", "ENU": "east, north, up", "NED": "north, east, down"}[config.frame]
    return {
        "a": "accelerometer (specific force), sensor axes, any unit",
        "g": "gyro, sensor axes, deg/s",
        "m": "magnetometer, sensor axes, any unit; zero where there is no sample",
        "mag_valid": "1.0 where the magnetometer has a sample, else 0.0",
        "period": "sample period T, s, 0 to 0.1",
        "external": f"acceleration known from elsewhere, without gravity, navigation axes ({frame}), unit of the "
                    "accelerometer; zero without",
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

    def equations(xp, *, a, g, m=None, period=config.period_s, mag_valid=None, external=None, **arguments):
        given = {name: arguments.pop(name) for name in config.inputs}
        parameters, calibration = (
            values._replace(**{name: value for name, value in given.items() if name in values._fields})
            for values in (config.parameters, config.calibration))
        if mag_valid is not None:
            m = tuple(xp.select(mag_valid < 0.5, 0.0, x) for x in m)
        return flight.flight_update(
            xp, flight.Sensors(a, g, m, external), flight.State(**arguments),
            flight.Settings(period, parameters, frame, config.axes, calibration, config.stale_field))

    inputs: dict = {"a": vector("in_acc{}")}
    rows = tuple(vector(f"row{number}{{}}") for number in "12")
    state = {"q": vector("q{}", "0123"), "pending": vector("p{}"), "force": vector("s{}"), "force_rate": vector("v{}"),
             "gyro_mean": vector("gyro_mean{}"), "accel_mean": vector("acc_mean{}"),
             "unrest": "unrest", "bias": vector("bias{}"), "bias_variance": "bias_variance",
             "rows": rows, "rows_rate": tuple(vector(f"row{number}_rate{{}}") for number in "12"),
             "rows_bias": vector("row_bias{}", "12"), "rows_bias_rate": vector("row_bias_rate{}", "12"),
             "clock": "clock", "settled": "settled", "rest_clock": "rest_clock", "recovery": "recovery"}
    reset = {"q0": 1.0, "clock": -float(flight.ALIGNMENTS), "bias_variance": config.bias_deviation**2}
    if config.magnetometer:
        inputs["m"] = vector("in_mag{}")
        state |= {"reference": ("field_level", "field_up"), "field_count": "field_count", "field_age": "field_age",
                  "heading_variance": "heading_variance", "last_field": vector("field{}"),
                  "field_moved": "field_moved"}
        reset |= {"field_count": -float(flight.ALIGNMENTS), "heading_variance": flight.HEADING_VARIANCE}
    inputs["g"] = vector("in_gyro{}")
    if config.mag_valid_input and config.magnetometer:
        inputs["mag_valid"] = "in_mag_valid"
    if config.period_input:
        inputs["period"] = "in_period"
    if config.external_input:
        inputs["external"] = vector("in_ext_{}")
    for name in config.inputs:
        ports = INPUT_PORTS.get(name.rpartition("_")[2]) if name in Calibration._fields else None
        inputs[name] = ports(name) if ports else f"in_{name}"
    return System(
        "INS_flight", "flight attitude filter: " + ("9 axes" if config.magnetometer else "6 axes"), equations,
        kernels=KERNELS, meanings=_meanings(config),
        sections=("GYRO", "QUAT", "MATX", "ACC_MAG", "EULER"),
        start="in_data_en", finish="out_INS_finish", inputs=inputs,
        outputs={"c": matrix("out_c{}"), "angles": vector("out_{}", ("pitch", "roll", "yaw")),
                 "q": vector("out_q{}", "0123"), "bias": vector("out_bias{}"), "earth": vector("out_earth{}"),
                 "linear": vector("out_linear{}")},
        state=state, reset=reset,
        status=tuple(name for name in STATUS if (config.magnetometer or not name.startswith("magnetometer"))
                     and (config.external_input or name != "external_used")),
        status_port="out_status")


POOL = Pool(
    operators=(Adder(count=2, latency=3, two_paths=True), Multiplier(count=2), Extremes(), TableReciprocal(),
               TableArctangent(), Selector()),
    side_memory=True, side_registered=True)

FLIGHT = FlightConfig(
    name="flight", description="9-axis flight filter: motion, shocks and magnetic disturbance, bias learnt",
    sample_rate_hz=500, pool=POOL)

FLIGHT_6AXIS = FlightConfig(
    name="flight_6axis", description="the same without magnetometer: heading from the gyro only",
    sample_rate_hz=500, magnetometer=False, pool=POOL)
