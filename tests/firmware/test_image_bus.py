"""The image's I2C on the simulated chip: clock rates, the wire meanwhile, and an IMU's readings and their cost."""

import pytest

from mrl_driver.protocol import REPLIES, Frame, FrameDecoder, encode_request
from mrl_driver.protocol.table import BRIDGES, PARAMETER_BY_NAME
from mrl_driver.robot.chips import ATMEGA328P, ATMEGA2560
from sim_arduino.avr.machine import AvrMachine
from tests import models
from tests.conformance.bench import FIRMWARE
from tests.firmware.imu_chip import ImuChip
from tests.long.bench.firmware_board import ENCODERS, LEFT, RIGHT, MotorBoard, Rig, request


@pytest.fixture
def board():
    made = Rig(FIRMWARE)
    made.run(0.15)
    yield made
    made.close()


def read_us(board):
    """The time from the end of the register's write, for the answer to @6e, to the read's address [us]."""
    board.forget()
    assert board.say(b"@6e", 0.02) == [Frame(6, (RIGHT, LEFT))]
    asked = next(i for i, each in enumerate(board.transfers) if each.data == bytes([ENCODERS]))
    return board.microseconds(board.transfers[asked + 1].cycle - board.transfers[asked].cycle)


def test_clocks_of_the_bus(board):
    """From repeated start to the address's acknowledge: 9 clocks, of 2.5 us at first, and the interrupt."""
    for khz in (400, 100, 200):
        if khz != 400:
            board.say(request("write_config", PARAMETER_BY_NAME["bus_speed"].number, khz), 0.02)
        assert 9 * 1000 / khz <= read_us(board) < 9 * 1000 / khz + 10


def test_stop_and_start_instead_of_a_repeated_start(board):
    """The stop between write and read takes about one clock of 2.5 us."""
    repeated_us = read_us(board)
    board.say(request("write_config", PARAMETER_BY_NAME["bus_stop"].number, 1), 0.02)
    assert 2.0 <= read_us(board) - repeated_us <= 10.0


def test_slow_slaves_may_stretch_the_clock(board):
    """100 us more for each of nine bytes are within the patience of 4 ms."""
    board.machine.stretch_clock(1600)
    assert read_us(board) > 100


def powered(build):
    """One of the images, on an H-bridge board with its wiring accepted."""
    on_mega = build.endswith("_mega")
    image = FIRMWARE.with_name(f"mrl_firmware{build}.elf")
    chip, pins = (ATMEGA2560, models.MEGA_PINS) if on_mega else (ATMEGA328P, models.DUO_PINS)
    machine = AvrMachine(image, chip=chip)
    machine.write_eeprom(0, models.wired_eeprom(1, pins, chip, bridge=TB6612))
    machine.power_cycle(1)
    return machine


LEAST_FREE = {"": 900, "_environment": 900, "_xbee": 900, "_hbridge": 600, "_hbridge_mega": 4096}
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


BUILDS = {"": 0x68, "_environment": 0x69, "_xbee": 0x68, "_hbridge": 0x69, "_hbridge_mega": 0x68}
"""Images, and an address at which each looks for the IMU."""


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
