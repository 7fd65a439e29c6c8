"""A stop that the board makes by itself is final: it refuses moves until the host's stop, and says so."""

import pytest

from mrl_driver.protocol import encode_request
from mrl_driver.protocol.stop_reason import STOP_REASONS
from mrl_driver.protocol.table import BY_NAME
from sim_arduino.board.python_board import CHECK_SILENCE_S
from sim_arduino.hardware.xbee import RadioFit

from .test_hold_rows import BOARD, HOLDER, SILENCE, SILENCE_S, Robot

WATCHDOG_MS = 60
SILENT_S = 0.07
MOVE = ("move_differential", 150, 0)


def refused_for(bench) -> str:
    """Sends a move; the stop reason in the status that answers it."""
    (status,) = bench.ask(*MOVE)
    assert status.code == BY_NAME["read_status"].code
    return STOP_REASONS[status.args[3]]


@pytest.fixture
def stopped(bench):
    """A robot that its board has stopped, because the host was silent."""
    bench.ask("set_watchdog", WATCHDOG_MS)
    bench.ask(*MOVE)
    bench.run(SILENT_S)
    return bench


def test_moves_are_refused_and_answered_with_the_status_until_the_host_has_stopped_the_robot(stopped):
    assert refused_for(stopped) == "link_watchdog" and not stopped.is_driven()
    assert stopped.counters() == {"unavailable": 1}
    stopped.ask("stop")
    assert stopped.ask(*MOVE) == [] and stopped.is_driven()


def test_a_move_of_speed_zero_is_refused_too_and_does_not_end_it(stopped):
    stopped.ask("move_differential", 0, 0)
    stopped.ask(*MOVE)
    assert not stopped.is_driven()


def test_a_host_that_turns_the_watchdog_off_can_drive_as_in_2013(stopped):
    stopped.ask("set_watchdog", 0)
    assert stopped.ask(*MOVE) == [] and stopped.is_driven()


def test_a_host_of_2013_can_drive_after_the_session_of_another_has_ended_without_a_stop(bench):
    bench.ask("set_check", 1)
    bench.ask("set_watchdog", WATCHDOG_MS)
    bench.ask(*MOVE)
    bench.run(SILENT_S)
    bench.ask("set_check", 0)
    bench.ask(*MOVE)
    assert bench.is_driven()
    bench.run(SILENT_S)
    bench.ask(*MOVE)
    assert bench.is_driven()


def after_the_checksums(bench, watchdog_ms):
    """A robot whose board has stopped it and ended the checksums, and a move that the line has held up meanwhile."""
    bench.ask("set_check", 1)
    bench.ask("set_watchdog", watchdog_ms)
    bench.ask(*MOVE)
    bench.run(CHECK_SILENCE_S + SILENT_S)
    bench.checked = False
    return encode_request(BY_NAME[MOVE[0]].code, *MOVE[1:], checked=True)


@pytest.mark.parametrize(("watchdog_ms", "reason"), [(WATCHDOG_MS, "link_watchdog"), (5000, "check_ended")])
def test_a_move_that_the_line_held_up_until_the_checksums_have_ended_is_refused(bench, watchdog_ms, reason):
    held_up = after_the_checksums(bench, watchdog_ms)
    bench.send(held_up)
    assert not bench.is_driven() and bench.stop_reason() == reason
    bench.ask("stop")
    bench.send(held_up)
    assert bench.is_driven()


def test_a_host_that_turns_off_checksums_which_have_ended_can_drive_as_in_2013(bench):
    after_the_checksums(bench, WATCHDOG_MS)
    bench.send(encode_request(BY_NAME["set_check"].code, 0, checked=True))
    bench.ask(*MOVE)
    assert bench.is_driven()


def test_a_stop_by_the_host_is_not_one_of_them(bench):
    bench.ask("set_watchdog", 1000)
    for _ in range(2):
        bench.ask(*MOVE)
        assert bench.is_driven()
        bench.ask("stop")


def test_after_a_hold_by_radio_the_host_must_stop_the_robot_too(benches):
    bench = benches("omni3md", radio=RadioFit(BOARD), stored={"radio_hold": SILENCE})
    bench.run(SILENCE_S)
    bench.ask("set_watchdog", 1000)
    bench.ask(*MOVE)
    robot = Robot(bench, HOLDER)
    robot.say("hold", 1)
    robot.say("free", 1)
    assert refused_for(bench) == "held" and not bench.is_driven()
    bench.ask("stop")
    bench.ask(*MOVE)
    assert bench.is_driven()


def test_a_motor_board_that_comes_back_does_not_drive_on(benches):
    bench = benches("omni3md")
    bench.ask("set_watchdog", 1000)
    bench.ask(*MOVE)
    bench.plant.motor_board.present = False
    bench.ask("start_stream", 10, wait_s=0.1)
    bench.plant.motor_board.present = True
    bench.ask("stop_stream", wait_s=0.3)
    assert refused_for(bench) == "motor_board" and not bench.is_driven()
    bench.ask("stop")
    bench.ask(*MOVE)
    assert bench.is_driven()
