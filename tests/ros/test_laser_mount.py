"""The laser's place on the robot: looked up once, for the laser of the first scan."""

from types import SimpleNamespace

import pytest
import tf2_ros

from ros1_bridge.control.laser_mount import MountFinder


@pytest.fixture
def finder(monkeypatch):
    """A finder on a robot with a laser in front and one behind, which looks back."""
    places = {"front": (0.1, 0.0, 1.0), "rear": (-0.1, 1.0, 0.0)}

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


def test_laser_without_a_place_is_named(finder):
    assert finder.mount("nowhere") is None and "nowhere has no place on the robot" in finder.trouble


def test_scan_of_a_second_laser_is_not_taken_for_one_of_the_first(finder):
    """Its points would be on the wrong side of the robot."""
    finder.mount("front")
    assert finder.mount("rear") is None
    assert finder.trouble == "it is in frame rear, expected front as before: the zones watch one laser"
