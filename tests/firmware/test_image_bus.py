"""The real image's I2C: clock rates, repeated start or stop and start, and the wire meanwhile."""

from pathlib import Path

import pytest

from mrl_driver.protocol import encode_request
from mrl_driver.protocol.table import PARAMETER_BY_NAME
from sim_arduino.avr.machine import AvrMachine
from tests.firmware.imu_chip import ImuChip

BUILD = Path(__file__).resolve().parent.parent.parent / "build" / "firmware"
WRITE_CONFIG = 35
ENCODERS = 0xD8


class MotorBoard:
    """Counts 258 and 515; remembers nothing."""

    present = True

    def write(self, data, time_s):
        return True

    def read(self, count, time_s):
        return bytes([2, 3, 0, 0, 1, 2, *bytes(58)])[:count]


@pytest.fixture
def chip():
    machine = AvrMachine(BUILD / "mrl_firmware.elf")
    machine.i2c[0x18] = MotorBoard()
    machine.transfers = []
    machine.on_transfer = machine.transfers.append
    machine.run(0.1)
    machine.sent()
    yield machine
    machine.close()


def set_parameter(machine, name, value):
    machine.send(encode_request(WRITE_CONFIG, PARAMETER_BY_NAME[name].number, value))
    machine.run(0.02)
    machine.sent()
    machine.transfers.clear()


def counts(machine):
    """The answer to @6e, and the time from the end of the register's write to the read's address [us]."""
    machine.transfers.clear()
    machine.send(b"@6e")
    machine.run(0.02)
    asked = next(
        i for i, t in enumerate(machine.transfers) if t.kind == "write" and t.data == bytes([ENCODERS])
    )
    asked_cycle, read_cycle = (machine.transfers[i].cycle for i in (asked, asked + 1))
    return bytes(byte.data for byte in machine.sent()), (read_cycle - asked_cycle) / 16


def test_clock_of_400_khz(chip):
    """From repeated start to the address's acknowledge: 9 clocks of 2.5 us and the interrupt."""
    answer, read_us = counts(chip)
    assert answer == b"@6,258,515e\r\n" and 9 * 2.5 <= read_us < 9 * 2.5 + 10


@pytest.mark.parametrize("khz", [100, 200])
def test_other_clocks(chip, khz):
    set_parameter(chip, "bus_speed", khz)
    answer, read_us = counts(chip)
    assert answer == b"@6,258,515e\r\n" and 9 * 1000 / khz <= read_us < 9 * 1000 / khz + 10


def test_stop_and_start_instead_of_a_repeated_start(chip):
    """The stop between write and read takes about one clock of 2.5 us."""
    _, repeated_us = counts(chip)
    set_parameter(chip, "bus_stop", 1)
    answer, stopped_us = counts(chip)
    assert answer == b"@6,258,515e\r\n" and 2.0 <= stopped_us - repeated_us <= 10.0


def test_slow_slaves_may_stretch_the_clock(chip):
    """100 us more for each of nine bytes are within the patience of 4 ms."""
    chip.stretch_clock(1600)
    assert counts(chip)[0] == b"@6,258,515e\r\n"


def test_sram_is_left_free():
    """Every build has 900 bytes that nothing touches, after a second of everything."""
    for name in ("mrl_firmware", "mrl_firmware_environment", "mrl_firmware_xbee", "mrl_firmware_hbridge"):
        with AvrMachine(BUILD / f"{name}.elf") as machine:
            machine.i2c[0x18], machine.i2c[0x69] = MotorBoard(), ImuChip()
            machine.run(0.1)
            machine.send(
                b"@16,1e@18e@47,10e@5e@31e@12,1,1,1e@99e" + encode_request(36) + encode_request(32, 1)
            )
            machine.run(1.0)
            assert machine.sram_untouched() >= 900, name
