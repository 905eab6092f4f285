"""The command line's `design quaternion`."""

import re

import pytest
from click.testing import CliRunner

from strapdown.cli import main
from strapdown.design import minimax

TURN = "--rate-max 2000 --period 0.002"


@pytest.fixture
def run(tmp_path):
    """Function of a line of options that returns exit status and output."""
    def invoke(options):
        result = CliRunner().invoke(
            main, ["design", "quaternion", *options.split(), "--output", str(tmp_path / "errors.png")])
        return result.exit_code, result.output
    return invoke


def test_coefficients_and_picture(run, tmp_path):
    status, output = run(f"{TURN} --order 3")
    assert status == 0
    coefficients = minimax(3, 0.06981317007977318)
    printed = {key: float(value) for key, value in re.findall(r"([ad]0\[\d\]) = (\S+)", output)}
    assert printed == {f"{name}[{i}]": value for name in ("a0", "d0")
                       for i, value in enumerate(getattr(coefficients, name))}
    assert (tmp_path / "errors.png").read_bytes().startswith(b"\x89PNG")


def test_the_least_order_for_a_wanted_drift(run):
    # Order 2 drifts by 5e-7 deg/h at 2,000 deg/s: tests/design/test_quaternion.py checks the error behind it.
    assert "order 2, minimax" in run(f"{TURN} --error 1e-6")[1]
    assert "order 3, minimax" in run(f"{TURN} --error 1e-8")[1]


@pytest.mark.parametrize(("options", "message"), [
    (f"{TURN} --order 1", "order must be from 2 to 8, not 1"),
    ("--rate-max 2000 --period 1", "largest angle of one update must be above 0 and at most 3 rad, not 34.9066 rad"),
    (f"{TURN} --order 2 --error 1", "--order and --error exclude each other"),
    (f"{TURN} --error 1e-30", "no order up to 8"),
])
def test_mistakes_end_in_one_line(run, options, message):
    status, output = run(options)
    assert status == 2
    assert message in output
    assert len(output.strip().splitlines()) == 1
