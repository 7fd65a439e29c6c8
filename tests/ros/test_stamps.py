"""Stamps of frames: wall time that never repeats, read from the messages."""

from types import SimpleNamespace

from hypothesis import given, settings
from hypothesis import strategies as st

from mrl_driver.driver import Telemetry
from mrl_driver.geometry import ORIGIN
from mrl_driver.robot.models import load
from mrl_driver.robot.odometry import Twist, Wheels
from ros1_bridge.node.robot_parameters import check
from ros1_bridge.topics.publishers import STEP_S, Publishers

WALL_S = 1.8e9
FLOAT_NS = 240
"""Step of a float at that time."""


class Stamps:
    """Publishers whose odometry has a subscriber that keeps the last message."""

    def __init__(self):
        self._now_s = self._wall_s = 0.0
        parameters, model = check({"port": "p"}, "node"), load("traxbot")
        self._out = Publishers(
            self._publisher, OSError, parameters, model, lambda: self._wall_s, lambda: self._now_s
        )

    def _publisher(self, topic, kind, **_options):
        connection = SimpleNamespace(socket=None, write_data=lambda data: self._keep(kind, data))
        impl = SimpleNamespace(
            connections=[connection] if topic == "odom" else [], add_subscriber_listener=lambda _: None
        )
        return SimpleNamespace(impl=impl)

    def _keep(self, kind, data):
        stamp = kind().deserialize(data[4:]).header.stamp
        self._last = stamp.secs, stamp.nsecs

    def next(self, event_s, monotonic_s, wall_s):
        """The stamp of a frame at `event_s`, published when the clocks show these times."""
        self._now_s, self._wall_s = monotonic_s, wall_s
        self._out.telemetry(Telemetry(event_s, event_s, ORIGIN, Twist(0.0, 0.0), {}, (), Wheels(0, 0), None))
        return self._last


def ns(stamp):
    return stamp[0] * 10**9 + stamp[1]


def test_stamp_is_the_wall_time_of_the_event():
    assert Stamps().next(1.5, 2.0, 1000.0) == (999, 500_000_000)


def test_two_frames_out_of_one_read_get_two_stamps():
    stamps = Stamps()
    first, second = (ns(stamps.next(1.0, 1.0, WALL_S)) for _ in range(2))
    assert abs(second - first - STEP_S * 1e9) <= FLOAT_NS


def test_clock_that_is_set_back_is_followed():
    stamps = Stamps()
    stamps.next(1.0, 1.0, WALL_S)
    assert stamps.next(1.0, 1.0, WALL_S - 3600) == (WALL_S - 3600, 0)


def test_simulated_time_that_stands_at_its_start_gives_stamps_too():
    stamps = Stamps()
    made = [ns(stamps.next(event_s, 3.0, 0.0)) for event_s in (0.0, 2.9, 3.0)]
    assert made == sorted(set(made)) and made[0] == 0


@settings(max_examples=50)
@given(st.lists(st.floats(0, 0.9), min_size=1))
def test_stamps_increase(events):
    """Whatever the jitter below a second."""
    stamps = Stamps()
    made = [ns(stamps.next(event_s, 1.0, WALL_S)) for event_s in events]
    assert all(before < after for before, after in zip(made, made[1:]))
