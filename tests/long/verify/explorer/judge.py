"""Judges what the motors do against the properties P1 to P7, in simulated time.

It knows what the user, the line and the boards did, and looks at the outputs of the motor board; what the driver
believes counts only where a property is about that.
"""

import math
from typing import Optional

from mrl_driver.protocol.stop_reason import STOP_REASONS, StopReason
from tests.long.soak.truth import PULSE_S

from .world import World

STEP_S = 0.05
WATCHDOG_SLACK_S = 0.015
STOP_S = 0.05  # P2: the motors stop within this time [s]
IN_FLIGHT_S = 0.02
"""P4: a command that was sent just before the stop may be carried out for this time after it [s]."""
REPEAT_S = 0.1  # P5: after a fault of the line has ended, a stop has arrived within this time [s]
GREETING_S = 0.4
"""The same while the board is being greeted: a port is looked for every 0.1 s, requests go every 0.25 s [s]."""
SILENT_S = 0.28
JUMP_M, NEW_S = 0.065, 0.4
"""P7: from the loss of the port to this time after its return [s] the pose moves less than this [m]: the robot coasts
for at most 0.05 m, and another board's counters are 0.079 m ahead."""
RECENT_S = 2.0  # P6: the cause of a stop lies back no longer than this [s]
REASONS = [name for name, _ in STOP_REASONS] if isinstance(STOP_REASONS[0], tuple) else list(STOP_REASONS)
NEVER = -math.inf


class Judge:
    """The truth about commands and causes, and the verdict."""

    def __init__(self) -> None:
        self.allowed = False  # The user wants the robot to move now
        self.inhibited = self.closed = self.zero = self.late = False
        self.goal_ended = False  # An emergency stop has ended the planner's goal
        self.told_s = NEVER  # The user's last command, on the host's clock [s]
        self.commanded_s = self.ended_s = NEVER
        """The user's last command, and the end of the permission, on the board's clock [s]."""
        self.user_s = self.reset_s = self.port_s = self.paused_s = self.absent_s = self.blocked_s = NEVER
        """When each cause of a stop was there last [s]."""
        self.greeted_s = NEVER  # The board was being greeted last [s]
        self.hung_s = NEVER  # Until when a callback hangs [s]
        self.empty = False
        self.before_s = 0.0
        self.reason, self.told, self.expected = 0, "", False
        self.x_m = 0.0

    def command(self, world: World, moves: bool) -> None:
        self.told_s, self.zero, self.late = world.host_s, not moves, False
        if moves and not self.inhibited and not self.closed:
            self.allowed, self.commanded_s = True, world.board_s
        elif not moves:
            self.end(world.board_s)
            self.user_s = world.board_s

    def end(self, at_s: float) -> None:
        """Nobody wants motion from now on, until the next command."""
        if self.allowed:
            self.allowed, self.ended_s = False, at_s

    def settle(self, world: World) -> None:
        self.before_s, self.told = world.board_s, world.driver.stop_reason
        self.look(world)

    def look(self, world: World) -> None:
        board = world.board
        self.before_s, self.reason, self.expected = world.board_s, board.stop_reason, board.expects_motion
        self.told = world.driver._core.session.motion.stop_reason

    def note_place(self, world: World) -> None:
        """The port is lost here; what was not read of the way is no jump."""
        self.x_m = math.nan if world.line.backlog else self._x_m(world)

    @staticmethod
    def _x_m(world: World) -> float:
        odometry = world.driver._core.state.odometry
        return float(odometry.pose.x_m) if odometry is not None else 0.0

    def step(self, world: World) -> str:
        """Judge the step that has ended; return the property that is violated, or nothing."""
        self._follow(world)
        if not world.driver.ready:
            self.greeted_s = world.board_s
        broken = self._motors(world) or self._reasons(world)
        new = world.board_s - self.port_s < NEW_S and not self.allowed and self.commanded_s <= self.port_s
        if not broken and new and abs(self._x_m(world) - self.x_m) > JUMP_M:
            broken = "P7"
        self.look(world)
        return broken

    def _follow(self, world: World) -> None:
        """End the permission for the causes that lie outside the driver, or that the driver has seen."""
        if not self.allowed:
            return
        now_s, line, truth, timeout_s = world.board_s, world.line, world.board.truth, world.timeout_s
        stopped_s = max(truth.stopped_us, truth.quiet_us) / 1e6
        expired_s = world.host_s - self.told_s - (timeout_s or world.user_timeout_s)
        if stopped_s > self.before_s and stopped_s - line.stop_s > STOP_S:
            self.end(stopped_s)
        elif expired_s >= 0:
            self.end(now_s - expired_s)
        elif now_s - line.heard_s >= SILENT_S:
            self.end(line.heard_s + SILENT_S)
        elif world.driver._core.session.motion.target is None:
            self.end(now_s)

    def _motors(self, world: World) -> str:
        line, truth = world.line, world.board.truth
        turned_s, moved_s = truth.turned_us / 1e6, truth.moved_us / 1e6
        if truth.late_us > (world.watchdog_s + WATCHDOG_SLACK_S) * 1e6:
            return "P1"
        if self.allowed:
            return ""
        begun_s = self.commanded_s
        pulse = not truth.turning and 0 <= turned_s - moved_s < PULSE_S
        if moved_s > self.ended_s + IN_FLIGHT_S and moved_s > self.before_s and not pulse:
            return "P4"
        if turned_s <= self.before_s:
            return ""
        most_s = begun_s + (world.timeout_s or world.user_timeout_s) + world.watchdog_s + WATCHDOG_SLACK_S
        if turned_s > most_s and line.slept_s == 0:
            return "P3"
        ready = world.driver.ready
        disturbed = max(line.fault_s, self.greeted_s) > self.ended_s - REPEAT_S
        since_s = max(self.ended_s, line.fault_s, self.greeted_s if ready else NEVER)
        if (
            turned_s > since_s + (GREETING_S if not ready else REPEAT_S if disturbed else STOP_S)
            and not pulse
        ):
            return "P5" if disturbed or self.user_s >= self.ended_s else "P2"
        return ""

    def _reasons(self, world: World) -> str:
        board, now_s = world.board, world.board_s
        own = REASONS[board.stop_reason] if board.stop_reason < len(REASONS) else "?"
        restarted = now_s - max(self.reset_s, self.port_s) < RECENT_S
        if board.stop_reason != self.reason and own != "none" and not restarted:
            moved = max(board.truth.moved_us / 1e6, world.line.move_s + IN_FLIGHT_S) >= self.before_s
            if not self.expected and not moved:  # nor was a move under way
                return "P6"
        told = world.driver._core.session.motion.stop_reason
        if told != self.told and not self._is_true(told, world):
            return "P6"
        if (
            world.commander.stopped_by == StopReason.COMMAND_TOO_LATE
            and not self.late
            and world.driver.command is None
        ):
            return "P6"
        return ""

    def _is_true(self, reason: str, world: World) -> bool:
        now_s, line = world.board_s, world.line

        def recent(at_s: float) -> bool:
            return now_s - at_s < RECENT_S

        timeout_s: Optional[float] = world.timeout_s
        if reason == "command_timeout":
            return timeout_s is not None and world.host_s - self.told_s >= timeout_s - 1e-6
        if reason == "user":
            return recent(self.user_s) or self.zero
        if reason == "closed":
            return self.closed
        if reason == "battery":
            return self.empty
        causes = {
            "no_telemetry": max(line.fault_s, self.hung_s),
            "link_watchdog": max(line.fault_s, self.hung_s),
            "check_ended": line.fault_s,
            "link_lost": self.port_s,
            "host_paused": max(self.paused_s, self.hung_s),
            "restarted": max(self.reset_s, self.port_s, line.fault_s),
            "boot": max(self.reset_s, self.port_s),
            "wheel_mismatch": max(self.blocked_s, self.absent_s, line.fault_s, self.reset_s),
            "motor_board": self.absent_s,
        }
        if reason in ("none", "host"):
            return True
        return recent(causes.get(reason, NEVER))
