"""What all configurations share: frozen, validated by pydantic, mistakes told in one line."""

import re
from typing import Annotated

import pydantic
from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from strapdown.kernel.pool import Pool

__all__ = ["Axes", "Config", "ConfigError", "Gain", "Positive"]


class ConfigError(ValueError):
    """A configuration that cannot be; the message is one line that names field and remedy."""


def _axes(axes):
    if any(not re.fullmatch("[+-][xyz]", axis) for axis in axes) or len({axis[1] for axis in axes}) != 3:
        raise ValueError("must name each sensor axis once, with its sign, as in +y,-x,+z")
    return axes


Axes = Annotated[tuple[str, str, str], AfterValidator(_axes)]
Gain = Annotated[float, Field(ge=0, le=1e6, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, le=1e6, allow_inf_nan=False)]


class Config(BaseModel):
    """Base of the configurations: a name, a line for people, a rate, and the operators of the engine."""

    model_config = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)

    name: str = Field(pattern="^[a-z][a-z0-9_]*$", description="name of the configuration, and of its output folder")
    description: str = Field(description="one line for people")
    sample_rate_hz: float = Field(gt=0, le=1e6, allow_inf_nan=False, description="updates per second, 1/T")
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
        for name, field in type(self).model_fields.items():
            if "tuple" in str(field.annotation) and isinstance(value := changes.get(name), str):
                changes[name] = tuple(value.split(",")) if value else ()
        try:
            return type(self)(**(fields | changes))
        except pydantic.ValidationError as error:
            raise ConfigError(_one_line(self, error)) from None


def _one_line(config, error):
    """The first complaint of a ValidationError as one line."""
    first = error.errors()[0]
    where = ".".join(str(part) for part in first["loc"][:1])
    if first["type"] == "extra_forbidden":
        fields = ", ".join(field for field in type(config).model_fields if field != "pool")
        return f"configuration {config.name} has no field {where!r}: choose from {fields}"
    message = first["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
    if not message.startswith("must"):
        message = f"must be {message}"
    return f"configuration {config.name}: {where} {message}, not {first['input']!r}"
