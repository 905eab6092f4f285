"""Images of the line cameras: each error has the size that was asked for."""

import numpy as np
import pytest

from strapdown_sim.instrument.image import FULL_SCALE, LineCamera

QUIET = {"shot_electrons": 0.0, "read_counts": 0.0}


def moment(line, order=1, base=100.0):
    weight = line - base
    centre = (np.arange(len(line)) * weight).sum() / weight.sum()
    return centre if order == 1 else (weight * (np.arange(len(line)) - centre) ** 2).sum() / weight.sum()


def test_line_has_its_place_width_and_peak():
    camera = LineCamera(512, **QUIET)
    line = camera.charge(200.25).astype(float)
    assert line.dtype == float
    assert moment(line) == pytest.approx(200.25, abs=2e-3)
    assert moment(line, 2) == pytest.approx(64, rel=2e-3)
    assert line.max() == pytest.approx(100 + 0.7 * FULL_SCALE, abs=2)


def test_counts_have_twelve_bits_and_follow_the_exposure():
    camera = LineCamera(256, **QUIET)
    lines = camera.charge([100, 100, 100], [5e-5, 1e-4, 1e-3])
    assert (lines.shape, lines.dtype) == ((3, 256), np.uint16)
    assert 2 * (lines[0, 100] - 100) == pytest.approx(lines[1, 100] - 100, abs=2)
    assert lines[2].max() == FULL_SCALE
    assert np.count_nonzero(lines[2] == FULL_SCALE) > 20


def test_equal_seeds_give_equal_lines_and_blocks_equal_single_lines():
    options = {"prnu": 0.02, "fringes": 0.03, "lag": 0.01, "transfer": 0.95, "seed": 7}
    together = LineCamera(256, **options).charge([100, 120, 90])
    np.testing.assert_array_equal(together, LineCamera(256, **options).charge([100, 120, 90]))
    assert (together != LineCamera(256, **(options | {"seed": 8})).charge([100, 120, 90])).any()
    quiet = options | QUIET
    one_by_one = LineCamera(256, **quiet)
    np.testing.assert_array_equal([one_by_one.charge(p) for p in (100, 120, 90)],
                                  LineCamera(256, **quiet).charge([100, 120, 90]))


def test_read_noise_and_shot_noise():
    dark = LineCamera(4096, laser=False, shot_electrons=0.0).charge(0).astype(float)
    assert dark.std() == pytest.approx(4.0, rel=0.06)
    bright = LineCamera(4096, laser=False, ambient=0.5, read_counts=0.0).charge(0).astype(float)
    assert bright.std() == pytest.approx(FULL_SCALE * np.sqrt(0.5 / 50_000), rel=0.06)


def test_fixed_pattern():
    plain = LineCamera(4096, laser=False, ambient=0.5, **QUIET).charge(0).astype(float)
    for name in "prnu", "fringes":
        lines = LineCamera(4096, laser=False, ambient=0.5, **QUIET, **{name: 0.02}).charge([0, 0])
        np.testing.assert_array_equal(lines[0], lines[1])
        pattern = (lines[0] - 100.0) / (plain - 100) - 1
        assert pattern.std() == pytest.approx(0.02, rel=0.05)
        # Fringes of 6 px are alike one pixel further; pixels' sensitivities are not.
        alike = np.corrcoef(pattern[1:], pattern[:-1])[0, 1]
        assert (alike > 0.98) == (name == "fringes")


def test_background_ghost_and_laser_off():
    line = LineCamera(1001, laser=False, ambient=0.1, gradient=0.2, **QUIET).charge(0).astype(float)
    np.testing.assert_allclose((line[[0, 500, -1]] - 100) / FULL_SCALE, [0.1, 0.2, 0.3], atol=2e-4)
    ghost = LineCamera(512, ghost=0.2, ghost_px=150, **QUIET).charge(200).astype(float)
    assert ghost[350] - 100 == pytest.approx(0.2 * (ghost[200] - 100), abs=1)
    assert LineCamera(512, laser=False, **QUIET).charge(200).max() == 100


def test_lag_transfer_and_smear():
    lagging = LineCamera(512, lag=0.01, **QUIET).charge([100, 400]).astype(float)
    assert lagging[1, 100] - 100 == pytest.approx(0.01 * (lagging[0, 100] - 100), abs=1)
    late = LineCamera(512, transfer=0.95, **QUIET)
    # The loss at pixel j is 5 % of j/511, and moves the charge by one pixel.
    assert moment(late.charge(400).astype(float)) - 400 == pytest.approx(0.05 * 400 / 511, abs=3e-3)
    smeared = LineCamera(512, smear=1e-3, **QUIET).charge(200).astype(float)
    assert smeared[100] == 100
    assert smeared[400] - 100 == pytest.approx(1e-3 * 0.7 * FULL_SCALE * 8 * np.sqrt(2 * np.pi), abs=1)


def test_charge_is_clipped_at_full_scale():
    assert set(LineCamera(64, laser=False, ambient=2.0, offset=-1000.0, **QUIET).charge(0)) == {FULL_SCALE - 1000}
