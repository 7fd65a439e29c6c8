"""The robot does not move without a command: after a stop of the board itself, or when its wheels turn unasked."""

import math
from functools import partial
from types import SimpleNamespace

import pytest

from mrl_driver.driver import Options
from mrl_driver.driver.recorded import RecordedDriver
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.problems import PROBLEMS
from mrl_driver.protocol.stop_reason import STOP_REASONS
from mrl_driver.protocol.table import BY_NAME, STOP_CODE
from mrl_driver.safety.wheel_monitor import FAST, Mismatch
from mrl_driver.session.events import OwnStop
from mrl_driver.session.handshake import DEFAULT_PLAN, Board
from mrl_driver.session.session import REFUSED_S
from mrl_driver.view.words import stopped_by
from sim_arduino.faults import hardware_faults
from tests.conformance.bench import Bench
from tests.fake_board import FakeBoard
from tests.long.soak.truth import Truth
from tests.scripted_line import ScriptedLine

from .talk import Talk

LOSS_S, AWAY_S = 0.32, 0.08
TURN_S = 0.3  # The wheels turn after this time at the latest
SETTLED_S = 0.4  # After a fault, the wheels have slowed down
STILL_M = 1e-3
PHASE_S = 0.04
STATUS = BY_NAME["read_status"].code


def commanded_robot(engine="python", motors="omni3md", **options):
    """A robot that can `drive` at 0.2 m/s with a command in force for 10 s."""
    bench = Bench(engine, motors, battery_v=12.0)
    line = ScriptedLine(bench.board)
    driver = SteppedDriver(line, bench.model, options=Options(command_timeout_s=10.0, **options))
    driver.connect()
    return SimpleNamespace(driver=driver, bench=bench, line=line)


@pytest.fixture
def robots(close_later):
    """Makes such robots."""

    def make(*args, **options):
        robot = commanded_robot(*args, **options)
        close_later(robot.bench)
        close_later(robot.driver)
        return robot

    return make


def lose_bytes(robot):
    robot.line.to_board = lambda data: b""
    robot.driver.wait(LOSS_S)
    robot.line.to_board = lambda data: data


def take_motor_board_away(robot):
    robot.bench.plant.motor_board.present = False
    robot.driver.wait(AWAY_S)
    robot.bench.plant.motor_board.present = True


def travel_m(robot, fault, phase_s):
    """Drive, have the fault, and return what the robot travels after it by the same command [m]."""
    driver = robot.driver
    driver.stop()
    driver.wait(phase_s)
    assert driver.drive(0.2, 0.0)
    driver.wait(TURN_S)
    fault(robot)
    driver.wait(SETTLED_S)
    before_m = robot.bench.plant.true_pose.x_m
    driver.wait(SETTLED_S)
    return robot.bench.plant.true_pose.x_m - before_m


ENGINES = [("python", "omni3md", 6), ("python", "bridge", 2), ("pc", "omni3md", 2), ("avr", "omni3md", 1)]
"""Engines and phases; without the refusal, the robot drives on in most phases."""


@pytest.mark.parametrize("engine, motors, phases", ENGINES)
def test_after_a_loss_of_bytes_it_waits_for_a_new_command_and_follows_that(robots, engine, motors, phases):
    robot = robots(engine, motors)
    ways_m = [travel_m(robot, lose_bytes, PHASE_S) for _ in range(phases)]
    assert max(ways_m) < STILL_M
    assert (robot.driver.command, robot.driver.stop_reason) == (None, "link_watchdog")
    assert travel_m(robot, lambda _: None, 0.0) > 0.05


@pytest.mark.parametrize("engine", ["python", "pc"])
def test_a_motor_board_that_was_away_does_not_let_it_drive_on(robots, engine):
    robot = robots(engine)
    ways_m = [travel_m(robot, take_motor_board_away, 0.3) for _ in range(2)]
    assert max(ways_m) < STILL_M and robot.driver.stop_reason == "motor_board"


def test_the_voltage_that_a_missing_motor_board_does_not_measure_empties_no_battery(robots):
    """On the wire it is 0 V, which would be motor power that is off."""
    robot = robots()
    volts = []
    robot.driver.on(Board, lambda board: volts.append(board.battery_v))
    robot.driver.drive(0.2, 0.0)
    robot.driver.wait(TURN_S)
    hardware_faults.motor_board_absent(robot.bench.plant, True)
    states = set()
    for back in (False, True):
        hardware_faults.motor_board_absent(robot.bench.plant, not back)
        for _ in range(25):
            robot.driver.wait(0.1)
            states.add(robot.driver.battery_state)
    assert states == {"ok"} and robot.driver.stop_reason == "motor_board"
    assert any(map(math.isnan, volts)) and 0.0 not in volts and volts[-1] == 12.0


PLANNER_S, OBSTACLE_S = 0.1, 10.0
"""A planner publishes at 10 Hz, for this time although the robot cannot move."""
STALLED_SHARE = 0.04  # Of this time, in which a blocked wheel is driven; without the refusal it is above 0.7


def stalled_share(robot):
    """Block both wheels of a robot that stands, and let a planner drive it at 0.2 m/s at 10 Hz."""
    driver, motors = robot.driver, [robot.bench.plant.bridge.motor(wheel) for wheel in (0, 1)]
    driver.drive(0.2, 0.0)
    driver.wait(TURN_S)  # the board knows its encoders then
    driver.stop()
    driver.wait(1.0)
    for motor in motors:
        motor.blocked = True
    driven = steps = 0
    end_s = driver.now_s + OBSTACLE_S
    while driver.now_s < end_s:
        driver.drive(0.2, 0.0)
        for _ in range(5):
            driver.wait(PLANNER_S / 5)
            steps += 1
            driven += any(motor.shares.forward or motor.shares.backward for motor in motors)
    for motor in motors:
        motor.blocked = False
    return driven / steps


def test_a_planner_does_not_stall_a_wheel_again_and_again(robots):
    robot = robots("python", "bridge")
    assert stalled_share(robot) < STALLED_SHARE
    assert robot.driver.mismatch.reason == robot.driver.stop_reason == "wheel_blocked"
    assert PROBLEMS["wheel_blocked"].remedy in stopped_by(robot.driver)
    assert travel_m(robot, lambda _: None, 0.0) > 0.05


def test_after_a_command_of_zero_the_robot_drives_again_and_a_replay_has_the_same_refusal(robots, tmp_path):
    """The board has stopped it because of a blocked wheel that is free again."""
    blocked, events, again = robots("python", "bridge", record=str(tmp_path / "drive.mrl")), [], []
    blocked.driver.on_event(events.append)
    stalled_share(blocked)
    driver, before_m = blocked.driver, blocked.bench.plant.true_pose.x_m
    assert not driver.drive(0.2, 0.0) and driver.mismatch is not None
    assert driver.drive(0.0, 0.0) and driver.mismatch is None
    assert driver.drive(0.2, 0.0)
    driver.wait(1.0)
    assert driver.command is not None and blocked.bench.plant.true_pose.x_m > before_m + 0.1
    driver.close()
    played = RecordedDriver(str(tmp_path / "drive.mrl"))
    played.on_event(again.append)
    played.play()
    told = [[each for each in heard if isinstance(each, Mismatch)] for heard in (events, again)]
    assert told[0] == told[1] == [Mismatch("", "wheel_blocked")]


@pytest.fixture
def talk():
    """A session with a board that has told of a stop of its own; the robot stands."""
    made = Talk(FakeBoard(), command_timeout_s=None).until_ready().run(0.3)
    made.board.stop_reason = STOP_REASONS.index("stall")
    made.until(lambda: made.session.status.stop_reason == "stall")
    assert made.session.motion.stop_reason == "stall"
    return made


def tell(talk, reason="stall"):
    """The board sends its status again, which names its stop as the one before."""
    talk.session.status = talk.session.status._replace(stop_reason=reason)
    talk.board.stop_reason = STOP_REASONS.index(reason)
    talk.session.request(STATUS)
    talk.run(0.01)


MOVE, STAND = ((200, 0), None), ((0, 0), None)
HELD = ((0, 0), True)  # A command to move that an obstacle holds at zero


@pytest.mark.parametrize(
    "commands, pause_s, reason, target",
    [
        ([MOVE], 0.0, "stall", (200, 0)),
        ([MOVE] * 5, REFUSED_S / 4, "stall", None),
        ([STAND, MOVE], 1.0, "stall", None),
        ([STAND], 1.0, "stall", (0, 0)),
        ([HELD], 1.0, "stall", None),
        ([MOVE], 1.0, "boot", (200, 0)),
    ],
    ids=[
        "a status from before a new command",
        "commands one after the other count as one",
        "moves after it stood",
        "stands",
        "held at zero",
        "a start of the board",
    ],
)
def test_a_command_is_dropped_if_the_board_does_not_carry_it_out(talk, commands, pause_s, reason, target):
    for speeds, moves in commands:
        talk.session.drive(speeds, talk.now, **({} if moves is None else {"moves": moves}))
        talk.run(pause_s)
    tell(talk, reason)
    assert talk.session.motion.target == target


def test_a_command_to_move_that_begins_after_one_to_stand_is_new(talk):
    talk.session.drive((0, 0), talk.now)
    talk.run(1.0)
    talk.session.drive((200, 0), talk.now)
    tell(talk)
    assert talk.session.motion.target == (200, 0)


def test_a_command_that_the_board_does_not_carry_out_is_dropped_and_the_board_is_stopped(talk):
    talk.session.drive((200, 0), talk.now)
    talk.run(REFUSED_S)
    begin_s = talk.now
    tell(talk)
    motion = talk.session.motion
    assert (motion.target, motion.stop_reason) == (None, "stall") and b"@13e" in talk.sent_since(begin_s)


@pytest.mark.parametrize("end", ["stop", "zero", "timeout"])
def test_a_stop_of_the_user_before_the_news_of_the_boards_stop_is_enough(talk, end):
    """A command that only ran out is not."""
    talk.session.motion.timeout_s = 0.05
    talk.session.drive((200, 0), talk.now)
    talk.run(0.01)
    if end == "stop":
        talk.session.stop(talk.now)
    if end == "zero":
        talk.session.drive((0, 0), talk.now)
    talk.run(0.1)
    talk.board.stop_reason = STOP_REASONS.index("encoder")
    talk.session.request(STATUS)
    talk.run(0.01)
    assert talk.seen(OwnStop) == ([OwnStop("encoder")] if end == "timeout" else [])


def test_a_request_that_turns_motors_and_is_refused_gets_one_stop(talk):
    talk.session.request(BY_NAME["move_motors"].code, 20, 20)
    talk.run(REFUSED_S + 0.02)
    begin_s = talk.now
    tell(talk)
    tell(talk)
    assert talk.sent_since(begin_s).count(b"@13e") == 1


def test_the_end_of_a_session_without_checksums_turns_them_off_too():
    """Then a host of 2013 can drive, whatever the board's last stop was."""
    talk = Talk(plan=DEFAULT_PLAN._replace(check=False)).until_ready()
    talk.session.end()
    assert b"@32,0," in talk.session.take()


MOVE_FRAME = b"@%d," % BY_NAME["move_differential"].code
STOP = b"@%de" % STOP_CODE
MOVE_MOTORS = BY_NAME["move_motors_pid"].code
STOPPED_S = 0.2  # Without the driver, the board's watchdog takes at least 0.25 s
CENTIMETRE = 0.01
PERIODS_MS = (10, 20, 50)  # Of the telemetry


def stopped(period_ms, motors="omni3md", record=None, after_s=1.0):
    """A robot that has stopped, `after_s` after the stop; a line that may `deliver` a move which it has kept back."""
    bench = Bench("python", motors, battery_v=12.0)
    line, kept = ScriptedLine(bench.board), []

    def keep_a_move(data):
        """As a network may."""
        if MOVE_FRAME in data and not kept:
            kept.append(data)
            return b""
        return data

    driver = SteppedDriver(line, bench.model, options=Options(period_ms=period_ms, record=record))
    driver.connect()
    for to_board in (line.to_board,) * 20 + (keep_a_move,) * 4:
        line.to_board = to_board
        driver.drive(0.2, 0.0)
        driver.wait(0.05)
    driver.stop()
    driver.wait(after_s)
    (move,) = kept
    deliver = partial(bench.board.receive, move)
    return SimpleNamespace(driver=driver, bench=bench, plant=bench.plant, line=line, deliver=deliver)


def close(robot):
    robot.driver.close()
    robot.bench.close()


@pytest.fixture(params=PERIODS_MS, ids="{}ms".format)
def robot(request):
    made = stopped(request.param)
    yield made
    close(made)


def driven_s(robot):
    """How long the motors are driven after the line has delivered the move."""
    truth = Truth(robot.plant)
    robot.deliver()
    robot.driver.wait(1.0)
    begun, ended = truth.edges
    return ended.time_s - begun.time_s


def way_m(robot):
    """How far the robot goes after the line has delivered the move."""
    before_m = robot.plant.true_pose.x_m
    robot.deliver()
    robot.driver.wait(1.0)
    return robot.plant.true_pose.x_m - before_m


def test_a_move_that_arrives_after_its_stop_is_stopped_again(robot):
    assert driven_s(robot) < STOPPED_S


def test_an_h_bridge_robot_goes_a_centimetre_at_most():
    robot = stopped(20, "bridge")
    assert way_m(robot) < CENTIMETRE
    close(robot)


def test_each_motion_is_counted_once_and_the_reason_of_the_stop_stays(robot):
    for motions in (1, 2):
        driven_s(robot)
        robot.driver.wait(1.0)
        assert robot.driver.link.statistics.uncommanded_motions == motions
    assert robot.driver.stop_reason == "user"


def test_a_robot_that_is_pushed_by_hand_still_counts_as_stopped_and_gets_a_stop_every_50_ms_at_most(robot):
    before = len(robot.line.sent)
    for _ in range(100):
        robot.plant.robot.motors[0].travel += 7.0
        robot.driver.wait(0.01)
        assert robot.driver.stopped
    assert 10 <= sum(data.count(STOP) for _, data in robot.line.sent[before:]) <= 21


def test_a_board_that_is_greeted_again_after_such_a_request_is_guarded_again(robot):
    robot.driver.request(MOVE_MOTORS, 20, 20)
    for robot.line.to_host in (lambda data: b"", lambda data: data):
        robot.driver.wait(1.0)
    assert robot.driver.ready and driven_s(robot) < STOPPED_S


def test_a_request_that_turns_motors_is_not_stopped(robot):
    truth = Truth(robot.plant)
    robot.driver.request(MOVE_MOTORS, 20, 20)
    robot.driver.wait(0.2)
    assert truth.driven and robot.driver.link.statistics.uncommanded_motions == 0


def test_a_command_after_such_a_request_is_guarded_again(robot):
    robot.driver.request(MOVE_MOTORS, 20, 20)
    robot.driver.drive(0.1, 0.0)
    robot.driver.wait(2.0)
    assert driven_s(robot) < STOPPED_S


@pytest.mark.parametrize("motors", ["omni3md", "bridge"])
def test_a_board_with_the_parameters_of_another_robot_does_not_drive_on_at_twice_the_speed(robots, motors):
    robot = robots(motors=motors)
    robot.driver.parameters.write({"encoder_counts": 2 * robot.bench.model.board["encoder_counts"]})
    robot.driver.drive(0.2, 0.0)
    robot.driver.wait(3.0)
    assert robot.driver.mismatch.cause == FAST and robot.driver.stopped
    assert robot.driver.stop_reason == "wheel_mismatch"


@pytest.mark.parametrize("away_s", [0.1, 1.0])
def test_a_motor_board_whose_power_was_off_leaves_the_pose_and_makes_it_less_sure(robot, away_s):
    """As after an emergency switch in the battery's wire: its counters begin at zero again."""
    robot.driver.drive(0.2, 0.0)
    robot.driver.wait(1.5)
    robot.driver.stop()
    robot.driver.wait(1.0)
    before, spread = robot.driver.pose, robot.driver.telemetry.spread
    board = robot.plant.motor_board
    board.present = False
    robot.driver.wait(away_s)
    for encoder in (1, 2, 3):
        board.preset_encoder(robot.driver.now_s, encoder, 0)
    board.present = True
    robot.driver.wait(1.0)
    assert robot.driver.ready and robot.driver.pose == before
    assert robot.driver.telemetry.spread[0] > 10 * spread[0]


@pytest.mark.parametrize("gap_s", [0.0, 0.05, 0.08, 0.2])
def test_a_request_that_follows_a_preset_of_a_counter_is_carried_out(robot, gap_s):
    """The preset looks like a motion."""
    left = robot.plant.robot.motors[0]
    begun = left.travel
    robot.driver.request(BY_NAME["preset_encoder"].code, 1, 5000)
    robot.driver.wait(gap_s)
    robot.driver.request(BY_NAME["move_to_position"].code, 1, 50, 6500)
    robot.driver.wait(2.0)
    assert left.travel - begun == pytest.approx(6500 - 5000, abs=50)
