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
    """The longest computed distance of all runs, m."""
    return (np.linalg.norm(run.velocity_m_s, axis=-1) * leg.period_s).sum(axis=0).max()


def test_twin_drifts_as_the_float64_reference(legs):
    _, leg, run = legs
    reference = run_reference(leg)
    count, time_s = len(leg.omega_b), len(leg.omega_b) * leg.period_s
    # The kernel omits 3e-8 of the ellipsoid's curvature, twice with (h/R)²: a fraction of the distance. In every update
    # twin and reference each round position and attitude, whose tilt becomes g·t²/2; about two roundings on each side.
    bound = 6e-8 * distance(leg, run) + 4 * count * 2.0**-53 * (WGS84.radius + GRAVITY * time_s**2 / 2)
    assert np.abs(run.position_m - reference.position_m).max() <= bound
    # It must be small compared with the drift itself.
    assert bound < 1e-4 * track_errors(leg, run)[-1].max()


def test_first_seconds_are_the_recorded_track(legs):
    name, leg, run = legs
    error, time_s = track_errors(leg, run), (leg.sample * leg.period_s)[:, None]
    first = leg.sample * leg.period_s <= 5
    if name == CAR:
        # From rest. The accuracy of RTK is 1 cm, at both ends. That of course, which gives the heading, is 0.06 m/s at
        # the 2 m/s above which it is used. The accelerometer has a scale error of 1.3 %, known only along the vertical.
        way = np.linalg.norm(leg.position_m.swapaxes(0, 1), axis=-1)
        bound = 0.02 + 0.03 * way + 0.013 * GRAVITY * time_s**2 / 2
        assert (error[first] <= bound[first, :, None]).all()
    else:
        # The accuracy of the start attitude is 1 degree, and that of the accelerometer is similar: it vibrates at
        # 5 m/s², and its mean over a flight differs by 0.3 m/s² from the vertical. The accuracy of position is 0.1 m,
        # that of the clocks 0.05 s, at up to 4 m/s². The height has steps of 0.1 m, so the vertical speed is not known
        # well enough.
        bound = 0.1 + 0.05 * 4 * time_s + 2 * np.radians(1) * GRAVITY * time_s**2 / 2
        assert (error[first, :, 0] <= bound[first]).all()
    # A navigator that did not move, or moved in a straight line, would have a larger error.
    still = track_errors(leg, Run(np.zeros_like(run.position_m), run.velocity_m_s))
    assert (error[first][-1, :, 0] < still[first][-1, :, 0]).mean() > 0.5
