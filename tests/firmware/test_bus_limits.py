"""The I2C bus at its limits: its clock, how long a transfer may take, and who has to wait after one that hangs."""

import pytest

from mrl_driver.protocol.table import PARAMETER_BY_NAME
from tests.firmware.imu_chip import GYRO_DATA, ImuChip
from tests.firmware.test_failsafe import FAULT
from tests.firmware.test_omni3md_limits import BATTERY, HALF_MS, MOVE, PRESET, TEMPERATURE

IMU = 0x68
CPU_US = 1 / 16
PASS_S = 16e-6  # The loop sees the end of a transfer this much late at most


def transfer_bits(out: int, back: int = 0) -> int:
    """Clock periods of a transfer: bytes with their acknowledgements, starts and stop."""
    return 9 * (1 + out + (1 + back if back else 0)) + 3


@pytest.mark.parametrize("khz", [100, 103, 124, 128, 152, 171, 206, 252, 400])
def test_the_bus_has_the_clock_of_parameter_16(bench, khz):
    """Never a faster one, and a slower one by at most a step of the clock's divider, two cycles of the processor."""
    board = bench()
    board.send("write_config", PARAMETER_BY_NAME["bus_speed"].number, khz, wait_s=0.05)
    board.forget()
    board.board.gap(board.board.now_s + 0.01, b"@4,1,5e@4,1,6e")
    board.run(0.02)
    begin, end = board.write_times(PRESET)
    bits = transfer_bits(len(board.writes(PRESET)[0]))
    shortest_s, step_s = bits / khz * 1e-3, bits * 2 * CPU_US * 1e-6
    assert shortest_s <= end - begin + 1e-9 and end - begin <= shortest_s + step_s + PASS_S + 1e-9


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


def test_a_clock_that_the_divider_meets_is_met(bench):
    """125 kHz; a transfer takes a whole number of the loop's passes then."""
    board = bench()
    board.send("write_config", PARAMETER_BY_NAME["bus_speed"].number, 125, wait_s=0.05)
    board.forget()
    board.board.gap(board.board.now_s + 0.01, b"@4,1,5e@4,1,6e")
    board.run(0.02)
    begin, end = board.write_times(PRESET)
    assert end - begin == pytest.approx(transfer_bits(6) / 125e3, abs=1e-6)


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
