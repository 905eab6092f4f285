"""Configurations: frozen, validated sets of parameters, the named ones among them."""

import re
from typing import Annotated

import pydantic
from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from strapdown.kernel.pool import Pool

__all__ = ["AttitudeConfig", "ConfigError", "CONFIGS", "THESIS", "MAHONY"]


class ConfigError(ValueError):
    """A configuration that cannot be; the message is one line that names field and remedy."""


def _axes(axes):
    if any(not re.fullmatch("[+-][xyz]", axis) for axis in axes) or len({axis[1] for axis in axes}) != 3:
        raise ValueError("must name each sensor axis once, with its sign, as in +y,-x,+z")
    return axes


class AttitudeConfig(BaseModel):
    """Parameters of the complementary attitude filter (INS_acc … INS_top)."""

    model_config = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)

    name: str = Field(pattern="^[a-z][a-z0-9_]*$", description="name of the configuration, and of its output folder")
    description: str = Field(description="one line for people")
    sample_rate_hz: float = Field(gt=0, le=1e6, allow_inf_nan=False, description="updates per second, 1/T")
    kp: float = Field(ge=0, le=1e6, allow_inf_nan=False,
                      description="proportional gain Kp, rad/s per unit error")
    ki: float = Field(ge=0, le=1e6, allow_inf_nan=False,
                      description="integral gain Ki, rad/s² per unit error")
    magnetometer_axes: Annotated[tuple[str, str, str], AfterValidator(_axes)] = Field(
        description="sensor axes of the magnetometer that lie along body x, y and z")
    pool: pydantic.InstanceOf[Pool] = Field(default=Pool(), description="operators of the engine")

    @property
    def period_s(self):
        """Sample period T in seconds."""
        return 1 / self.sample_rate_hz

    def replace(self, **changes):
        """This configuration with some fields changed.

        Values may be strings, as they come from a command line. Raises: ConfigError.
        """
        fields = dict(self)
        if isinstance(axes := changes.get("magnetometer_axes"), str):
            changes["magnetometer_axes"] = tuple(axes.split(","))
        try:
            return type(self)(**(fields | changes))
        except pydantic.ValidationError as error:
            raise ConfigError(_one_line(self.name, error)) from None


def _one_line(name, error):
    """The first complaint of a ValidationError as one line."""
    first = error.errors()[0]
    where = ".".join(str(part) for part in first["loc"][:1])
    if first["type"] == "extra_forbidden":
        fields = ", ".join(field for field in AttitudeConfig.model_fields if field != "pool")
        return f"configuration {name} has no field {where!r}: choose from {fields}"
    message = first["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
    if not message.startswith("must"):
        message = f"must be {message}"
    return f"configuration {name}: {where} {message}, not {first['input']!r}"


THESIS = AttitudeConfig(
    name="thesis",
    description="the 2015 thesis: 500 Hz, Kp 10, Ki·T 0.001, magnetometer turned by 90 degrees",
    sample_rate_hz=500, kp=10, ki=0.5, magnetometer_axes=("+y", "-x", "+z"))

MAHONY = AttitudeConfig(
    name="mahony",
    description="the same filter with Kp 0.5, Ki 0, all sensors along the body axes, any sample rate",
    sample_rate_hz=500, kp=0.5, ki=0, magnetometer_axes=("+x", "+y", "+z"))

CONFIGS = {config.name: config for config in (THESIS, MAHONY)}
