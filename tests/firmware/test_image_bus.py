"""The image's I2C on the simulated chip: clock rates, the wire meanwhile, and an IMU's readings and their cost."""

from pathlib import Path

import pytest

from mrl_driver.protocol import REPLIES, FrameDecoder, encode_request
from mrl_driver.protocol.table import BRIDGES, PARAMETER_BY_NAME
from sim_arduino.avr.machine import AvrMachine
from tests import models
from tests.conformance.bench import FIRMWARE
from tests.firmware.imu_chip import ImuChip
from tests.long.bench import firmware_measures as measures
from tests.long.bench.firmware_board import Rig, request

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


def powered(build):
    """One of the images, on an H-bridge board with its wiring accepted."""
    machine = AvrMachine(FIRMWARE.with_name(f"mrl_firmware{build}.elf"))
    machine.write_eeprom(0, models.wired_eeprom(bridge=TB6612))
    machine.power_cycle(1)
    return machine


LEAST_FREE = {"": 900, "_environment": 900, "_xbee": 900, "_hbridge": 600}
TB6612 = BRIDGES.index("tb6612")


def test_sram_is_left_free():
    """Bytes that nothing touches, after a second of everything."""
    for build, free in LEAST_FREE.items():
        with powered(build) as machine:
            machine.i2c[0x18], machine.i2c[0x69] = MotorBoard(), ImuChip()
            machine.run(0.1)
            machine.send(
                b"@16,1e@18e@47,10e@5e@31e@12,1,1,1e@99e" + encode_request(36) + encode_request(32, 1)
            )
            machine.run(1.0)
            assert machine.sram_untouched() >= free, build


BUILDS = {"": 0x68, "_environment": 0x69, "_xbee": 0x68, "_hbridge": 0x69}
"""Images, and an address at which each looks for the IMU."""
PERIOD_MS = 10
WIRE_USE, IMU_HZ = 0.97, 99.0
STOP_US, MOVE_US, IDLE_MOVE_US = 600.0, 700.0, 350.0


@pytest.mark.parametrize("build", BUILDS)
def test_every_image_reads_it(build):
    with powered(build) as machine:
        chip = machine.i2c[BUILDS[build]] = ImuChip()
        machine.run(0.1)
        machine.sent()
        machine.send(b"@46e")
        machine.run(0.02)
        (frame,) = FrameDecoder(REPLIES).feed(bytes(byte.data for byte in machine.sent()))
        assert frame.args == chip.gyro + chip.accel


@pytest.fixture(scope="module")
def rig():
    """A TraxBot's board with an IMU that streams at 100 Hz, behind a full stream of encoders and sonars."""
    made = Rig(FIRMWARE).fit_imu(PERIOD_MS).settle()
    made.machine.send(request("start_stream"))
    yield made
    made.close()


def test_it_shares_a_full_serial_link(rig):
    frames = measures.stream_of(rig, 0.5)
    assert measures.wire_use(rig, frames) >= WIRE_USE
    assert measures.hertz(rig, rig.imu_frames) >= IMU_HZ


@pytest.mark.parametrize(
    ("command", "code", "limit_us"),
    [(b"@11,500,-800e", measures.MOVE, MOVE_US), (b"@13e", measures.STOP, STOP_US)],
)
def test_commands_are_carried_out_in_time(rig, command, code, limit_us):
    assert max(measures.command_delays_us(rig, command, code, 60)) <= limit_us


def test_a_command_on_an_idle_line_does_not_wait_for_a_reading():
    rig = Rig(FIRMWARE).fit_imu(PERIOD_MS).settle()
    delays_us = measures.command_delays_us(rig, b"@11,500,-800e", measures.MOVE, 100)
    rig.close()
    assert max(delays_us) <= IDLE_MOVE_US
