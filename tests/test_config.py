import pytest
from pydantic import ValidationError

from strapdown.config import CONFIGS, MAHONY, THESIS, ConfigError


def test_thesis_has_the_constants_of_the_thesis():
    assert THESIS.period_s == 0.002
    assert THESIS.kp == 10
    assert THESIS.ki * THESIS.period_s == 0.001
    assert THESIS.magnetometer_axes == ("+y", "-x", "+z")


def test_mahony_has_identity_axes_and_no_integral():
    assert (MAHONY.kp, MAHONY.ki, MAHONY.magnetometer_axes) == (0.5, 0, ("+x", "+y", "+z"))


def test_configurations_go_by_their_names():
    assert all(config.name == name for name, config in CONFIGS.items())


def test_configurations_are_frozen():
    with pytest.raises(ValidationError, match="frozen"):
        THESIS.kp = 1


def test_replace_takes_values_and_strings():
    changed = THESIS.replace(kp="2.5", magnetometer_axes="-z,+x,-y", sample_rate_hz=256)
    assert (changed.kp, changed.magnetometer_axes, changed.sample_rate_hz) == (2.5, ("-z", "+x", "-y"), 256)
    assert THESIS.kp == 10


@pytest.mark.parametrize(("change", "message"), [
    ({"kp": -1}, "configuration thesis: kp must be greater than or equal to 0, not -1"),
    ({"kp": "fast"}, "configuration thesis: kp must be a valid number, unable to parse string as a number, not 'fast'"),
    ({"ki": float("nan")}, "configuration thesis: ki must be a finite number, not nan"),
    ({"sample_rate_hz": 0}, "configuration thesis: sample_rate_hz must be greater than 0, not 0"),
    ({"sample_rate_hz": 1e9}, "configuration thesis: sample_rate_hz must be less than or equal to 1000000, "
                              "not 1000000000.0"),
    ({"magnetometer_axes": "+x,+x,+z"}, "configuration thesis: magnetometer_axes must name each sensor axis once, "
                                        "with its sign, as in +y,-x,+z, not ('+x', '+x', '+z')"),
    ({"magnetometer_axes": "x,y,z"}, "configuration thesis: magnetometer_axes must name each sensor axis once, "
                                     "with its sign, as in +y,-x,+z, not ('x', 'y', 'z')"),
    ({"gain": 1}, "configuration thesis has no field 'gain': choose from name, description, sample_rate_hz, kp, ki, "
                  "magnetometer_axes"),
])
def test_errors_are_one_line(change, message):
    with pytest.raises(ConfigError) as error:
        THESIS.replace(**change)
    assert str(error.value) == message
