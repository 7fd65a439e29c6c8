"""Every base by the same interface: round trips, closed forms, squares on the floor."""

import math
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import ORIGIN, advance
from mrl_driver.robot.kinematics import (
    Kinematics,
    Planar,
    differential,
    kinematics_of,
    mecanum,
    omni,
)
from mrl_driver.robot.models import Drive, MecanumDrive, OmniDrive

EXACT = 1e-12
UNROUNDED_M, COUNTED_M = 0.2e-3, 1e-3
"""A square of 1 m with rotation ends this close to the truth, without and with whole counts [m]."""
COUNT_M = 2 * math.pi * 0.03 / 2796.8
BASES = {
    "differential": differential(0.18),
    "tracked": differential(0.18, 0.1),
    "omni": omni(0.1),
    "omni_turned": omni(0.1, (0.0, 120.0, 240.0)),
    "mecanum": mecanum(0.2, 0.15),
}
speed = st.floats(-2, 2)
twists = st.builds(Planar, speed, speed, speed)


def huge(twist):
    return Planar(*(1e30 * each for each in twist))


def possible(base: Kinematics, twist: Planar) -> Planar:
    return twist if base.sideways else twist._replace(left=0.0)


@pytest.mark.parametrize("base", BASES.values(), ids=BASES)
@given(twist=twists)
def test_twist_to_wheels_and_back_is_the_same(base, twist):
    told = possible(base, twist)
    assert base.step(base.wheel_steps(told)) == pytest.approx(told, abs=EXACT)


@given(right=speed, left=speed)
def test_closed_form_of_two_wheels(right, left):
    assert BASES["differential"].step((right, left)) == pytest.approx(
        ((right + left) / 2, 0.0, (right - left) / 0.18), abs=EXACT
    )


@given(ways=st.tuples(speed, speed, speed))
def test_closed_form_of_three_wheels(ways):
    left, rear, right = ways
    half = math.sqrt(3) / 3
    assert BASES["omni"].step(ways) == pytest.approx(
        (half * (right - left), (left + right - 2 * rear) / 3, sum(ways) / 0.3), abs=EXACT
    )


@given(ways=st.tuples(speed, speed, speed, speed))
def test_closed_form_of_four_mecanum_wheels(ways):
    """The least-squares solution is the mean of what each wheel says."""
    front_left, front_right, rear_left, rear_right = ways
    assert BASES["mecanum"].step(ways) == pytest.approx(
        (
            sum(ways) / 4,
            (-front_left + front_right + rear_left - rear_right) / 4,
            (-front_left + front_right - rear_left + rear_right) / 4 / 0.35,
        ),
        abs=EXACT,
    )


@pytest.mark.parametrize("base", BASES.values(), ids=BASES)
@given(
    twist=st.one_of(twists, twists.map(huge)),
    most=st.floats(0.05, 1.0),
)
def test_saturation_keeps_the_direction(base, twist, most):
    told = possible(base, twist)
    kept = base.saturated(told, most)
    assert max(map(abs, base.wheel_steps(kept))) <= most + EXACT
    factor = min(1.0, most / max(*map(abs, base.wheel_steps(told)), EXACT))
    assert kept == pytest.approx([factor * part for part in told], abs=EXACT)


@pytest.mark.parametrize("base", BASES.values(), ids=BASES)
@given(twist=twists)
def test_covariance_is_that_of_independent_wheels(base, twist):
    """One wheel after the other: the spread is the sum of the steps that their deviations make."""
    ways = base.wheel_steps(possible(base, twist))
    expected = [0.0] * 6
    for at, way in enumerate(ways):
        deviation = math.sqrt(1e-4 * abs(way))
        x, y, t = base.step([deviation if each == at else 0.0 for each in range(len(ways))])
        expected = [a + b for a, b in zip(expected, (x * x, x * y, x * t, y * y, y * t, t * t))]
    expected[5] += 1e-3 * abs(base.step(ways).turn)
    assert base.covariance(ways, 1e-4, 1e-3) == pytest.approx(expected, abs=1e-12)


def square(base: Kinematics, whole_counts: bool) -> float:
    """How far odometry is off after a square of 1 m in which the robot turns round once [m]."""
    true = found = ORIGIN
    travelled, counted = [0.0] * len(base.rows), [0.0] * len(base.rows)
    for side in range(4):
        for _ in range(100):
            heading = side * math.pi / 2 - true.yaw_rad
            step = Planar(0.01 * math.cos(heading), 0.01 * math.sin(heading), 2 * math.pi / 400)
            ways = base.wheel_steps(step)
            true = advance(true, step.forward, step.turn, step.left)
            travelled = [a + way / COUNT_M for a, way in zip(travelled, ways)]
            read = [math.floor(count) for count in travelled] if whole_counts else travelled
            moved = base.step([(a - b) * COUNT_M for a, b in zip(read, counted)])
            found = advance(found, moved.forward, moved.turn, moved.left)
            counted = list(read)
    assert math.hypot(true.x_m, true.y_m) < 0.05  # it is a square, rounded by the turn within a step
    return math.hypot(found.x_m - true.x_m, found.y_m - true.y_m)


@pytest.mark.parametrize("name", ["omni", "mecanum"])
def test_a_square_with_rotation(name):
    assert square(BASES[name], whole_counts=False) < UNROUNDED_M
    assert square(BASES[name], whole_counts=True) < COUNTED_M


def test_wheels_that_do_not_determine_the_motion():
    with pytest.raises(ConfigError, match="the wheels of this omni base do not determine its motion"):
        omni(0.1, (0.0, 180.0, 0.0))


@pytest.mark.parametrize(
    "drive, kind",
    [
        (Drive(0.18, 1e-4), "differential"),
        (Drive(0.18, 1e-4, 0.0, 0.1), "tracked"),
        (OmniDrive(0.1, 1e-4, 0.5), "omni"),
        (MecanumDrive(0.2, 0.15, 0.05, 2000, 1.0), "mecanum"),
    ],
)
def test_the_drive_of_a_model_chooses_the_base(drive, kind):
    base = kinematics_of(drive)
    assert base.kind == kind
    assert base.wheel_steps(Planar(0.0, 0.0, 1.0))[0 if len(base.rows) < 4 else 1] == pytest.approx(
        drive.turning_separation_m / 2
    )


def test_no_arrays_on_the_drivers_path():
    """A ROS node has no 30 MB to spare for numpy."""
    code = (
        "import mrl_driver.driver.driver, mrl_driver.robot.kinematics, sys; sys.exit('numpy' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
