"""Real recordings through the strapdown navigator: twin against reference, both against the recorded track."""

import numpy as np
import pytest

from strapdown.algorithms.sins import WGS84
from strapdown_lab.studies.inertial import Run, car_leg, quadrotor_legs, run_reference, run_twin, track_errors

GRAVITY = WGS84.gravity
CAR, QUADROTORS = "ins_drive_first_half", ("ins_quad_horizontal_11", "ins_quad_vertical_17")


@pytest.fixture(scope="module", params=[CAR, *QUADROTORS])
def legs(request, shared_recordings):
    """Name of a recording, its first legs, and the twin's run."""
    path = shared_recordings / f"{request.param}.npz"
    leg = car_leg(path, 15) if request.param == CAR else quadrotor_legs(path, 5)
    return request.param, leg, run_twin(leg)


def distance(leg, run):
    """The longest way that a run believes it has gone, m."""
    return (np.linalg.norm(run.velocity_m_s, axis=-1) * leg.period_s).sum(axis=0).max()


def test_twin_drifts_as_the_float64_reference(legs):
    _, leg, run = legs
    reference = run_reference(leg)
    count, time_s = len(leg.omega_b), len(leg.omega_b) * leg.period_s
    # The kernel leaves out 3e-8 of the ellipsoid's curvature, twice with (h/R)²: a part of the way. In every update
    # each of them rounds position, and attitude, whose tilt becomes g·t²/2; some two roundings on each side.
    bound = 6e-8 * distance(leg, run) + 4 * count * 2.0**-53 * (WGS84.radius + GRAVITY * time_s**2 / 2)
    assert np.abs(run.position_m - reference.position_m).max() <= bound
    # What matters here is that it is little beside the drift itself.
    assert bound < 1e-4 * track_errors(leg, run)[-1].max()


def test_first_seconds_are_the_recorded_track(legs):
    name, leg, run = legs
    error, time_s = track_errors(leg, run), (leg.sample * leg.period_s)[:, None]
    first = leg.sample * leg.period_s <= 5
    if name == CAR:
        # From rest. RTK is good to 1 cm, at both ends; course, that is heading, to 0.06 m/s of the 2 m/s from which on
        # it is told; the accelerometer has a scale error of 1.3 %, known along the vertical only.
        way = np.linalg.norm(leg.position_m.swapaxes(0, 1), axis=-1)
        bound = 0.02 + 0.03 * way + 0.013 * GRAVITY * time_s**2 / 2
        assert (error[first] <= bound[first, :, None]).all()
    else:
        # The start's attitude is good to 1 degree, and so is the accelerometer: it vibrates at 5 m/s², and its mean
        # over a flight is 0.3 m/s² off the vertical. Position to 0.1 m; clocks to 0.05 s, at up to 4 m/s². Of the
        # vertical, in steps of 0.1 m, a speed is not known well enough.
        bound = 0.1 + 0.05 * 4 * time_s + 2 * np.radians(1) * GRAVITY * time_s**2 / 2
        assert (error[first, :, 0] <= bound[first]).all()
    # A navigator that stood still, or went on in a straight line, would be off by more.
    still = track_errors(leg, Run(np.zeros_like(run.position_m), run.velocity_m_s))
    assert (error[first][-1, :, 0] < still[first][-1, :, 0]).mean() > 0.5
