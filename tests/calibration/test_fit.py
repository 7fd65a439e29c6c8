"""Geometry and noise out of where runs ended."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrl_driver.apps.calibration import fit, geometry_procedures, umbmark
from mrl_driver.apps.calibration.trial import Trial, errors, spread
from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose, advance
from mrl_driver.robot.covariance import Uncertainty, error_squared
from mrl_driver.robot.models import Noise, load

from . import paths

TRAXBOT = load("traxbot")
BELIEVED = TRAXBOT.drive
NOISE = Noise(2e-5, 1e-4)
SAME_M = 0.0005

true_drives = st.builds(
    lambda offset, slip, scale: BELIEVED._replace(
        wheel_offset=offset, turn_slip=slip, metres_per_count=BELIEVED.metres_per_count * scale
    ),
    st.floats(-0.02, 0.02),
    st.floats(0.0, 0.15),
    st.floats(0.97, 1.03),
)


def laps(true, each=2, noise=None, rng=None):
    return [
        paths.driven(paths.square(left=left), BELIEVED, true, noise, rng)
        for left in (True, False)
        for _ in range(each)
    ]


@settings(max_examples=8, deadline=None)
@given(true_drives)
def test_square_and_straight_runs_give_the_true_drive(true):
    """Whatever wheels and slip, a perfect square of the believed drive tells them."""
    straight = [paths.driven(paths.straight(2.0), BELIEVED, true) for _ in range(2)]
    runs = straight + laps(true)
    found = fit.fit(runs, BELIEVED, [fit.SCALE, fit.OFFSET, fit.SLIP], TRAXBOT.noise)
    assert found.drive == pytest.approx(true, rel=1e-4, abs=1e-4)
    assert np.abs(errors(found.drive, runs)).max() < SAME_M


def test_umbmark_tells_unequal_wheels_from_a_wrong_wheelbase():
    ratio, slip = 1.005, 0.01
    true = BELIEVED._replace(wheel_offset=2 * (ratio - 1) / (ratio + 1), turn_slip=slip)
    runs = laps(true)
    points = [tuple(row[:2]) for row in errors(BELIEVED, runs).tolist()]
    found = umbmark.evaluate(points[:2], points[2:], 1.0, BELIEVED.wheel_separation_m)
    assert found.wheel_ratio == pytest.approx(ratio, abs=2e-4)
    assert found.wheelbase_ratio == pytest.approx(1 / (1 - slip), abs=1e-3)
    assert umbmark.corrected(BELIEVED, found, True) == pytest.approx(true, abs=1e-3)
    assert umbmark.corrected(BELIEVED, found, False).wheel_separation_m == pytest.approx(
        BELIEVED.wheel_separation_m / (1 - slip), rel=1e-3
    )


def test_an_end_measured_wrong_is_named_with_what_drives_it_again():
    runs = laps(BELIEVED._replace(turn_slip=0.05), 3)
    runs[4] = Trial(runs[4].steps, runs[4].end._replace(x_m=runs[4].end.x_m + 0.3))
    with pytest.raises(ConfigError, match="--again 5$"):
        geometry_procedures.evaluate(geometry_procedures.UMBMARK, runs, TRAXBOT)


def test_spread_of_a_whole_run_is_that_of_its_steps():
    """The matrix form for recordings and the step by step form for the bridge are one."""
    steps = paths.counts(paths.square() + paths.turn(-2.0) + paths.straight(-0.4), BELIEVED)
    carried, pose = Uncertainty(TRAXBOT._replace(noise=NOISE), (0.0,) * 6), Pose(0, 0, 0)
    for right_m, left_m in (steps * BELIEVED.metres_per_count).tolist():
        before, turn = pose, (right_m - left_m) / BELIEVED.wheel_separation_m
        pose = advance(before, (right_m + left_m) / 2, turn)
        carried.update(before, pose, (right_m, left_m), turn)
    whole = spread(BELIEVED, steps, NOISE)
    assert carried.spread == pytest.approx(tuple(whole[np.triu_indices(3)]), rel=2e-3, abs=1e-7)


def test_noise_comes_out_of_the_runs_and_the_errors_of_a_hundred_others_agree_with_it():
    """Normalised error squared of 100 drives: its mean lies in its 95 % bounds, chi2 of 300 over 100."""
    rng = np.random.default_rng(4)
    true = BELIEVED._replace(turn_slip=0.1)
    kinds = [paths.straight(2.0), paths.turn(6.0), paths.turn(-6.0), paths.square(), paths.square(left=False)]
    runs = [paths.driven(moves, BELIEVED, true, NOISE, rng) for moves in kinds for _ in range(12)]
    found = fit.fit(runs, BELIEVED, [fit.OFFSET, fit.SLIP], TRAXBOT.noise)
    noise = fit.estimate_noise(runs, found, 2, fit.BY_TRUTH)
    yaw = [spread(true, runs[-1].steps, each)[2, 2] for each in (noise, NOISE)]
    assert yaw[0] == pytest.approx(yaw[1], rel=0.2)
    squared = []
    for i in range(100):
        moves = paths.straight(0.8) + paths.turn(1.0 + i % 3) + paths.straight(0.7) + paths.turn(-2.0)
        steps = paths.counts(moves, found.drive)
        run = Trial(steps, paths.end(steps, true, NOISE, rng))
        cover = spread(found.drive, steps, noise)
        squared.append(error_squared(tuple(cover[np.triu_indices(3)]), *errors(found.drive, [run])[0]))
    assert 2.54 < np.mean(squared) < 3.50


def test_a_calibration_writes_how_sure_it_is_of_what_it_measured():
    runs = [paths.driven(paths.straight(2.0 * sign), BELIEVED, BELIEVED) for sign in (1, -1)]
    outcome = geometry_procedures.evaluate(geometry_procedures.STRAIGHT, runs, TRAXBOT)
    values = geometry_procedures.values_for(TRAXBOT, outcome)
    written = {name: value for (section, name), value in values.items() if section == "noise"}
    assert written == {"distance_scale_sd": fit.LEAST_SCALE_SD, "wheel_ratio_sd": fit.LEAST_SCALE_SD}
