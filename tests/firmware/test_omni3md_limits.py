"""The OMNI-3MD and the bus at their limits: what is sent and read, byte by byte, and when, to a tick of the clock."""

from typing import Dict, List, Tuple

import pytest

from mrl_driver.protocol.table import PARAMETER_BY_NAME, TICK_S
from tests.firmware.imu_chip import GYRO_DATA, ImuChip
from tests.firmware.test_failsafe import FAULT, STOP, refuse

ADDRESS = 0x18
VERSION, DECIMALS, BATTERY, TEMPERATURE = 0xFE, 0xFD, 0xD5, 0xD4
GEOMETRY, GAINS, RAMP, TIMEOUT, PRESCALER = 0xEA, 0xF4, 0xEC, 0xF1, 0xF0
PRESET, COUNTS, MOVE = 0xEF, 0xD8, 0xEB
HALF_MS = 0.5e-3
PASS_S = 16e-6
BIT_S = 2.5e-6  # 400 kHz
NONE = -1


def transfer_s(data: bytes) -> float:
    """Time of a write on the bus: address and data with their acknowledgements, start and stop [s]."""
    return (9 * (1 + len(data)) + 3) * BIT_S


class Answers:
    """An I2C slave in the place of the motor board that answers these bytes by register."""

    present = True

    def __init__(self, answers: Dict[int, bytes]) -> None:
        self.answers, self._register = answers, NONE

    def write(self, data: bytes, time_s: float) -> bool:
        self._register = data[0]
        return True

    def read(self, count: int, time_s: float) -> bytes:
        return self.answers[self._register][:count]


def word(value: int) -> bytes:
    return (value & 0xFFFF).to_bytes(2, "big")


ANSWERS = {VERSION: b"\x03", DECIMALS: b"\x07", BATTERY: word(291), TEMPERATURE: word(-50), COUNTS: bytes(6)}


@pytest.fixture
def answering(bench):
    """Starts a board whose motor board answers these bytes instead of ANSWERS."""

    def make(**changed: bytes):
        board = bench(boot=False)
        names = {"battery": BATTERY, "temperature": TEMPERATURE, "counts": COUNTS}
        answers = {**ANSWERS, **{names[name]: data for name, data in changed.items()}}
        board.plant.i2c[ADDRESS] = Answers(answers)
        return board

    return make


def on_the_bus(board) -> List[Tuple[str, bytes]]:
    """Transfers with the motor board: "write" or "read", and the bytes."""
    return [(kind, data) for _, kind, address, data in board.board.transfers if address == ADDRESS]


def test_the_start_byte_by_byte(answering):
    """A stop, four questions, and the set-up; then the polls, battery and temperature by turns."""
    board = answering()
    board.run(0.14)
    asked = [
        (VERSION, ANSWERS[VERSION]), (DECIMALS, ANSWERS[DECIMALS]),
        (BATTERY, ANSWERS[BATTERY]), (TEMPERATURE, ANSWERS[TEMPERATURE]),
    ]  # fmt: skip
    set_up = [
        bytes([GEOMETRY]) + word(8700) + word(2700) + word(437) + word(640),
        bytes([GAINS]) + word(700) + word(400) + word(200),
        bytes([RAMP]) + word(2500) + word(0),
        bytes([TIMEOUT]) + b"\x03\xaa\x03\x55",
        *(bytes([PRESCALER, encoder]) + b"\x00\xaa\x55" for encoder in (1, 2, 3)),
    ]
    questions = [part for code, answer in asked for part in (("write", bytes([code])), ("read", answer))]
    polls = questions[4:]
    assert on_the_bus(board) == [("write", STOP), *questions, *(("write", data) for data in set_up), *polls]


def test_what_the_motor_board_answers_at_the_start_is_its_information(answering):
    """Version 3.07, 29.1 V and -5.0 degC, before the first poll."""
    board = answering()
    assert board.ask("robot_info").args[:3] == (-500, 307, 2910)


UP = [(1, 10), (3276, 32760), (3277, 32767), (32767, 32767)]
DOWN = [(-1, -10), (-3276, -32760), (-3277, -32768), (-32768, -32768)]


@pytest.mark.parametrize(
    "field, tenths, hundredths",
    [*(("battery", *pair) for pair in UP), *(("temperature", *pair) for pair in UP + DOWN)],
)
def test_tenths_become_hundredths_within_int16(answering, field, tenths, hundredths):
    board = answering(**{field: word(tenths)})
    assert board.field("robot_info", field) == hundredths


@pytest.mark.parametrize("field, register", [("battery", BATTERY), ("temperature", TEMPERATURE)])
def test_a_poll_renews_its_own_field(answering, field, register):
    board = answering()
    board.run(0.06)
    before = board.ask("robot_info").args
    board.plant.i2c[ADDRESS].answers[register] = word(1234)
    board.run(0.1)
    after = board.ask("robot_info").args
    place = 0 if field == "temperature" else 2
    assert after == (*before[:place], 12340, *before[place + 1 :])


def test_counts_are_signed_and_in_their_places(answering):
    board = answering(counts=word(-2) + word(300) + word(-32768))
    board.run(0.1)
    board.forget()
    assert board.ask("read_encoders").args == (-32768, -2)
    assert on_the_bus(board)[:2] == [
        ("write", bytes([COUNTS])),
        ("read", word(-2) + word(300) + word(-32768)),
    ]


def test_information_of_a_board_that_is_asked_again_is_0_or_its_own(answering):
    """While it is asked, at each of eight moments; the bytes of an answer never stand in another field."""
    board = answering()
    board.run(0.1)
    for spaces in range(8):
        lose(board)
        board.forget()
        board.raw(b"@13e" + b"\r" * spaces + b"@5e", wait_s=0.1)
        temperature, _, battery, _, _ = board.frames()[0].args
        assert temperature in (0, -500) and battery in (0, 2910)


PHASES = [part * TICK_S / 4 for part in range(4)]  # Times within a tick of the board's clock [s]


@pytest.mark.parametrize("phase_s", PHASES)
def test_each_part_of_the_set_up_pauses_for_the_eeprom(bench, phase_s):
    """20, 15, 10 and 5 ms, and 10 ms for each prescaler."""
    board = bench()
    board.run(phase_s)
    board.send("default_config", wait_s=0.0)
    board.send("preset_encoder", 1, 0, wait_s=0.15)
    writes = [(t, data) for t, kind, at, data in board.board.transfers if kind == "write" and len(data) > 1]
    assert [data[0] for _, data in writes] == [GEOMETRY, GAINS, RAMP, TIMEOUT, *[PRESCALER] * 3, PRESET]
    pauses = [end - transfer_s(data) - begin for (begin, _), (end, data) in zip(writes, writes[1:])]
    assert pauses == pytest.approx([0.020, 0.015, 0.010, 0.005, *[0.010] * 3], abs=TICK_S)


@pytest.mark.parametrize("command", [b"@4,1,5e", b"@11,100,0e"])
def test_other_commands_do_not_pause(bench, command):
    """Six leave one behind the other: the loop sees the end of each one a pass later at most."""
    board = bench()
    board.board.gap(board.board.now_s + 0.01, command * 6)
    board.run(0.02)
    times = [t for t, kind, _, data in board.board.transfers if kind == "write" and data[0] in (PRESET, MOVE)]
    taken_s = transfer_s(board.writes()[0])
    assert [after - before for before, after in zip(times, times[1:])] == pytest.approx(
        [taken_s] * 5, abs=PASS_S
    )


def test_a_stop_in_one_pause_is_not_repeated_after_the_next(bench):
    board = bench()
    board.send("set_pid_gains", 1, 2, 3, wait_s=0.003)
    board.send("stop", wait_s=0.05)
    board.forget()
    board.send("set_pid_gains", 1, 2, 4, wait_s=0.05)
    assert [data[0] for data in board.writes()] == [GAINS]


def attempts(board, code: int, refused: int) -> List[float]:
    """The motor board refuses this command so many times from now on; the times of all attempts [s]."""
    times: List[float] = []

    def nack(address: int, data: bytes) -> bool:
        if data[0] != code:
            return False
        times.append(board.board.now_s)
        return len(times) <= refused

    board.board.nack = nack
    return times


def lose(board) -> float:
    """A move is refused until the motor board counts as lost; the time [s]."""
    times = attempts(board, MOVE, 4)
    board.send("move_differential", 100, 0, wait_s=0.005)
    assert len(times) == 4
    return times[-1]


@pytest.mark.parametrize("phase_s", PHASES)
def test_a_refused_command_is_sent_again_after_1_ms(bench, phase_s):
    board = bench()
    board.run(phase_s)
    times = attempts(board, MOVE, 3)
    board.send("move_differential", 100, 0)
    pauses = [after - before - transfer_s(board.writes()[0]) for before, after in zip(times, times[1:])]
    assert pauses == pytest.approx([0.001] * 3, abs=TICK_S)


def test_a_motor_board_that_is_missing_at_the_start_is_asked_for_each_48_ms(bench):
    board = bench(boot=False)
    times = attempts(board, STOP[0], 100)
    board.run(0.5)
    assert [after - before for before, after in zip(times, times[1:])] == pytest.approx(
        [0.048] * 10, abs=HALF_MS
    )


WAITS_S = [0.096, 0.192, 0.384, 0.768, 1.0, 1.0]


def test_the_time_to_the_next_question_doubles_up_to_a_second_with_each_loss(bench):
    board, waits_s = bench(sonars=False), []
    for wait_s in WAITS_S:
        lost_s = lose(board)
        board.forget()
        board.run(wait_s + 0.1)
        waits_s.append(board.write_times(STOP[0])[0] - lost_s)
    assert waits_s == pytest.approx(WAITS_S, abs=HALF_MS)


@pytest.mark.parametrize("early_s, wait_s", [(HALF_MS, 0.192), (-HALF_MS, 0.048)])
def test_a_motor_board_that_was_there_for_5_s_is_steady(bench, early_s, wait_s):
    board = bench()
    begun_s = board.board.now_s
    takes_s = lose(board) - begun_s
    board.forget()
    board.run(0.3)
    found_s = board.write_times(TEMPERATURE)[0]
    board.board.gap(found_s + 4.0, b"")
    board.run(found_s + 5.0 - early_s - takes_s - board.board.now_s)
    lost_s = lose(board)
    assert lost_s - found_s == pytest.approx(5.0 - early_s, abs=HALF_MS / 2)
    board.forget()
    board.run(0.3)
    assert board.write_times(STOP[0])[0] - lost_s == pytest.approx(wait_s, abs=HALF_MS)


@pytest.mark.parametrize("refused, limit_s", [(3, 0.006), (4, 0.2)])
def test_a_stop_to_a_lost_motor_board_has_four_attempts(bench, refused, limit_s):
    """Two in one pass of the loop: the first lets it be asked for, the second is a stop of its own."""
    board = bench()
    lose(board)
    times = attempts(board, STOP[0], refused)
    begun_s = board.board.now_s
    board.board.gap(begun_s + 0.002, b"@13e@13e")
    board.run(0.25)
    assert (times[refused] - begun_s < 0.01) == (refused < 4)
    assert times[refused] - begun_s < limit_s


def test_commands_that_wait_when_the_motor_board_is_lost_are_forgotten(bench):
    board = bench()
    attempts(board, MOVE, 4)
    board.board.gap(board.board.now_s + 0.01, b"@11,100,0e@4,1,5e@4,1,6e@4,1,7e")
    board.run(0.4)
    assert board.writes(GEOMETRY) and not board.writes(MOVE) and not board.writes(PRESET)
    assert board.counter("unavailable") == 3


def test_a_stop_while_the_motor_board_is_asked_leaves_its_answers_in_place(answering):
    board = answering()
    board.run(0.1)
    for spaces in range(8):
        lose(board)
        board.raw(b"@13e" + b"\r" * spaces + b"@13e", wait_s=0.1)
        assert board.ask("robot_info").args[:3] == (-500, 307, 2910)


def test_a_stop_in_the_first_millisecond_leaves_the_answers_in_place(answering):
    board = answering()
    board.raw(b"@13e@5e", wait_s=0.01)
    assert [frame.args[:3] for frame in board.frames()] == [(-500, 307, 2910)]


def test_counts_are_read_behind_a_command_that_waits(bench):
    board = bench()
    board.board.gap(board.board.now_s + 0.01, b"@4,1,77e@4,3,78e@6e")
    board.run(0.02)
    assert [frame.args for frame in board.frames()] == [(78, 77)]


def test_counts_are_not_taken_for_battery_or_temperature(answering):
    board = answering(counts=word(777) * 3)
    board.run(0.1)
    for _ in range(2):
        board.forget()
        board.ask("read_encoders", wait_s=0.003)
        assert board.ask("robot_info", wait_s=0.01).args[:3] == (-500, 307, 2910)


def test_counts_are_waited_for_while_a_command_is_refused(bench):
    board = bench()
    refuse(board, MOVE, 3)
    board.board.gap(board.board.now_s + 0.01, b"@11,100,0e@6e")
    board.run(0.02)
    assert [frame.code for frame in board.frames()] == [6]


@pytest.mark.parametrize("code", [MOVE, COUNTS])
def test_counts_are_given_up_when_the_bus_hangs(bench, code):
    """Be it their own read or a move before it; the next question is answered."""
    board = bench()
    board.board.hang_bus(True, recoveries=1)
    board.board.gap(board.board.now_s + 0.01, b"@11,100,0e@6e" if code == MOVE else b"@6e")
    board.run(0.05)
    assert board.counter("unavailable") == 1
    assert board.ask("read_encoders").args == (0, 0)


def test_counts_that_are_refused_are_given_up_at_once(bench):
    board = bench()
    times = attempts(board, COUNTS, 1)
    board.send("read_encoders", wait_s=0.01)
    assert len(times) == 1 and board.counter("unavailable") == 1


@pytest.mark.parametrize("hangs, refused, lost", [(1, 1, False), (1, 2, True), (2, 0, True)])
def test_a_hang_counts_as_two_of_the_four_refusals_that_lose_the_motor_board(bench, hangs, refused, lost):
    board = bench()
    board.board.hang_bus(True, recoveries=hangs)
    times = attempts(board, MOVE, refused)
    board.send("move_differential", 100, 0, wait_s=0.3)
    assert len(times) == refused + (not lost)
    assert bool(board.writes(STOP[0])) == bool(board.writes(GEOMETRY)) == lost
    assert len(board.writes(MOVE)) == (not lost)


def test_a_stop_that_hangs_in_a_pause_is_a_fault_and_is_sent_afterwards(bench):
    board = bench()
    board.send("set_pid_gains", 1, 2, 3, wait_s=0.003)
    board.board.hang_bus(True, recoveries=1)
    board.forget()
    board.send("stop", wait_s=0.05)
    assert STOP in board.writes()
    assert board.faults() == FAULT["motor_board"] | FAULT["bus_hung"]


def test_the_same_gains_are_not_written_twice(bench):
    board = bench()
    for _ in range(2):
        board.send("set_pid_gains", 1, 2, 3, wait_s=0.05)
    assert len(board.writes(GAINS)) == 1


@pytest.mark.parametrize("gains", [(9, 2, 3), (1, 9, 3), (1, 2, 9)])
def test_one_gain_that_changes_is_written(bench, gains):
    board = bench()
    board.send("set_pid_gains", 1, 2, 3, wait_s=0.05)
    board.forget()
    board.send("set_pid_gains", *gains, wait_s=0.05)
    assert board.writes(GAINS) == [bytes([GAINS]) + b"".join(word(gain) for gain in gains)]


PARTS = {GEOMETRY: range(1, 5), GAINS: range(5, 8), RAMP: range(8, 10), TIMEOUT: [12]}


@pytest.mark.parametrize("number", range(27))
def test_a_changed_parameter_is_told_in_its_part_alone(bench, number):
    board = bench()
    board.send("write_config", number, 1, wait_s=0.03)
    wanted = [code for code, numbers in PARTS.items() if number in numbers]
    assert [data[0] for data in board.writes()] == wanted


MOVES = {
    "calibrate": (),
    "move_motors_pid": (20, 20),
    "move_motors": (20, 20),
    "move_differential": (100, 0),
    "move_to_position": (1, 20, 500),
    "move_omni": (20, 0, 0),
}
OTHERS = {"preset_encoder": (1, 5), "set_encoder_prescaler": (3, 1)}


@pytest.mark.parametrize("name", [*MOVES, *OTHERS])
def test_a_stop_drops_the_moves_that_wait_and_nothing_else(bench, name):
    """The motor board writes its EEPROM meanwhile; the stop is repeated at the end of that."""
    board = bench()
    board.send("set_pid_gains", 1, 2, 3, wait_s=0.003)
    board.forget()
    board.send(name, *{**MOVES, **OTHERS}[name], wait_s=0.002)
    board.send("stop", wait_s=0.05)
    assert [data for data in board.writes() if data == STOP] == [STOP] * 2
    assert len(board.writes()) - 2 == (name in OTHERS)


@pytest.mark.parametrize("name", [*MOVES, *OTHERS])
def test_a_stop_drops_the_move_that_was_refused_and_nothing_else(bench, name):
    board = bench()
    left = [True]
    board.board.nack = lambda address, data: (
        len(data) > 1 and data[0] != STOP[0] and bool(left) and left.pop()
    )
    board.send(name, *{**MOVES, **OTHERS}[name], wait_s=0.0)
    while left:
        board.run(1e-4)
    board.board.gap(board.board.now_s, b"@13e")
    board.run(0.05)
    assert len(board.writes()) - board.writes().count(STOP) == (name in OTHERS)


@pytest.mark.parametrize("name", MOVES)
def test_each_move_turns_the_motors_for_the_status(bench, name):
    board = bench()
    board.send("stop")
    board.send(name, *MOVES[name])
    assert board.field("read_status", "stop_reason") == 0


@pytest.mark.parametrize("count", range(1, 9))
def test_commands_that_wait_keep_their_order(bench, count):
    """Eight at most, wherever the queue begins: moves between them are dropped by the stop."""
    for before in (0, 3, 6):
        board = bench()
        board.raw(b"@4,1,0e" * before)
        board.send("set_pid_gains", 1, 2, 3, wait_s=0.003)
        board.forget()
        wire = b"".join(b"@4,1,%de" % n if n % 3 else b"@11,%d,0e" % n for n in range(count))
        board.board.gap(board.board.now_s + 0.001, wire + b"@13e")
        board.run(0.05)
        kept = [b"\xef\x01" + word(n) + b"\xaa\x55" for n in range(count) if n % 3]
        assert board.writes(PRESET) == kept and not board.writes(MOVE)


IMU = 0x68
CPU_US = 1 / 16


def transfer_bits(out: int, back: int = 0) -> int:
    """Clock periods of a transfer: bytes with their acknowledgements, starts and stop."""
    return 9 * (1 + out + (1 + back if back else 0)) + 3


@pytest.mark.parametrize("khz", [100, 103, 124, 125, 128, 152, 171, 206, 252, 400])
def test_the_bus_has_the_clock_of_parameter_16(bench, khz):
    """Never a faster one, and a slower one by at most a step of the clock's divider, two cycles of the processor.

    The divider meets 125 kHz, with which a transfer takes a whole number of the loop's passes.
    """
    board = bench()
    board.send("write_config", PARAMETER_BY_NAME["bus_speed"].number, khz, wait_s=0.05)
    board.forget()
    board.board.gap(board.board.now_s + 0.01, b"@4,1,5e@4,1,6e")
    board.run(0.02)
    begin, end = board.write_times(PRESET)
    bits = transfer_bits(len(board.writes(PRESET)[0]))
    shortest_s, step_s = bits / khz * 1e-3, bits * 2 * CPU_US * 1e-6
    assert shortest_s <= end - begin + 1e-9 and end - begin <= shortest_s + step_s + PASS_S + 1e-9
    assert khz != 125 or end - begin == pytest.approx(shortest_s, abs=1e-6)


def test_a_transfer_that_does_not_end_hangs_after_4_ms_and_the_bus_rests_for_16_ms(bench):
    board = bench()
    board.board.gap(board.board.now_s + 0.01, b"@11,100,0e")
    board.board.hang_bus(True, recoveries=1)
    begun_s = board.board.now_s
    board.run(0.05)
    (end,) = board.write_times(MOVE)
    taken_s = transfer_bits(len(board.writes(MOVE)[0])) * 2.5e-6
    assert end - begun_s - taken_s == pytest.approx(0.020, abs=HALF_MS)


@pytest.fixture
def with_imu(bench):
    """A board that reads its IMU every 10 ms; `hang()` holds the bus from the next reading on, and returns its time."""
    board = bench(boot=False)
    board.plant.i2c[IMU] = ImuChip()
    board.run(0.2)
    board.send("start_imu_stream", 10, wait_s=0.1)

    def hang(recoveries: int) -> float:
        for code in (BATTERY, GYRO_DATA):  # the next poll is at least 20 ms away then
            board.forget()
            while not board.write_times(code):
                board.run(1e-4)
        begun_s = board.write_times(GYRO_DATA)[0] + 0.010 - transfer_bits(1, 6) * 2.5e-6
        board.run(begun_s - 0.2e-3 - board.board.now_s)
        board.board.hang_bus(True, recoveries=recoveries)
        return begun_s

    board.hang = hang
    return board


def test_a_reading_of_the_imu_hangs_after_2_ms_and_the_motor_board_need_not_wait_longer(with_imu):
    board = with_imu
    begun_s = board.hang(recoveries=1)
    board.run(0.5e-3)
    board.raw(b"@11,100,0e", wait_s=0.02)
    (end,) = board.write_times(MOVE)
    taken_s = transfer_bits(len(board.writes(MOVE)[0])) * 2.5e-6
    assert end - begun_s - taken_s == pytest.approx(0.002, abs=HALF_MS)


def test_a_hang_of_the_imu_is_a_fault_of_the_bus_and_not_of_the_motor_board(with_imu):
    with_imu.hang(recoveries=1)
    with_imu.run(0.01)
    assert with_imu.faults() == FAULT["bus_hung"] | FAULT["imu"]


def test_a_stop_that_the_loop_takes_late_in_its_pass_goes_before_a_poll(bench):
    """It ends in the second part of what has waited, and the poll has been due for a while."""
    board = bench()
    board.run(0.1)
    board.forget()
    while not board.write_times(BATTERY):
        board.run(1e-3)
    last_s = board.write_times(BATTERY)[0]
    board.forget()
    board.board.gap(last_s + 0.045, b"\r" * 13 + b"@13e")
    board.run(0.002)
    assert [data[0] for _, kind, _, data in board.board.transfers if kind == "write"] == [0xFC, TEMPERATURE]
