"""A planner drives as fast as the zones allow, and gets its own speed back."""

import math
import signal

import pytest
import rospy
from dynamic_reconfigure.server import Server
from hypothesis import given
from hypothesis import strategies as st

from mrl_driver.errors import ConfigError
from ros1_bridge.control.planner_limit import RAISE_S, STEP_M_S, PlannerLimit
from ros1_bridge.node.parameters import Row
from ros1_bridge.robot.reconfigure import Description
from tests.waiting import wait_until

from . import stand_ins
from .rig import START_S

OWN, SLOWEST = 0.3, 0.05
FREE = math.inf


class Planner:
    """A planner's parameters, and what is stored about it."""

    def __init__(self, own=OWN):
        self.values = {"max_vel_x": own, "min_vel_x": SLOWEST}
        self.stored, self.calls, self.now = None, [], 0.0
        self.limit = self.new_node()

    def new_node(self):
        self.limit = PlannerLimit(self.configure, self.store, self.stored)
        return self.limit

    def configure(self, values):
        self.calls.append(dict(values))
        self.values.update(values)
        return self.values

    def store(self, pair):
        self.stored = pair

    def step(self, allowed, seconds=0.2):
        """The line of the log, and the planner's speed after some seconds with this allowed speed."""
        lines = []
        for _ in range(max(1, round(seconds / 0.2))):
            self.now += 0.2
            lines.append(self.limit.step(allowed, self.now))
        return "".join(lines), self.values["max_vel_x"]


@pytest.mark.parametrize(
    "own, allowed, speed", [(OWN, FREE, OWN), (OWN, 0.17, 0.15), (0.12, 0.25, 0.12), (OWN, 0.0, SLOWEST)]
)
def test_zone_lowers_the_planners_speed_at_once_but_not_below_its_slowest(own, allowed, speed):
    """A highest speed below its lowest one makes no sense to the planner, which is not asked while the way is free."""
    planner = Planner(own)
    line, now_m_s = planner.step(allowed)
    assert now_m_s == pytest.approx(speed) and bool(planner.calls) == (allowed < FREE)
    assert bool(line) == (speed < own)
    assert line in ("", f"a zone is entered: the planner drives at {speed:g} m/s at most")


def test_speed_is_given_back_when_the_zone_has_been_clear_for_a_while():
    planner = Planner()
    planner.step(0.17)
    assert planner.step(FREE, RAISE_S - 0.4)[1] == pytest.approx(0.15)
    assert planner.step(FREE, 1.0) == ("the planner has its own highest speed again, 0.3 m/s", OWN)


def test_range_that_flickers_raises_nothing():
    planner = Planner()
    planner.step(0.1)
    for _ in range(20):
        assert planner.step(FREE, 0.4)[1] == planner.step(0.1)[1] == pytest.approx(0.1)


def test_planner_is_told_seldom():
    planner = Planner()
    for allowed in range(290, 100, -1):
        planner.step(allowed / 1000)
    assert sum(bool(call) for call in planner.calls) == round((0.29 - 0.10) / STEP_M_S)


def test_speed_that_somebody_else_sets_meanwhile_stays():
    planner = Planner()
    planner.step(0.17)
    planner.values["max_vel_x"] = 0.22
    assert planner.step(FREE, 5.0)[1] == 0.22


@pytest.mark.parametrize("restarted, speed", [(False, OWN), (True, 0.25)])
def test_node_that_was_killed_in_a_zone_leaves_no_slow_planner(restarted, speed):
    planner = Planner()
    planner.step(0.17)
    if restarted:
        planner.values["max_vel_x"] = 0.25
    planner.new_node()
    assert planner.step(FREE, 5.0)[1] == speed and planner.stored is None


def test_planner_without_a_highest_speed_is_refused():
    planner = Planner()
    del planner.values["max_vel_x"]
    with pytest.raises(ConfigError, match="has no parameter max_vel_x, expected"):
        planner.step(0.1)


@given(st.lists(st.floats(0.0, 1.0) | st.just(FREE), max_size=40))
def test_planner_is_never_faster_than_allowed_or_its_own(speeds):
    planner = Planner()
    for allowed in speeds:
        _, speed = planner.step(allowed)
        assert speed <= max(SLOWEST, min(allowed, OWN)) + 1e-9 or speed == OWN and allowed >= OWN
    planner.limit.give_back()
    assert planner.values["max_vel_x"] == OWN and planner.stored is None


@pytest.fixture
def planner(rig):
    """A planner's dynamic_reconfigure server, with the names and ranges of the real one, in the rig's namespace."""
    known = stand_ins.GROUPS["base_local_planner/TrajectoryPlannerROS"]["parameters"]
    rows = []
    for name, value in (("max_vel_x", OWN), ("min_vel_x", SLOWEST)):
        _, low, high = known[name].split()
        rows.append(Row(name, float, value, "", name, float(low), float(high)))
    told = []

    def note(config, _level):
        told.append(config["max_vel_x"])
        return config

    server = Server(Description(rows), note, f"{rig.ns}/move_base/TrajectoryPlannerROS")
    yield told
    server.set_service.shutdown()


def test_node_limits_the_planner_before_a_wall_and_gives_its_speed_back(rig, planner):
    board = rig.board("--robot", "traxbot", "--pose", "1.35,0,0")
    node = rig.node(board.port, "_zones:=sonars")
    wait_until(lambda: planner[-1] < OWN, START_S)
    assert planner[-1] >= SLOWEST
    node.signal(signal.SIGINT)
    assert node.wait(START_S)
    assert planner[-1] == OWN
    assert not rospy.has_param(f"{rig.ns}/move_base/TrajectoryPlannerROS/zone_limit")
