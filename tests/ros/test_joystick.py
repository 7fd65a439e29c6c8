"""Joystick layouts, and the node on messages."""

import pytest
from geometry_msgs.msg import Twist
from hypothesis import given
from hypothesis import strategies as st
from sensor_msgs.msg import Joy

from ros1_bridge.teleop.joystick_mapping import LAYOUTS, shares_of
from tests.waiting import wait_until

from .rig import ROOT, START_S

PS3, WIIMOTE = LAYOUTS["ps3"], LAYOUTS["wiimote"]


def pressed(*indices):
    return [int(i in indices) for i in range(17)]


def test_nothing_moves_without_the_dead_man_button():
    assert shares_of(PS3, [1.0, 1.0], pressed()) is None


def test_stick_drives():
    assert shares_of(PS3, [0.5, 1.0], pressed(PS3.dead_man)) == (1.0, 0.5)


def test_stick_at_rest_does_not_creep():
    assert shares_of(PS3, [0.05, -0.05], pressed(PS3.dead_man)) == (0.0, 0.0)


def test_wiimote_drives_with_its_cross():
    """Held sideways: its right is forward, its up is left."""
    assert shares_of(WIIMOTE, [0.1, 9.8, 0.2], pressed(WIIMOTE.dead_man, 7, 8)) == (1.0, 1.0)


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=list(LAYOUTS))
def test_message_that_is_too_short_moves_nothing(layout):
    assert shares_of(layout, [], []) is None


@given(st.lists(st.floats(width=32), max_size=4), st.lists(st.integers(0, 1), max_size=17))
def test_shares_are_at_most_one(axes, buttons):
    for layout in LAYOUTS.values():
        shares = shares_of(layout, axes, buttons)
        assert shares is None or all(-1 <= share <= 1 for share in shares)


def test_node_passes_on_and_ends_with_one_stop(rig):
    rig.start("joystick", str(ROOT / "ros1_bridge" / "nodes" / "teleop_joystick"), f"__ns:={rig.ns}")
    joy, twists = rig.publisher("joy", Joy), rig.topic("cmd_vel", Twist)
    twists.wait_for_publisher()

    def driven():
        """The first twists may be gone before the node knows of us."""
        joy.publish(axes=[0.0, 1.0], buttons=pressed(PS3.dead_man))
        return bool(twists.messages)

    wait_until(driven)
    assert twists.messages[0].linear.x == 0.25
    joy.publish(axes=[0.0, 1.0], buttons=pressed())
    wait_until(lambda: twists.messages[-1] == Twist())
    joy.publish(axes=[0.0, 1.0], buttons=pressed())
    count = len(twists.messages)
    joy.publish(axes=[0.0, 1.0], buttons=pressed(PS3.dead_man))
    assert twists.wait(count + 1)[count].linear.x == 0.25
    assert twists.messages.count(Twist()) == 1


def test_unknown_layout_is_named(rig):
    node = ROOT / "ros1_bridge" / "nodes" / "teleop_joystick"
    started = rig.start("joystick", str(node), f"__ns:={rig.ns}", "_layout:=tank")
    assert started.wait(START_S)
    assert started.exit_code == 2
    assert any("'tank', expected one of ps3, wiimote" in line for line in started.output())
