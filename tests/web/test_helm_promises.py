"""What the helm promises, whatever pages, networks and clocks do.

An observer that knows the true times of all that happens watches the acts of a helm that does not.
"""

import math
from collections import Counter

from hypothesis import settings, stateful
from hypothesis import strategies as st

from mrl_driver.apps.web.helm import Drive, Go, Goal, Halt, Helm, Latch, Unlatch, why_of
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.safety.operator_delay import DRIFT

from .pages import Page

STOP_S, OLDEST_S, SENT_S, HAND_OVER_S = 0.15, 0.15, 0.25, 1.0
START_S = 1000.0
ERROR_S = 1e-6
TICK_S = 1e-5  # No two things happen at the same time
PAGES = st.integers(0, 2)
WAYS_S = st.sampled_from([0.0, 0.001, 0.03, 0.14, 0.16, 0.3])
seen = Counter()  # How often each act was seen: promises of a helm that does nothing would be worth nothing


class TruePage(Page):
    """A page whose clock drifts, and what is on its way in both directions."""

    def __init__(self, number, ahead_s, drift, may_drive):
        super().__init__(number, ahead_s)
        self.drift, self.may_drive = drift, may_drive
        self.out, self.coming, self.past = [], [], []
        self.began_s = {}  # When each press began

    def page_s(self, now_s):
        return now_s + self.ahead_s + self.drift * (now_s - START_S)

    def hear_at(self, at_s, now_s):
        if self.heard_s is None or at_s >= self.heard_s:
            self.heard_s, self.heard_t_s = at_s, self.page_s(now_s)

    def send(self, now_s, control):
        self.out.append((now_s, control._replace(t_s=self.page_s(now_s))))


class Promises(stateful.RuleBasedStateMachine):
    """Pages press, release, come and go; messages are late, lost, doubled and overtake each other."""

    def __init__(self):
        super().__init__()
        self.helm, self.now_s = Helm(), START_S
        self.pages = []
        for may_drive in (True, True, False):
            self.connect(may_drive, 0.0, 0.0)
        self.driver = self.wants = None
        self.moving = self.latched = False
        self.stands, self.halted_s = True, -math.inf
        self.stopped_s = -math.inf  # The last stop that was not the release of the press in force
        self.press = None  # Client and number of the press in force
        self.over = set()  # Presses in force at a stop
        self.newest, self.delivered = {}, set()
        self.ends_s = math.inf

    # -- the observer

    def call(self, method, *args, message=None, sent_s=math.nan):
        """Calls the helm and judges what it does."""
        self.now_s += TICK_S
        who = args[0] if args else None
        was, stood = self.driver, self.stands or self.now_s >= self.halted_s + HAND_OVER_S - ERROR_S
        acts = getattr(self.helm, method)(*args, *([message] if message else []), self.now_s)
        for act in acts:
            seen[type(act).__name__] += 1
            if isinstance(act, (Drive, Go)):
                self.judge_drive(who, message, sent_s, act)
            elif isinstance(act, (Halt, Latch)):
                self.judge_stop(act, method, who, message)
            elif isinstance(act, Unlatch):
                assert method == "release" and who == was and self.latched
                assert args[1] >= self.latched_s, "a stop that its page did not show at the click"
                self.latched, self.stopped_s = False, self.now_s
        if method == "stop":
            assert any(isinstance(act, Latch) for act in acts), "a stop was refused"
        self.judge_driver(method, who, was, stood or self.stands)
        return acts

    def judge_drive(self, who, message, sent_s, act):
        assert message is not None and message.held, "motion without a command"
        assert who == self.driver == self.helm.state().driver and self.page(who).may_drive
        assert not self.latched and (who, message.seq) not in self.delivered
        assert message.seq > self.newest.get(who, -1), "an overtaken command drives"
        assert self.now_s - sent_s <= OLDEST_S + ERROR_S, "an old command drives"
        assert act.age_s >= (self.now_s - sent_s) * (1 - 2 * DRIFT) - ERROR_S, "its age is larger"
        assert (who, message.press) not in self.over, "a press drives after its stop"
        assert self.page(who).began_s[message.press] >= self.stopped_s, "the press began before the stop"
        self.moving, self.press = True, (who, message.press)
        self.ends_s = min(self.now_s + STOP_S, sent_s + SENT_S * (1 + 2 * DRIFT))

    def judge_stop(self, act, method, who, message):
        if isinstance(act, Halt) and act.reason is StopReason.RELEASED:
            assert method == "control" and not message.held and self.press[0] == who
        else:
            self.stopped_s = self.now_s
        if self.press is not None:
            self.over.add(self.press)
        self.moving, self.press, self.ends_s = False, None, math.inf
        self.halted_s, self.stands = self.now_s, False
        if isinstance(act, Latch):
            self.latched, self.latched_s = True, self.now_s

    def judge_driver(self, method, who, was, stood):
        state = self.helm.state()
        self.driver = state.driver
        assert self.latched <= state.latched and self.moving == state.driving
        if self.driver not in (None, was):
            assert self.page(self.driver).may_drive and stood, "a hand-over to a robot on the move"
            assert self.driver == self.wants or (method == "take" and who == self.driver)
            self.stopped_s = max(self.stopped_s, self.now_s)
        self.wants = state.wants

    @stateful.invariant()
    def the_stop_is_due_in_time(self):
        if self.moving:
            assert self.helm.due_s <= self.ends_s + ERROR_S

    # -- what pages do

    def connect(self, may_drive, ahead_s, drift, like=None):
        number = sum(1 for _ in self.pages) + 1
        page = TruePage(number, ahead_s, drift, may_drive)
        if like is not None:
            page.held, page.goal = like.held, like.goal
            page.press = like.press
            page.began_s = dict(like.began_s)
        self.pages.append(page)
        self.helm.join(number, may_drive, self.now_s)
        page.since_s = self.now_s
        self.here = [*getattr(self, "here", []), number][-3:]

    def page(self, number):
        return self.pages[number - 1]

    def at(self, index):
        return self.page(self.here[index])

    @stateful.rule(index=PAGES, goal=st.sampled_from([None, Goal(1.0, 0.0)]))
    def press_control(self, index, goal):
        self.now_s += TICK_S
        page = self.at(index)
        control = page.push(self.now_s, goal)
        page.began_s[page.press] = self.now_s
        page.send(self.now_s, control)

    @stateful.rule(index=PAGES)
    def release_control(self, index):
        page = self.at(index)
        page.send(self.now_s, page.lift(self.now_s))

    @stateful.rule(index=PAGES)
    def repeat(self, index):
        page = self.at(index)
        page.send(self.now_s, page.message(self.now_s))

    @stateful.rule(index=PAGES, goal=st.sampled_from([None, Goal(1.0, 0.0), Goal(2.0, 0.0, 1.0)]))
    def err(self, index, goal):
        """A page that presses the same press again, with something else."""
        page = self.at(index)
        if page.press:
            page.held, page.goal = True, goal
            page.send(self.now_s, page.message(self.now_s))

    @stateful.rule(index=PAGES, ahead_s=st.floats(-1e4, 1e4), drift=st.floats(-DRIFT, DRIFT))
    def come_back(self, index, ahead_s, drift):
        """With its finger down, if it was; what it has sent before may still come."""
        page = self.at(index)
        self.call("leave", page.number)
        self.here.remove(page.number)
        self.connect(page.may_drive, ahead_s, drift, page)

    # -- the network

    @stateful.rule(index=PAGES)
    def tell(self, index):
        page = self.at(index)
        page.coming.append(self.now_s)

    @stateful.rule(index=PAGES)
    def hear(self, index):
        page = self.at(index)
        if page.coming:
            page.hear_at(page.coming.pop(0), self.now_s)

    @stateful.rule(index=PAGES, pick=st.integers(0, 5), again=st.booleans())
    def arrive(self, index, pick, again):
        """Any message that is on its way, and perhaps once more later."""
        page = self.at(index)
        if page.out:
            at = -1 - pick % len(page.out)
            sent_s, control = page.out[at] if again else page.out.pop(at)
            self.deliver(page, sent_s, control)

    @stateful.rule(index=PAGES)
    def burst(self, index):
        page = self.at(index)
        for sent_s, control in page.out:
            self.deliver(page, sent_s, control)
        page.out = []

    def deliver(self, page, sent_s, control):
        acts = self.call("control", page.number, message=control, sent_s=sent_s)
        self.delivered.add((page.number, control.seq))
        page.past.append((sent_s, control))
        self.newest[page.number] = max(control.seq, self.newest.get(page.number, -1))
        return acts

    @stateful.rule(
        index=st.integers(0, 1),
        way_s=st.sampled_from([0.0, 0.01, 0.03]),
        press_way_s=st.sampled_from([0.0, 0.01, 0.1, 0.2]),
        goal=st.sampled_from([None, Goal(1.0, 0.0)]),
        releases=st.booleans(),
    )
    def behave(self, index, way_s, press_way_s, goal, releases):
        """A page that does as it should over a good line drives; perhaps it releases a latched stop before."""
        page = self.at(index)
        if not page.may_drive:
            return
        page.out = []
        if self.driver is None:
            self.call("take", page.number)
            self.pass_time(HAND_OVER_S)
        for _ in range(2):  # the page also answers to the stop that may have been due
            self.exchange(page, page.lift, way_s)
        if self.latched and releases and self.driver == page.number:
            self.call("release", page.number, page.heard_s)
            assert not self.latched, "a good release does nothing"
            self.exchange(page, page.lift, way_s)
        acts = self.exchange(page, lambda now_s: page.push(now_s, goal), press_way_s)
        if self.driver == page.number and not self.latched and press_way_s < OLDEST_S:
            assert any(isinstance(act, (Drive, Go)) for act in acts), "a good press does not drive"

    @stateful.initialize(goal=st.sampled_from([None, Goal(1.0, 0.0)]))
    def begin(self, goal):
        self.behave(0, 0.0, 0.0, goal, True)

    @stateful.precondition(lambda self: not self.moving)
    @stateful.rule(index=st.integers(0, 1), releases=st.booleans())
    def begin_again(self, index, releases):
        self.behave(index, 0.01, 0.01, None, releases)

    @stateful.precondition(lambda self: self.moving)
    @stateful.rule(way_s=st.sampled_from([0.0, 0.01, 0.1, 0.2]))
    def drive_on(self, way_s):
        """The page goes on; the line is good, or bad now."""
        page = self.page(self.driver)
        self.exchange(page, page.message, way_s)

    @stateful.precondition(lambda self: self.moving)
    @stateful.rule(pick=st.integers(1, 4))
    def deliver_again(self, pick):
        """What the driving page has sent comes once more."""
        page = self.page(self.driver)
        if len(page.past) >= pick:
            self.deliver(page, *page.past[-pick])

    @stateful.precondition(lambda self: self.moving)
    @stateful.rule(
        how=st.sampled_from(["stop", "itself", "stall", "release"]), heard=st.booleans(), new=st.booleans()
    )
    def defy_a_stop(self, how, heard, new):
        """The control stays held; or another press, begun before the stop, arrives after it."""
        page = self.page(self.driver)
        page.out = []
        seen[f"defied {how}"] += 1
        if new:
            page.send(self.now_s, page.lift(self.now_s))
            self.press_control(self.here.index(page.number), None)
        if how == "stop":
            self.call("stop", self.here[-1])
        elif how == "itself":
            self.stop_by_itself()
        elif how == "stall":
            self.stall(0.2)
        else:
            self.exchange(page, page.lift, 0.0)
            page.held = True
        self.now_s += TICK_S
        if heard:
            page.hear_at(self.now_s, self.now_s)
        if not new:
            page.send(self.now_s, page.message(self.now_s))
        self.burst(self.here.index(page.number))

    def exchange(self, page, control, way_s):
        """The page hears of the state now, and answers."""
        self.now_s += TICK_S
        page.hear_at(self.now_s, self.now_s)
        made = control(self.now_s)
        page.began_s.setdefault(page.press, self.now_s)
        page.send(self.now_s, made)
        sent_s, made = page.out.pop()
        self.pass_time(way_s)
        return self.deliver(page, sent_s, made)

    # -- time, and what people and the robot do

    @stateful.rule(seconds=WAYS_S)
    def pass_time(self, seconds):
        end_s = self.now_s + seconds
        while self.helm.due_s <= end_s:
            self.now_s = max(self.now_s, self.helm.due_s)
            self.call("tick")
        self.now_s = end_s

    @stateful.rule(seconds=st.sampled_from([0.1, 0.2, 5.0]))
    def stall(self, seconds):
        """Nobody calls the helm."""
        self.now_s += seconds

    @stateful.rule(index=PAGES, what=st.sampled_from(["take", "take", "yield_", "stop"]))
    def ask(self, index, what):
        self.call(what, self.here[index])

    @stateful.rule(index=PAGES, late_s=st.sampled_from([0.0, 0.1, 5.0]))
    def release(self, index, late_s):
        """The click may arrive after controls that were sent later."""
        page = self.page(self.here[index])
        self.call("release", page.number, None if page.heard_s is None else page.heard_s - late_s)

    @stateful.precondition(lambda self: not self.latched)
    @stateful.rule(index=PAGES)
    def stop(self, index):
        self.call("stop", self.here[index])

    @stateful.precondition(lambda self: self.moving)
    @stateful.rule()
    def stop_by_itself(self):
        self.now_s += TICK_S
        acts = self.helm.robot_stopped(why_of(StopReason.BATTERY), self.now_s)
        for act in acts:
            if isinstance(act, Halt):
                self.judge_stop(act, "robot_stopped", None, None)
        self.judge_driver("robot_stopped", None, self.driver, self.stands)
        assert not self.moving

    @stateful.rule()
    def stand(self):
        self.stands = True
        self.call("stands")


def test_the_helm_keeps_its_promises():
    """The same examples each time, with motion and every kind of stop in them."""
    seen.clear()
    stateful.run_state_machine_as_test(
        Promises, settings=settings(max_examples=60, stateful_step_count=40, deadline=None, database=None)
    )
    assert min(seen[kind] for kind in ("Drive", "Go", "Halt", "Latch", "Unlatch")) >= 3, seen
