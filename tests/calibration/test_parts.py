"""Sonar curve, gains, wires, and where a run ended: the pure parts."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrl_driver.apps.calibration import fit, gains, geometry_procedures, wiring_check
from mrl_driver.apps.calibration.gains import BridgeGains, DutyStep, Motor
from mrl_driver.apps.calibration.ground_truth import Truth, parse_pose, truth_file
from mrl_driver.apps.calibration.trial import Trial, errors, path, spread
from mrl_driver.apps.calibration.wiring_check import LEFT, RIGHT, diagnose, seen_in
from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose, advance
from mrl_driver.robot import sonar_curve
from mrl_driver.robot.covariance import Uncertainty
from mrl_driver.robot.kinematics import Planar, kinematics_of
from mrl_driver.robot.models import Noise, load
from mrl_driver.robot.models.drives import metres_per_count
from mrl_driver.robot.odometry import FourWheels
from mrl_driver.robot.sonar_curve import THESIS, Curve
from tests.consistency import error_squared
from tests.models import four_wheels

from . import paths

DISTANCES_M = np.arange(0.20, 2.001, 0.05)
NOISE_M, MOST_ERROR_M, LEAST_R2 = 0.01, 0.01, 0.999


def readings(curve, rng, each=3, noise_m=NOISE_M):
    truth = np.repeat(DISTANCES_M, each)
    return np.round(curve.counts(truth + rng.normal(0, noise_m, len(truth)))), truth


@settings(max_examples=25, deadline=None)
@given(st.floats(0.9, 1.5), st.floats(0.9, 1.03), st.floats(-2.0, 2.0))
def test_curve_of_noisy_readings_is_within_a_centimetre(a, b, c):
    """1 cm of noise, whole counts, three readings at each distance from 20 to 200 cm; as a rule: noise has no bound."""
    true, worst_m = Curve(a, b, c), []
    for seed in range(5):
        counts, truth = readings(true, np.random.default_rng(seed))
        found = sonar_curve.fit(counts, truth)
        assert found.r2 >= LEAST_R2
        errors_m = found.curve.on_wire().range_m(true.counts(DISTANCES_M)) - DISTANCES_M
        worst_m.append(np.abs(errors_m).max())
    assert np.median(worst_m) < MOST_ERROR_M


def test_readings_that_missed_the_wall_are_left_out():
    counts, truth = readings(THESIS, np.random.default_rng(1), noise_m=0.0)
    counts[[5, 40]] = [400.0, np.nan]
    found = sonar_curve.fit(counts, truth)
    assert list(np.flatnonzero(~found.used)) == [5, 40]
    assert found.curve == pytest.approx(THESIS, abs=0.2)


def test_a_missing_wall_is_named_with_its_distance():
    counts, truth = readings(THESIS, np.random.default_rng(1))
    counts[truth > 1.72] = np.nan
    words = r"missed the wall 18 of 111 times, always at 1.75, 1.80, 1.85, 1.90 m"
    with pytest.raises(ConfigError, match=words):
        sonar_curve.fit(counts, truth)


@pytest.mark.parametrize(
    "damage",
    [
        lambda counts, rng: np.full(len(counts), 80.0),
        lambda counts, rng: 80.0 + rng.integers(-1, 2, len(counts)),
        lambda counts, rng: counts[::-1],
    ],
    ids=["constant", "wheels that spin", "rising towards the wall"],
)
@pytest.mark.filterwarnings("error")
def test_readings_that_do_not_follow_the_distances_give_no_curve(damage):
    rng = np.random.default_rng(1)
    counts, truth = readings(THESIS, rng)
    with pytest.raises(
        ConfigError, match=r"R2 -?[01]\.\d+, expected at least 0\.95: see that the robot drives"
    ):
        sonar_curve.fit(damage(counts, rng), truth)


def test_a_curve_that_the_board_cannot_store_is_refused():
    """The least squares need a = 3.94; the board stores at most 3.2767."""
    counts = np.round(Curve(3.1455, 1.3271, 0.7707).counts(DISTANCES_M))
    with pytest.raises(ConfigError, match=r"cannot store the curve 3\.9\d+ s\^.* such as 3\.2767 s\^"):
        sonar_curve.fit(counts, DISTANCES_M)


@settings(max_examples=15, deadline=None)
@given(st.floats(3000, 20000), st.floats(0.03, 0.4), st.floats(0.0, 0.1))
def test_a_motor_is_found_in_its_step(full, tau, delay):
    times = np.arange(0, 1.5, 0.02)
    since = np.maximum(0, times - delay)
    way = np.floor(0.4 * full * (since - tau * (1 - np.exp(-since / tau))))
    found = gains.identify(DutyStep(0.4, times, way))
    assert found.full_counts_s == pytest.approx(full, rel=0.03)
    assert found.time_constant_s + found.delay_s == pytest.approx(tau + delay, abs=0.03)


@pytest.mark.parametrize("tau", [0.05, 0.2])
def test_suggested_gains_reach_the_speed_without_much_overshoot(tau):
    plants = (Motor(0.0, 12000.0, tau, 0.02), Motor(0.0, 9000.0, 1.2 * tau, 0.02))
    speed = gains.simulate(plants, np.array([gains.suggest(plants)]), 0.4, 0.05)[0]
    assert speed.max() < 1 + gains.OVERSHOOT
    assert np.abs(speed[:, 20:] - 1).max() < 0.02


@pytest.mark.parametrize(
    "left, right, finding",
    [
        ((0, 900, LEFT, 1), (900, 0, RIGHT, 1), None),
        ((0, 900, RIGHT, 1), (900, 0, LEFT, 1), "motors swapped"),
        ((900, 0, LEFT, 1), (0, 900, RIGHT, 1), "encoders swapped"),
        ((0, -900, LEFT, 1), (900, 0, RIGHT, 1), "left encoder reversed"),
        ((0, -900, LEFT, -1), (900, 0, RIGHT, 1), "left motor runs backward"),
        ((0, 0, LEFT, 1), (900, 0, RIGHT, 1), "left encoder does not count"),
        ((0, 0, LEFT, 0), (900, 0, RIGHT, 1), "left motor does not turn"),
        ((0, 0), (0, 0), "no wheel moved"),
        ((900, 0), (0, 900), "encoders or motors swapped"),
        ((0, 900), (-900, 0), "right encoder or motors reversed"),
    ],
)
def test_wires_are_told_from_what_turned_and_what_counted(left, right, finding):
    trials = [
        wiring_check.Trial(motor, {LEFT: left, RIGHT: right}, *seen)
        for motor, (right, left, *seen) in ((LEFT, left), (RIGHT, right))
    ]
    found = diagnose(trials)
    assert (found == []) if finding is None else any(line.startswith(finding) for line in found)


@pytest.mark.parametrize(
    "x_m, yaw_rad, seen",
    [
        (0.05, -0.5, (LEFT, 1)),
        (0.05, 0.5, (RIGHT, 1)),
        (-0.05, 0.5, (LEFT, -1)),
        (-0.05, -0.5, (RIGHT, -1)),
        (0, 0, (LEFT, 0)),
    ],
)
def test_the_wheel_that_turned_is_seen_in_the_true_pose(x_m, yaw_rad, seen):
    assert seen_in(x_m, yaw_rad) == seen


ROW = '{"t": 1.0, "x": %s, "y": 0.5, "yaw": 1.5}\n'


@pytest.mark.parametrize(
    ("text", "pose"),
    [
        ("0.012 -0.034 1.5", (0.012, -0.034, math.radians(1.5))),
        ("1,2", (1.0, 2.0, None)),
        (" 1, 2, 350", (1.0, 2.0, math.radians(-10))),
    ],
)
def test_what_people_type(text, pose):
    found = parse_pose(text)
    assert found[:2] == pose[:2]
    assert math.isnan(found.yaw_rad) if pose[2] is None else found.yaw_rad == pytest.approx(pose[2])


@pytest.mark.parametrize("text", ["", "1", "1 2 3 4", "one two", "nan 0", "inf 0", "201 3"])
def test_what_is_not_a_place(text):
    words = "expected x and y in metres, not centimetres" if text == "201 3" else "expected x y"
    with pytest.raises(ConfigError, match=words):
        parse_pose(text)


def test_the_newest_whole_pose_counts(tmp_path):
    """The emulator may be in the middle of a line."""
    file = tmp_path / "truth.jsonl"
    file.write_text("".join(ROW % x for x in range(200)) + '{"t": 2.0, "x": 7')
    assert truth_file(str(file))() == Pose(199.0, 0.5, 1.5)


def test_a_truth_is_measured_from_where_the_run_began(tmp_path):
    file = tmp_path / "truth.jsonl"
    file.write_text(ROW % 1.0)
    ruler = Truth(truth_file(str(file)))
    ruler.begin("run 1")
    file.write_text(ROW % 1.5)
    x_m, y_m, yaw_rad = ruler.end("run 1", lambda pose: None)
    assert (x_m, y_m, yaw_rad) == pytest.approx((0.5 * math.cos(1.5), -0.5 * math.sin(1.5), 0.0))


@pytest.mark.parametrize(
    "text", [None, "", "\n", "x\n", "[1, 2]\n", '{"x": 1}\n', '{"x": null, "y": 0, "yaw": 0}\n']
)
def test_a_file_without_a_pose_is_refused(tmp_path, text):
    file, words = tmp_path / "truth.jsonl", "expected a pose as JSON"
    if text is None:
        words = "does not exist, expected the file that mrl-sim --truth writes"
    else:
        file.write_text(text)
    with pytest.raises(ConfigError, match=words):
        truth_file(str(file))()


DUTIES = (0.3, 0.5, 0.8)
COUNTS_A_TURN = 1496.0
MOST_SHARE, MOST_TAU_SHARE = 0.005, 0.03
"""Largest errors of the fit: gain, full speed and dead band; time constant."""


def travelled(times_s, speed_counts_s, tau_s, delay_s):
    since = np.maximum(0.0, times_s - delay_s)
    return speed_counts_s * (since + tau_s * np.expm1(-since / tau_s))


def steps_of(motor, rng, duties=DUTIES):
    """Steps of 1 s, read every 20 ms with a jitter of 0.5 ms, in whole counts; the host is up to 10 ms late."""
    made = []
    for duty in duties:
        times_s = np.arange(0, 1, 0.02) + rng.normal(0, 5e-4, 50)
        speed = max(0.0, motor.gain_counts_s * (duty - motor.dead_band))
        exact = travelled(times_s, speed, motor.time_constant_s, motor.delay_s + rng.uniform(0, 0.01))
        made.append(DutyStep(duty, times_s, np.floor(exact + rng.uniform())))
    return made


def some_motor(rng):
    return Motor(
        rng.uniform(0, 0.2), rng.uniform(2000, 12000), rng.uniform(0.02, 0.2), rng.uniform(0, 0.03), 0.0
    )


@pytest.mark.parametrize("seed", range(20))
def test_a_motor_is_found_in_its_noisy_steps(seed):
    rng = np.random.default_rng(seed)
    true = some_motor(rng)
    found = gains.identify_bridge(steps_of(true, rng))
    assert found.full_counts_s == pytest.approx(true.full_counts_s, rel=MOST_SHARE)
    assert found.dead_band == pytest.approx(true.dead_band, abs=MOST_SHARE)
    assert found.time_constant_s == pytest.approx(true.time_constant_s, rel=MOST_TAU_SHARE)
    assert found.off_line < MOST_SHARE


def test_a_curve_is_told_from_a_line_and_full_speed_is_found():
    """A bridge that lets the motor coast between pulses: speed is a - b / duty; at full duty 5400 count/s."""
    rng = np.random.default_rng(3)
    steps = [
        steps_of(Motor(0.0, 6000 * (1 - 0.1 / duty) / duty, 0.1, 0.0, 0.0), rng, (duty,))[0]
        for duty in DUTIES
    ]
    found = gains.identify_bridge(steps)
    assert found.off_line > gains.LINEAR_WITHIN
    assert found.full_counts_s == pytest.approx(5400, rel=0.06)


def steps_with(dead_band, rng):
    return steps_of(Motor(dead_band, 8000.0, 0.1, 0.0, 0.0), rng)


def test_a_step_in_the_dead_band_does_not_count_and_a_dead_band_is_never_negative():
    """Noise of a motor without friction may put the line's root below zero."""
    rng = np.random.default_rng(1)
    assert gains.identify_bridge(steps_with(0.4, rng)).dead_band == pytest.approx(0.4, abs=MOST_SHARE)
    steps = [
        step._replace(travel=step.travel * (1.02 if step.duty < 0.4 else 1.0))
        for step in steps_with(0.0, rng)
    ]
    assert gains.identify_bridge(steps).dead_band == 0.0


@pytest.mark.parametrize(
    "dead_band, damage, words",
    [
        (0.1, lambda step: step._replace(travel=-step.travel), "a positive number: run mrl calibrate wiring"),
        (0.6, lambda step: step, "the wheel turned at 1 of 3 duties, expected at least 2"),
    ],
    ids=["backward", "one duty only"],
)
def test_steps_that_tell_nothing_are_refused(dead_band, damage, words):
    with pytest.raises(ConfigError, match=words):
        gains.identify_bridge([damage(step) for step in steps_with(dead_band, np.random)])


def test_gains_follow_the_rule_of_lambda_tuning():
    """tau 0.12 s gives lambda 0.04 s: kp = 0.12 / (1 / 0.9 x 0.05), ki = kp / 0.12."""
    motor = Motor(0.1, 4000.0, 0.12, 0.0, 0.0)
    assert gains.design([motor], COUNTS_A_TURN) == BridgeGains(2160, 18000, 100, 144)
    with pytest.raises(ConfigError, match=r"friction_duty 550 \[0.1 %\], expected 0 to 500"):
        gains.design([Motor(0.55, 4000.0, 0.1, 0.0, 0.0)], COUNTS_A_TURN)


@pytest.mark.filterwarnings("error")
def test_a_wheel_that_does_not_turn_neither_rises_nor_settles():
    times_s = np.arange(0, 1, 0.02)
    found = gains.describe(times_s, np.zeros_like(times_s), 0.0)
    assert math.isnan(found.rise_s) and math.isnan(found.settle_s)
    assert found.offset == 1.0


def test_both_wheels_bear_the_gains():
    """Full speed is that of the slower wheel, friction the smaller one; no wheel gets more than its own gains."""
    right, left = Motor(0.10, 4000.0, 0.10, 0.0, 0.0), Motor(0.06, 5000.0, 0.15, 0.0, 0.0)
    both = gains.design([right, left], COUNTS_A_TURN)
    alone = [gains.design([motor], COUNTS_A_TURN) for motor in (right, left)]
    assert (both.full_speed, both.friction_duty) == (alone[0].full_speed, alone[1].friction_duty)
    assert both.kp <= min(one.kp for one in alone) and both.ki <= min(one.ki for one in alone)


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


@pytest.mark.parametrize("tracks", [True, False])
@pytest.mark.parametrize("share", [0.01, 0.25])
def test_umbmark_tells_unequal_wheels_from_a_wrong_wheelbase(share, tracks):
    """However wrong the believed drive is; on tracks the slip is found, on wheels the wheelbase."""
    found = {fit.SLIP: share} if tracks else {fit.AXLE: BELIEVED.wheel_separation_m / (1 - share)}
    true = BELIEVED._replace(wheel_offset=share / 5, **found)
    model = TRAXBOT._replace(drive=BELIEVED, body=TRAXBOT.body._replace(tracks=tracks))
    outcome = geometry_procedures.evaluate(geometry_procedures.UMBMARK, laps(true), model)
    assert outcome.after == pytest.approx(true, abs=1e-5)


def test_squares_of_mecanum_wheels_tell_their_slip():
    free = geometry_procedures.free_numbers(geometry_procedures.UMBMARK, four_wheels("mecanum"))
    assert free == (fit.OFFSET, fit.SLIP)


def test_umbmark_says_how_far_the_mean_end_of_the_worse_direction_is_off():
    runs = [
        Trial(lap.steps, lap.end._replace(x_m=lap.end.x_m + off_m))
        for lap, off_m in zip(laps(BELIEVED), (0.001, 0.003, 0.0, -0.001))
    ]
    plan = geometry_procedures.CalibrationPlan(geometry_procedures.UMBMARK, {}, [], (), ())
    assert "E_max,syst: 2.0 mm before, " in plan.evaluate(runs, TRAXBOT, "").lines[-1]


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
        carried.update(before, pose, (right_m, left_m), turn, 1.0)
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


def test_a_fit_that_has_not_come_to_an_end_gives_nothing(monkeypatch):
    monkeypatch.setattr(fit, "STEPS", 1)
    with pytest.raises(ConfigError, match="4 runs do not determine wheel_offset, turn_slip"):
        fit.fit(laps(BELIEVED._replace(turn_slip=0.1)), BELIEVED, [fit.OFFSET, fit.SLIP], TRAXBOT.noise)


def test_wheels_that_spin_while_the_robot_stands_give_no_slip():
    runs = [Trial(paths.counts(paths.turn(angle), BELIEVED), Pose(0.0, 0.0, 0.0)) for angle in (2.0, -2.0)]
    with pytest.raises(ConfigError, match="2 runs do not determine turn_slip"):
        fit.fit(runs, BELIEVED, [fit.SLIP], TRAXBOT.noise)


def moved(drive, *moves):
    """Counts of mecanum wheels for these steps of the body."""
    steps = [kinematics_of(drive).wheel_steps(Planar(*move)) for move in moves for _ in range(100)]
    names = FourWheels._fields
    places = [kinematics_of(drive).wheels.index(name) for name in names]
    return np.array(steps)[:, places] / metres_per_count(drive, names)


def test_runs_ahead_and_aside_give_the_size_of_each_mecanum_wheel():
    """Radius and ratio of the sides follow from runs ahead and back, the others from runs to the sides."""
    mecanum = four_wheels("mecanum")
    believed = mecanum.drive
    true = believed._replace(
        wheel_radius_m=0.033, wheel_offset=0.01, cross_offset=-0.02, rear_offset=0.03, side_slip=0.1
    )
    drive = believed
    for procedure, moves in (
        (geometry_procedures.STRAIGHT, [(0.01, 0.0, 0.0), (-0.01, 0.0, 0.0)]),
        (geometry_procedures.SIDEWAYS, [(0.0, 0.01, 0.0), (0.0, -0.01, 0.0)]),
    ):
        counts = [moved(believed, move) for move in moves]
        runs = [Trial(each, Pose(*path(true, each)[-1])) for each in counts]
        drive = geometry_procedures.evaluate(procedure, runs, mecanum._replace(drive=drive)).after
    assert tuple(drive) == pytest.approx(tuple(true), rel=1e-4, abs=1e-4)


@pytest.mark.parametrize(
    ("wheels", "procedure", "words"),
    [
        (2, geometry_procedures.SIDEWAYS, "is for mecanum wheels; traxbot has none"),
        (4, geometry_procedures.STRAIGHT, "counts of 4 wheels, expected 2: start again with --restart"),
    ],
)
def test_runs_of_another_base_are_refused(wheels, procedure, words):
    runs = [Trial(np.ones((9, wheels)), Pose(0.0, 0.0, 0.0))] * 2
    with pytest.raises(ConfigError, match=words):
        geometry_procedures.evaluate(procedure, runs, TRAXBOT)
