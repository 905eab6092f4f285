"""The example of docs/calibration.md: the line of a calibration brings the heading of the flight filter back."""

import numpy as np
import pytest

from strapdown_lab import docs
from strapdown_lab.checkout import block
from strapdown_lab.studies import calibration
from strapdown_sim.magnetometer import field_facts, field_rows

pytest.importorskip("scipy", reason="scipy is not installed, so nothing can be fitted.")


def test_tables(root):
    text = (root / "docs" / "calibration.md").read_text(encoding="utf-8")
    for name, content in docs.calibration_blocks().items():
        assert block(text, name)[1].strip() == content, name


def test_the_line_brings_the_heading_back():
    """A clean field, errors, and errors with the fields that were printed for them."""
    (clean, _), (wrong, _), (back, _) = calibration.heading_errors_deg().values()
    assert wrong > 5
    # Hard iron known to 0.03 µT of a horizontal field of 20 µT, soft iron to 0.001 of 48 µT: 0.16 degrees.
    assert back == pytest.approx(clean, abs=0.16)


def test_only_the_errors_are_told():
    (_, clean), (_, wrong), (_, back) = calibration.heading_errors_deg().values()
    assert max(clean, back) < 0.3
    assert wrong > 10
    assert field_rows(field_facts(calibration.example().wrong), "turns.csv")


def test_fields_are_the_errors():
    fields = calibration.example().calibration.fields
    for own, bias, matrix in (
            (fields["magnetometer"], calibration.HARD_IRON, calibration.SOFT_IRON),
            (fields["accelerometer"], calibration.ACCELEROMETER_BIAS, calibration.ACCELEROMETER_MATRIX)):
        np.testing.assert_array_less(np.abs(own.bias - bias), 6 * own.bias_deviation)
        np.testing.assert_array_less(np.abs(own.matrix - matrix), 6 * own.matrix_deviation)
    gyro = fields["gyro"]
    np.testing.assert_array_less(np.abs(gyro.bias - calibration.GYRO_BIAS), 5 * gyro.bias_deviation)
