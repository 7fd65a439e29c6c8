"""The laser's place on the robot: looked up once, for the laser of the first scan."""

import math
from types import SimpleNamespace

import pytest
import tf2_ros

from ros1_bridge.control.zone_feed import MountFinder


@pytest.fixture
def finder(monkeypatch):
    """A finder on a robot with a laser in front, one behind, which looks back, and one with a place that is none."""
    places = {"front": (0.1, 0.0, 1.0), "rear": (-0.1, 1.0, 0.0), "nan": (math.nan, 0.0, 1.0)}

    def lookup_transform(_base, frame, _time):
        if frame not in places:
            raise tf2_ros.LookupException(f"no {frame}")
        x, turn_z, turn_w = places[frame]
        at, turn = SimpleNamespace(x=x, y=0.0, z=0.0), SimpleNamespace(x=0.0, y=0.0, z=turn_z, w=turn_w)
        return SimpleNamespace(transform=SimpleNamespace(translation=at, rotation=turn))

    buffer = SimpleNamespace(lookup_transform=lookup_transform)
    monkeypatch.setattr(tf2_ros, "Buffer", lambda: buffer)
    monkeypatch.setattr(
        tf2_ros, "TransformListener", lambda _: SimpleNamespace(unregister=lambda: places.pop("front", None))
    )
    return MountFinder("base_link")


def test_place_is_looked_up_once(finder):
    assert finder.mount("front") == finder.mount("front") == (0.1, 0.0, 0.0)


def test_scan_of_a_second_laser_is_not_taken_for_one_of_the_first(finder):
    """Its points would be on the wrong side of the robot."""
    finder.mount("front")
    assert finder.mount("rear") is None
    assert finder.trouble == "it is in frame 'rear', expected 'front' as before: the zones watch one laser"


def test_place_that_is_not_finite_is_none(finder):
    assert finder.mount("nan") is None and "expected finite numbers" in finder.trouble
    assert finder.mount("nowhere") is None and "'nowhere' has no place on the robot" in finder.trouble
    assert finder.mount("front") == (0.1, 0.0, 0.0), "a later place is taken"


@pytest.mark.parametrize("before", ["front", "nowhere"])
def test_frame_of_a_scan_is_quoted_in_one_line(finder, before):
    """tf repeats the whole frame in its error."""
    finder.mount(before)
    finder.mount("\x1b[2J\n[ERROR] " * 1000)
    assert finder.trouble.isprintable() and len(finder.trouble) < 1200
