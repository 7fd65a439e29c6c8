"""Requests that turn motors, and when they need a checksum."""

from mrl_driver.protocol import encode_request
from mrl_driver.protocol.table import BY_NAME, COMMANDS
from sim_arduino.board.python_board import CHECK_SILENCE_S

MOVES = {
    "move_motors_pid": (20, 20),
    "move_motors": (20, 20),
    "move_differential": (200, 0),
    "move_to_position": (1, 20, 3000),
    "move_omni": (20, 0, 0),
}
DRIVE_S = 0.2
PLAIN_MOVES = [encode_request(BY_NAME[name].code, *args) for name, args in MOVES.items()]
SILENT_S = CHECK_SILENCE_S + 0.1


def is_set_going(bench, wire):
    """Whether a request turns a motor; afterwards the robot stands."""
    bench.send(wire, DRIVE_S)
    driven = bench.is_driven()
    bench.send(b"@13e", DRIVE_S)
    return driven


def after_silence(bench):
    """The host has turned checksums on, and was silent until the board has ended them."""
    bench.ask("set_check", 1)
    bench.run(SILENT_S)
    bench.checked = False
    return bench


def test_moves_and_calibrate_are_the_requests_that_turn_motors():
    assert {row.name for row in COMMANDS if row.turns} == {"calibrate", *MOVES}


def test_no_other_request_turns_a_motor(bench):
    for row in COMMANDS:
        if not row.turns and row.name not in ("xbee_text", "set_baud"):
            bench.send(encode_request(row.code, *(field.high for field in row.request)))
            bench.send(encode_request(BY_NAME["set_check"].code, 0, checked=True))
            assert not bench.is_driven(), row.name


def test_a_host_of_2013_moves_without_a_checksum(omni3md):
    assert [is_set_going(omni3md, wire) for wire in PLAIN_MOVES] == [True] * len(MOVES)


def test_calibrate_needs_a_checksum_always(bench):
    assert not is_set_going(bench, b"@1e")
    assert bench.counters() == {"bad_check": 1}


def test_calibrate_with_its_checksum_turns_the_wheels(omni3md):
    assert is_set_going(omni3md, encode_request(1))


def test_once_the_host_has_asked_for_checksums_each_move_needs_one(bench):
    """Also after the board has ended them, because the host fell silent."""
    after_silence(bench)
    assert not any(is_set_going(bench, wire) for wire in PLAIN_MOVES)
    assert bench.counters() == {"bad_check": len(MOVES)}


def test_after_the_silence_a_move_with_a_checksum_drives(bench):
    after_silence(bench)
    assert is_set_going(bench, encode_request(BY_NAME["move_differential"].code, 200, 0, checked=True))


def test_other_requests_need_none_after_the_silence(bench):
    assert after_silence(bench).reply("read_encoders") == (0, 0)


def test_a_host_that_turns_checksums_off_moves_without_them(bench):
    bench.ask("set_check", 1)
    bench.send(encode_request(BY_NAME["set_check"].code, 0, checked=True))
    bench.checked = False
    assert is_set_going(bench, b"@11,200,0e")


def test_a_reset_ends_the_need_of_checksums(bench):
    after_silence(bench)
    bench.board.reset()
    bench.run(0.5)
    assert is_set_going(bench, b"@11,200,0e")


def test_a_parameter_lets_hosts_of_2013_calibrate(omni3md):
    omni3md.write_config("plain_calibrate", 1)
    assert is_set_going(omni3md, b"@1e") and is_set_going(omni3md, encode_request(1))


def test_the_parameter_counts_until_the_host_asks_for_checksums(omni3md):
    omni3md.write_config("plain_calibrate", 1)
    after_silence(omni3md)
    assert not is_set_going(omni3md, b"@1e")
