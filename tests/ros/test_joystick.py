"""Joystick layouts, the tilt of a Wiimote, and the nodes for joystick and keys."""

import math
import os
import pty
import signal
import subprocess
import termios

import pytest
import rospy
from geometry_msgs.msg import Twist
from hypothesis import given
from hypothesis import strategies as st
from sensor_msgs.msg import Joy
from std_msgs.msg import Header

from ros1_bridge.teleop.joystick_mapping import GRAVITY_M_S2, LAYOUTS, REPEATED_S, Joystick, shares_of
from tests.waiting import wait_until

from .rig import ROOT, START_S

PS3, WIIMOTE = LAYOUTS["ps3"], LAYOUTS["wiimote"]


def pressed(*indices):
    return [int(i in indices) for i in range(17)]


@pytest.mark.parametrize(
    "layout, axes, buttons, shares",
    [
        (PS3, [1.0, 1.0], pressed(), None),
        (PS3, [0.5, 1.0], pressed(PS3.dead_man), (1.0, 0.5)),
        (PS3, [0.05, -0.05], pressed(PS3.dead_man), (0.0, 0.0)),
        (WIIMOTE, [0.1, 9.8, 0.2], pressed(WIIMOTE.dead_man, 7, 8), (1.0, 1.0)),
        *((layout, [], [], None) for layout in LAYOUTS.values()),
    ],
    ids=lambda each: getattr(each, "name", None),
)
def test_stick_and_cross_drive_while_the_dead_man_button_is_held(layout, axes, buttons, shares):
    """A stick at rest does not creep.  A Wiimote is held sideways: its right is forward, its up is left."""
    assert shares_of(layout, axes, buttons) == shares


class Hand:
    """Holds a Wiimote at 100 Hz, with B pressed unless told otherwise; its time and stamps are its own."""

    def __init__(self):
        self.joystick, self.now_s, self.stamp_s = Joystick(LAYOUTS["wiimote_tilt"]), 50.0, 1e9

    def hold(self, pitch_deg=0.0, roll_deg=0.0, seconds=1.0, *cross, held=True, g=1.0, repeats=False):
        """Nose down and right side down are positive; returns the last shares."""
        pitch, roll = math.radians(pitch_deg), math.radians(roll_deg)
        up = (math.sin(roll), math.sin(pitch), math.sqrt(1 - math.sin(pitch) ** 2 - math.sin(roll) ** 2))
        buttons = pressed(*([WIIMOTE.dead_man] if held else []), *cross)
        for _ in range(round(seconds * 100)):
            self.now_s += 0.01
            self.stamp_s += 0.0 if repeats else 0.01
            share = g() if callable(g) else g
            axes = [GRAVITY_M_S2 * share * part for part in up]
            shares = self.joystick.shares(axes, buttons, self.stamp_s, self.now_s)
        return shares


@pytest.fixture
def hand():
    """A hand that has pressed B with the Wiimote flat."""
    made = Hand()
    assert made.hold() == (0.0, 0.0)
    return made


@pytest.mark.parametrize(
    "tilt, shares",
    [
        ((30, 0), (1.0, 0.0)),
        ((-30, 0), (-1.0, 0.0)),
        ((0, 30), (0.0, -1.0)),
        ((0, -17.5), (0.0, 0.5)),
        ((4.9, -4.9), (0.0, 0.0)),
        ((60, 10), (1.0, -0.2)),
    ],
)
def test_tilt_drives_from_the_dead_band_to_full_deflection(hand, tilt, shares):
    """Nose down is forward, right side down turns right."""
    assert hand.hold(*tilt) == pytest.approx(shares, abs=1e-3)


def test_the_position_in_which_b_is_pressed_is_neutral(hand):
    hand.hold(20, 10, held=False)
    assert hand.hold(20, 10) == (0.0, 0.0)
    assert hand.hold(50, 10) == pytest.approx((1.0, 0.0), abs=1e-3)


def test_a_trembling_hand_is_smoothed(hand):
    """10 Hz and 6 deg to either side: less than a fifth of the way to full speed gets through."""
    hand.hold(17.5)
    seen = [hand.hold(17.5 + 6 * math.sin(2 * math.pi * n / 10), 0, 0.01)[0] for n in range(100)]
    assert max(seen) - min(seen) < 0.2 * 12 / 25 * 2


def test_free_fall_stops_within_a_tenth_of_a_second(hand):
    hand.hold(20)
    assert hand.hold(20, 0, 0.1, g=0.0) == (0.0, 0.0)


def test_a_shaken_wiimote_drives_again_only_after_b_was_released(hand):
    strokes = iter(range(1000))
    assert hand.hold(20, 0, 0.3, g=lambda: 1 + 0.8 * math.sin(next(strokes))) == (0.0, 0.0)
    assert "shaken" in hand.joystick.trouble
    assert hand.hold(20) == (0.0, 0.0)
    hand.hold(0, 0, held=False)
    hand.hold()
    assert hand.hold(30) == pytest.approx((1.0, 0.0), abs=1e-3)


def test_a_wiimote_that_is_not_flat_when_b_is_pressed_does_not_drive():
    hand = Hand()
    hand.hold(50, 0, held=False)
    hand.hold(50)
    assert hand.hold(0) == (0.0, 0.0)
    assert "50 deg from flat" in hand.joystick.trouble


def test_a_wiimote_out_of_reach_stops_though_its_node_repeats_that_b_is_held(hand):
    assert hand.hold(30)[0] == pytest.approx(1.0, abs=1e-3)
    assert hand.hold(30, 0, REPEATED_S - 0.02, repeats=True) is not None
    assert hand.hold(30, 0, 0.05, repeats=True) is None


def test_cross_replaces_the_tilt_while_it_is_pressed(hand):
    tilted = LAYOUTS["wiimote_tilt"]
    assert hand.hold(30, 0, 1.0, tilted.back, tilted.left) == (-1.0, 1.0)


@given(st.lists(st.floats(width=32), max_size=6), st.lists(st.integers(0, 1), max_size=17))
def test_a_joystick_never_asks_for_more_than_full_speed(axes, buttons):
    for layout in LAYOUTS.values():
        joystick = Joystick(layout)
        for now_s in (1.0, 1.01, 1.02):
            shares = joystick.shares(axes, buttons, 0.0, now_s)
            assert shares is None or all(-1 <= share <= 1 for share in shares)


def test_node_passes_on_and_ends_with_one_stop(rig):
    rig.program("teleop_joystick")
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


def test_release_that_seems_older_than_the_computer_is_a_stop(rig):
    """As if a clock was set between the release and its arrival."""
    rig.program("teleop_joystick")
    joy, twists = rig.publisher("joy", Joy), rig.topic("cmd_vel", Twist)
    twists.wait_for_publisher()

    def driven():
        now = Header(stamp=rospy.Time.now())
        joy.publish(header=now, axes=[0.0, 1.0], buttons=pressed(PS3.dead_man))
        return bool(twists.messages)

    wait_until(driven)
    joy.publish(header=Header(stamp=rospy.Time(1)), axes=[0.0, 1.0], buttons=pressed())
    wait_until(lambda: twists.messages[-1] == Twist())


NODE = ROOT / "ros1_bridge" / "nodes" / "teleop_keyboard"


@pytest.fixture
def keys(rig):
    """The node in a terminal; writes to `master` are its keys."""
    master, slave = pty.openpty()
    before = termios.tcgetattr(slave)
    command = [str(NODE), f"__ns:={rig.ns}", "_linear_speed:=0.2"]
    node = subprocess.Popen(
        command, stdin=slave, stdout=slave, stderr=slave, env=rig.env, start_new_session=True
    )
    rig.twists = rig.topic("cmd_vel", Twist)
    rig.twists.wait_for_publisher()
    wait_until(lambda: not termios.tcgetattr(slave)[3] & termios.ICANON)
    yield rig, node, master
    if node.poll() is None:
        node.kill()
    node.wait()
    assert termios.tcgetattr(slave) == before, "the terminal is not as it was"
    for fd in (master, slave):
        os.close(fd)


def test_keys_drive_until_they_are_let_go_and_q_ends(keys):
    """A key counts as held for 0.6 s; then one stop is sent, and nothing more."""
    rig, node, master = keys
    os.write(master, b"w\x1b[D")
    driving = rig.twists.wait(2)[1]
    assert (driving.linear.x, driving.angular.z) == (0.2, 0.9)
    wait_until(lambda: rig.twists.messages[-1] == Twist())
    assert rig.twists.messages.count(Twist()) == 1
    os.write(master, b"s")
    wait_until(lambda: rig.twists.messages[-1].linear.x == -0.2)
    os.write(master, b"q")
    assert node.wait(START_S) == 0
    wait_until(lambda: rig.twists.messages[-1] == Twist())


def test_ctrl_c_amid_driving_is_a_stop(keys):
    rig, node, master = keys
    os.write(master, b"w")
    rig.twists.wait(2)
    node.send_signal(signal.SIGINT)
    assert node.wait(START_S) == 0
    wait_until(lambda: rig.twists.messages[-1] == Twist())
