"""The driver without I/O and without a thread: one robot's session, state, speed limiter and guards.

Bytes and time go in; bytes and events come out.  `Driver` runs it on a port in real time, `SteppedDriver` on an
emulated board in simulated time.  All times are seconds of one monotonic clock, which the caller reads.
"""

import math
from typing import Any, Dict, List, Optional, Set, Tuple, Type, Union

from mrl_driver.arguments import require_number
from mrl_driver.errors import BoardTimeout, ConfigError, FrameError, MrlError
from mrl_driver.protocol import Frame
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.protocol.table import BY_CODE, COMMANDS
from mrl_driver.robot import battery
from mrl_driver.robot.hold import CAPABILITY as HOLD
from mrl_driver.robot.hold import Hold, hold_of
from mrl_driver.robot.inputs import CAPABILITY as INPUTS
from mrl_driver.robot.inputs import Inputs, inputs_of
from mrl_driver.robot.kinematics import cannot_sideways
from mrl_driver.robot.models import RobotModel, kind_of, require_supported
from mrl_driver.robot.odometry import AnyTwist, AnyWheels, OmniTwist, Twist
from mrl_driver.robot.radio import RadioNode, RadioQueue, RadioText, Request, node_of, text_of
from mrl_driver.robot.robot_state import RobotEvent, RobotState, Telemetry
from mrl_driver.robot.wheel_odometry import PlanarCommands, commands_of
from mrl_driver.safety.speed_limiter import SpeedLimiter
from mrl_driver.safety.wheel_monitor import BOARD_STOPS, DEAD, POWERLESS, Mismatch, WheelMonitor, monitor_of
from mrl_driver.session.events import (
    Awaited,
    Counts,
    ImuReading,
    Info,
    Lost,
    OwnStop,
    Ready,
    Reconnected,
    Reply,
    SensorRead,
    Slowed,
    Status,
)
from mrl_driver.session.handshake import Board, Plan
from mrl_driver.session.link_counters import Counters
from mrl_driver.session.session import LATE_S, NOT_BY_ITSELF, Session, SessionEvent
from mrl_driver.transport.baud_rates import command_gap_s, least_imu_period_ms, least_period_ms

from .options import Options

DriverEvent = Union[
    RobotEvent, SensorRead, RadioText, Hold, Inputs, Mismatch, Awaited, Lost, Reconnected, Slowed
]
"""What a driver reports to its listeners, besides the `MrlError` that ends it."""
GENTLE_S = 3.0  # longest duration of a gentle stop [s]
# Longest stream period [ms], so that the driver notices silence in time.  Listeners that want fewer frames get every
# n-th one.
SLOWEST_MS = 50

ONLY_IDENTIFIED = "the board is only identified"
"""Reason to refuse commands with the option `identify`: without telemetry nobody sees what the robot does."""

INDEXED = {
    row.code
    for row in COMMANDS
    if row.request and row.reply and row.request[0].name == row.reply[0].name in ("index", "servo")
}
"""Codes of requests whose reply repeats their index."""


def _speeds(linear_m_s: Any, angular_rad_s: Any, lateral_m_s: Any) -> Tuple[float, float, float]:
    """Return the arguments of `drive` as floats; raise FrameError if one is not a finite number."""
    if type(linear_m_s) is type(angular_rad_s) is type(lateral_m_s) is float and math.isfinite(
        linear_m_s + angular_rad_s + lateral_m_s
    ):
        return linear_m_s, angular_rad_s, lateral_m_s  # the common case
    return (
        require_number("linear_m_s", linear_m_s, FrameError),
        require_number("angular_rad_s", angular_rad_s, FrameError),
        require_number("lateral_m_s", lateral_m_s, FrameError),
    )


class Core:
    """One robot.  If `model` is None, the packaged model that lists the board's robot id is used."""

    session: Session  # the conversation with the board, after `begin`
    session_kind: Type[Session] = Session

    def __init__(self, model: Optional[RobotModel], options: Options) -> None:
        if model is not None:
            require_supported(model)
        self._options = options
        self._sideways: Optional[PlanarCommands] = None
        self.begun = False  # `begin` was called: there is a session
        self.state = RobotState(
            model, options.ignore_battery, options.any_id, options.build, options.robot_id, options.virtual
        )
        self.limiter = SpeedLimiter()
        self.inhibited: Set[str] = {ONLY_IDENTIFIED} if options.identify else set()
        """While there are reasons in it, commands are refused; see `Driver.inhibit`."""
        self.mismatch: Optional[Mismatch] = None
        """The wheel that did not follow its command, or why the board has stopped the robot for a wheel; or None."""
        self.replies: Dict[int, Tuple[int, ...]] = {}  # fields of the last `Reply`, by command code
        self.hold: Optional[Hold] = None
        """Whether the radio holds the robot; None before the board has said so."""
        self.held = False
        """Other robots hold this one by radio, or the board listens for them; it refuses to move."""
        self.inputs: Optional[Inputs] = None
        """Bumpers, cliff sensors and emergency stop of the board; None before it has said so."""
        self.latched = False  # the emergency stop was active, and was not released
        self.radio_queue = RadioQueue()  # texts that wait for the radio
        self.nodes: Optional[Dict[int, RadioNode]] = None
        """The radios that have answered, by address, while a search is under way."""
        self.stops = 0  # times that `stop` was called
        self.leaving = False  # the driver is closing: it refuses new commands
        self.due_s = -math.inf  # latest time of the next `turn` if no bytes arrive before [s]
        self._monitor: Optional[WheelMonitor] = None
        self._monitored: Optional[Tuple[int, ...]] = None
        least_ms = least_period_ms(options.line_baud)
        self._every = max(1, math.ceil(options.period_ms / max(SLOWEST_MS, least_ms)))
        self._period_ms = max(least_ms, round(options.period_ms / self._every))
        self._untold = 0
        self._fresh: Tuple[str, ...] = ()

    def begin(self, now: float) -> None:
        """Start to greet the board; `turn` returns the results."""
        options = self._options
        gap_s = command_gap_s(options.line_baud)
        least_imu_ms = least_imu_period_ms(options.line_baud, self._period_ms)
        wanted = options.imu_period_ms and not options.identify
        imu_ms = max(least_imu_ms, options.imu_period_ms) if least_imu_ms and wanted else 0
        plan = Plan(options.watchdog_ms, self._period_ms, options.check, gap_s, imu_ms, not options.identify)
        self.session = self.session_kind(
            self._admit, now, plan, options.command_timeout_s, options.greeting_s
        )
        self.session.queued_s = options.queued_s
        self.begun = True

    def join(
        self, board: Board, stream_code: int, checked: bool, now: float, last: Optional[Frame] = None
    ) -> List[DriverEvent]:
        """Go on with a board that was greeted already, see `Session.join`; return the events for the listeners.

        Raises:
            BoardError: the board is not the right one.
        """
        events: List[DriverEvent] = []
        for event in self.session.join(board, stream_code, checked, now, last):
            if isinstance(event, Counts):
                self.state.on_counts(event, [])
            else:
                events += self._digest(event, now)
        self.due_s = -math.inf
        return events

    def _admit(self, board: Board) -> Optional[str]:
        """Accept the board, and choose the motion request for the robot's drive type."""
        stream, model, motion = self.state.admit(board), self.state.model, self.session.motion
        assert model is not None
        self._sideways = commands_of(model.drive)
        if self._sideways is not None:
            motion.request_of, self.limiter.saturate = self._sideways.spell, self._sideways.saturated
        else:
            motion.request_of = self.limiter.saturate = None
        self.session.reads_imu = model.has_odometry
        if self.limiter.limits is None and model.drives:
            limits = model.limits
            if not limits.braking_m_s2:  # the board's own ramp is enough for a robot that does not tip over
                limits = limits._replace(
                    linear_acceleration_m_s2=math.inf, angular_acceleration_rad_s2=math.inf
                )
            self.limiter.limits = limits
        return stream

    def answer(self, code: int, args: Tuple[int, ...]) -> Optional[Tuple[int, ...]]:
        """The reply to a request, or None.  A late reply with another index does not count."""
        reply = self.replies.get(code)
        return None if reply is None or (code in INDEXED and reply[0] != args[0]) else reply

    def turn(self, data: bytes, now: float) -> List[DriverEvent]:
        """Process the bytes that arrived, do what is due, and return the events for the listeners.

        Raises:
            BoardError: the board does not answer properly, or is not the right one.
        """
        session, state, motion = self.session, self.state, self.session.motion
        events: List[DriverEvent] = []
        due_s = self.due_s
        for event in session.receive(data, now) if data else ():
            if type(event) is not Counts:
                events += state.on_imu(event) if type(event) is ImuReading else self._digest(event, now)
                continue
            telemetry = state.on_counts(event, events)
            if telemetry is None:
                continue
            events += (telemetry,) if self._every == 1 else self._thin(telemetry)
            target, monitor = motion.target, self._monitor
            if target is None:
                self._monitor = None
            elif monitor is None or target != self._monitored or event.time_s >= monitor.next_s:
                events += self._check_wheels(telemetry.counts, event, now)
        limiter = self.limiter
        if motion.target is None:
            limiter.target = None
        elif limiter.restrict or limiter.speeds != limiter.target:
            self.limit_again(now)
        if session.hurried or motion.due_s < due_s or now >= due_s - (session.lead_s if data else 0.0):
            for event in session.tick(now):
                events += self._digest(event, now)
            self._send_waiting(now)
            self.due_s = self.deadline(now)
        return events

    def deadline(self, now: float) -> float:
        """Latest time of the next `turn` if no bytes arrive before [s]."""
        due_s = self.session.deadline(now)
        return min(due_s, self.radio_queue.due_s) if self.session.ready else due_s

    def send_by_radio(self, request: Request, now: float) -> None:
        """Send a request of the radio as soon as its line is free; raise MrlError if too many wait already."""
        self.radio_queue.add(request, now)
        self._send_waiting(now)
        self.session.hurried = self.session.hurried or self.radio_queue.due_s < math.inf

    def _send_waiting(self, now: float) -> None:
        """Send the radio's next request if it is due; while the board is silent or being greeted, they wait."""
        if self.radio_queue.due_s <= now and self.session.ready:
            request = self.radio_queue.take(now)
            if request is not None:
                self.expire(now)
                self.session.request(*request)

    def drive(self, linear_m_s: float, angular_rad_s: float, now: float, lateral_m_s: float = 0.0) -> bool:
        """Put a command in force, see `Driver.drive`.

        Raises:
            FrameError: a speed is not a finite number, or the base cannot move sideways; the robot was stopped.
            ConfigError: the board has no motors, or `restrict` has not returned finite speeds; the robot was stopped.
        """
        session, state, limiter = self.session, self.state, self.limiter
        try:
            wanted = linear_m_s, angular_rad_s, lateral_m_s = _speeds(linear_m_s, angular_rad_s, lateral_m_s)
        except FrameError as error:
            raise self.refuse(error, now) from None
        if limiter.limits is None:
            self._require_motors()
        if lateral_m_s and state.model is not None and self._sideways is None:
            self.stop(now, StopReason.USER)
            raise FrameError(
                f"{cannot_sideways(lateral_m_s, kind_of(state.model.drive))}; the robot was stopped"
            )
        moves = bool(linear_m_s or angular_rad_s or lateral_m_s)
        if state.powerless and session.motion.target is not None and not moves:
            self.stop(now, StopReason.BATTERY)  # at once: the gentle stop ends here
        if limiter.limits is None or self.leaving or state.powerless or self.inhibited:
            session.motion.prolong(now)
            return False
        if (self.mismatch is not None and moves) or self.held or self.latched:
            return False
        if self.inputs is not None and self.inputs.active:
            against = self._against(self.inputs, linear_m_s, angular_rad_s, lateral_m_s)
            if against is not StopReason.NONE:
                self.stop(now, against)
                return False
        self.mismatch = None
        if session.motion.target is None:
            limiter.drop()
        limiter.target = limiter.limited(wanted if self._sideways is not None else wanted[:2])
        try:
            linear, angular, *others = limiter.step(now)
        except ConfigError as error:
            raise self.refuse(error, now) from None
        lateral_mm_s = (round(others[0] * 1000),) if others else ()
        return session.drive((round(linear * 1000), round(angular * 1000), *lateral_mm_s), now, moves)

    def expire(self, now: float) -> None:
        """Apply the limits again, and stop the robot if it must not drive on, before a request feeds the watchdog."""
        self.limit_again(now)
        self.session.expire(now)

    def require_may_turn(self, code: int, now: float) -> None:
        """Raise MrlError if a request that turns motors must not be sent now, or ever."""
        self._require_motors()
        self.session.require_answers(now)
        if self.held or self.latched:
            raise MrlError(
                f"{BY_CODE[code].name} is refused, nothing was sent: {self.hold if self.held else self.inputs}"
            )
        if self.state.powerless:
            raise MrlError(
                f"{BY_CODE[code].name} is refused, nothing was sent: the battery is {self.state.battery_state}; charge "
                "it, and switch it on"
            )
        if self.leaving or self.inhibited:
            why = "the driver is being closed" if self.leaving else ", ".join(sorted(self.inhibited))
            raise MrlError(
                f"{BY_CODE[code].name} is refused while commands are inhibited ({why}), nothing was sent; "
                "try again after that has ended"
            )
        if self._is_limited:
            raise MrlError(
                f"{BY_CODE[code].name} is refused, nothing was sent: lower limits of speed, or a restriction, are in "
                "force, and the board would not keep them; use drive(), or end them first"
            )

    @property
    def _is_limited(self) -> bool:
        """The robot may not do all that its model allows; the board does not know."""
        return self.state.model is not None and self.limiter.is_below(self.state.model.limits)

    def on_new_limits(self, now: float) -> None:
        """Stop what a request turns if the new limits do not allow all speeds."""
        if self.begun and self.session.turning and self._is_limited:
            self.stop(now, StopReason.USER)

    def _require_motors(self) -> None:
        """Raise ConfigError if the board has no motors."""
        if self.state.model is not None:
            self.state.model.require_motors()

    def limit_again(self, now: float) -> None:
        """Continue to accelerate, and apply `limiter.restrict` again, if a command is in force."""
        limiter, motion = self.limiter, self.session.motion
        if limiter.target is not None and motion.target is not None:
            try:
                speeds = limiter.step(now)
            except ConfigError as error:
                self.refuse(error, now)
            else:
                self.session.adjust(tuple(round(speed * 1000) for speed in speeds), now)

    def limited(self, linear_m_s: float, angular_rad_s: float, lateral_m_s: float = 0.0) -> AnyTwist:
        """The speeds after limiting, on the same arc; a base that cannot move sideways ignores the lateral speed.

        Raises:
            FrameError: a speed is not a finite number.
            ConfigError: the board has no motors.
        """
        self._require_motors()
        linear_m_s, angular_rad_s, lateral_m_s = _speeds(linear_m_s, angular_rad_s, lateral_m_s)
        if self._sideways is not None:
            return OmniTwist(*self.limiter.limited((linear_m_s, angular_rad_s, lateral_m_s)))
        return Twist(*self.limiter.limited((linear_m_s, angular_rad_s)))

    def statistics(self) -> Counters:
        """Return the counters of the link; raise BoardTimeout before `begin`."""
        if not self.begun:
            raise BoardTimeout("not connected; call connect() first")
        counters, odometry = self.session.counters, self.state.odometry
        counters.refused_counts = odometry.baseline.refused if odometry else 0
        counters.texts_dropped = self.radio_queue.dropped
        return counters.snapshot()

    def stop(self, now: float, reason: StopReason) -> None:
        """Stop at once."""
        self.stops += 1
        self.mismatch = self._monitor = None
        self.limiter.drop()
        self.session.stop(now, reason)

    def refuse(self, error: MrlError, now: float) -> MrlError:
        """Stop the robot because something given cannot be used; return the error to raise."""
        self.stop(now, StopReason.NOT_A_NUMBER)
        return type(error)(f"{error}; the robot was stopped")

    def _digest(self, event: SessionEvent, now: float) -> List[DriverEvent]:
        """Update the robot's state from an event, and stop the robot if its battery is empty or off."""
        events: List[DriverEvent] = [*self.state.digest(event, now)]
        if isinstance(event, Ready):
            self.state.settled = self.state.settled or self._options.identify
            if self.state.has_ranges:
                self.session.poll_ranges(now)
            self._monitor = None  # after a restart the board's time starts at zero again
            if HOLD not in event.board.capabilities:  # other firmware never says that it has ended
                self.hold, self.held = None, False
            if INPUTS not in event.board.capabilities:
                self.inputs, self.latched = None, False
        elif isinstance(event, Info) and self.state.powerless:
            self._spare_battery(now)
        elif isinstance(event, OwnStop):
            events += self._on_own_stop(event.reason)
        elif isinstance(event, Status):
            self._explain(event.stop_reason)
        elif isinstance(event, Reply):
            self.replies[event.frame.code] = event.frame.args
            name = self.session.sensors.name_of(event.frame.code)
            if name:
                events.append(SensorRead(name, self.session.sensors.readings[name]))
            events += self._on_hold(hold_of(event.frame), now)
            events += self._on_inputs(inputs_of(event.frame, self.inputs), now)
            text, node = text_of(event.frame), node_of(event.frame)
            if text is not None:
                events.append(text)
            if node is not None and self.nodes is not None:
                self.nodes[node.address] = node
        return events

    def _on_hold(self, hold: Optional[Hold], now: float) -> List[DriverEvent]:
        """Stop if other robots hold this one, and report a change."""
        if hold is None or hold == self.hold:
            return []
        self.hold, self.held = hold, hold.held
        if self.held and self.session.motion.target is not None:
            self.stop(now, StopReason.HELD)
        return [hold]

    def _against(
        self, inputs: Inputs, linear_m_s: float, angular_rad_s: float, lateral_m_s: float
    ) -> StopReason:
        """Why the board would refuse a command: a wheel would turn towards an active input."""
        assert self.state.model is not None
        rim_m_s = 0.5 * self.state.model.base.wheel_separation_m * math.fabs(angular_rad_s)
        most_m_s = rim_m_s + math.fabs(lateral_m_s)
        return inputs.against(linear_m_s - most_m_s, linear_m_s + most_m_s)

    def _on_inputs(self, inputs: Optional[Inputs], now: float) -> List[DriverEvent]:
        """Stop at an emergency stop, and report a change."""
        if inputs is None or inputs == self.inputs:
            return []
        self.inputs, self.latched = inputs, inputs.latched
        if inputs.latched and self.session.motion.target is not None:
            self.stop(now, StopReason.EMERGENCY_STOP)
        return [inputs]

    def _thin(self, telemetry: Telemetry) -> List[Telemetry]:
        """Every n-th telemetry; its `fresh` includes the sonars that were new in the skipped ones."""
        self._fresh = tuple(dict.fromkeys(self._fresh + telemetry.fresh))
        self._untold = (self._untold + 1) % self._every
        if self._untold:
            return []
        telemetry, self._fresh = telemetry._replace(fresh=self._fresh), ()
        return [telemetry]

    def _check_wheels(self, travel: AnyWheels, event: Counts, now: float) -> List[DriverEvent]:
        """Stop the robot if a wheel does not follow its command, and report the wheel.

        A frame that arrives late was made while commands were late too, or held back: the monitor starts again.  Wheels
        without encoders tell nothing.
        """
        motion = self.session.motion
        assert motion.target is not None and self.state.model is not None
        if event.arrival_s - event.stamp_s >= LATE_S or not self.state.model.has_odometry:
            self._monitor = None
            return []
        if self._monitor is None:
            self._monitor = monitor_of(self.state.model, motion.pace)
        self._monitored = motion.target
        linear_mm_s, angular_mrad_s, *lateral_mm_s = motion.target
        lateral_m_s = lateral_mm_s[0] / 1000 if lateral_mm_s else 0.0
        mismatch = self._monitor.update(
            linear_mm_s / 1000, angular_mrad_s / 1000, travel, event.time_s, lateral_m_s
        )
        if mismatch is None:
            return []
        self.stop(now, StopReason.WHEEL_MISMATCH)
        self.mismatch = mismatch
        return [mismatch]

    def _on_own_stop(self, reason: StopReason) -> List[DriverEvent]:
        """The board has stopped the robot by itself: if a wheel was the reason, refuse the commands that follow.

        Otherwise a source that keeps sending them would stall the wheel again each time.
        """
        if reason is StopReason.EMERGENCY_STOP and not self.latched:
            self.inputs, self.latched = (self.inputs or Inputs())._replace(latched=True), True
            return [self.inputs]
        if reason not in BOARD_STOPS or self.mismatch is not None:
            return []
        self.mismatch = Mismatch("", str(reason))
        return [self.mismatch]

    def _explain(self, reason: StopReason) -> None:
        """If the board has stopped the robot before a wheel stood still, that was the reason, and no mismatch.

        A board that has carried out the command would say that the host has stopped it.
        """
        for_no_wheel = reason not in (*NOT_BY_ITSELF, *BOARD_STOPS, StopReason.STALL)
        if for_no_wheel and self.mismatch is not None and self.mismatch.cause in (DEAD, POWERLESS):
            self.mismatch = None
            self.session.motion.stop_reason = reason

    def _spare_battery(self, now: float) -> None:
        """Stop to protect the battery: gently if it is empty; at once if motor power is off, so that the robot does
        not move when power returns, or if a request turned the motors.
        """
        motion, model = self.session.motion, self.state.model
        if model is None or (motion.target is None and not self.session.turning):
            return
        if motion.target is None or self.state.battery_state == battery.OFF:
            self.session.stop(now, StopReason.BATTERY)
            return
        speed_m_s = math.hypot(motion.target[0], *motion.target[2:]) / 1000
        motion.fade(now, min(GENTLE_S, speed_m_s / model.limits.linear_acceleration_m_s2))
