"""A robot with an H-bridge, from the host's requests to the true motion of its wheels, on every engine that has one."""

import math

import pytest

from mrl_driver.host.firmware_images import image_path
from mrl_driver.protocol import REPLIES, Frame, FrameDecoder, encode_request
from mrl_driver.protocol.stop_reason import STOP_REASONS
from mrl_driver.protocol.table import BY_NAME, PARAMETER_BY_NAME
from sim_arduino.board import PythonBoard
from sim_arduino.board.avr_board import AvrEngine
from sim_arduino.faults.faulty_engine import FaultyEngine
from sim_arduino.hardware.robot_physics import Errors
from sim_arduino.hardware.wiring import Plant
from sim_arduino.world.world import World
from tests.models import bridged

ENGINES = ("python", "avr")
STEP_S = 1e-3
BOOT_S = 0.3
OVERSHOOT, MEAN_ERROR, BAND, SETTLED_S, RIPPLE = 0.05, 0.01, 0.05, 0.25, 0.2
SAME_M, SAME_RAD = 0.005, 0.02  # Largest difference of the two engines after a course


class Duo:
    """A board and its plant, stepped by 1 ms."""

    def __init__(self, engine, faults=(), errors=None):
        model = bridged()
        self.plant = Plant(
            model, World(), (0.0, 0.0, 0.0), wiring=1, errors=errors or Errors(), footprint="none"
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
        self.send("read_status")
        row = BY_NAME["read_status"]
        (args,) = [frame.args for frame in self.run(0.02) if frame.code == row.code]
        return dict(zip([field.name for field in row.reply], args))

    @property
    def stop_reason(self):
        return STOP_REASONS[self.status()["stop_reason"]]

    def recorded(self, seconds):
        """True speeds of the left wheel on the floor, each millisecond [m/s]."""
        found, scale = [], self.plant.model.drive.metres_per_count
        self.run(seconds, lambda: found.append(self.plant.bridge.motor(0).speed * scale))
        return found

    @property
    def driven(self):
        shares = [self.plant.bridge.motor(wheel).shares for wheel in (0, 1)]
        return any(each.forward or each.backward for each in shares)


@pytest.fixture(params=ENGINES)
def duo(request, close_later):
    def make(**options):
        made = Duo(request.param, **options)
        close_later(made.board)
        return made

    return make


@pytest.mark.parametrize("phase", [0.0, 0.2])
def test_a_step_to_300_mm_s_is_quick_and_exact(duo, phase):
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
        robot = Duo(engine)
        for linear, angular in ((300, 0), (200, 1500), (0, 0)):
            robot.send("move_differential", linear, angular)
            robot.run(1.0)
        ends.append(robot.plant.true_pose)
        robot.board.close()
    (one, other), apart = ends, ends[0].yaw_rad - ends[1].yaw_rad
    assert math.hypot(one.x_m - other.x_m, one.y_m - other.y_m) < SAME_M
    assert abs(apart) < SAME_RAD
    assert abs(one.yaw_rad) > 1.0


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
    assert robot.recorded(0.1)[-1] == pytest.approx(0.2, rel=MEAN_ERROR)
    assert robot.status()["impossible"] == 0
