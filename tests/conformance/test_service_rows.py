"""Rows about the board itself, and what stops the robot when nobody tells it to."""

import pytest

from mrl_driver.protocol import Frame, Garbage, encode_request
from mrl_driver.protocol.stop_reason import STOP_REASONS
from mrl_driver.protocol.table import BAUD, BAUDS, PARAMETER_BY_NAME, RESET_CAUSES

from .bench import ANSWER_S, CAPABILITIES, STEP_S

WATCHDOG_MARGIN_S = 0.015
BEFORE_S = 0.002
"""An earlier release than at the end of the watchdog's period is wrong: the clocks' ticks, and a step."""
STALL_S = 0.254
"""Longer than the 250 ms after which bytes are stale; a CPU that serves no interrupt for 256 ms is reset."""


def test_protocol_and_capabilities_of_the_sonar_build(bench):
    assert bench.reply("read_protocol") == (2, CAPABILITIES[bench.motors])


def test_protocol_and_capabilities_of_the_environment_build(sensors):
    assert sensors.reply("read_protocol") == (2, 1 + 2 + 4 + 8 + 32 + 128 + 256)


def test_status_after_power_on(bench):
    status = bench.status()
    assert RESET_CAUSES[status.reset_cause] == "power_on"
    assert STOP_REASONS[status.stop_reason] == "boot"
    assert status.faults == 0


def test_uptime_counts_seconds(bench):
    bench.run(2.0)
    assert bench.status().uptime == 2


def test_stop_by_the_host_is_told(bench):
    bench.ask("move_differential", 100, 0)
    bench.ask("stop")
    assert bench.stop_reason() == "host"


def test_stop_of_a_standing_robot_keeps_the_reason_of_the_last_one(bench):
    bench.ask("stop")
    assert bench.stop_reason() == "boot"


def test_debug_is_off_at_first_and_can_be_set(bench):
    assert bench.reply("get_debug") == (0,)
    bench.ask("set_debug", 1)
    assert Frame(15, (1,)) in bench.ask("get_debug")


def test_debug_text_comes_behind_what_is_answered_at_once(bench):
    """An answer that waits for its counters is not cut, and the text is lost."""
    bench.ask("set_debug", 1)
    answers = [bench.send(request) for request in (b"@15e", b"@6e", b"@20e", b"@13e@13e")]
    assert answers == [
        b"@15,1e\r\n[INFO] get_debug\r\n",
        b"@6,0,0e\r\n",
        b"[ERROR] unavailable\r\n[INFO] read_alcohol\r\n",
        b"[INFO] stop\r\n[INFO] stop\r\n",
    ]


def test_debug_text_holds_no_frame(bench):
    bench.ask("set_debug", 1)
    assert bench.send(b"@1xe") == b"[ERROR] not_integer\r\n"


def test_reset_button(bench):
    bench.ask("move_differential", 300, 0)
    bench.board.reset()
    bench.run(0.6)
    status = bench.status()
    assert RESET_CAUSES[status.reset_cause] == "external"
    assert STOP_REASONS[status.stop_reason] == "boot"
    assert not bench.is_driven()


# ---- check value


def test_check_mode_adds_check_sequence_and_time(bench):
    assert bench.reply("set_check", 1) == (1,)
    first, second = (bench.ask("read_encoders")[0].stamp for _ in range(2))
    assert second.sequence - first.sequence == 1
    assert second.time - first.time == pytest.approx(ANSWER_S / 64e-6, abs=0.002 / 64e-6)


def test_in_check_mode_a_bare_request_is_refused(bench):
    bench.ask("set_check", 1)
    assert bench.send(b"@6e") == b""
    assert bench.counters() == {"bad_check": 1}


def test_a_plain_stop_works_in_check_mode(bench):
    bench.ask("move_differential", 200, 0)
    bench.ask("set_check", 1)
    bench.send(b"@13e")
    assert not bench.is_driven() and bench.stop_reason() == "host"


def test_the_host_ends_check_mode(bench):
    bench.ask("set_check", 1)
    assert bench.send(encode_request(32, 0, checked=True)).startswith(b"@32,0e")


def test_check_mode_ends_with_the_link_and_stops_the_motors(bench):
    bench.ask("set_check", 1)
    bench.ask("move_differential", 200, 0)
    bench.run(2.1)
    bench.checked = False
    assert bench.stop_reason() == "check_ended"
    assert not bench.is_driven()


# ---- watchdog


@pytest.mark.parametrize("period_ms", [100, 250, 500])
def test_watchdog_stops_the_motors(bench, period_ms):
    bench.ask("set_watchdog", period_ms)
    bench.send(b"@11,200,0e", wait_s=0.0)
    silent_from = bench.now_s + 10 * 86.8e-6
    bench.run(period_ms / 1000 - BEFORE_S)
    assert bench.is_driven()
    late_s = bench.run_until_released(0.1) - silent_from - period_ms / 1000
    assert -BEFORE_S <= late_s <= WATCHDOG_MARGIN_S + STEP_S
    assert bench.stop_reason() == "link_watchdog"


def test_watchdog_is_off_until_it_is_set(bench):
    bench.ask("move_differential", 200, 0)
    bench.run(3.0)
    assert bench.is_driven() and bench.stop_reason() == "none"


def test_watchdog_lets_a_robot_drive_while_frames_come(bench):
    bench.ask("set_watchdog", 200)
    bench.ask("move_differential", 200, 0)
    for _ in range(10):
        bench.ask("read_encoders", wait_s=0.1)
    assert bench.is_driven() and bench.stop_reason() == "none"


def test_garbage_does_not_feed_the_watchdog(bench):
    bench.ask("set_watchdog", 200)
    bench.ask("move_differential", 200, 0)
    for _ in range(4):
        bench.send(b"@99e@6xe", wait_s=0.1)
    assert not bench.is_driven()


# ---- stalls


def test_a_stall_stops_the_motors_and_drops_what_waited(bench):
    bench.ask("move_differential", 200, 0)
    bench.now_s += STALL_S
    bench.board.gap(bench.now_s, b"@11,300,0e" * 40)
    bench.run(0.1)
    assert not bench.is_driven() and bench.stop_reason() == "stall"


# ---- configuration


def test_parameters_are_read_by_number(bench):
    number = PARAMETER_BY_NAME["linear_ceiling"].number
    assert bench.reply("read_config", number) == (number, bench.model.board["linear_ceiling"])


def test_a_written_parameter_is_in_force_at_once(bench):
    bench.write_config("linear_ceiling", 100)
    bench.ask("move_differential", 300, 0, wait_s=3.0)
    assert bench.wheels() == pytest.approx((0.1, 0.1), abs=0.01)


def test_a_parameter_out_of_its_range_is_refused(bench):
    number = PARAMETER_BY_NAME["linear_ceiling"].number
    assert bench.ask("write_config", number, 0) == []
    assert bench.counters() == {"argument_range": 1}


def test_unsaved_parameters_are_gone_after_a_reset(bench):
    bench.write_config("linear_ceiling", 100)
    bench.board.reset()
    bench.run(0.6)
    assert bench.reply("read_config", 10) == (10, bench.model.board["linear_ceiling"])


def test_saved_parameters_survive_a_reset(bench):
    bench.write_config("linear_ceiling", 100)
    assert bench.reply("save_config", wait_s=0.3) == (1,)
    bench.board.reset()
    bench.run(0.6)
    assert bench.reply("read_config", 10) == (10, 100)
    assert bench.status().faults == 0


def test_gains_that_change_while_the_board_saves_are_saved_too(bench):
    bench.write_config("linear_ceiling", 100)
    bench.send(encode_request(36) + encode_request(2, 701, 401, 0), wait_s=0.3)
    assert b"@36,1e" in bench.text
    bench.board.reset()
    bench.run(0.6)
    assert bench.status().faults == 0
    assert bench.reply("read_config", 10) == (10, 100)
    assert bench.reply("read_config", PARAMETER_BY_NAME["kp"].number)[1] == 701


def test_defaults_follow_the_robot_id(bench):
    bench.write_config("robot_id", 4)
    assert bench.reply("default_config") == (1,)
    assert bench.reply("read_config", 1) == (1, 11000)
    assert bench.reply("read_config", 0) == (0, 4)


def test_an_unset_id_is_a_fault(bench):
    bench.write_config("robot_id", 0)
    assert bench.status().faults == 8


def test_guarded_requests_need_their_check_value(bench):
    assert bench.send(b"@35,10,100e@36e@37e@33,100e@32,1e@45,2e@50e") == b""
    assert bench.counters() == {"bad_check": 7}


# ---- what arrives together


def test_frames_cut_by_a_newer_one_still_stop(bench):
    bench.ask("move_differential", 200, 0)
    assert bench.send(b"@11,50@13e") == b""
    assert not bench.is_driven()


def test_many_requests_at_once_are_answered_in_order(bench):
    got = bench.ask("read_encoders") and bench.send(b"@6e@15e@17e@29e")
    assert got == b"@6,0,0e\r\n@15,0e\r\n@17,0e\r\n@29,2,%de\r\n" % CAPABILITIES[bench.motors]


def test_more_questions_than_the_wire_can_answer_are_counted(bench):
    """Each of 5 bytes asks for 23; those that find no room are lost, the next one is answered."""
    bench.send(b"@5e" * 100, wait_s=0.5)
    assert bench.counters()["overrun"] > 0
    answered = bench.ask("robot_info")
    assert answered and not any(isinstance(event, Garbage) for event in answered)


def test_a_request_whose_answer_finds_no_room_is_not_carried_out(bench):
    """Behind more and more requests, so that some answers find room."""
    number = PARAMETER_BY_NAME["kp"].number
    bench.send(encode_request(35, number, 0, checked=True))
    lost, kp = 0, 0
    for value in range(1, 10):
        wanted = encode_request(35, number, value, checked=True)
        answered = b"@35," in bench.send(b"@31e" * (10 + value) + wanted, wait_s=0.1)
        lost, kp = lost + (not answered), value if answered else kp
        assert bench.reply("read_config", number) == (number, kp)
    assert 0 < lost < 9


def test_answers_overtake_that_of_a_save(bench):
    """It looks at each byte of the EEPROM first, even if none has to change."""
    bench.send(encode_request(36) + encode_request(29))
    assert b"@29," in bench.text and b"@36,1e" in bench.text
    assert bench.text.index(b"@29,") < bench.text.index(b"@36,1e")


# ---- speed of the line


@pytest.mark.parametrize("rate", [1, 2, 3])
def test_the_speed_changes_once_the_answer_has_left(bench, rate):
    assert bench.reply("set_baud", rate) == (rate,)
    bench.board.set_host_baud(BAUDS[rate])
    assert bench.reply("read_protocol")[0] == 2
    assert bench.reply("set_baud", 0) == (0,)
    bench.board.set_host_baud(BAUD)
    assert bench.reply("read_protocol")[0] == 2


def test_a_speed_that_the_host_does_not_follow_is_left_again(bench):
    bench.reply("set_baud", 2)
    for _ in range(4):
        assert not any(isinstance(event, Frame) for event in bench.ask("read_protocol", wait_s=0.2))
    bench.run(0.4)
    assert bench.reply("read_protocol")[0] == 2


def test_a_running_stream_goes_on_at_the_new_speed(bench):
    bench.ask("start_stream")
    bench.ask("set_baud", 2)
    bench.board.set_host_baud(BAUDS[2])
    bench.run(0.05)
    assert sum(isinstance(event, Frame) for event in bench.ask("read_protocol", wait_s=0.2)) > 100
