"""Figures of the faults table that time alone decides, exact in simulated time; `test_faults` has them on ptys."""

import pytest

from mrl_driver.driver.options import Options
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.robot.models import load
from mrl_driver.robot.robot_state import RobotState
from mrl_driver.session.events import Counts, Ready, Stale
from mrl_driver.session.handshake import RETRY_S, Board
from sim_arduino.board import PythonBoard
from sim_arduino.board.board2013 import Board2013
from sim_arduino.faults.faulty_engine import FaultyEngine
from sim_arduino.hardware.wiring import Plant
from tests.scripted_line import ScriptedLine

from .emulator import MOVE, STOP
from .talk import Talk

HOST_DEAD_S, BEYOND_TIMEOUT_S = 0.3, 0.05
LATE_S, STALE_S = 0.1, 0.3
READY_S, READY_2013_S = 5.0, 8.0
AGE_S = 0.05
FROZEN_S, COMMAND_S = 5.0, 0.02
FLOOD_S = 2.5
ON_THE_WAY_S = 0.005  # A frame on the wire, and one in the making


class Bench:
    """A driver that drives, the line between, and when the motor board was told what."""

    def __init__(self, **options):
        self.plant = Plant(load("traxbot"))
        self.board = PythonBoard(self.plant)
        self.engine = FaultyEngine(self.board)
        self.line = ScriptedLine(self.engine)
        self.robot = SteppedDriver(self.line, options=Options(**options))
        self.robot.connect()
        self.heard = []
        self.robot.on_event(lambda event: self.heard.append((self.robot.now_s, event)))

    def drive(self, seconds):
        """Commands every 20 ms, as from a joystick; when the last one was given."""
        end_s = self.robot.now_s + seconds
        while self.robot.now_s < end_s - 1e-9:
            last_s = self.robot.now_s
            self.robot.drive(0.2, 0.0)
            self.robot.wait(COMMAND_S)
        return last_s

    def times(self, code, since_s):
        return [c.time_s for c in self.plant.motor_board.commands if c.code == code and c.time_s > since_s]

    def told(self, kind):
        return [time_s for time_s, event in self.heard if isinstance(event, kind)]


def test_a_dead_host_is_a_stop_within_300_ms():
    bench = Bench()
    bench.drive(0.5)
    died_s = bench.robot.now_s
    bench.engine.advance(died_s + 1.0)
    assert bench.times(STOP, died_s)[0] - died_s <= HOST_DEAD_S


@pytest.mark.parametrize("timeout_s", [0.1, 0.25, 0.6])
def test_a_dead_command_source_is_a_stop_50_ms_after_the_timeout(timeout_s):
    bench = Bench(command_timeout_s=timeout_s)
    last_s = bench.drive(0.5)
    bench.robot.wait(1.0)
    assert timeout_s <= bench.times(STOP, last_s)[0] - last_s <= timeout_s + BEYOND_TIMEOUT_S


def test_a_board_that_stood_still_for_5_s_carries_out_nothing_that_waited():
    """It is sent no motion once its telemetry is late; what came before that is stale when it goes on."""
    bench = Bench()
    bench.drive(0.5)
    frozen_s = bench.robot.now_s
    bench.engine.freeze(FROZEN_S)
    bench.drive(FROZEN_S)
    waited = b"".join(data for time_s, data in bench.line.sent if time_s >= frozen_s)
    assert 1 <= waited.count(b"@11,") <= LATE_S / COMMAND_S + 1
    bench.robot.wait(1.0)
    assert bench.robot.ready and bench.robot.command is None
    assert bench.times(MOVE, frozen_s) == []
    assert bench.times(STOP, frozen_s)[0] >= frozen_s + FROZEN_S


@pytest.mark.parametrize("period_ms", [20, 50, 200, 1000])
def test_a_silent_board_is_stale_within_300_ms_whatever_the_period(period_ms):
    bench = Bench(period_ms=period_ms)
    bench.drive(2.0)
    last_s = bench.robot.now_s - bench.robot.link.age_s
    bench.engine.freeze(1.0)
    bench.robot.wait(0.5)
    assert bench.told(Stale)[0] - last_s <= STALE_S


@pytest.mark.parametrize("period_ms", [50, 200, 1000])
def test_a_late_board_is_sent_no_motion_whatever_the_period(period_ms):
    bench = Bench(period_ms=period_ms)
    bench.drive(2.0)
    silent_s = bench.robot.now_s
    bench.engine.freeze(1.0)
    bench.drive(0.5)
    assert (
        max(time_s for time_s, data in bench.line.sent if b"@11," in data) - silent_s <= LATE_S + ON_THE_WAY_S
    )


class Flood:
    """Garbage that fills the time between the board's frames, at 115200 baud."""

    def __init__(self, garbage):
        self.garbage, self.on = garbage, False
        self.line = None
        self._filled_s, self._amid = 0.0, False

    def __call__(self, data):
        room = (self.line.now_s - self._filled_s) * 11520 - len(data)
        self._amid = not data.endswith(b"\n") if data else self._amid
        if self._amid or not self.on:
            self._filled_s = self.line.now_s - room / 11520
            return data
        count = max(0, int(room))
        self._filled_s = self.line.now_s - (room - count) / 11520
        garbage, self.garbage = self.garbage[:count], self.garbage[count:] + self.garbage[:count]
        return data + garbage


@pytest.mark.parametrize("garbage", [bytes(range(256)), b"@8,12345,-2", b"7" * 99])
def test_a_flood_of_garbage_leaves_commands_and_telemetry_their_period(garbage):
    """What feeds the board's watchdog goes on every 100 ms or with the frame before, questions every 500 ms."""
    plant = Plant(load("traxbot"))
    flood = Flood(garbage)
    line = flood.line = ScriptedLine(PythonBoard(plant), to_host=flood, step_s=0.001)
    robot = SteppedDriver(line, options=Options(command_timeout_s=None))
    robot.connect()
    told = []
    robot.on_telemetry(lambda telemetry: told.append(robot.now_s))
    robot.drive(0.2, 0.0)
    flood.on, begun_s = True, robot.now_s
    robot.wait(FLOOD_S)
    for start, least_s, most_s in ((b"@11,", 0.08, 0.1), (b"@30,", 0.5, 0.5)):
        times = [time_s for time_s, data in line.sent for _ in range(data.count(start)) if time_s > begun_s]
        assert len(times) >= 0.9 * FLOOD_S / most_s - 1
        assert all(0.9 * least_s <= b - a <= 1.1 * most_s for a, b in zip(times, times[1:]))
    assert len(told) == pytest.approx(FLOOD_S / 0.02, rel=0.1)
    assert robot.ready and robot.command == (0.2, 0.0) and robot.link.statistics.unanswered == 0


def test_a_line_that_stalls_drops_the_command():
    """Without the board's watchdog, which would have stopped the robot as well."""
    bench = Bench(watchdog_ms=0)
    bench.drive(0.5)
    bench.engine.stall(0.6)
    bench.robot.wait(1.5)
    assert bench.robot.ready and bench.robot.command is None and bench.robot.stopped


def test_a_restart_moves_nothing_however_few_the_counts():
    """Ten counts back to none could as well be a movement."""
    state = RobotState(load("traxbot"))
    board = Board(1, 2, 1.72, 12.0, 25.0)
    for restarted, count, time_s in ((True, 0, 0.0), (False, 10, 0.02), (True, 0, 0.04)):
        if restarted:
            state.digest(Ready(board, True, True), time_s)
        state.digest(Counts(count, count, None, time_s, time_s, time_s, 0), time_s)
    assert state.odometry.pose.x_m == 10 * load("traxbot").drive.metres_per_count


@pytest.mark.parametrize(
    ("make", "deaf_s", "limit_s"), [(PythonBoard, 2.0, READY_S), (Board2013, 2.0, READY_2013_S)]
)
def test_a_board_that_opening_has_reset_is_ready_in_time_and_stays_still(make, deaf_s, limit_s):
    plant = Plant(load("traxbot"))
    babble = [b"\xf0\x00@5,2" + bytes(range(0x80, 0xC0))]
    line = ScriptedLine(make(plant), start_s=deaf_s)
    line.to_host = lambda data: babble.pop() + data if babble and line.now_s >= deaf_s else data
    robot = SteppedDriver(line)
    robot.connect()
    assert deaf_s < robot.now_s <= limit_s
    assert [command for command in plant.motor_board.commands if command.code == MOVE] == []


def test_a_2013_board_left_in_debug_mode_is_greeted():
    """Its text has lines of its own."""
    board = Board2013(Plant(load("traxbot")))
    board.debug = 1
    robot = SteppedDriver(board)
    robot.connect()
    assert robot.now_s <= READY_2013_S


def test_half_a_frame_at_connect_costs_nothing_but_itself():
    """The answer right behind it counts: nothing has to be asked again."""
    talk = Talk()
    talk.board.out += b"@8,12"
    assert talk.until_ready().now < RETRY_S


def test_after_a_pause_of_the_host_telemetry_is_fresh_and_all_of_it_is_true():
    """What waited for 5 s comes all at once; each frame follows the one before in the board's time."""
    bench = Bench()
    bench.drive(2.0)
    told = []
    bench.robot.on_telemetry(told.append)
    paused_s = bench.robot.now_s
    bench.robot.pause(FROZEN_S)
    assert told[0].stamp_s - paused_s <= AGE_S
    bench.robot.wait(1.0)
    assert bench.robot.ready and bench.robot.command is None
    assert bench.robot.now_s - bench.robot.telemetry.stamp_s <= AGE_S
    assert bench.robot.pose.x_m == pytest.approx(bench.plant.true_pose.x_m, abs=0.0005)
