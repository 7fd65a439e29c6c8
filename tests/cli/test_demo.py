"""`mrl demo`: an emulated robot and what drives it, in one terminal."""

import os
import signal

import pytest

from mrl_driver.apps.web import command, listening
from sim_arduino import demo

from .run import fails, mrl
from .terminal import Terminal


def test_keys_drive_the_emulated_robot_and_q_ends_all():
    terminal = Terminal("demo")
    terminal.wait_for(r"front +\S+ +[\d.]+ m")  # the first frames are without readings
    terminal.wait_for(r"\+0\.250 m/s", b"w")
    terminal.press(b"q")
    assert terminal.end() == 0
    terminal.wait_for(
        r"x .* front [\d.]+ m .* battery 1[\d.]+ V \(ok\)\s+next:(\s+?\n  [^\r\n]{1,78}){2}\s+?\n  mrl new"
    )


@pytest.mark.parametrize(("key", "code"), [(b"q", 0), (b"\x03", 130)])
def test_page_ends_with_a_key(key, code):
    terminal = Terminal("demo", "--web")
    terminal.wait_for("shows traxbot 1; q ends it")
    terminal.press(key)
    assert terminal.end() == code


def test_page_ends_with_a_key_in_a_program_of_a_script():
    """Such a one ignores Ctrl-C if it was started in the background."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        terminal = Terminal("demo", "--web")
    finally:
        signal.signal(signal.SIGINT, before)
    terminal.wait_for("shows traxbot 1; q ends it")
    terminal.press(b"q")
    assert terminal.end() == 0


@pytest.mark.parametrize("busy", [False, True])
def test_page_is_at_the_port_of_mrl_web_if_that_is_free(busy, monkeypatch):
    given = []
    monkeypatch.setattr(command.web, "main", lambda words, **_: given.extend(words))
    with listening.listening_socket(listening.HOST, 0) as other:
        monkeypatch.setattr(listening, "PORT", other.getsockname()[1])
        if not busy:
            other.close()
        assert mrl("demo", "--web").returncode == 0
    assert f"{listening.HOST}:{0 if busy else listening.PORT}" in given


def test_a_terminal_without_keys_leaves_ctrl_c_as_it_was(monkeypatch):
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        monkeypatch.setattr(demo.Keyboard, "__enter__", lambda self: os.read(-1, 1))
        assert mrl("demo", "--web").returncode
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


def test_without_ros_the_way_to_ros_is_named(monkeypatch):
    monkeypatch.setattr(demo.importlib.util, "find_spec", lambda name: None)
    assert "make run" in fails(2, "demo", "--ros")


def test_the_demonstration_through_ros_has_no_other_world():
    assert "--world is given with --ros" in fails(2, "demo", "--ros", "--world", "square")


def test_its_own_robot_wins_over_that_of_the_program():
    assert "nowhere" in fails(2, "--robot", "duo", "demo", "--robot", "nowhere")
