"""What the node's services refuse, with a driver and a commander that only say what they are told to."""

from types import SimpleNamespace

import pytest

from mrl_driver.errors import BoardTimeout
from mrl_driver.protocol.table import BY_NAME, PARAMETER_BY_NAME
from mrl_driver.robot import models
from ros1_bridge.robot.services import Services


@pytest.fixture
def done():
    """What the services did."""
    return []


def services(done, twist=(0.0, 0.0), moving=False, seeking=False):
    driver = SimpleNamespace(
        twist=twist, reset_pose=lambda: done.append("pose"), request=lambda *args: done.append(args)
    )
    commander = SimpleNamespace(moving=moving, seeking=seeking, ready=True)
    return Services(driver, commander, lambda: done.append("covariance"))


def test_robot_at_rest_gets_a_new_origin(done):
    assert services(done).reset_odometry()[0] and done == ["pose", "covariance"]


@pytest.mark.parametrize("state", [{"twist": (0.1, 0.0)}, {"moving": True}, {"seeking": True}])
@pytest.mark.parametrize("action", [Services.reset_odometry, Services.calibrate])
def test_robot_under_way_is_refused(done, action, state):
    """Also while it stands on its way to a pose, because a sonar is silent: the pose would be another place."""
    success, words = action(services(done, **state))
    assert (success, done) == (False, []) and "stop it first" in words


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
    return Services(driver, None, None)


def test_gains_that_are_offered_are_the_boards_own():
    """dynamic_reconfigure sends all three if one is changed: calibrated gains would be overwritten."""
    gains = {"kp": 800, "ki": 350, "kd": 210}
    assert with_gains(gains).gains() == gains


def test_gains_of_a_board_that_does_not_tell_them_are_the_models():
    assert with_gains({}, ()).gains() == {"kp": 700, "ki": 400, "kd": 200}


def test_gains_that_cannot_be_read_are_not_guessed():
    with pytest.raises(BoardTimeout):
        with_gains({"kp": 800}).gains()
