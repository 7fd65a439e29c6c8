"""The image of a bare board on the simulated chip: its stops, its memory, and what its faults lead to."""

import math
import random
from pathlib import Path

import pytest

from mrl_driver.driver import Options
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.host.firmware_images import image_path
from mrl_driver.protocol import REPLIES, Frame, FrameDecoder, encode_request
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.protocol.table import BY_NAME, TICK_S, VIRTUAL_FAULTS
from mrl_driver.robot.chips import ATMEGA328P, ATMEGA2560
from sim_arduino.avr.machine import AvrMachine
from sim_arduino.board.avr_board import FIRMWARE, configured_eeprom
from sim_arduino.serve import factory
from tests.conftest import EXPLORE
from tests.firmware.virtual_chip import driven
from tests.models import model

IMAGES = {ATMEGA328P: "mrl_firmware_virtual.elf", ATMEGA2560: "mrl_firmware_virtual_mega.elf"}
STOP_US = 350.0  # from the last bit of @13e to motors without drive, as with the H-bridge image
OLD_NANO_BYTES = 30720  # that the bootloader of an old Nano leaves
LEAST_FREE = 600  # bytes of SRAM
FAULT = {name: 1 << bit for bit, (name, _) in enumerate(VIRTUAL_FAULTS)}
START_M = (1.0, 1.0)
STREAM_MS = 13  # no multiple of a sample
PERIOD_S = 4.992e-3  # of the control
PHASES = 40


@pytest.fixture
def robot(close_later):
    emulated = close_later(factory.make(factory.Options(robot="duo", build="virtual", robot_id=23)))
    with SteppedDriver(emulated.engine, options=Options(ignore_battery=True)) as driver:
        yield driver


def drive(robot, linear_m_s, angular_rad_s, seconds):
    for _ in range(round(seconds / 0.1)):
        if not robot.drive(linear_m_s, angular_rad_s) or robot.wait(0.1):
            return


def put(robot, *faults):
    robot.parameters.write({"virtual_faults": sum(FAULT[name] for name in faults)})


def pose_m(robot):
    """Where the robot says that it is, from its start [m m rad]."""
    x, y, heading = robot.ask(BY_NAME["read_virtual_pose"].code)
    return x / 1000 - START_M[0], y / 1000 - START_M[1], heading / 1000


class Chip:
    """A bare board that streams and measures, and whose motors are looked at in its memory."""

    def __init__(self, chip):
        elf = FIRMWARE.with_name(IMAGES[chip])
        self.machine = AvrMachine(elf, chip=chip)
        self.machine.write_eeprom(0, configured_eeprom(elf, 23, model("duo")._replace(chip=chip.name)))
        self.machine.reset()
        self.machine.run(0.3)
        self.machine.send(b"@16,1e@31e" + encode_request(BY_NAME["start_stream"].code, 10))
        self.machine.run(0.1)

    def stop_us(self, phase_s):
        """Time from the last bit of a stop to motors without drive [us]; they stay without."""
        self.machine.send(b"@11,200,700e")
        self.machine.run(0.2 + phase_s)
        while not any(driven(self.machine)):  # between two pulses of a slow wheel
            self.machine.run(1e-3)
        end = self.machine.send(b"@13e")
        self.machine.run_until(end)
        while any(driven(self.machine)):
            self.machine.run_until(self.machine.cycle + 64)
        stopped = self.machine.cycle
        while self.machine.cycle < stopped + PERIOD_S * self.machine.frequency_hz:
            self.machine.run(1e-4)
            assert not any(driven(self.machine))
        return 1e6 * (stopped - end) / self.machine.frequency_hz

    def heading_mrad(self):
        """Where the robot looks, as the board says."""
        self.machine.send(encode_request(BY_NAME["set_check"].code, 0) + b"@14e@62e")
        self.machine.run(0.1)
        sent = FrameDecoder(REPLIES).feed(bytes(byte.data for byte in self.machine.sent()))
        code = BY_NAME["read_virtual_pose"].code
        return next(each.args[2] for each in sent if isinstance(each, Frame) and each.code == code)


@pytest.fixture
def chip_of(close_later):
    def make(chip):
        made = Chip(chip)
        close_later(made.machine)
        return made

    return make


@pytest.fixture(params=IMAGES if EXPLORE else [ATMEGA328P], ids=lambda chip: chip.name)
def chip(request, chip_of):
    """Both are made of the same sources."""
    return chip_of(request.param)


def test_a_stop_does_not_wait_for_the_whole_calculation(chip):
    phases = random.Random(1)
    assert max(chip.stop_us(phases.uniform(0.0, 0.01)) for _ in range(60)) <= STOP_US
    assert chip.machine.sram_untouched() >= LEAST_FREE


@pytest.mark.parametrize("end", [b"@11,0,0e", b"@13e"])
def test_a_command_counts_for_both_wheels_from_the_same_period_on(chip, end):
    """It comes at any moment of a period.  A wheel that is a period ahead turns the robot, for good."""
    for phase in range(PHASES):
        chip.machine.run(PERIOD_S * phase / PHASES)
        for command in (b"@11,200,0e", end):
            chip.machine.send(command)
            chip.machine.run(40 * PERIOD_S)
    assert abs(chip.heading_mrad()) <= 1


@pytest.mark.parametrize("chip", IMAGES, ids=lambda chip: chip.name)
def test_counts_of_a_stream_are_those_of_their_time(chip, chip_of):
    """A frame comes at any moment between two samples."""
    chip = chip_of(chip)
    chip.machine.send(b"@11,200,0e" + encode_request(BY_NAME["start_stream"].code, STREAM_MS))
    chip.machine.run(1.5)
    chip.machine.send(encode_request(BY_NAME["set_check"].code, 1))
    chip.machine.run(1.0)
    events = FrameDecoder(REPLIES, checked=True).feed(bytes(byte.data for byte in chip.machine.sent()))
    found = [(each.stamp.time, each.args[1]) for each in events if isinstance(each, Frame) and each.stamp]
    moved = [((end - begin) % 65536, to - at) for (begin, at), (end, to) in zip(found, found[1:])]
    per_tick = (found[-1][1] - found[0][1]) / sum(ticks for ticks, _ in moved)
    assert all(abs(ticks * TICK_S - STREAM_MS * 1e-3) < 1e-3 for ticks, _ in moved)
    assert len(moved) > 60 and max(abs(counts - ticks * per_tick) for ticks, counts in moved) < 2.5


def test_the_image_fits_beside_the_bootloader_of_an_old_nano():
    lines = Path(image_path("virtual")).read_text().splitlines()
    assert sum(int(line[1:3], 16) for line in lines if line[7:9] == "00") <= OLD_NANO_BYTES


def test_the_pose_is_that_of_the_odometry(robot):
    for linear, angular in ((0.2, 0.5), (-0.15, 0.3), (0.0, -1.5), (0.3, -0.6)):
        drive(robot, linear, angular, 3.0)
    robot.stop()
    robot.wait(1.0)
    assert math.dist(pose_m(robot)[:2], robot.pose[:2]) < 0.003
    assert pose_m(robot)[2] == pytest.approx(robot.pose.yaw_rad, abs=0.003)


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize(
    "fault, driven_s, reason",
    [("blocked", 1.0, StopReason.WHEEL_BLOCKED), ("encoder_silent", 0.0, StopReason.ENCODER)],
)
def test_the_board_stops_for_a_wheel(robot, side, fault, driven_s, reason):
    """A wheel that is blocked on the way, and an encoder that has never counted."""
    drive(robot, 0.2, 0.0, driven_s)
    put(robot, f"{side}_{fault}")
    drive(robot, 0.2, 0.0, 2.0)
    robot.wait(1.0)
    assert (robot.status.stop_reason, robot.command) == (reason, None)


@pytest.mark.parametrize("name", ["front", "left", "right"])
def test_a_dead_sonar_gives_no_range(robot, name):
    robot.wait(1.0)
    assert all(math.isfinite(range_m) for range_m in robot.ranges.values())
    put(robot, f"{name}_sonar_dead")
    robot.wait(1.0)
    assert [each for each, range_m in robot.ranges.items() if math.isnan(range_m)] == [name]


def test_a_battery_that_sags_is_empty(robot):
    put(robot, "battery_sags")
    robot.wait(10.0)
    assert robot.board.battery_v == pytest.approx(9.0, abs=0.1)
    assert robot.battery_state == "empty"


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_wheel_that_slips_takes_the_robot_from_its_odometry(robot, side):
    put(robot, f"{side}_slips")
    drive(robot, 0.2, 0.0, 1.5)
    turned = pose_m(robot)[2] * (1 if side == "left" else -1)
    assert abs(robot.pose.yaw_rad) < 0.02 and 0.5 < turned < math.pi


def test_sonars_measure_the_room(robot):
    """The front one stands 0.09 m ahead of the middle, 1 m from two walls of a room of 4 by 3 m."""
    robot.wait(1.0)
    assert robot.ranges["front"] == pytest.approx(4.0 - 1.09, abs=0.02)
    assert robot.ranges["right"] == pytest.approx((1.0 - 0.05) * math.sqrt(2), abs=0.02)
