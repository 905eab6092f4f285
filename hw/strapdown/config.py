"""The base of all configurations. They are frozen, and pydantic validates them. An error is one line."""

import re
import unicodedata
from collections.abc import Callable
from dataclasses import replace
from enum import Enum
from typing import Annotated, Any, ClassVar, NamedTuple, get_type_hints

import pydantic
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo, field_validator

from strapdown.kernel.pool import SELDOM, STYLES, MemoryStyle, Pool
from strapdown.kernel.system import System

__all__ = ["Angle", "Assembly", "Axes", "Config", "ConfigError", "Gain", "Matrix", "Names", "Positive",
           "RightHandedAxes", "TunableConfig", "Vector"]


class ConfigError(ValueError):
    """A configuration is not valid. The message is one line that names the field and the remedy."""


def _listed(value):
    """The tuple of a comma-separated string from a command line; other values unchanged."""
    if isinstance(value, str):
        return tuple(value.split(",")) if value else ()
    return value


def _axes(axes):
    if any(not re.fullmatch("[+-][xyz]", axis) for axis in axes) or sorted(axis[1] for axis in axes) != list("xyz"):
        raise ValueError("must name each sensor axis once, with its sign, as in +y,-x,+z")
    return axes


def _left_handed(axes):
    """Whether axes, as signed letters, form a left-handed frame: the determinant of their matrix is negative."""
    matrix = [[(axis[1] == letter) * (-1 if axis[0] == "-" else 1) for letter in "xyz"] for axis in axes]
    (a, b, c), (d, e, f), (g, h, i) = matrix
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) < 0


def _right_handed(axes):
    if _left_handed(axes):
        raise ValueError("must be right-handed, like a rotated sensor: change one sign, or swap two axes")
    return axes


def _power_of_two(number):
    if number & (number - 1):
        raise ValueError("must be a power of two")
    return number


Names = Annotated[tuple[str, ...], BeforeValidator(_listed)]
_EITHER_HAND = AfterValidator(_axes)
Axes = Annotated[Names, _EITHER_HAND]
"""Sensor axes along body x, y and z, each with its sign. Those of a magnetometer may be left-handed."""
RightHandedAxes = Annotated[Names, _EITHER_HAND, AfterValidator(_right_handed)]
Gain = Annotated[float, Field(ge=0, le=1e6, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, le=1e6, allow_inf_nan=False)]
Angle = Annotated[float, Field(ge=-180, le=180, allow_inf_nan=False)]


def _vector(value):
    """Three numbers of a command line; other values unchanged."""
    value = _listed(value)
    if isinstance(value, tuple) and len(value) != 3:
        raise ValueError("must be three numbers, as in 0,0,0.5")
    return value


def _rows(value):
    """Three rows of a matrix from nine numbers of a command line; three rows unchanged."""
    numbers = _listed(value)
    rows = tuple(numbers[i:i + 3] for i in range(0, 9, 3)) if isinstance(value, str) else value
    if len(numbers) != (9 if isinstance(value, str) else 3):
        raise ValueError("must be nine numbers, by rows")
    return rows


def _invertible(rows):
    (a, b, c), (d, e, f), (g, h, i) = rows
    if a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) == 0:
        raise ValueError("must have an inverse")
    return rows


Number = Annotated[float, Field(ge=-1e6, le=1e6, allow_inf_nan=False)]
Vector = Annotated[tuple[Number, Number, Number], BeforeValidator(_vector)]
"""Three numbers, comma-separated on a command line."""
Matrix = Annotated[tuple[Vector, Vector, Vector], BeforeValidator(_rows), AfterValidator(_invertible)]
"""Three rows of three numbers: nine numbers, by rows, on a command line."""


def _style(value):
    """A memory style from a command line: the empty string is None."""
    if value in ("", None):
        return None
    try:
        return MemoryStyle(value)
    except ValueError:
        raise ValueError(f"must be {STYLES}") from None


def _optional_style(value):
    """A memory style, or no memory, from a command line."""
    words = {"none": False, "false": False, "true": True}
    value = words.get(value, value) if isinstance(value, str) else value
    try:
        return value if isinstance(value, bool) else _style(value)
    except ValueError:
        raise ValueError(f"must be none, {STYLES}") from None


Style = Annotated[MemoryStyle | None, BeforeValidator(_style)]
OptionalStyle = Annotated[MemoryStyle | bool | None, BeforeValidator(_optional_style)]


class Assembly(NamedTuple):
    """A module that is made of components and has no equations of its own."""

    title: str
    """Its function in one line."""
    make: Callable[..., Any]
    """Function of the configuration that makes its component, for a ``Top``."""


class Config(BaseModel):
    """Base of the configurations: a name, a description, a rate, the operators of the engine, its channels, the kinds
    of its memories, when it starts again, and a clock enable.

    A subclass adds its fields and says in ``systems`` which modules it configures.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)

    name: str = Field(pattern="^[a-z][a-z0-9_]*$", description="name of the configuration, and of its output folder")
    description: str = Field(description="one line for people")
    sample_rate_hz: float = Field(gt=0, le=1e6, allow_inf_nan=False, description="updates per second, 1/T")
    pool: pydantic.InstanceOf[Pool] = Field(default=Pool(), description="operators of the engine")
    channels: Annotated[int, AfterValidator(_power_of_two)] = Field(
        default=1, ge=1, le=64, description="sensors that share one core, each with a separate state; a power of two")
    interval: int | None = Field(
        default=None, ge=1, le=10_000,
        description="clock cycles from one sample to the next of several channels; None: the scheduler's choice")
    operand_memory: Style = Field(
        default=None, description="kind of the operand memory: auto, distributed or block; None: as in pool")
    side_memory: OptionalStyle = Field(
        default=None, description="kind of the memories of the side buses, or none; None: as in pool")
    microcode: Style = Field(
        default=None, description="kind of the ROM: auto, distributed or block; None: as in pool")

    restart_after: int = Field(
        default=8, ge=0, le=1_000,
        description="updates, refused in a row although every input was finite, after which a core with a status port "
                    "starts again from its reset state; 0: never")

    clock_enable: bool = Field(
        default=False, description="whether the core has a clock enable, the port ce; it counts enabled cycles only")

    removed: ClassVar[dict[str, str]] = {}
    """Maps each field of an earlier release that is gone to what is set in its place."""

    @field_validator("*")
    @classmethod
    def _printable(cls, value: object) -> object:
        # Such characters end a line of a header, or cannot be seen in it.
        if isinstance(value, str) and any(unicodedata.category(char) in ("Cc", "Cs", "Zl", "Zp") for char in value):
            raise ValueError("must be one line without control characters")
        return value

    @field_validator("interval", mode="before")
    @classmethod
    def _interval(cls, value: object, info: ValidationInfo) -> object:
        if value in ("", None):
            return None
        if info.data.get("channels") == 1:
            raise ValueError("must be None (empty on a command line) where channels is 1")
        return value

    @property
    def period_s(self):
        """Sample period T in seconds."""
        return 1 / self.sample_rate_hz

    @property
    def engine_pool(self):
        """The pool of the engine: ``pool`` with the memories of this configuration, its open settings decided for the
        number of channels."""
        memories = {name: value for name in ("operand_memory", "side_memory", "microcode")
                    if (value := getattr(self, name)) is not None}
        return replace(self.pool, **memories).settled(self.channels)

    @property
    def values(self) -> dict[str, Any]:
        """All fields and the settings of the engine as plain JSON values; channels and interval only if it has several
        channels, and those of ``SELDOM`` only if they are not the defaults."""
        hidden = {"pool"} if self.channels > 1 else {"pool", "channels", "interval"}
        return {
            **{field: getattr(self, field) for field in type(self).model_fields if field not in hidden},
            **{name: value.value if isinstance(value, Enum) else value
               for name, value in self.engine_pool.parameters.items() if SELDOM.get(name, ...) is not value},
            "format": self.pool.format.name, "subnormals": self.pool.format.subnormals.value}

    @property
    def warnings(self) -> tuple[str, ...]:
        """Lines on fields that are seldom meant as they are."""
        return tuple(
            f"configuration {self.name}: {field} {','.join(getattr(self, field))} are left-handed: right only for a "
            "sensor whose own axes are" for field, info in type(self).model_fields.items()
            if _EITHER_HAND in info.metadata and _left_handed(getattr(self, field)))

    def systems(self) -> dict[str, Callable[..., System]]:
        """Maps each module name to the function that makes the module's System from this configuration.

        The last module is the main module, if there are no ``assemblies``. It has all the functions of the
        configuration.
        """
        raise NotImplementedError

    def assemblies(self) -> dict[str, Assembly]:
        """Maps the name of each further module, which has no equations of its own, to its Assembly.

        They follow the Systems. If there are any, the last one is the main module.
        """
        return {}

    def constant_inputs(self) -> dict[str, float]:
        """Values, for a replay, of the main module's inputs that are not sensors, by the kernel's names."""
        return {}

    def replace(self, **changes):
        """This configuration with some fields changed.

        Parameters of the pool are fields, too, by their names in ``Pool.parameters``, as in ``adders=2``; see
        ``Pool.with_parameters``. Values may be strings, as they come from a command line: a tuple as comma-separated
        names, an interval of None as the empty string. Raises: ConfigError.
        """
        known = self.pool.known_parameters
        if names := [name for name in changes if name in known and name not in type(self).model_fields]:
            pool = changes.get("pool", self.pool)
            changed = self._changed_pool(pool, {name: changes.pop(name) for name in names})
            changes |= {"pool": changed}
        try:
            # Without the fields that follow from others.
            return type(self)(**({name: getattr(self, name) for name in self.model_fields_set} | changes))
        except pydantic.ValidationError as error:
            raise ConfigError(_one_line(self, error)) from None

    def _changed_pool(self, pool, values):
        """A pool with other values of parameters. Raises: ConfigError."""
        typed = {}
        for name, value in values.items():
            owner, parameter = pool.known_parameters[name]
            try:
                typed[name] = pydantic.TypeAdapter(get_type_hints(owner)[parameter.name]).validate_python(value)
            except pydantic.ValidationError as error:
                meaning = error.errors()[0]["msg"].removeprefix("Input should be ")
                raise ConfigError(f"configuration {self.name}: {name} must be {meaning}, not {value!r}") from None
        try:
            return pool.with_parameters(**typed)
        except (TypeError, ValueError) as error:
            raise ConfigError(f"configuration {self.name}: {error}") from None


class TunableConfig(Config):
    """Base of the configurations with parameters that can be inputs at run time."""

    tunable: ClassVar[tuple[str, ...]]
    """Fields that can be inputs."""

    inputs: Names = Field(default=(), description="parameters that are inputs at run time instead of constants")

    @field_validator("inputs")
    @classmethod
    def _tunable(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        if gone := [name for name in names if name in cls.removed]:
            raise ValueError(f"must not name {gone[0]}, which was removed: use {cls.removed[gone[0]]}")
        if unknown := [name for name in names if name not in cls.tunable]:
            raise ValueError(f"must name parameters of the filter ({unknown[0]} is unknown)")
        if twice := [name for name in names if names.count(name) > 1]:
            raise ValueError(f"must name each parameter once ({twice[0]} stands twice)")
        return names

    def constant_inputs(self) -> dict[str, float]:
        """The parameters that are inputs."""
        return {name: getattr(self, name) for name in self.inputs}

    @property
    def input_meanings(self) -> dict[str, str]:
        """Maps the parameters that are inputs to their meanings."""
        return {name: type(self).model_fields[name].description or "" for name in self.inputs}


def _one_line(config, error):
    """The first error of a ValidationError as one line."""
    first = error.errors()[0]
    where = ".".join(str(part) for part in first["loc"][:1])
    if first["type"] == "extra_forbidden" and where in type(config).removed:
        return f"configuration {config.name}: {where} was removed: use {type(config).removed[where]}"
    if first["type"] == "extra_forbidden":
        fields = ", ".join(field for field in type(config).model_fields if field != "pool")
        return (f"configuration {config.name} has no field {where!r}: choose from {fields}; of its pool: "
                f"{', '.join(name for name in config.pool.parameters if name not in type(config).model_fields)}")
    message = first["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
    if not where:
        return f"configuration {config.name}: {message}"
    if not message.startswith("must"):
        message = f"must be {message}"
    return f"configuration {config.name}: {where} {message}, not {first['input']!r}"
