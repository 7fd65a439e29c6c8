"""What the node's services and `set_pose` do and refuse; driver and commander only say what they are told to."""

import math
from functools import partial
from types import SimpleNamespace

import pytest
from geometry_msgs.msg import Point, Pose, PoseWithCovariance, PoseWithCovarianceStamped, Quaternion
from std_msgs.msg import Header

from mrl_driver.driver import Driver
from mrl_driver.errors import BoardTimeout, LinkLost
from mrl_driver.geometry import ORIGIN
from mrl_driver.protocol.table import BY_NAME, PARAMETER_BY_NAME
from mrl_driver.robot import models
from mrl_driver.robot.covariance import AT_START
from mrl_driver.robot.inputs import Inputs
from ros1_bridge.robot.services import Services


@pytest.fixture
def done():
    """What the services did."""
    return []


def services(done, twist=(0.0, 0.0), driving=False, seeking=False, manual=False, localisers=()):

    def reset_pose(pose, spread):
        Driver("/dev/null").reset_pose(pose, spread)  # which refuses what is no covariance
        done.append((pose, spread))

    driver = SimpleNamespace(twist=twist, reset_pose=reset_pose, request=lambda *args: done.append(args))
    commander = SimpleNamespace(driving=driving, seeking=seeking, ready=True, manual=manual)
    return Services(driver, commander, lambda: localisers)


def wanted(x_m=1.0, frame="odom", variances=(0.04, 0.09, 0.01)):
    """A message on `set_pose` that turns the robot by 90 degrees."""
    pose = PoseWithCovariance(Pose(Point(x_m, 2.0, 0.0), Quaternion(0.0, 0.0, 1.0, 1.0)), [0.0] * 36)
    pose.covariance[0], pose.covariance[7], pose.covariance[35] = variances
    return PoseWithCovarianceStamped(Header(frame_id=frame), pose)


def set_pose(made, **other):
    return made.set_pose(wanted(**other), "odom")


def test_robot_at_rest_gets_a_new_origin(done):
    assert services(done).reset_odometry()[0] and done == [(ORIGIN, AT_START)]


@pytest.mark.parametrize("frame", ["", "odom"])
def test_pose_and_covariance_are_set(done, frame):
    assert set_pose(services(done, twist=(0.0, 0.02)), frame=frame) == (True, "the pose is 1, 2, 1.5708")
    assert done == [(pytest.approx((1.0, 2.0, math.pi / 2)), (0.04, 0.0, 0.0, 0.09, 0.0, 0.01))]


@pytest.mark.parametrize(
    "other, words",
    [
        ({"frame": "map"}, "the pose is in 'map', expected odom"),
        ({"x_m": math.nan}, "position is nan"),
        ({"variances": (0.1, -0.1, 0.1)}, "the covariance of the pose is"),
    ],
)
def test_pose_that_makes_no_sense_is_refused(done, other, words):
    success, said = set_pose(services(done), **other)
    assert (success, done) == (False, []) and words in said


UNDER_WAY = [
    *({"twist": twist} for twist in ((0.1, 0.0), (0.0, -0.021), (0.0, 0.0, 0.1))),
    *({"driving": True}, {"seeking": True}),
]


@pytest.mark.parametrize("state", UNDER_WAY)
@pytest.mark.parametrize("action", [Services.reset_odometry, set_pose, Services.calibrate])
def test_robot_under_way_is_refused(done, action, state):
    """Also while it stands on its way to a pose, because a sonar is silent: the pose would be another place."""
    success, words = action(services(done, **state))
    assert (success, done) == (False, []) and "stop it first" in words
    if action is Services.calibrate:
        success, words = services(done, manual=True).calibrate()
        assert (success, done) == (False, []) and "faster than manual mode allows" in words


@pytest.mark.parametrize("action", [Services.reset_odometry, set_pose])
def test_pose_of_a_robot_that_is_localised_is_not_moved(done, action):
    """A localisation would take the jump for motion: with amcl, move_base said 1.7 m off that it has arrived."""
    success, words = action(services(done, localisers={"/hector", "/amcl"}))
    assert (success, done) == (False, []) and words.startswith("/amcl, /hector would")
    assert "initialpose" in words


def with_gains(gains, capabilities=("config",)):
    """Services of a board that has these gains."""
    numbers = {PARAMETER_BY_NAME[name].number: value for name, value in gains.items()}

    def ask(code, number):
        assert code == BY_NAME["read_config"].code
        if number not in numbers:
            raise BoardTimeout("no answer")
        return number, numbers[number]

    driver = SimpleNamespace(
        board=SimpleNamespace(capabilities=frozenset(capabilities)), ask=ask, model=models.load("traxbot")
    )
    return Services(driver, None)


def test_gains_that_are_offered_are_the_boards_own():
    """dynamic_reconfigure sends all three if one is changed: calibrated gains would be overwritten."""
    gains = {"kp": 800, "ki": 350, "kd": 210}
    assert with_gains(gains).gains() == gains
    assert with_gains({}, ()).gains() == {"kp": 700, "ki": 400, "kd": 200}, (
        "those of the model, if it does not tell them"
    )
    with pytest.raises(BoardTimeout):
        with_gains({"kp": 800}).gains()  # not guessed


@pytest.mark.parametrize(
    "latched, words",
    [(True, "released; the robot stands until the next command"), (False, "no emergency stop was latched")],
)
def test_release_of_the_stop_lets_the_driver_follow_commands_whatever_the_commander_tells(
    done, latched, words
):
    commander = SimpleNamespace(
        emergency=latched, release=lambda: done.append("released"), release_input=lambda: True
    )
    assert Services(None, commander).release_stop() == (True, words) and done == ["released"]


def test_an_emergency_stop_that_is_still_pressed_is_not_released(done):
    commander = SimpleNamespace(emergency=True, release=lambda: None, release_input=lambda: False)
    driver = SimpleNamespace(inputs=Inputs(("emergency_stop",), True))
    released, words = Services(driver, commander).release_stop()
    assert not released and words.startswith("emergency stop is pressed, or its wire is broken")


ACTIONS = {
    "stop": ((), ("latch",), "stopped; release_stop lets the robot follow commands again"),
    "enable_motors": ((True,), ("enable", True), "enabled"),
    "calibrate": (
        (),
        ("request", 1),
        "the motor board calibrates, the wheels turn; reset_odometry afterwards",
    ),
    "set_gains": ((7, 8, 9), ("request", 2, 7, 8, 9), "gains are 7, 8, 9"),
}
FAILED = {
    "stop": "latched, but the robot cannot be reached: ",
    "enable_motors": "disabled, but the robot cannot be reached: ",
}


@pytest.mark.parametrize("error", [None, LinkLost("gone")])
@pytest.mark.parametrize("name", ACTIONS)
def test_an_action_is_answered_with_what_was_done_or_why_it_failed(done, name, error):
    args, called, words = ACTIONS[name]

    def call(*given):
        done.append(given)
        if error:
            raise error

    both = SimpleNamespace(twist=(0.0, 0.0), ready=True, driving=False, seeking=False, manual=False)
    vars(both).update({each: partial(call, each) for each in ("latch", "enable", "request")})
    answer = getattr(Services(both, both), name)(*args)
    assert answer == ((False, f"{FAILED.get(name, '')}gone") if error else (True, words)) and done == [called]


def test_motors_are_disabled_and_a_robot_that_is_not_ready_is_not_calibrated(done):
    commander = SimpleNamespace(enable=done.append, ready=False, refusal=lambda: "no telemetry")
    made = Services(None, commander)
    assert made.enable_motors(False) == (True, "stopped and disabled") and done == [False]
    assert made.calibrate() == (False, "refused: no telemetry")


def lose():
    raise LinkLost("gone")


def test_a_release_that_does_not_reach_the_board_says_so():
    commander = SimpleNamespace(emergency=True, release=lambda: None, release_input=lose)
    driver = SimpleNamespace(radio=SimpleNamespace(release_hold=lose))
    made = Services(driver, commander)
    assert made.release_stop() == made.release_hold() == (False, "gone")


def test_frame_of_others_is_quoted_in_one_short_line(done):
    _, words = set_pose(services(done), frame="\x1b[2J\n[ERROR] " * 100)
    assert words.isprintable() and len(words) < 150


@pytest.mark.parametrize(
    "free, message", [(True, "released; the robot stands until the next command"), (False, "radio 7 holds")]
)
def test_release_of_a_hold_says_whether_the_robot_is_free(free, message):
    driver = SimpleNamespace(radio=SimpleNamespace(release_hold=lambda: free, hold="radio 7 holds"))
    assert Services(driver, None).release_hold() == (free, message)
