"""A robot with an H-bridge, from the host's requests to the true motion of its wheels, on every engine that has one."""

import math

import pytest

from mrl_driver.host.firmware_images import image_path
from mrl_driver.protocol import REPLIES, Frame, FrameDecoder, encode_request
from mrl_driver.protocol.table import BY_NAME, PARAMETER_BY_NAME, RESET_CAUSES, STOP_REASONS, WIRING
from sim_arduino.board import PythonBoard
from sim_arduino.board.avr_board import AvrEngine
from sim_arduino.faults.faulty_engine import FaultyEngine
from sim_arduino.hardware.robot_physics import Errors
from sim_arduino.hardware.wiring import Plant
from sim_arduino.world.world import World
from tests.models import bridged

ENGINES = ("python", "avr")
BIT = {name: 1 << number for number, (name, _) in enumerate(WIRING)}
STEP_S = 1e-3
BOOT_S = 0.3
OVERSHOOT, MEAN_ERROR, BAND, SETTLED_S, RIPPLE = 0.05, 0.01, 0.05, 0.25, 0.2
SAME_M, SAME_RAD = 0.005, 0.02
"""Largest difference of the two engines after a course."""


class Duo:
    """A board and its plant, stepped by 1 ms."""

    def __init__(self, engine, model, faults=(), wiring=1, errors=None):
        self.plant = Plant(
            model, World(), (0.0, 0.0, 0.0), wiring=wiring, errors=errors or Errors(), footprint="none"
        )
        robot_id = model.ids[0]
        board = (
            AvrEngine(self.plant, image_path("hbridge"), robot_id)
            if engine == "avr"
            else PythonBoard(self.plant, robot_id)
        )
        self.board, self.now = FaultyEngine(board, faults), 0.0
        self.decoder = FrameDecoder(REPLIES)
        self.run(BOOT_S)

    def run(self, seconds, each=None):
        """Runs for a time; `each` is called after each step.  Returns the frames that came."""
        frames, end = [], self.now + seconds
        while self.now < end - 0.5 * STEP_S:
            self.now += STEP_S
            events = self.decoder.feed(self.board.advance(self.now))
            frames += [event for event in events if isinstance(event, Frame)]
            if each:
                each()
        return frames

    def send(self, name, *values):
        self.board.receive(encode_request(BY_NAME[name].code, *values))

    def set(self, **parameters):
        for name, value in parameters.items():
            self.send("write_config", PARAMETER_BY_NAME[name].number, value)
            self.run(0.01)

    def status(self):
        """The reply to `read_status`, by field."""
        self.send("read_status")
        row = BY_NAME["read_status"]
        (args,) = [frame.args for frame in self.run(0.02) if frame.code == row.code]
        return dict(zip([field.name for field in row.reply], args))

    @property
    def stop_reason(self):
        return STOP_REASONS[self.status()["stop_reason"]]

    @property
    def speeds(self):
        """True speeds of the wheels on the floor [m/s]."""
        scale = self.plant.model.drive.metres_per_count
        return [self.plant.bridge.motor(wheel).speed * scale for wheel in (0, 1)]

    @property
    def driven(self):
        shares = [self.plant.bridge.motor(wheel).shares for wheel in (0, 1)]
        return any(each.forward or each.backward for each in shares)

    def recorded(self, seconds):
        """True speeds of the left wheel, each millisecond."""
        speeds = []
        self.run(seconds, lambda: speeds.append(self.speeds[0]))
        return speeds


@pytest.fixture(params=ENGINES)
def duo(request):
    """Makes a robot, with options of `Duo`."""
    made = []

    def make(model=None, **options):
        made.append(Duo(request.param, model or bridged(), **options))
        return made[-1]

    yield make
    for each in made:
        each.board.close()


def test_it_drives_at_the_commanded_speed_and_stops(duo):
    robot = duo()
    robot.send("move_differential", 300, 0)
    robot.run(2.0)
    assert robot.speeds == pytest.approx([0.3, 0.3], rel=MEAN_ERROR)
    robot.send("stop")
    robot.run(0.5)
    assert (robot.speeds, robot.stop_reason) == ([0.0, 0.0], "host")


def test_it_turns_left_at_a_positive_rate(duo):
    robot = duo()
    robot.send("move_differential", 0, 1000)
    robot.run(2.0)
    assert robot.plant.true_pose.yaw_rad > 1.0
    assert robot.speeds == pytest.approx([-0.075, 0.075], rel=0.02)


@pytest.mark.parametrize("phase", [0.0, 0.2])
def test_a_step_to_300_mm_s_is_quick_and_exact(duo, phase):
    """Without a ramp; the encoders' phase error costs nothing."""
    robot = duo(errors=Errors(encoder_phase=phase))
    robot.set(ramp_time=0)
    robot.send("move_differential", 300, 0)
    speeds = robot.recorded(1.0)
    late = [index for index, speed in enumerate(speeds) if abs(speed / 0.3 - 1.0) > BAND]
    assert max(speeds) < 0.3 * (1.0 + OVERSHOOT)
    assert (late[-1] + 1) * STEP_S <= SETTLED_S
    assert sum(speeds[500:]) / 500 == pytest.approx(0.3, rel=MEAN_ERROR)


def test_a_crawl_at_20_mm_s_is_even(duo):
    """147 edges a second, 20 % of phase error."""
    robot = duo(errors=Errors(encoder_phase=0.2))
    robot.set(ramp_time=0)
    robot.send("move_differential", 20, 0)
    robot.run(1.0)
    speeds = robot.recorded(2.0)
    assert (max(speeds) - min(speeds)) / (sum(speeds) / len(speeds)) <= RIPPLE


def test_both_engines_drive_the_same_course():
    """A straight line, an arc and a stop; the image's motors answer 1 ms late."""
    ends = []
    for engine in ENGINES:
        robot = Duo(engine, bridged())
        for linear, angular in ((300, 0), (200, 1500), (0, 0)):
            robot.send("move_differential", linear, angular)
            robot.run(1.0)
        ends.append(robot.plant.true_pose)
        robot.board.close()
    (one, other), apart = ends, ends[0].yaw_rad - ends[1].yaw_rad
    assert math.hypot(one.x_m - other.x_m, one.y_m - other.y_m) < SAME_M
    assert abs(apart) < SAME_RAD
    assert abs(one.yaw_rad) > 1.0


# ---- cables


def test_a_board_that_does_not_know_its_wiring_refuses_to_move(duo):
    robot = duo(bridged(wiring=0))
    robot.send("move_differential", 300, 0)
    robot.run(0.5)
    assert robot.speeds == [0.0, 0.0]


@pytest.mark.parametrize(
    "wiring",
    [
        ("motors_swapped", "encoders_swapped"),
        ("motors_swapped", "left_motor_reversed", "right_encoder_reversed"),
        ("encoders_swapped", "right_motor_reversed", "left_encoder_reversed"),
        ("left_motor_reversed", "right_motor_reversed", "left_encoder_reversed", "right_encoder_reversed"),
        ("single_channel",),
    ],
    ids="+".join,
)
def test_a_board_that_knows_its_wiring_drives_straight(duo, wiring):
    told = sum(BIT[name] for name in ("set", *wiring))
    robot = duo(bridged(wiring=told), wiring=told)
    robot.send("move_differential", 200, 0)
    robot.run(2.0)
    assert robot.speeds == pytest.approx([0.2, 0.2], rel=0.02)
    assert abs(robot.plant.true_pose.yaw_rad) < 0.02


# ---- faults

STOPS = [  # fault, stop reason, longest time until the bridges stop driving [s]
    ("wheel_blocked", "wheel_blocked", 0.5),
    ("encoder_open", "encoder", 0.2),
    ("encoder_open:wheel=right,channel=b", "encoder", 0.2),
    ("encoder_swapped", "encoder", 0.1),
    ("encoder_oscillation", "encoder", 0.02),
]


@pytest.mark.parametrize(("fault", "reason", "within_s"), STOPS)
def test_a_fault_stops_the_robot_and_says_why(duo, fault, reason, within_s):
    robot = duo()
    robot.send("move_differential", 200, 0)
    robot.run(1.5)
    robot.board.inject(fault)
    robot.run(within_s + 2e-3)
    assert not robot.driven
    assert robot.stop_reason == reason


def test_bounces_cost_nothing(duo):
    """The pulses count forward and back again, and no transition is impossible."""
    robot = duo(faults=["encoder_bounce:pulses=2"])
    robot.send("move_differential", 200, 0)
    robot.run(2.0)
    assert robot.speeds == pytest.approx([0.2, 0.2], rel=MEAN_ERROR)
    assert robot.status()["impossible"] == 0


def test_a_sagging_battery_stops_the_robot(duo):
    """From 12.5 V to 8.5 V, measured at A3."""
    robot = duo(bridged(undervoltage=1000))
    robot.send("move_differential", 200, 0)
    robot.run(1.5)
    assert robot.driven
    robot.board.inject("battery_sag:volts=4")
    robot.run(2.0)
    assert (robot.driven, robot.stop_reason) == (False, "undervoltage")


def test_a_brown_out_stops_the_robot_and_is_the_reset_cause(duo):
    robot = duo()
    robot.send("move_differential", 200, 0)
    robot.run(1.5)
    robot.board.inject("brown_out:at=0")
    robot.run(1.0)
    assert robot.speeds == [0.0, 0.0]
    assert RESET_CAUSES[robot.status()["reset_cause"]] == "brown_out"
