"""The images with an IMU on the simulated chip: its readings, the times of its frames, and what it costs the others."""

import pytest

from mrl_driver.protocol import REPLIES, FrameDecoder
from sim_arduino.avr.machine import AvrMachine
from tests.conformance.bench import FIRMWARE
from tests.firmware.imu_chip import ImuChip
from tests.long.bench import firmware_measures as measures
from tests.long.bench.firmware_board import Rig, request

BUILDS = {"": 0x68, "_environment": 0x69, "_xbee": 0x68, "_hbridge": 0x69}
"""Images, and an address at which each looks for the IMU."""
PERIOD_MS = 10
WIRE_USE, IMU_HZ = 0.97, 99.0
STOP_US, MOVE_US, IDLE_MOVE_US = 600.0, 700.0, 350.0
ENCODERS = 0xD8


@pytest.mark.parametrize("build", BUILDS)
def test_every_image_reads_it(build):
    with AvrMachine(FIRMWARE.with_name(f"mrl_firmware{build}.elf")) as machine:
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
