"""What the node's services refuse, with a driver and a commander that only say what they are told to."""

from types import SimpleNamespace

import pytest

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
