"""The page that drives, the commands that count, and when the robot must stop.  Pure.

One client has the helm, or nobody.  Its commands drive while a control is held: from one press to its release.  Each
stop ends the press, and no later command of it drives.  After a stop, commands count only after the client has sent a
message without a held control that echoes a message of ours from after the stop: the page knew of the stop, and no
control was held.  This needs no comparison of clocks, and no order of arrival.

The latched emergency stop may come from every client at any time.
"""

import math
from dataclasses import dataclass, field, replace
from typing import Dict, List, NamedTuple, Optional, Union

from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.safety.message_age import MessageAge
from mrl_driver.safety.operator_delay import DRIFT, delay_text
from mrl_driver.view.words import STOPS

STOP_S = 0.15  # the robot stops after this time without a fresh command [s]
OLDEST_S = 0.15  # commands older than this are dropped [s]
SENT_S = 0.25  # the robot stops at the latest this long after its page has sent the last fresh command [s]
HAND_OVER_S = 1.0  # the helm changes hands when the robot stands, at the latest this long after its stop [s]
WINDOW_S = 10.0  # older pairs of `heard` and `heard_t` do not count [s]
SAME_S = 1e-6  # times on the wire are rounded to this [s]
DEAF_S = 2.0
"""The age is unknown if the newest message that the page has is older than this [s]: its picture stands still."""
COARSE_S = 0.02
"""Browsers that hide the exact time round it to at most this [s].  A message that seems to arrive longer before it was
sent shows that the page's clock has jumped."""

WATCHES, TAKE_FIRST = "this link is for watching only", "take the helm first"
LATCHED = "the emergency stop is latched: release it first"
PRESS_AGAIN = "release the control and press it again"
RELEASES = "only the driving page can release the emergency stop: take the helm first"
LET_GO = "let go of all controls, then release the emergency stop again"


class Why(NamedTuple):
    """Why the robot stands, or does not follow a command: for programs, and in words for people."""

    reason: StopReason
    words: str


def why_of(reason: StopReason) -> Why:
    """Return a reason with its usual words."""
    return Why(reason, STOPS[reason].why)


GOING = why_of(StopReason.NONE)


class Goal(NamedTuple):
    """A place to drive to, in the odom frame."""

    x_m: float
    y_m: float
    yaw_rad: Optional[float] = None  # None: any yaw will do


class Control(NamedTuple):
    """What the controls of a page command, and whether one of them is held."""

    seq: int  # number of the message; it grows
    t_s: float  # when it was sent [s, the page's clock]
    heard_s: Optional[float]  # time of our newest message that the page has [s, our clock]; None: it has none
    heard_t_s: Optional[float]  # when that arrived there [s, the page's clock]
    press: int  # number of the press, or of the last one; it grows
    held: bool
    linear_m_s: float = 0.0
    angular_rad_s: float = 0.0
    lateral_m_s: float = 0.0
    goal: Optional[Goal] = None  # in place of speeds


class Drive(NamedTuple):
    """Drive at these speeds.  `age_s` is an upper bound of the command's age."""

    linear_m_s: float
    angular_rad_s: float
    lateral_m_s: float
    age_s: float


class Go(NamedTuple):
    """Drive one step towards a goal."""

    goal: Goal
    age_s: float


class Halt(NamedTuple):
    """Stop the robot."""

    reason: StopReason


class Latch(NamedTuple):
    """Stop the robot, and let nothing move it until `Unlatch`."""


class Unlatch(NamedTuple):
    """End the latched stop."""


class Refuse(NamedTuple):
    """Tell a client why what it asked for does not happen."""

    client: int
    why: str


class Tell(NamedTuple):
    """The state has changed: send it to all."""


Act = Union[Drive, Go, Halt, Latch, Unlatch, Refuse, Tell]


@dataclass
class HelmState:
    """What all clients may know."""

    driver: Optional[int] = None  # the client that has the helm
    wants: Optional[int] = None  # the client that gets it next
    driving: bool = False  # a press is in force
    latched: bool = False
    latched_by: Optional[int] = None  # the client that set the emergency stop; None: none of ours
    latched_by_other: str = ""  # name of another source of the emergency stop; empty: there is none
    released_by_other: bool = False  # another program has released our emergency stop
    spent: Dict[int, int] = field(default_factory=dict)  # the newest press of each client that is over
    why: Why = GOING  # why the robot was stopped last; `none` while a press is in force
    late: int = 0  # commands that were dropped because they were too old, or their age was not known
    repeated: int = 0  # messages that were dropped because a newer one had arrived before
    malformed: int = 0  # messages that could not be read


class Freshness:
    """The age of the messages of one page, over one connection, although its clock is not ours.

    Each message has its time `t`, and the time `heard` of the newest message that the page has from us, with the page's
    time `heard_t` of its arrival (see `safety.message_age`).
    """

    def __init__(self) -> None:
        self._age = MessageAge(WINDOW_S, COARSE_S, DRIFT)

    def age_s(self, t_s: float, heard_s: Optional[float], heard_t_s: Optional[float], now_s: float) -> float:
        """Return an upper bound of the age of a message [s]; infinity if it is not known.

        Args:
            t_s: when it was sent [s, the page's clock].
            heard_s: when we sent the newest message that the page had then [s, our clock]; None: it had none.
            heard_t_s: when that arrived there [s, the page's clock].
            now_s: when the message is processed [s, our clock].
        """
        if heard_s is None or heard_t_s is None or not heard_s <= now_s + SAME_S or not heard_t_s <= t_s:
            return math.inf
        self._age.heard(heard_s, heard_t_s)
        return self._age.age_s(t_s, now_s) if now_s - heard_s <= DEAF_S else math.inf


class _Client:
    """What is known of a client's controls."""

    def __init__(self, may_drive: bool) -> None:
        self.may_drive = may_drive
        self.freshness = Freshness()
        self.seq = -1
        self.press = self.spent = -1
        self.held = False
        self.told = -1  # the press whose delay was reported
        self.rested_s = -math.inf
        """Time of the newest message of ours that this client has echoed while no control was held [s]."""

    def note(self, control: Control, now_s: float) -> float:
        """Take note of a message that is newer than those before, and return an upper bound of its age [s]."""
        self.seq, self.press, self.held = control.seq, max(self.press, control.press), control.held
        return self.freshness.age_s(control.t_s, control.heard_s, control.heard_t_s, now_s)


class Helm:
    """Decides which client drives and when the robot stops.  Not thread-safe: the server's loop owns it.

    Clients are numbers that are never used again: one that comes back is another one.  Each method returns acts in
    their order, and first does what was due before `now_s` (see `tick`).
    """

    def __init__(self, stop_s: float = STOP_S, oldest_s: float = OLDEST_S, sent_s: float = SENT_S) -> None:
        self._stop_s, self._oldest_s, self._sent_s = stop_s, oldest_s, sent_s
        self._clients: Dict[int, _Client] = {}
        self._state = HelmState()
        self._goal: Optional[Goal] = None  # of the press in force; None: it commands speeds
        self._press = -1
        self._ends_s = math.inf  # the press in force ends without a fresh command [s]
        self._since_s = -math.inf  # last time at which held controls lost their effect [s]
        self._halted_s = -math.inf
        self._stands = True
        self._latched = self._robot_latched = False
        self._latched_s = -math.inf

    # -- clients, and the one that drives

    def join(self, client: int, may_drive: bool, now_s: float) -> List[Act]:
        """A client has connected; without `may_drive` it can only watch and stop."""
        acts = self.tick(now_s)
        self._clients[client] = _Client(may_drive)
        return [*acts, Tell()]

    def leave(self, client: int, now_s: float) -> List[Act]:
        """A client's connection has ended."""
        acts = self.tick(now_s)
        if self._clients.pop(client, None) is None:
            return acts
        if client == self._state.wants:
            self._state.wants = None
        if client == self._state.driver:
            return acts + self._give_up(StopReason.PAGE_LEFT, now_s)
        return [*acts, Tell()]

    def take(self, client: int, now_s: float) -> List[Act]:
        """A client wants the helm.

        It gets it when the robot stands.  One that has it and holds a control keeps it until the control is released.
        """
        acts = self.tick(now_s)
        who = self._clients.get(client)
        if who is None or not who.may_drive:
            return [*acts, Refuse(client, WATCHES)]
        if client in (self._state.driver, self._state.wants):
            return [*acts, Tell()]
        if self._state.wants is not None:
            return [*acts, Refuse(client, "somebody else has asked for the helm already")]
        self._state.wants = client
        if self._state.driver is not None and not self._state.driving:
            return acts + self._give_up(StopReason.HELM_HANDED_OVER, now_s)
        return acts + (self._hand_over(now_s) or [Tell()])

    def yield_(self, client: int, now_s: float) -> List[Act]:
        """A client gives up the helm, or its wish for it."""
        acts = self.tick(now_s)
        if client == self._state.driver:
            return acts + self._give_up(StopReason.HELM_GIVEN_UP, now_s)
        if client == self._state.wants:
            self._state.wants = None
            return [*acts, Tell()]
        return [*acts, Refuse(client, "you do not have the helm")]

    def _give_up(self, reason: StopReason, now_s: float) -> List[Act]:
        """The driving client loses the helm."""
        acts = self._halt(why_of(reason), now_s)
        self._state.driver = None
        return acts

    def _hand_over(self, now_s: float) -> List[Act]:
        """Give the helm to the client that wants it, if it is free and the robot stands."""
        stands = self._stands or now_s >= self._halted_s + HAND_OVER_S
        if self._state.wants is None or self._state.driver is not None or not stands:
            return []
        self._state.driver, self._state.wants = self._state.wants, None
        self._since_s = now_s
        return [Tell()]

    @property
    def waits(self) -> bool:
        """A hand-over waits until the robot stands."""
        return self._state.wants is not None and self._state.driver is None

    # -- commands

    def control(self, client: int, control: Control, now_s: float) -> List[Act]:
        """A client reports its controls."""
        acts = self.tick(now_s)
        who = self._clients.get(client)
        if who is None:
            return acts
        if not control.held:
            return acts + self._rest(client, who, control, now_s)
        if control.seq <= who.seq:
            self._state.repeated += 1
            return acts
        age_s = who.note(control, now_s)
        why = self._why_not(client, who, control)
        if why:
            new, who.spent = control.press > who.spent, max(who.spent, control.press)
            return [*acts, Refuse(client, why), Tell()] if new else acts
        if age_s > self._oldest_s:
            self._state.late += 1
            return acts + self._complain(client, who, age_s)
        return acts + self._drive(who, control, age_s, now_s)

    def _rest(self, client: int, who: _Client, control: Control, now_s: float) -> List[Act]:
        """No control is held: the press is over, however late and in whatever order this arrives."""
        if control.seq > who.seq:
            who.note(control, now_s)
            if control.heard_s is not None and control.heard_s <= now_s + SAME_S:
                who.rested_s = max(who.rested_s, control.heard_s)
        else:
            self._state.repeated += 1
            if control.press < who.press:
                return []
            who.press, who.held = control.press, False
        who.spent = who.press
        if client != self._state.driver or not self._state.driving:
            return []
        since_s = self._since_s
        acts = self._halt(why_of(StopReason.RELEASED), now_s)
        self._since_s = since_s  # the next press is another one already
        return acts

    def _why_not(self, client: int, who: _Client, control: Control) -> str:
        """Return why a held control of this client does not drive; empty if it may."""
        if not who.may_drive:
            return WATCHES
        if client != self._state.driver:
            return TAKE_FIRST
        if self._is_latched:
            return LATCHED
        rested = who.rested_s >= self._since_s - SAME_S
        return "" if rested and who.spent < control.press == who.press else PRESS_AGAIN

    def _complain(self, client: int, who: _Client, age_s: float) -> List[Act]:
        """Tell a client once in a press that its commands are too old to begin with."""
        if self._state.driving or who.told == who.press:
            return []
        who.told = who.press
        age, oldest = delay_text(age_s if age_s < math.inf else math.nan), delay_text(self._oldest_s)
        return [Refuse(client, f"the delay of this page's commands is {age}, expected at most {oldest}")]

    def _drive(self, who: _Client, control: Control, age_s: float, now_s: float) -> List[Act]:
        """Follow a fresh command."""
        begins = not self._state.driving
        if not begins and control.press == self._press and control.goal != self._goal:
            return self._halt(why_of(StopReason.GOAL_CHANGED), now_s)
        if not begins and control.press > self._press:
            who.spent = self._press
        self._state.driving, self._state.why = True, GOING
        self._press, self._goal = control.press, control.goal
        self._ends_s = now_s + min(self._stop_s, self._sent_s - age_s)
        act: Act = Drive(control.linear_m_s, control.angular_rad_s, control.lateral_m_s, age_s)
        if control.goal is not None:
            act = Go(control.goal, age_s)
        return [act, Tell()] if begins else [act]

    # -- stops

    def stop(self, client: int, now_s: float) -> List[Act]:
        """Anybody asks for the emergency stop.  It is never refused, and never too old."""
        acts = self.tick(now_s)
        self._latched, self._state.latched_by, self._latched_s = True, client, now_s
        self._state.released_by_other = False
        self._end_press(why_of(StopReason.EMERGENCY_STOP), now_s)
        return [*acts, Latch(), Tell()]

    def release(self, client: int, heard_s: Optional[float], now_s: float) -> List[Act]:
        """A client wants to end the latched stop, which its page had shown: it may be newer than the click.

        `heard_s` is the time of our newest message that the page had then.
        """
        acts = self.tick(now_s)
        who = self._clients.get(client)
        if who is None or client != self._state.driver:
            return [*acts, Refuse(client, RELEASES)]
        shown = heard_s is not None and self._latched_s - SAME_S <= heard_s <= now_s + SAME_S
        if who.held or not shown or who.rested_s < self._latched_s - SAME_S:
            return [*acts, Refuse(client, LET_GO)]
        if not self._is_latched:
            return [*acts, Tell()]
        self._latched, self._state.latched_by, self._since_s, self._state.why = False, None, now_s, GOING
        self._state.released_by_other = False
        return [*acts, Unlatch(), Tell()]

    def robot_latched(self, latched: bool, now_s: float) -> List[Act]:
        """The robot reports that a latched stop is in force, or that it has ended.

        One of our own ends with `release` alone, but the state says if the robot no longer has it.
        """
        acts = self.tick(now_s)
        if latched == self._robot_latched:
            return acts
        self._robot_latched = latched
        self._state.released_by_other = self._latched and not latched
        if latched and not self._latched:
            self._latched_s = now_s
        if self._state.driving:
            return acts + self._halt(why_of(StopReason.EMERGENCY_STOP), now_s)
        self._since_s = now_s
        if latched:
            self._state.why = why_of(StopReason.EMERGENCY_STOP)
        return [*acts, Tell()]

    def robot_stopped(self, why: Why, now_s: float) -> List[Act]:
        """The robot has stopped by itself, or refused a command."""
        acts = self.tick(now_s)
        return acts + self._halt(why, now_s) if self._state.driving else acts

    def stands(self, now_s: float) -> List[Act]:
        """Since the last `Halt` or `Latch`, measurements have confirmed that the robot stands still."""
        self._stands = True
        return self.tick(now_s)

    def _halt(self, why: Why, now_s: float) -> List[Act]:
        self._end_press(why, now_s)
        return [Halt(why.reason), Tell()]

    def _end_press(self, why: Why, now_s: float) -> None:
        """The robot is stopped: no control that is held now drives any more, and a wish for the helm comes true."""
        who = self._clients.get(self._state.driver) if self._state.driver is not None else None
        if who is not None and self._state.driving:
            who.spent = max(who.spent, self._press)
        self._state.driving, self._goal, self._ends_s = False, None, math.inf
        self._since_s = self._halted_s = now_s
        self._stands, self._state.why = False, why
        if self._state.wants is not None:
            self._state.driver = None

    @property
    def _is_latched(self) -> bool:
        return self._latched or self._robot_latched

    # -- time and state

    @property
    def due_s(self) -> float:
        """Time of the next `tick` if nothing else happens [s]; infinity: none is needed."""
        return self._halted_s + HAND_OVER_S if self.waits else self._ends_s

    def tick(self, now_s: float) -> List[Act]:
        """Do what is due by now."""
        acts = self._halt(why_of(StopReason.COMMAND_TIMEOUT), now_s) if now_s >= self._ends_s else []
        return acts + self._hand_over(now_s)

    def malformed(self) -> None:
        """A message could not be read."""
        self._state.malformed += 1

    def state(self) -> HelmState:
        """Return what all clients may know."""
        spent = {client: who.spent for client, who in self._clients.items()}
        other = "another program" if self._robot_latched and not self._latched else ""
        return replace(self._state, latched=self._is_latched, latched_by_other=other, spent=spent)
