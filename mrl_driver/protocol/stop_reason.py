"""Why a robot stands: one list for the board, the driver, the ROS node and the page."""

from enum import Enum
from typing import Tuple


class StopReason(str, Enum):
    """Why a robot was stopped, or may not move.  A member equals its text, so recordings and topics carry the text.

    `view.words` has the sentence for each, and what to do.
    """

    NONE = "none"  # there was no stop, or the reason is not known
    # The board, by its status:
    HOST = "host"
    LINK_WATCHDOG = "link_watchdog"
    STALL = "stall"
    MOTOR_BOARD = "motor_board"
    BOOT = "boot"
    CHECK_ENDED = "check_ended"
    WHEEL_BLOCKED = "wheel_blocked"
    ENCODER = "encoder"
    UNDERVOLTAGE = "undervoltage"
    HELD = "held"  # another robot holds this one by radio; also the driver's reason
    BUMPER = "bumper"
    CLIFF = "cliff"
    EMERGENCY_STOP = "emergency_stop"  # of a board's input; also of the ROS node and of the page, which latch
    # The driver:
    USER = "user"
    NOT_A_NUMBER = "not_a_number"
    COMMAND_TIMEOUT = "command_timeout"
    BATTERY = "battery"
    WHEEL_MISMATCH = "wheel_mismatch"
    NO_TELEMETRY = "no_telemetry"
    RESTARTED = "restarted"
    """The board has restarted while the driver was connected; `BOOT` is the board's word for each of its starts."""
    LINK_LOST = "link_lost"
    HOST_PAUSED = "host_paused"
    CLOSED = "closed"
    # The ROS node:
    MOTORS_DISABLED = "motors_disabled"
    MAY_BE_MOVING = "may_be_moving"  # the link to a board without a watchdog was lost while the robot drove
    PROTECTIVE_ZONE = "protective_zone"
    COMMAND_TOO_LATE = "command_too_late"
    MANUAL_MODE = "manual_mode"  # the change to manual mode ended a drive to a pose
    COMMANDS_UNPAUSED = "commands_unpaused"
    """Commands of a source that has not paused since a stop; they are refused."""
    # The page:
    RELEASED = "released"
    """The control was released."""
    GOAL_REACHED = "goal_reached"
    GOAL_BLOCKED = "goal_blocked"
    GOAL_CHANGED = "goal_changed"
    """The goal changed while the control was held."""
    PAGE_LEFT = "page_left"
    HELM_GIVEN_UP = "helm_given_up"
    HELM_HANDED_OVER = "helm_handed_over"
    # Live views:
    DRIVEN_ELSEWHERE = "driven_elsewhere"
    """In place of a reason: the robot drives by commands that this program does not see."""
    UNKNOWN = "unknown"  # a text of another version

    __hash__ = str.__hash__

    def __str__(self) -> str:
        return self.value

    @property
    def words(self) -> str:
        """The text with spaces."""
        return self.value.replace("_", " ")

    @classmethod
    def _missing_(cls, value: object) -> "StopReason":
        return cls.UNKNOWN


_MEMBERS: Tuple[StopReason, ...] = tuple(StopReason)
STOP_REASONS = _MEMBERS[: _MEMBERS.index(StopReason.EMERGENCY_STOP) + 1]
"""Reasons of the board, by their value in its status."""
PASSING = (
    StopReason.NONE, StopReason.USER, StopReason.HOST, StopReason.BOOT, StopReason.RESTARTED, StopReason.LINK_LOST,
    StopReason.NO_TELEMETRY, StopReason.LINK_WATCHDOG, StopReason.COMMAND_TIMEOUT, StopReason.HOST_PAUSED,
)  # fmt: skip
"""Stops for the link, after which a drive may go on; after all others somebody must look."""
