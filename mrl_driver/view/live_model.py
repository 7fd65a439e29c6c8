"""What a live view shows of one robot: state, path, rate of the telemetry, messages, delays.  No I/O and no clock; time
is a parameter.
"""

import math
from typing import Any, Callable, List, Optional, Tuple

from mrl_driver.errors import MrlError
from mrl_driver.robot.robot_state import Telemetry
from mrl_driver.session.events import ImuChanged, Lost, PathUnknown, Reconnected, Slowed

from .shown_state import Shown, has_motors, has_odometry, state_of
from .trail import Trail

_TOLD = (Lost, Reconnected, Slowed, PathUnknown, ImuChanged, MrlError)
"""Events that become a message for the user."""


class LiveModel:
    """Follows one robot for a live view: a Driver, or what has the same attributes, and then a `state` of its own.

    Telemetry and events arrive on the robot's reading thread; the other methods are for the thread that draws.  The
    attributes `notice` and `record` are those of `Shown`; a view may set them.
    """

    def __init__(
        self,
        robot: Any,
        now_s: float,
        state: Optional[Callable[[], Shown]] = None,
        input_name: str = "key",
        remedy: str = "space goes on",
    ) -> None:
        """Begin at `now_s` [s], on the clock of all calls.

        `remedy` is what lets the robot drive on after a wheel did not follow its command.
        """
        self._robot, self._state = robot, state or (lambda: state_of(robot))
        self._input_name, self._remedy = input_name, remedy
        self._start_s = now_s
        self._seen: List[Tuple[float, int]] = []  # times, and numbers of frames until then
        self._moves, self._has_path = has_motors(robot.model), has_odometry(robot.model)
        self.trail, self.frames, self.record = Trail(), 0, ""
        self.notice: str = robot.warning
        robot.on_telemetry(self._on_telemetry)
        robot.on_event(self._on_event)

    def _on_telemetry(self, telemetry: Telemetry) -> None:
        self.frames += 1
        if self._has_path:
            self.trail.add(telemetry.pose, telemetry.stamp_s)

    def _on_event(self, event: object) -> None:
        if isinstance(event, _TOLD):
            self.notice = str(event)

    def delays_s(self, input_s: float) -> Tuple[float, float, float]:
        """Return the operator's delay [s], and its parts: `input_s`, from input to written command, and the link.

        A part that is not known yet is NaN and does not count.
        """
        link_s = self._robot.link.delay_s
        known = [part for part in (input_s, link_s) if not math.isnan(part)]
        return math.fsum(known) if known else math.nan, input_s, link_s

    def shown(self, now_s: float, input_s: float = math.nan, warning: str = "") -> Shown:
        """Return what to show now, `input_s` after the operator's last input [s]; NaN if unknown.

        A `warning` of the view is more important than other messages; a wheel that did not follow its command is more
        important still.
        """
        mismatch, recorder = self._robot.mismatch, self._robot.recorder
        loss = recorder.loss if recorder is not None else ""
        # boards without motors have no telemetry that could be counted
        frames = self.frames if self._moves else self._robot.link.statistics.streamed
        return self._state()._replace(
            now_s=now_s,
            elapsed_s=now_s - self._start_s,
            rate_hz=self._rate_hz(frames, now_s),
            trail=self.trail.poses,
            distance_m=self.trail.distance_m,
            notice=f"{mismatch}; {self._remedy}" if mismatch is not None else warning or loss or self.notice,
            record=self.record,
            incomplete=bool(loss),
            delays_s=self.delays_s(input_s),
            input_name=self._input_name,
        )

    def _rate_hz(self, frames: int, now_s: float) -> float:
        """Return the frames per second over the last second, from the number of frames so far."""
        self._seen = [each for each in self._seen if now_s - each[0] <= 1.0][-20:]
        self._seen.append((now_s, frames))
        (first_s, first), (last_s, last) = self._seen[0], self._seen[-1]
        return (last - first) / (last_s - first_s) if last_s > first_s else 0.0
