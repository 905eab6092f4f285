"""The float64 reference of a module, with the parameters of a configuration."""

from collections.abc import Callable

from .reference.attitude import ComplementaryFilter
from .reference.flight import FlightFilter
from .reference.modules import reference_outputs

__all__ = ["REFERENCES", "complementary_filter", "flight_filter", "module_outputs"]


def complementary_filter(config):
    """The reference of INS_top for an AttitudeConfig."""
    return ComplementaryFilter(kp=config.kp, ki=config.ki, period_s=config.period_s, mag_axes=config.magnetometer_axes)


def flight_filter(config):
    """The reference of INS_flight for a FlightConfig."""
    return FlightFilter(period_s=config.period_s, frame=config.frame, axes=config.axes,
                        magnetometer=config.magnetometer, stale_field=config.stale_field,
                        calibration=config.calibration._asdict(), **config.parameters._asdict())


REFERENCES: dict[str, Callable] = {"INS_top": complementary_filter, "INS_flight": flight_filter}
"""Maps each module that replays recordings to the function that makes its reference for a configuration.

The reference has ``run(accel, mag, gyro_deg_s)``, that of INS_flight also with ``period_s`` and ``mag_valid`` for the
inputs of TIMED_INPUTS in ``replay``; the configuration has ``frame``, the navigation frame.
"""


def module_outputs(module, inputs, config):
    """Outputs of a module without state in float64, for an AttitudeConfig; see ``reference_outputs``."""
    return reference_outputs(module, inputs, kp=config.kp, ki=config.ki, period_s=config.period_s,
                             mag_axes=config.magnetometer_axes)
