"""INS_flight: the flight attitude filter under the ports of INS_top, and more."""

from strapdown.algorithms import attitude, flight
from strapdown.kernel.system import System

__all__ = ["FLIGHT_CORES", "ins_flight"]

STATUS = ("accelerometer_missing", "magnetometer_missing", "starting", "at_rest", "magnetometer_rejected",
          "range_exceeded")
"""Status bits, lowest first; the 6-axis filter leaves those of the magnetometer out."""

KERNELS = (flight.flight_update, flight.turned, flight.matrix_of_turn, flight.low_pass,
           flight.tilt_correction, flight.field_correction, flight.bias_update, attitude.euler_angles)


def _vector(pattern, names="xyz"):
    return tuple(pattern.format(name) for name in names)


def _matrix(pattern):
    return tuple(tuple(pattern.format(f"{row}{column}") for column in "123") for row in "123")


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
    } | {name: type(config).model_fields[name].description for name in config.inputs}


def ins_flight(config):
    """System of INS_flight for a FlightConfig."""
    frame = flight.FRAMES[config.frame]

    def equations(xp, *, period=config.period_s, mag_valid=None, **arguments):
        parameters = config.parameters._replace(**{name: arguments.pop(name) for name in config.inputs})
        if mag_valid is not None:
            arguments["m"] = tuple(xp.select(mag_valid < 0.5, 0.0, x) for x in arguments["m"])
        return flight.flight_update(xp, period=period, parameters=parameters, frame=frame, axes=config.axes,
                                    **arguments)

    inputs: dict = {"a": _vector("in_acc{}")}
    state = {"q": _vector("q{}", "0123"), "pending": _vector("p{}"), "first": _vector("f{}"), "second": _vector("s{}"),
             "mean": _vector("mean{}"), "bias": _vector("bias{}"),
             "clock": "clock", "rest_clock": "rest_clock", "rested": "rested"}
    reset = {"q0": 1.0, "clock": -float(flight.ALIGNMENTS), "rested": -1.0}
    if config.magnetometer:
        inputs["m"] = _vector("in_mag{}")
        state |= {"reference": ("field_level", "field_up"), "field_clock": "field_clock", "field_age": "field_age"}
        reset["field_clock"] = -float(flight.ALIGNMENTS)
    inputs["g"] = _vector("in_gyro{}")
    if config.mag_valid_input and config.magnetometer:
        inputs["mag_valid"] = "in_mag_valid"
    if config.period_input:
        inputs["period"] = "in_period"
    inputs |= {name: f"in_{name}" for name in config.inputs}
    words = [word for names in state.values() for word in ((names,) if isinstance(names, str) else names)]
    return System(
        "INS_flight", "flight attitude filter: " + ("9 axes" if config.magnetometer else "6 axes"), equations,
        kernels=KERNELS, meanings=_meanings(config),
        sections=("GYRO", "QUAT", "MATX", "ACC_MAG", "EULER"),
        start="in_data_en", finish="out_INS_finish", inputs=inputs,
        outputs={"c": _matrix("out_c{}"), "angles": _vector("out_{}", ("pitch", "roll", "yaw")),
                 "q": _vector("out_q{}", "0123"), "bias": _vector("out_bias{}"), "earth": _vector("out_earth{}"),
                 "linear": _vector("out_linear{}")},
        state=state, reset=dict.fromkeys(words, 0.0) | reset,
        status=tuple(name for name in STATUS if config.magnetometer or not name.startswith("magnetometer")),
        status_port="out_status")


FLIGHT_CORES = {"INS_flight": ins_flight}
"""Module name to the function that makes its System for a FlightConfig."""
