"""`mrl demo`: an emulated robot and what drives it, in one terminal."""

import signal

import pytest

from sim_arduino import demo
from tests.waiting import wait_until

from .run import fails
from .terminal import Terminal


def test_keys_drive_the_emulated_robot_and_q_ends_all():
    terminal = Terminal("demo")
    wait_until(lambda: b"asked" in terminal.seen)
    wait_until(lambda: terminal.press(b"w") or b"+0.250 m/s" in terminal.seen, step_s=0.1)
    terminal.press(b"q")
    assert terminal.end() == 0
    assert b"mrl new" in terminal.seen


@pytest.mark.parametrize(("key", "code"), [(b"q", 0), (b"\x03", 130)])
def test_page_ends_with_a_key(key, code):
    terminal = Terminal("demo", "--web")
    wait_until(lambda: b"shows traxbot" in terminal.seen)
    terminal.press(key)
    assert terminal.end() == code


def test_page_ends_with_a_key_in_a_program_of_a_script():
    """Such a one ignores Ctrl-C if it was started in the background."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        terminal = Terminal("demo", "--web")
    finally:
        signal.signal(signal.SIGINT, before)
    wait_until(lambda: b"shows traxbot" in terminal.seen)
    terminal.press(b"q")
    assert terminal.end() == 0


def test_without_ros_the_way_to_ros_is_named(monkeypatch):
    monkeypatch.setattr(demo.importlib.util, "find_spec", lambda name: None)
    assert "make run" in fails(2, "demo", "--ros")


def test_the_demonstration_through_ros_has_no_other_world():
    assert "--world is given with --ros" in fails(2, "demo", "--ros", "--world", "square")


def test_its_own_robot_wins_over_that_of_the_program():
    assert "nowhere" in fails(2, "--robot", "duo", "demo", "--robot", "nowhere")
