"""What may happen: each event acts at once, and then takes a number of steps of 50 ms."""

from typing import Callable, Dict, NamedTuple, Optional, Tuple

from mrl_driver.errors import MrlError
from mrl_driver.protocol.stop_reason import StopReason
from ros1_bridge.control.velocity_sources import Source

from .board import NEW_BATTERY_V
from .judge import STEP_S, Judge
from .world import COUNTS_AHEAD, StepEnd, World

SPEED_M_S = 0.2
LONG_STEPS = 6
"""A long fault takes 0.3 s: longer than the watchdog's period, and than the driver waits for telemetry."""
HUNG_STEPS, LATE_STEPS = 10, 3
"""A callback hangs for 0.5 s; after 0.15 s, when telemetry is late, the next event follows."""
EMPTY_V = 8.0
PLANNER = Source("/move_base")
Act = Callable[[World, Judge], None]


class Event(NamedTuple):
    """One kind of event."""

    name: str
    act: Act
    steps: int = 1
    after: Optional[Act] = None  # What happens after these steps; one more follows


def _quietly(call: Callable[[], object]) -> None:
    """A command to a driver that has failed, or whose port is gone, raises: it has no effect.

    A command that waits, because another write blocks, goes on while the driver runs.
    """
    try:
        call()
    except (MrlError, StepEnd):
        return


def _drive(world: World, judge: Judge, speed_m_s: float = SPEED_M_S) -> None:
    def drive() -> None:
        if world.commander.drive(speed_m_s, 0.0):
            judge.command(world, speed_m_s != 0)

    _quietly(drive)


def _begin_goal(world: World, judge: Judge) -> None:
    if not world.line.planner_drives:
        world.line.planner_drives, judge.goal_ended = True, judge.inhibited
    _plan(world, judge)


def _plan(world: World, judge: Judge) -> None:
    """The planner's next command.  It does not hear that its goal has ended, and a stop ends it for good."""

    def drive() -> None:
        if world.commander.drive(SPEED_M_S, 0.0, source=PLANNER) and not judge.goal_ended:
            judge.command(world, True)

    _quietly(drive)


def _drive_zero(world: World, judge: Judge) -> None:
    _drive(world, judge, 0.0)
    judge.user_s = world.board_s  # it may be a stop that waits for the port


def _asked(world: World, judge: Judge) -> None:
    judge.end(world.board_s)
    judge.user_s = world.board_s


def _stop(world: World, judge: Judge) -> None:
    _asked(world, judge)
    judge.late = False
    _quietly(world.commander.stop)


def _drive_and_stop(world: World, judge: Judge) -> None:
    _drive(world, judge)
    _stop(world, judge)


def _late(world: World, judge: Judge) -> None:
    _asked(world, judge)
    judge.late = True
    _quietly(lambda: world.commander.stop(StopReason.COMMAND_TOO_LATE))


def _emergency(world: World, judge: Judge) -> None:
    _asked(world, judge)
    judge.inhibited, judge.late, judge.goal_ended = True, False, True
    _quietly(world.commander.latch)


def _release(world: World, judge: Judge) -> None:
    judge.inhibited = False
    _quietly(world.commander.release)


def _close(world: World, judge: Judge) -> None:
    _asked(world, judge)
    judge.closed = True
    _quietly(world.driver._connection.stop_for_good)


def _zones(world: World, judge: Judge) -> None:
    world.line.zones_until = world.board_s + 5 * STEP_S


def _nothing(world: World, judge: Judge) -> None:
    return


def _fault(attribute: str, steps: int) -> Act:
    def act(world: World, judge: Judge) -> None:
        line = world.line
        until_s = round(world.board_s + steps * STEP_S, 6)
        setattr(line, attribute, max(until_s, getattr(line, attribute)))
        line.fault_s = max(line.fault_s, until_s)

    return act


def _away(suspended: bool) -> Act:
    def act(world: World, judge: Judge) -> None:
        world.stand_still(LONG_STEPS * STEP_S, suspended)
        judge.end(world.board_s)
        judge.paused_s = world.line.fault_s = world.board_s

    return act


def _block(world: World, judge: Judge) -> None:
    _fault("blocked_until", 1)(world, judge)
    world.block()


def _hang(world: World, judge: Judge) -> None:
    judge.hung_s = world.line.hung_until = round(world.board_s + HUNG_STEPS * STEP_S, 6)


def _reset(world: World, judge: Judge) -> None:
    judge.end(world.board_s)
    world.board.reset()
    judge.reset_s = world.line.fault_s = world.board_s


def _change_port(world: World, judge: Judge) -> None:
    """A driver whose callback hangs notices it after that."""
    judge.port_s, world.line.fault_s = world.board_s, max(world.board_s, world.line.hung_until)


def _unplug(world: World, judge: Judge) -> None:
    judge.end(world.board_s)
    world.ports.plugged = False
    judge.note_place(world)
    _change_port(world, judge)


def _plug(world: World, judge: Judge) -> None:
    world.ports.plugged = True
    _change_port(world, judge)


def _plug_other(world: World, judge: Judge) -> None:
    world.board.exchange(world.other_board, COUNTS_AHEAD)
    world.ports.same_board = False
    _plug(world, judge)


def _refuse(world: World, judge: Judge) -> None:
    world.board.refuse_stops(1)
    world.line.fault_s = max(world.line.fault_s, world.board_s)


def _motor_board_off(world: World, judge: Judge) -> None:
    if world.board.truth.turning:  # otherwise nothing is stopped, and the command may be carried out later
        judge.end(world.board_s)
    world.board.set_absent(True)
    judge.absent_s = world.line.fault_s = world.board_s


def _motor_board_on(world: World, judge: Judge) -> None:
    world.board.set_absent(False)
    judge.absent_s = world.line.fault_s = world.board_s


def _battery(world: World, judge: Judge) -> None:
    judge.empty = True
    world.board.set_battery(EMPTY_V)


def _battery_full(world: World, judge: Judge) -> None:
    world.board.set_battery(NEW_BATTERY_V)


def _wheels_block(world: World, judge: Judge) -> None:
    world.board.set_blocked(True)
    judge.blocked_s = world.board_s


def _wheels_free(world: World, judge: Judge) -> None:
    world.board.set_blocked(False)
    judge.blocked_s = world.board_s


EVENTS: Dict[str, Event] = {
    "d": Event("drive", _drive),
    "g": Event("a planner begins to drive to a goal, and does not hear that it is cancelled", _begin_goal),
    "z": Event("drive with speed zero", _drive_zero),
    "s": Event("stop", _stop),
    "w": Event("the user does nothing for 50 ms", _nothing),
    "W": Event("the user does nothing for 250 ms", _nothing, 5),
    "q": Event("drive, and stop at once", _drive_and_stop),
    "i": Event("emergency stop (inhibit)", _emergency),
    "u": Event("release of the emergency stop (allow)", _release),
    "t": Event("an operator's command that is too late stops the robot", _late),
    "v": Event("the zones limit the command after each turn, for 250 ms", _zones, 5),
    "x": Event("close", _close),
    "l": Event("the bytes to the board are lost in the next 50 ms", _fault("lost_until", 1), 0),
    "m": Event("telemetry is lost in the next 50 ms", _fault("mute_until", 1), 0),
    "y": Event("the bytes to the board arrive twice in the next 50 ms", _fault("twice_until", 1), 0),
    "b": Event("another thread's write blocks in the next 50 ms", _block, 0),
    "n": Event("the motor board refuses the next stop", _refuse, 0),
    "L": Event("the bytes to the board are lost for 300 ms", _fault("lost_until", LONG_STEPS), LONG_STEPS),
    "M": Event("telemetry is lost for 300 ms", _fault("mute_until", LONG_STEPS), LONG_STEPS),
    "X": Event(
        "the bytes to the board are damaged for 300 ms", _fault("damaged_until", LONG_STEPS), LONG_STEPS
    ),
    "P": Event("the host's process is paused for 300 ms", _away(False)),
    "S": Event("the host's machine is suspended for 300 ms", _away(True)),
    "h": Event("a callback hangs for 500 ms, while another thread polls", _hang, LATE_STEPS),
    "r": Event("the board resets", _reset),
    "c": Event("the port goes away for 100 ms, and comes back", _unplug, 2, _plug),
    "o": Event("the port goes away for 100 ms, and comes back with another board", _unplug, 2, _plug_other),
    "a": Event("the motor board is away for 100 ms", _motor_board_off, 2, _motor_board_on),
    "e": Event("the battery is empty", _battery, 0),
    "f": Event("the battery is full", _battery_full, 0),
    "k": Event("the wheels are blocked for 300 ms", _wheels_block, LONG_STEPS, _wheels_free),
}
ALL = "".join(EVENTS)
DEEP = "dsWlLMXPhrcoa"  # The kinds of event of the longest sequences
QUICK = "dslLMPhc"  # Those of the short form


def happen(world: World, judge: Judge, letter: str) -> str:
    """Let an event happen, and return the property that is violated, or nothing."""
    event = EVENTS[letter]
    if judge.closed and letter in "dgzsqiutx":
        return ""
    event.act(world, judge)
    broken = _pass(world, judge, event.steps)
    if event.after is not None and not broken:
        event.after(world, judge)
        broken = _pass(world, judge, 1)
    return broken


def _pass(world: World, judge: Judge, steps: int) -> str:
    for _ in range(steps):
        if world.line.planner_drives and not judge.closed:
            _plan(world, judge)
        world.run(STEP_S)
        if world.line.blocked_until <= world.board_s:
            world.unblock()
        broken = judge.step(world)
        if broken:
            return broken
    return ""


def words(path: str) -> Tuple[str, ...]:
    return tuple(EVENTS[letter].name for letter in path)
