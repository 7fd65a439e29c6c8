"""Goals round walls and boxes: an emulated robot in simulated time, with its three sonars and its odometry alone."""

import math
import random

import pytest

from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.geometry import Pose
from mrl_driver.navigation.goal_seeker import BLIND_S, PATIENCE_S, GoalSeeker
from mrl_driver.navigation.occupancy_grid import FloorMap
from mrl_driver.robot import models
from mrl_driver.robot.models import Limits, SonarMount
from sim_arduino.serve import factory
from sim_arduino.world import world_file

SONARS = models.load("traxbot").sonars
LIMITS = Limits(0.25, 0.9, math.inf, math.inf)
STEP_S, READY_S, MOST_S = 0.05, 1.0, 150.0
PLACE_M, HEADING_RAD = 0.06, 0.1
TRAP = ", [0.3, -0.6, 0.3, 0.6], [-0.7, 0.6, 0.3, 0.6], [-0.7, -0.6, 0.3, -0.6]"


def seek(tmp_path, floor, start, goal, patience_s=60.0):
    """The seeker at the end, where the robot truly is, and how often it touched something."""
    file = tmp_path / "world.yaml"
    file.write_text(f"start: [{start[0]}, {start[1]}, {math.degrees(start[2])}]\n{floor}")
    emulated = factory.make(factory.Options(robot="traxbot"), world_file.load(str(file)))
    bumps = 0
    try:
        with SteppedDriver(emulated.engine) as robot:
            robot.reset_pose(Pose(*start))
            robot.wait(READY_S)
            seeker = GoalSeeker(goal, LIMITS, robot.now_s, SONARS, patience_s)
            while robot.now_s < MOST_S:
                speeds = seeker.command(tuple(robot.pose)[:3], robot.ranges, robot.now_s)
                if seeker.reached or seeker.blocked:
                    break
                robot.drive(*speeds)
                robot.wait(STEP_S)
                bumps += emulated.plant.robot.state.bumped
            return seeker, emulated.plant.true_pose, bumps
    finally:
        emulated.close()


def room(walls="", boxes=""):
    return (
        f"walls: [[-2, -2, 2, -2], [2, -2, 2, 2], [2, 2, -2, 2], [-2, 2, -2, -2]{walls}]\nboxes: [{boxes}]\n"
    )


def across(seed):
    """Start and goal on the two sides of a room."""
    chance = random.Random(seed)
    sides = [
        (side * chance.uniform(1.2, 1.6), chance.uniform(-1.5, 1.5), chance.uniform(-3, 3))
        for side in (-1, 1)
    ]
    chance.shuffle(sides)
    return sides


@pytest.mark.parametrize(
    "floor, start, goal",
    [
        (room(", [0, -2, 0, 0.8]"), (-1.4, -0.5, 0.0), (1.4, -0.5, 0.0)),
        (room(", [-1.21, -0.368, 0.344, 0.194]"), (1.027, 0.708, 1.469), (-1.307, -1.351, 0.783)),
        (room(boxes="[0, 0.3, 1.0, 1.0, 0]"), (1.4, 0.4, 3.0), (-1.4, 0.1, 0.0)),
        (room(TRAP), (-1.4, 0.0, 0.0), (1.4, 0.0, 0.0)),
        (room(boxes="[0.1, -0.1, 0.6, 0.9, 30]"), *across(2)),
    ],
    ids=["to-the-side", "its-end-unseen", "box", "trap", "turned-box"],
)  # fmt: skip
def test_a_goal_behind_something_is_reached_and_nothing_touched(tmp_path, floor, start, goal):
    seeker, pose, bumps = seek(tmp_path, floor, start, goal)
    assert seeker.reached and bumps == 0
    assert math.hypot(pose.x_m - goal[0], pose.y_m - goal[1]) < PLACE_M
    assert abs(math.remainder(pose.yaw_rad - goal[2], math.tau)) < HEADING_RAD


def test_a_goal_in_a_wall_is_given_up_after_the_patience(tmp_path):
    seeker, _, bumps = seek(tmp_path, room(), (0.0, 0.0, 0.0), (2.4, 0.0, 0.0), patience_s=8.0)
    assert seeker.blocked and bumps == 0
    assert seeker.why.endswith("it came no closer for 8 s") or seeker.why.endswith("leave no free path")


def test_what_is_seen_near_closes_the_way_and_is_forgotten_where_later_looks_are_free():
    floor = FloorMap(SONARS)
    floor.see((0.0, 0.0, 0.0), {"front": 0.3})
    assert not floor.is_free((0.0, 0.0), (1.0, 0.0)) and floor.path((0.0, 0.0), (1.0, 0.0))
    for step in range(-10, 11):
        floor.see((0.0, 0.0, 0.04 * step), {"front": 3.0})
    assert floor.is_free((0.0, 0.0), (1.0, 0.0))
    for step in range(72):
        floor.see((0.0, 0.0, math.radians(5 * step)), {"front": 0.3})
    assert floor.path((0.0, 0.0), (2.0, 0.0)) is None, "walled in"


def test_a_look_frees_no_more_than_the_sensor_measures():
    floor = FloorMap({**SONARS, "short": SONARS["front"]._replace(farthest_m=0.3)})
    floor.see((0.0, 0.0, 0.0), {"front": 0.45})
    for name, free in (("short", False), ("front", True)):
        for _ in range(10):
            floor.see((0.0, 0.0, 0.0), {name: math.inf})
        for step in range(-10, 11):
            floor.see((0.0, 0.0, 0.04 * step), {name: math.inf})
        assert floor.is_free((0.0, 0.0), (1.0, 0.0)) == free


def close_on_the_left(goal_y_m, yaw, x_m, limits=LIMITS):
    """Speeds at these places, once something is close on the left of a robot that came along the x axis."""
    seeker = GoalSeeker((0.35, goal_y_m, 0.0), limits, 0.0, SONARS)
    free, close = {name: math.inf for name in SONARS}, {"front": math.inf, "left": 0.17, "right": math.inf}
    for step in range(13):
        seeker.command((0.03 * step, 0.0, 0.0), free, 0.05 * step)
    seeker.command((0.36, 0.0, yaw), close, 0.7)
    return [seeker.command((x, 0.0, yaw), close, 0.75 + 0.05 * step) for step, x in enumerate(x_m)]


@pytest.mark.parametrize("yaw, backs", [(0.0, True), (1.2, False)], ids=["from-behind", "from-aside"])
def test_with_something_close_beside_it_goes_back_where_it_came_from_before_it_turns(yaw, backs):
    """Its corners need room to turn; what is behind is known only where it has just been."""
    speeds = close_on_the_left(-2.0 if yaw else 2.0, yaw, [0.36 - 0.01 * step for step in range(30)])
    assert (speeds[0][0] < 0 and speeds[0][1] == 0) is backs
    assert sum(linear < 0 for linear, _ in speeds) < 24


def test_robot_that_rolls_on_for_a_while_still_goes_back():
    """It needs 0.16 m to stand; the way that it rolls on is one that it may go back."""
    speeds = close_on_the_left(2.0, 0.0, [0.36 + 0.01 * min(step, 32 - step) for step in range(33)])
    assert all(linear < 0 for linear, _ in speeds)


def test_speeds_keep_to_limits_below_those_at_which_motors_surely_turn():
    """On the way, on the way back, and in turns on the way and at the goal."""
    limits = LIMITS._replace(linear_m_s=0.01, angular_rad_s=0.05)
    speeds = close_on_the_left(2.0, 0.0, [0.36], limits)
    for goal in ((3.0, 0.0, 0.0), (0.0, 3.0, 0.0), (0.0, 0.0, 2.0)):
        speeds.append(GoalSeeker(goal, limits, 0.0, SONARS).command((0.0, 0.0, 0.0), {}, 0.0))
    assert speeds == [(-0.01, 0.0), (0.01, 0.0), (0.0, 0.05), (0.0, 0.05)]


@pytest.mark.parametrize("name", ["front", "left", "right"])
@pytest.mark.parametrize("silent", [(), (math.nan,)], ids=["absent", "nan"])
def test_robot_stands_when_a_sonar_falls_silent(name, silent):
    seeker = GoalSeeker((3.0, 0.0, 0.0), LIMITS, 0.0, SONARS)
    free = {each: math.inf for each in SONARS}
    assert seeker.command((0.0, 0.0, 0.0), free, 0.0)[0] > 0
    heard = {each: math.inf for each in SONARS if each != name}
    heard.update((name, range_m) for range_m in silent)
    assert seeker.command((0.2, 0.0, 0.0), heard, BLIND_S)[0] > 0
    assert seeker.command((0.2, 0.0, 0.0), heard, BLIND_S + 0.01) == (0.0, 0.0)
    assert seeker.blind == (name,)


def walled_in(look_rad):
    """The seconds until a robot that something surrounds gives up, and the seeker."""
    seeker, yaw_rad, now_s = GoalSeeker(Pose(1.2, 0.0, 0.0), LIMITS, 0.0, SONARS, look_rad=look_rad), 0.0, 0.0
    while not seeker.blocked:
        now_s += STEP_S
        ranges = dict.fromkeys(SONARS, 0.3)
        yaw_rad += STEP_S * seeker.command(Pose(0.0, 0.0, yaw_rad), ranges, now_s)[1]
    return now_s, seeker


def test_robot_that_something_surrounds_gives_up_after_the_turns_it_may_look():
    """Without a limit it waits for obstacles that go away."""
    after_s, seeker = walled_in(4 * math.pi)
    assert 4 * math.pi / LIMITS.angular_rad_s < after_s < 40.0
    assert seeker.why == "the sonars leave no free path, 1.2 m away"
    assert walled_in(math.inf)[0] > PATIENCE_S


def test_goal_given_up_for_a_silent_sonar_says_so():
    seeker = GoalSeeker((3.0, 0.0, 0.0), LIMITS, 0.0, SONARS, patience_s=5.0)
    for now_s, front_m in ((0.0, math.inf), (2.0, math.nan), (2.1, math.inf)):
        linear, _ = seeker.command((0.0, 0.0, 0.0), {"front": front_m}, now_s)
    assert linear > 0, "the sonar is heard again"
    for second in range(3, 11):
        seeker.command((0.0, 0.0, 0.0), {"front": math.nan}, float(second))
    assert seeker.blocked and seeker.why == "no valid reading of sonar front: check its cable"


def test_goal_is_given_up_if_the_robot_does_not_turn_to_its_yaw():
    """As when the emergency stop is latched there: the client would wait for ever."""
    seeker = GoalSeeker((0.0, 0.0, 2.0), LIMITS, 0.0, SONARS, patience_s=5.0)
    for time_s in range(20):
        assert seeker.command((0.0, 0.0, 0.05 * time_s), {}, float(time_s))[1] > 0
    for time_s in range(20, 25):
        assert not seeker.blocked
        speeds = seeker.command((0.0, 0.0, 0.95), {}, float(time_s))
    assert seeker.blocked and speeds == (0.0, 0.0)
    assert seeker.why == "it is there, but has not turned further to the goal's yaw for 5 s"


def test_last_range_counts_while_a_reading_is_invalid():
    """The robot drives at half speed beside something; for the next half second the sonar says nothing."""
    seeker = GoalSeeker((3.0, 0.0, 0.0), LIMITS, 0.0, {"left": SonarMount(0.0, 0.1, 90.0)})
    seeker.command((0.0, 0.0, 0.0), {"left": 0.25}, 0.0)
    assert seeker.command((0.0, 0.0, 0.0), {"left": math.nan}, 0.5) == (0.5 * LIMITS.linear_m_s, 0.0)
