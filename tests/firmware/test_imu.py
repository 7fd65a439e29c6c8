"""The IMU: its search, set-up, readings, stream and losses."""

import pytest

from mrl_driver.protocol import Frame
from mrl_driver.protocol.table import BRIDGES, CAPABILITIES, FAULTS, TICK_S
from tests import models
from tests.firmware import imu_chip
from tests.firmware.pc_board import BRIDGE, SONARS

CAPABILITY = 1 << [name for name, _ in CAPABILITIES].index("imu")
FAULT = 1 << [name for name, _ in FAULTS].index("imu")
LOW, HIGH = 0x68, 0x69
TB6612 = BRIDGES.index("tb6612")
FOUND_S = 0.1  # Search, set-up, and the time in which the gyro settles
LOST_S = 1.1  # Longest time until a chip that is back is in use again
READ_S = 0.7e-3  # Longest time from the read of the counters to the gyro's, both 6 bytes at 400 kHz
ENCODERS = 0xD8


@pytest.fixture
def fitted(bench):
    """Makes benches whose board has an IMU: `fitted(address, who_am_i, **options)`; the chip is `chip`."""

    def make(address=LOW, who_am_i=imu_chip.MPU_6050, **options):
        made = bench(boot=False, **options)
        made.chip = made.plant.i2c[address] = imu_chip.ImuChip(who_am_i)
        made.run(FOUND_S + 0.1)
        made.forget()
        return made

    return make


@pytest.fixture
def board(fitted):
    return fitted()


def capabilities(board):
    return board.field("read_protocol", "capabilities")


def imu_frames(board):
    return [frame for frame in board.frames() if frame.code == 46]


def reads(board, address):
    """Times of the reads of an address [s], and their numbers of bytes."""
    return [(t, len(data)) for t, kind, at, data in board.board.transfers if (kind, at) == ("read", address)]


# ---- search and set-up


@pytest.mark.parametrize("address", [LOW, HIGH])
@pytest.mark.parametrize("library", [SONARS, BRIDGE])
def test_a_chip_at_either_address_is_found_and_set_up(fitted, address, library):
    board = fitted(address, library=library, eeprom=models.wired_eeprom(bridge=TB6612))
    assert capabilities(board) & CAPABILITY
    assert board.chip.registers == imu_chip.SET_UP


@pytest.mark.parametrize(
    "who_am_i",
    [imu_chip.MPU_6050, imu_chip.MPU_6500, imu_chip.MPU_9250, imu_chip.MPU_9255, imu_chip.ICM_20689],
)
def test_chips_of_the_family_are_accepted(fitted, who_am_i):
    assert capabilities(fitted(who_am_i=who_am_i)) & CAPABILITY


@pytest.mark.parametrize("who_am_i", [0x00, 0x69, 0x72, 0x12, 0xFF])
def test_other_chips_are_left_alone(fitted, who_am_i):
    board = fitted(who_am_i=who_am_i)
    before = dict(board.chip.registers)
    board.run(LOST_S)
    assert not capabilities(board) & CAPABILITY and board.chip.registers == before


def test_a_request_at_the_start_waits_for_the_search(bench):
    """A host that greets the board in its first millisecond must not take it for one without an IMU."""
    board = bench(boot=False)
    board.plant.i2c[HIGH] = imu_chip.ImuChip()
    assert capabilities(board) & CAPABILITY


# ---- readings


def test_gyro_then_accelerometer(board):
    board.chip.gyro, board.chip.accel = (1, -2, 32767), (-32768, 16384, -1)
    assert board.ask("read_imu").args == (1, -2, 32767, -32768, 16384, -1)


def test_nothing_is_sent_before_the_gyro_has_settled(bench):
    """The chip gives nonsense for 50 ms after its set-up, also if it is fitted late."""
    board = bench()
    chip = board.plant.i2c[LOW] = imu_chip.ImuChip()
    for _ in range(40):
        board.send("start_imu_stream", 10, wait_s=0.02)
    assert {frame.args for frame in board.frames()} == {chip.gyro + chip.accel}


def test_board_time_is_that_of_the_gyros_read(board):
    board.check(True)
    board.forget()
    frame = board.ask("read_imu")
    read_s = reads(board, LOW)[0][0]
    assert frame.stamp.time * TICK_S == pytest.approx(read_s, abs=TICK_S + 16e-6)


# ---- two streams


@pytest.fixture
def both(board):
    """Encoders every 20 ms and the IMU every 10 ms, with checksums."""
    board.check(True)
    board.send("start_stream", 20, wait_s=0.027)
    board.send("start_imu_stream", 10, wait_s=0.1)
    board.forget()
    return board


@pytest.mark.parametrize("last", [("start_imu_stream", 10), ("start_stream", 20)])
@pytest.mark.parametrize("phase_ms", [1, 4, 7])
def test_the_imu_is_read_directly_after_the_counters(both, last, phase_ms):
    """Of every second reading of the gyro; the others come half way between.  Whichever stream began last."""
    both.run(phase_ms * 1e-3)
    both.send(*last, wait_s=0.05)
    both.forget()
    both.run(0.2)
    counts = both.write_times(ENCODERS)
    after = [min(t - at for t in both.write_times(imu_chip.GYRO_DATA) if t > at) for at in counts[:-1]]
    assert max(after) < READ_S


def test_the_imu_gets_its_turn_between_encoder_frames_that_leave_it_no_gap(both):
    """The serial link has room for both streams, but not for a whole IMU frame between two others."""
    both.check(False)
    both.send("start_stream", 5, wait_s=0.1)
    both.forget()
    both.run(1.0)
    codes = [frame.code for frame in both.frames()]
    assert (codes.count(8), codes.count(46)) == pytest.approx((200, 100), abs=3)


@pytest.mark.parametrize("flood", [b"@31e" * 1500, b"@"])
def test_neither_a_flood_of_questions_nor_a_frame_that_never_ends_starves_the_imu(board, flood):
    board.send("start_imu_stream", 20, wait_s=0.05)
    board.forget()
    board.raw(flood, wait_s=0.5)
    assert len(imu_frames(board)) == pytest.approx(25, abs=2)


def test_answers_go_before_an_imu_frame(board):
    """More requests than the line can answer come around the time at which the frame is due."""
    board.send("start_imu_stream", 1000, wait_s=0.98)
    board.forget()
    board.raw(b"@31e" * 100, wait_s=0.2)
    codes = [frame.code for frame in board.frames()]
    assert codes.count(46) == 1 and codes[-1] == 46 and len(codes) > 10


def test_the_stream_of_encoders_alone_is_reported(board):
    board.send("start_imu_stream", 1000)
    assert board.ask("get_stream").args == (0,)


@pytest.mark.parametrize("request_", [("start_imu_stream", 100), ("read_imu",)])
def test_what_was_read_for_a_frame_that_was_not_sent_is_forgotten(both, request_):
    both.check(False)
    both.forget()
    gyro, counts = [], []
    while not (gyro and counts and counts[-1] < gyro[-1] < counts[-1] + READ_S):
        both.run(1e-4)
        gyro, counts = both.write_times(imu_chip.GYRO_DATA), both.write_times(ENCODERS)
    both.raw(b"@48e@19e", wait_s=0.1)
    both.chip.gyro = (7, 8, 9)
    both.forget()
    both.send(*request_)
    assert both.frames()[0].args[:3] == (7, 8, 9)


# ---- losses


def test_a_chip_that_vanishes_without_a_stream_is_a_fault(board):
    board.chip.present = False
    board.run(LOST_S)
    assert board.faults() & FAULT


def test_a_loss_of_power_without_a_stream_is_noticed_within_a_second(board):
    board.chip.power_cycle()
    board.run(1.0)
    assert board.chip.registers == imu_chip.SET_UP


def test_one_read_that_fails_costs_the_time_of_a_set_up(board):
    board.send("start_imu_stream", 10, wait_s=0.1)
    failed = []
    board.board.nack = lambda address, data: address == LOW and not failed and not failed.append(data)
    board.run(0.02)
    board.forget()
    board.run(1.0)
    assert len(imu_frames(board)) >= 100 - (imu_chip.SETTLED_S + 0.03) * 100


def test_a_bus_that_hangs_does_not_hold_up_answers(fitted):
    """At any phase of a reading, and also if the answer before needs the bus."""
    for phase_us in range(0, 2000, 250):
        board = fitted()
        board.send("start_imu_stream", 10, wait_s=0.05 + phase_us * 1e-6)
        board.board.hang_bus(True)
        board.raw(b"@6e@17e", wait_s=0.02)
        assert Frame(17, (0,)) in board.events


def test_a_reading_does_not_wait_for_the_rest_after_a_hang(both):
    """The counters' read hangs, and the IMU's waits behind it; it fails with that one, and a question is answered."""
    both.check(False)
    both.forget()
    while not both.write_times(ENCODERS):
        both.run(1e-4)
    both.run(both.write_times(ENCODERS)[0] + 0.019 - both.board.now_s)
    both.board.hang_bus(True)
    both.run(0.006)
    both.raw(b"@17e", wait_s=0.005)
    assert Frame(17, (1,)) in both.events
