"""The IMU's calibration on readings that were computed: no robot, no driver."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from mrl_driver.apps.calibration import imu_fit
from mrl_driver.apps.calibration.imu_fit import ACCEL, GYRO, Turned, angle, levelled, push_of, rest_of, yaw_of
from mrl_driver.apps.calibration.imu_procedures import by_wheels
from mrl_driver.errors import ConfigError
from mrl_driver.geometry import GRAVITY_M_S2
from mrl_driver.robot import models
from mrl_driver.robot.models import ImuMount
from mrl_driver.robot.odometry import Wheels

PERIOD_S = 0.02
NOISE_RAD_S, NOISE_M_S2 = math.radians(0.04), 0.03
"""Of one reading: data sheet of the MPU-6050, at the bandwidth of 42 Hz."""
BIAS = (math.radians(3.0), math.radians(-8.0), math.radians(5.0))
SLANTED = ImuMount(roll_deg=170.0, pitch_deg=-8.0, yaw_deg=90.0)
ON_ITS_SIDE = ImuMount(roll_deg=90.0)


def measured(mount, rates, pushes=(), seed=1, bias=BIAS, noise=1.0):
    """Readings (N, 8) of a chip mounted so, on a robot that turns and accelerates so [rad/s, m/s2]."""
    rng, rates = np.random.default_rng(seed), np.asarray(rates, float)
    axes = np.array([mount.rotate(axis) for axis in np.eye(3)])  # row i: axis i of the chip in base_link
    rows = np.zeros((len(rates), 8))
    rows[:, 0] = 100 + PERIOD_S * np.arange(len(rates))
    rows[:, 1] = rows[:, 0] + 7
    rows[:, GYRO] = (
        np.outer(rates, axes[:, 2]) + bias + noise * NOISE_RAD_S * rng.normal(size=(len(rates), 3))
    )
    pushes = np.zeros(len(rates)) if len(pushes) == 0 else pushes
    true = np.stack((pushes, np.zeros(len(rates)), np.full(len(rates), GRAVITY_M_S2)), axis=1)
    rows[:, ACCEL] = true @ axes.T + noise * NOISE_M_S2 * rng.normal(size=(len(rates), 3))
    return rows


def rates_of(*parts):
    return np.concatenate([np.full(round(seconds / PERIOD_S), rate) for rate, seconds in parts])


def at_rest(mount=SLANTED, **options):
    return measured(mount, rates_of((0.0, 5.0)), **options)


def test_the_way_by_the_wheels_knows_their_sizes():
    """10 m straight by the counts are an arc if the right wheel is larger by 4 %."""
    model = models.load("traxbot")
    model = model._replace(drive=model.drive._replace(wheel_offset=0.04))
    counts = round(10 / model.drive.metres_per_count)
    way = by_wheels(model, SimpleNamespace(counts=Wheels(counts, counts)))
    assert way == pytest.approx((10.0, 0.0, 0.4 / model.drive.turning_separation_m), abs=1e-4)


# -- at rest


@pytest.mark.parametrize("mount", [SLANTED, ON_ITS_SIDE, ImuMount(), ImuMount(pitch_deg=90.0)])
def test_gravity_gives_roll_and_pitch(mount):
    """Yaw and place stay as they were."""
    before = ImuMount(x_m=0.1, yaw_deg=30.0, gyro_scale=1.01)
    found = levelled(ImuMount(), rest_of(at_rest(mount)).accel_m_s2)
    up = [found.rotate(axis)[2] for axis in np.eye(3)]
    assert np.allclose(up, [mount.rotate(axis)[2] for axis in np.eye(3)], atol=2e-3)
    assert levelled(before, (0.0, 0.0, 9.8)) == before


def changed(where, change):
    """A damage: readings in which these values are changed so."""

    def damage(rows):
        rows[where] = change(rows[where])
        return rows

    return damage


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (
            changed(np.s_[100:, 2], lambda rates: rates + math.radians(1.0)),
            "the robot moved, expected it to stand still",
        ),
        (changed(np.s_[::2, 5], lambda pushes: pushes + 1.0), "the robot moved, expected it to stand still"),
        (changed(np.s_[:], lambda rows: rows[0]), "the IMU repeats one reading"),
        (
            changed(np.s_[:, ACCEL], lambda pushes: pushes / 5),
            r"the IMU measures 2.0 m/s2 at rest, expected 9.8 within 1.5",
        ),
        (
            changed(np.s_[:, 4], lambda rates: rates + 0.6),
            "the gyro measures 39.[34] deg/s at rest, expected at most 25",
        ),
        (lambda rows: rows[:40], "the IMU sent 40 readings at rest, expected at least 50"),
    ],
)
def test_readings_that_are_not_those_of_a_robot_at_rest_are_refused(damage, said):
    with pytest.raises(ConfigError, match=said):
        rest_of(damage(at_rest()))


# -- turns

TURN = ((0.0, 3.0), (0.8, math.tau / 0.8), (0.0, 3.0))  # One turn counter-clockwise between two rests of 3 s


def turned(rows, mount):
    return angle(rows, mount, rest_of(rows[:150]), rest_of(rows[-150:]))


TURNED_RAD = 0.8 * PERIOD_S * round(math.tau / 0.8 / PERIOD_S)


@pytest.mark.parametrize("mount", [SLANTED, ON_ITS_SIDE])
def test_the_turn_is_that_about_the_vertical_whatever_the_mount_and_the_bias(mount):
    """To a tenth of a degree; the rates change in steps, which one reading can miss."""
    found, sd = turned(measured(mount, rates_of(*TURN)), mount)
    assert found == pytest.approx(TURNED_RAD, abs=math.radians(0.1))
    assert sd < math.radians(0.2)


def test_the_deviation_of_a_turn_is_that_of_its_bias():
    """200 drives with a noisy bias: the errors are as large as is said.  A drift is removed, and makes it less sure."""
    drives = [measured(ImuMount(), rates_of(*TURN), seed=seed) for seed in range(200)]
    errors, said = np.array([turned(rows, ImuMount()) for rows in drives]).T
    assert 0.5 < np.std(errors) / np.mean(said) < 1.5
    drives[0][:, 4] += np.linspace(0.0, math.radians(0.2), len(drives[0]))
    found, sd = turned(drives[0], ImuMount())
    assert found == pytest.approx(errors[0], abs=math.radians(0.05)) and sd > 2 * said[0]


@pytest.mark.parametrize(
    ("parts", "damage", "said"),
    [
        (
            TURN,
            lambda rows: np.delete(rows, slice(200, 230), axis=0),
            r"readings are 0.62 s apart, expected at most 0.25 s",
        ),
        (TURN, lambda rows: rows[np.r_[:300, 250 : len(rows)]], "board time went back"),
        (
            ((0.0, 3.0), (math.radians(492), 1.0), (0.0, 3.0)),
            lambda rows: rows,
            "the end of its range; repeat the calibration",
        ),
    ],
)
def test_a_turn_with_a_gap_or_beyond_the_range_is_refused(parts, damage, said):
    with pytest.raises(ConfigError, match=said):
        turned(damage(measured(ImuMount(), rates_of(*parts))), ImuMount())


def turn_of(degrees, scale=1.02, error_deg=0.0, wheels=1.1):
    true = math.radians(degrees)
    return Turned(true / scale, math.radians(0.1), true * wheels, true + math.radians(error_deg))


def test_the_scale_is_the_mean_of_the_turns_and_long_ones_count_more():
    """The true angle of each has the measured heading."""
    turns = [turn_of(360, error_deg=4.0), turn_of(3600), turn_of(-3600)]
    scale, sd = imu_fit.scale_of(turns, math.radians(0.5))
    assert scale == pytest.approx(1.02, abs=1e-3) and 2e-4 < sd < 1e-3
    for heading_deg in (0.0, 170.0, -170.0):
        true = math.radians(3 * 360 + heading_deg)
        assert imu_fit.true_angle(true / 1.03, math.radians(heading_deg), 1.02) == pytest.approx(true)


@pytest.mark.parametrize(
    ("turn", "before", "said"),
    [
        (
            {"degrees": 360, "wheels": -1.0},
            1,
            "the gyro turned 353 deg and the wheels -360 deg, expected the same direction",
        ),
        ({"degrees": 360, "wheels": 3.0}, 1, "expected the same direction"),
        ({"degrees": 720, "error_deg": -20.0}, 1, r"a scale of 0.992, expected 1.020 within 0.02\d"),
        ({"degrees": 360, "scale": 1.25}, 0, r"a scale of 1.2\d\d, expected 1.000 within 0.10"),
    ],
)
def test_a_turn_that_contradicts_wheels_earlier_turns_or_the_data_sheet_is_refused(turn, before, said):
    with pytest.raises(ConfigError, match=f"run 2: .*{said}"):
        imu_fit.require_agreement(turn_of(**turn), [turn_of(360)] * before, math.radians(0.5), "run 2")


# -- straight drives


def pushed(mount, seed=1):
    """A drive of 0.4 m, as wheels and IMU see it: a second of 0.2 m/s2, and one of braking."""
    pushes = rates_of((0.0, 2.0), (0.2, 1.0), (0.0, 1.0), (-0.2, 1.0), (0.0, 1.0))
    rows = measured(mount, np.zeros(len(pushes)), pushes, seed)
    speeds = np.cumsum(pushes) * PERIOD_S
    ways = np.stack((rows[::5, 1], (np.cumsum(speeds) * PERIOD_S)[::5]), axis=1)
    return push_of(rows, mount, ways)


@pytest.mark.parametrize("yaw_deg", [0.0, 90.0, -135.0, 180.0])
def test_the_imu_accelerates_where_the_wheels_do(yaw_deg):
    """A robot that only spins its wheels gives no yaw."""
    mount = ImuMount(roll_deg=180.0, pitch_deg=5.0, yaw_deg=yaw_deg)
    pushes = [pushed(mount), pushed(mount, 2)]
    yaw, sd = yaw_of(pushes)
    off = math.remainder(yaw - math.radians(yaw_deg), math.tau)
    assert abs(off) < 3 * sd < math.radians(15)
    with pytest.raises(ConfigError, match="of the wheels' acceleration, expected 1 within 0.5"):
        yaw_of([each._replace(imu_m_s2=0.1 * each.imu_m_s2) for each in pushes])
