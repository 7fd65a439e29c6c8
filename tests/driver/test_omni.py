"""Kinematics of two and of three wheels, and a robot with three, from the command to the pose, in simulated time."""

import math
from statistics import mean

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrl_driver.driver.options import Options as DriverOptions
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import ConfigError
from mrl_driver.geometry import ORIGIN, Pose, advance
from mrl_driver.robot import models
from mrl_driver.robot.kinematics import Kinematics, Planar, differential, kinematics_of, mecanum, omni
from mrl_driver.robot.models import Drive, MecanumDrive, OmniDrive
from mrl_driver.robot.odometry import CONFIRMATIONS, OmniTwist, OmniWheels
from mrl_driver.robot.wheel_odometry import MOVE_OMNI, MOVE_TWIST, OmniCommands, PlanarCommands, WheelOdometry
from mrl_driver.safety.speed_limiter import SpeedLimiter
from sim_arduino.serve.factory import Options, make

OMNI = models.load("omni")
POSE_M, YAW_RAD = 0.002, 0.005
"""Odometry against the truth after some metres: counts round to 0.07 mm, chords of a frame to less."""
speed = st.floats(-2, 2)


@pytest.fixture
def robot(request):
    """A driver on an emulated omni: `robot.driver`, `robot.plant`."""
    made = make(Options(robot="omni", engine=getattr(request, "param", "python")))
    driver = SteppedDriver(made.engine, OMNI, DriverOptions(command_timeout_s=None))
    driver.connect()
    made.plant.driver = driver
    yield made.plant
    driver.close()
    made.close()


def off_m(robot, start, pose):
    """Distance of a pose from the true one, both from `start` on."""
    return math.dist(robot.true_pose.relative_to(start)[:2], pose[:2])


def off_rad(robot, start):
    return abs(math.remainder(robot.driver.pose.yaw_rad - robot.true_pose.yaw_rad + start.yaw_rad, math.tau))


@pytest.mark.parametrize("robot", ["python", "avr"], indirect=True)
def test_it_goes_where_odometry_says(robot):
    """Forward, to the left, in an arc that slides, back across: the true pose, from the start on."""
    driver, start = robot.driver, Pose(*robot.true_pose)
    for linear, angular, lateral in ((0.2, 0.0, 0.0), (0.0, 0.0, 0.2), (0.1, 1.0, 0.1), (-0.15, 0.0, -0.15)):
        assert driver.drive(linear, angular, lateral)
        driver.wait(1.5)
        seen = []
        for _ in range(10):  # one reading has the noise of whole counts
            driver.wait(0.02)
            seen.append(driver.twist)
        assert [mean(part) for part in zip(*seen)] == pytest.approx([linear, angular, lateral], abs=0.04)
        assert driver.command == OmniTwist(linear, angular, lateral)
    driver.stop()
    driver.wait(1.0)
    assert off_m(robot, start, driver.pose) < POSE_M and off_rad(robot, start) < YAW_RAD
    assert driver.stopped and driver.mismatch is None and driver.link.statistics.refused_counts == 0
    assert isinstance(driver.telemetry.counts, OmniWheels)


def test_two_counters_that_were_requested_do_not_move_it(robot):
    """The third would count as zero."""
    driver = robot.driver
    driver.drive(0.0, 0.0, 0.1)
    driver.wait(1.0)
    poses = []
    driver.on_telemetry(lambda telemetry: poses.append(telemetry.pose))
    driver.request(8)
    driver.wait(0.2)
    assert driver.link.statistics.refused_counts == 0
    assert all(one.y_m <= next.y_m for one, next in zip(poses, poses[1:]))


def test_a_blocked_rear_wheel_stops_it(robot):
    """Its encoder alone shows it: going straight ahead it rests, to the side it turns fastest."""
    driver, motor = robot.driver, robot.robot.motors[1]
    driver.drive(0.2, 0.0)
    driver.wait(2.0)
    assert driver.mismatch is None
    motor.move = lambda dt, volts: 0.0
    driver.drive(0.0, 0.0, 0.2)
    driver.wait(2.0)
    assert driver.mismatch.wheel == "rear"
    assert str(driver.mismatch).startswith("rear wheel moved 0 mm, expected at least")
    assert not driver.drive(0.0, 0.0, 0.2)


def limiter(limits, drive):
    """The limiter of a robot with these."""
    made = SpeedLimiter()
    made.limits, made.saturate = limits, OmniCommands(drive).saturated
    return made


@given(linear=speed, angular=speed, lateral=speed)
def test_limits_keep_direction_and_arc(linear, angular, lateral):
    """Those of the robot and of its wheels, which reach half of these 1 m/s."""
    limits, drive = OMNI.limits._replace(linear_m_s=1.0, lateral_m_s=1.0), OMNI.drive
    kept = OmniTwist(*limiter(limits, drive).limited((linear, angular, lateral)))
    assert math.hypot(kept.linear_m_s, kept.lateral_m_s) <= limits.linear_m_s + 1e-12
    assert abs(kept.angular_rad_s) <= limits.angular_rad_s + 1e-12
    ways = kinematics_of(drive).wheel_steps(Planar(kept.linear_m_s, kept.lateral_m_s, kept.angular_rad_s))
    assert max(map(abs, ways)) <= drive.full_speed_m_s + 1e-12
    assert kept.linear_m_s * angular == pytest.approx(linear * kept.angular_rad_s, abs=1e-9)
    assert kept.linear_m_s * lateral == pytest.approx(linear * kept.lateral_m_s, abs=1e-9)


@given(linear=st.integers(-350, 350), angular=st.integers(-3000, 3000), lateral=st.integers(-350, 350))
def test_the_wire_carries_it_to_a_percent_and_a_degree(linear, angular, lateral):
    code, share, rotation, direction = OmniCommands(OMNI.drive).spell((linear, angular, lateral))
    assert code == MOVE_OMNI and 0 <= share <= 100 and 0 <= direction < 360
    way = share * 5.0  # 1 % is 5 mm/s
    assert way * math.cos(math.radians(direction)) == pytest.approx(linear, abs=2.5 + 0.009 * way)
    assert way * math.sin(math.radians(direction)) == pytest.approx(lateral, abs=2.5 + 0.009 * way)
    assert rotation * 50 == pytest.approx(angular, abs=25.01)
    told = OmniCommands(OMNI.drive).read((share, rotation, direction))
    assert told == pytest.approx((linear / 1000, angular / 1000, lateral / 1000), abs=0.026)


def test_wheels_that_sit_elsewhere_turn_the_direction():
    """The motor board counts its directions from its own motors: 60 deg is where motor 1 is."""
    drive = OMNI.drive._replace(angles_deg=(0.0, 120.0, 240.0))
    assert OmniCommands(drive).spell((100, 0, 0)) == (MOVE_OMNI, 20, 0, 60)


def test_counters_that_wrap_and_one_that_jumps():
    """The wrap is movement; a jump of one counter is refused until it is confirmed, and never integrated."""
    odometry = WheelOdometry(OMNI.drive, 1.5)
    odometry.update(32767, -32768, 0.0, 10)
    assert odometry.update(-32767, -32766, 0.01, 12)
    assert odometry.travel == (2, 2, 2)
    assert odometry.pose[:2] == pytest.approx((0.0, 0.0), abs=1e-12)
    for frame in range(CONFIRMATIONS):
        assert not odometry.update(-32767, -32766, 0.02 + 0.01 * frame, 20000)
    assert odometry.update(-32767, -32766, 0.1, 20001)
    assert odometry.travel == (2, 2, 3) and odometry.baseline.refused == CONFIRMATIONS


@pytest.mark.parametrize("exact", [True, False])
def test_three_counters_that_start_from_zero_again_move_nothing(exact):
    """A board that goes on streaming after its restart, with little on its counters."""
    odometry = WheelOdometry(OMNI.drive, 1.5, exact)
    for frame, count in enumerate([2000, 2001, 2002, 2003, 0, 1, 2, 3, 4]):
        odometry.update(count, count, 0.02 * frame, count)
    assert max(map(abs, odometry.travel)) <= 6


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
@given(twist=st.one_of(twists, twists.map(huge)), most=st.floats(0.05, 1.0))
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
    "drive, kind, arm_m",
    [
        (Drive(0.18, 1e-4), "differential", 0.09),
        (Drive(0.18, 1e-4, 0.0, 0.1), "tracked", 0.1),
        (OmniDrive(0.1, 1e-4, 0.5), "omni", 0.1),
        (MecanumDrive(0.2, 0.15, 0.05, 2000, 1.0), "mecanum", 0.35),
    ],
)
def test_the_drive_of_a_model_chooses_the_base(drive, kind, arm_m):
    base = kinematics_of(drive)
    assert base.kind == kind
    assert max(base.wheel_steps(Planar(0.0, 0.0, 1.0))) == pytest.approx(arm_m)


def test_a_request_makes_up_for_slip_to_the_side():
    commands = PlanarCommands(MecanumDrive(0.2, 0.15, 0.05, 2000, 1.0, side_slip=0.2))
    assert commands.spell((100, 0, 80)) == (MOVE_TWIST, 100, 100, 0)
    assert commands.read((100, 100, 0)) == OmniTwist(0.1, 0.0, pytest.approx(0.08))
