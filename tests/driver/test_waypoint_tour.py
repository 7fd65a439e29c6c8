"""Which waypoint follow_waypoints drives to next, claims of shared ones, idleness, and courses along straight legs."""

import math

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from mrl_driver.errors import ConfigError
from mrl_driver.navigation.claims import LATE_S, NAMESAKE, REPEAT_S, SILENT_S, Claim, ClaimMessage
from mrl_driver.navigation.line_follower import Course
from mrl_driver.navigation.waypoint_tour import (
    CLAIMING,
    DONE,
    DRIVING,
    IDLE,
    PAUSED,
    WAITING,
    Idleness,
    WaypointTour,
)


def begun(count=3, **options):
    """A tour on its way to the first waypoint."""
    tour = WaypointTour(**options)
    tour.begin(count, 0.0)
    return tour


def arrive(tour, now_s=0.0):
    tour.reached(tour.target.attempt, now_s)


def fail(tour):
    tour.failed(tour.target.attempt, "blocked")


@pytest.mark.parametrize(
    "repeat, places, state", [(False, [0, 1, 2], DONE), (True, [0, 1, 2, 0, 1], DRIVING)]
)
def test_waypoints_are_visited_in_turn_and_then_the_tour_is_done_or_repeated(repeat, places, state):
    """Idleness counts from the begin of the list."""
    tour, seen = WaypointTour(repeat=repeat), []
    assert (tour.target, tour.state, tour.number, tour.lap) == (None, IDLE, 0, 0)
    assert not tour.pause() and not tour.resume() and not tour.skip()
    tour.begin(3, 100.0)
    for step in range(len(places)):
        seen.append(tour.target.place)
        arrive(tour, 110.0 + 20.0 * step)
    assert (seen, tour.state, tour.lap) == (places, state, 2 if repeat else 1)
    assert tour.idleness.visits == len(places) and tour.idleness.worst_s(150.0) == (60.0 if repeat else 50.0)


def test_the_robot_waits_at_a_waypoint():
    tour = begun(wait_s=2.0)
    arrive(tour, 10.0)
    assert (tour.state, tour.target) == (WAITING, None)
    tour.tick(11.9)
    assert tour.target is None
    tour.tick(12.0)
    assert tour.target.place == 1


@pytest.mark.parametrize(
    "skips, reached, state, number",
    [(False, 0, PAUSED, 1), (True, 0, DRIVING, 2), (True, 2, DONE, 3)],
    ids=["pauses", "skipped if that is wanted", "the last one ends the tour"],
)
def test_a_failure_has_a_reason(skips, reached, state, number):
    tour = begun(3, skip_failed=skips)
    for _ in range(reached):
        arrive(tour)
    fail(tour)
    assert (tour.state, tour.reason) == (state, "blocked")
    assert tour.number == number


def test_another_goal_pauses_and_the_end_has_no_target():
    tour = begun()
    tour.interrupt(tour.target.attempt, "another goal")
    assert (tour.state, tour.reason, tour.target) == (PAUSED, "another goal", None)
    tour.resume()
    tour.end()
    assert (tour.state, tour.target, tour.count) == (IDLE, None, 0)


def test_a_lap_of_failures_pauses_though_failures_are_skipped():
    """The robot would try for ever."""
    tour = begun(3, skip_failed=True, repeat=True)
    for _ in range(3):
        fail(tour)
    assert tour.state == PAUSED


def test_a_pause_keeps_the_waypoint_and_resume_is_a_new_attempt():
    tour = begun()
    arrive(tour)
    before = tour.target
    assert tour.pause() and tour.target is None
    assert tour.resume()
    assert tour.target.place == before.place and tour.target.attempt != before.attempt


def test_reports_of_an_earlier_attempt_do_not_count():
    tour = begun()
    old = tour.target.attempt
    tour.pause()
    tour.reached(old, 0.0)
    assert tour.state == PAUSED
    for again in (tour.resume, lambda: tour.begin(2, 0.0)):
        again()
        tour.reached(old, 0.0)
        tour.failed(old, "")
        tour.interrupt(old, "")
        assert (tour.state, tour.target.place) == (DRIVING, 0)


@pytest.mark.parametrize("before", ["drive", "wait", "pause"])
def test_skip_drives_to_the_next_waypoint(before):
    tour = begun(wait_s=9.0)
    if before == "wait":
        arrive(tour)
    elif before == "pause":
        tour.pause()
    assert tour.skip()
    assert tour.target.place == 1


@pytest.fixture
def other():
    """The claim of another robot, which shares the first waypoint."""
    return Claim("b", ["a"], -LATE_S)


@pytest.fixture
def sharing(other):
    """Makes a tour of robot a on its way to the first waypoint, and the claim that it shares."""

    def make(**options):
        claim = Claim("a", ["b"], -LATE_S)
        talk(claim, other)
        return begun(claim=claim, shared={0}, **options), claim

    return make


def talk(claim, other, now_s=0.0):
    """Messages go to and fro."""
    for step in (0.0, REPEAT_S, 2 * REPEAT_S):
        for sender, receiver in ((claim, other), (other, claim)):
            for message in sender.messages(now_s + step):
                receiver.receive(message, now_s + step)


def test_robot_drives_to_a_shared_waypoint_when_it_holds_the_claim_and_keeps_it_until_another_one(
    sharing, other
):
    tour, claim = sharing()
    assert (tour.state, tour.target) == (CLAIMING, None)
    talk(claim, other)
    tour.tick(1.0)
    assert tour.target.place == 0
    arrive(tour, 1.0)
    assert claim.held and tour.target.place == 1
    arrive(tour, 2.0)
    assert not claim.held


def test_robot_waits_as_long_as_another_one_is_silent(sharing):
    tour, _ = sharing()
    tour.tick(10 * SILENT_S)
    assert (tour.state, tour.reason) == (CLAIMING, "no message from b for 3 s")


def test_shared_waypoint_is_skipped_if_another_robot_is_silent_and_that_is_wanted(sharing, other):
    tour, claim = sharing(skip_failed=True)
    tour.tick(SILENT_S - 1.0)
    assert tour.state == CLAIMING
    tour.tick(SILENT_S + 1.0 + 2 * REPEAT_S)
    assert tour.target.place == 1
    talk(claim, other)
    assert not claim.held


def test_tour_pauses_while_another_robot_has_the_name_of_this_one(sharing, other):
    """Also on its way to a waypoint that is not shared: both robots have the same settings, and must be looked at."""
    tour, claim = sharing()
    tour.skip()
    claim.hear_namesake(1.0)
    for now_s in (1.0, 1.0 + SILENT_S):
        tour.tick(now_s)
        assert (tour.state, tour.reason) == (PAUSED, NAMESAKE.format("a"))
        claim.messages(now_s)
        tour.resume()
    claim.messages(1.1 + SILENT_S)
    tour.tick(1.1 + SILENT_S)
    assert tour.state == DRIVING


@pytest.mark.parametrize("act", ["pause", "skip", "end"])
def test_claim_is_withdrawn_if_the_robot_does_not_wait_for_it_any_more(sharing, other, act):
    tour, claim = sharing()
    getattr(tour, act)()
    talk(claim, other)
    assert not claim.held


def test_claim_is_withdrawn_if_a_new_list_begins_elsewhere(other):
    claim = Claim("a", ["b"], -LATE_S)
    tour = begun(claim=claim, shared={1})
    tour.skip()
    assert tour.state == CLAIMING
    tour.begin(2, 0.0)
    talk(claim, other)
    assert tour.target.place == 0 and not claim.held


def test_robot_that_is_stopped_on_its_way_keeps_the_claim(sharing, other):
    """It may be at the shared waypoint."""
    tour, claim = sharing()
    talk(claim, other)
    tour.tick(1.0)
    tour.end()
    assert claim.held


NAMES = ("a", "b", "c")


class Talk:
    """Three robots and the messages between them, under way until they are delivered."""

    def __init__(self, names=NAMES):
        self.now_s = 0.0
        self.claims = {name: Claim(name, [each for each in names if each != name], -LATE_S) for name in names}
        self.under_way = []
        self.dead = set()

    def send(self):
        """All robots send what is due."""
        for name, claim in self.claims.items():
            if name not in self.dead:
                self.under_way += claim.messages(self.now_s)

    def deliver(self, message):
        if message.to not in self.dead:
            self.claims[message.to].receive(ClaimMessage.parse(message.text), self.now_s)

    def exchange(self, times=3):
        """Messages go to and fro without delay."""
        for _ in range(times):
            self.now_s += REPEAT_S
            self.send()
            under_way, self.under_way = self.under_way, []
            for message in under_way:
                self.deliver(message)

    @property
    def holders(self):
        return [name for name, claim in self.claims.items() if claim.held]


@pytest.fixture
def three():
    made = Talk()
    made.exchange()
    return made


def test_first_claim_wins_and_the_next_follows_after_the_release(three):
    """Release and the grant of the next claim are one message."""
    three.claims["c"].want()
    three.exchange(1)
    three.claims["a"].want()
    three.exchange()
    assert three.holders == ["c"]
    three.claims["c"].release()
    for message in three.claims["c"].messages(three.now_s):
        three.deliver(message)
    three.exchange(1)
    assert three.holders == ["a"]


@pytest.mark.parametrize("dead, holders", [("c", []), ("a", ["a"])], ids=["before its answer", "as holder"])
def test_a_robot_that_vanished_blocks_the_place_and_is_named_until_it_is_heard_again(three, dead, holders):
    if holders:
        three.claims["a"].want()
        three.exchange()
    three.dead.add(dead)
    three.claims["b"].want()
    three.exchange(100)
    assert three.holders == holders and three.claims["b"].silent(three.now_s) == (dead,)
    three.dead.clear()
    three.claims["a"].release()
    three.exchange()
    assert three.holders == ["b"]


def test_robot_is_silent_after_the_limit_and_repeats_its_messages_before():
    claim = Claim("a", ["b"], 10.0)
    assert not claim.silent(10.0 + SILENT_S) and claim.silent(10.1 + SILENT_S) == ("b",)
    claim = Claim("a", ["b"], 0.0)
    assert claim.messages(0.0) and not claim.messages(REPEAT_S - 0.1) and claim.messages(REPEAT_S)


def test_claims_at_the_same_time_are_decided_by_name(three):
    for name in ("c", "b", "a"):
        three.claims[name].want()
    three.exchange()
    assert three.holders == ["a"]


def test_robot_that_started_again_does_not_claim_by_a_message_from_before_its_start():
    """It granted the claim of a, and has forgotten that; by the late message its own claim would be better."""
    three = Talk(("a", "b"))
    three.exchange()
    late = ClaimMessage("a", 0, "b", 0)
    for _ in range(2):
        three.claims["a"].want()
        three.exchange()
        three.claims["a"].release()
    three.claims["a"].want()
    three.exchange()
    three.claims["b"] = Claim("b", ["a"], three.now_s)
    three.claims["b"].want()
    three.deliver(late)
    three.exchange(10)
    assert three.holders == ["a"]


def test_message_that_was_overtaken_does_not_take_the_place_away(three):
    late = ClaimMessage("b", 0, "a", 0)
    three.claims["a"].want()
    three.exchange()
    three.deliver(late)
    assert three.holders == ["a"]


def test_message_of_a_stranger_or_for_another_robot_is_ignored():
    claim = Claim("a", ["b"], 0.0)
    claim.want()
    for message in (ClaimMessage("x", 0, "a", 1), ClaimMessage("b", 0, "c", 1)):
        claim.receive(message, 0.0)
    assert claim.messages(0.0) == [ClaimMessage("a", 0, "b", 0)] and not claim.held


@pytest.mark.parametrize("text", ["", "a 1 b", "a 1 b 2 3", "a -1 b 2", "a x b 2", "a 1 b 1234567890"])
def test_other_texts_are_refused(text):
    with pytest.raises(ValueError, match="expected SENDER CLAIM RECEIVER GRANTED"):
        ClaimMessage.parse(text)
    message = ClaimMessage("1", 9999, "2", 9998)
    assert ClaimMessage.parse(message.text) == message and len(message.text) <= 16


def test_robot_that_hears_its_name_from_another_one_holds_nothing_and_grants_nothing(three):
    """One grant would count for both."""
    first, other = three.claims["a"], three.claims["b"]
    first.want()
    three.exchange()
    first.hear_namesake(three.now_s)
    assert not first.held
    first.release()
    other.want()
    three.exchange()
    assert not other.held
    three.exchange(int(SILENT_S / REPEAT_S) + 1)
    assert other.held


def test_robot_grants_nothing_until_it_has_heard_a_robot_that_had_its_name_before():
    """That one may be at the place, and its messages may come after the claim of another robot."""
    claim = Claim("a", ["b"], 0.0)
    claim.receive(ClaimMessage("b", 1, "a", 0), 0.0)
    assert claim.messages(LATE_S) == [ClaimMessage("a", 0, "b", 0)]
    assert claim.messages(LATE_S + REPEAT_S) == [ClaimMessage("a", 0, "b", 1)]


@pytest.mark.parametrize("names", [("a", "a"), ("a b", "c"), ("", "c")])
def test_names_that_messages_cannot_carry_are_refused(names):
    with pytest.raises(ConfigError, match="expected"):
        Claim(names[0], names[1:], 0.0)


SHARED, COUNT = (0, 1), 3
ROBOTS = st.sampled_from(NAMES)


class SharedPlace(RuleBasedStateMachine):
    """A robot is at the place from when its tour lets it drive there until it has reached a waypoint elsewhere."""

    def __init__(self):
        super().__init__()
        self.now_s = 0.0
        self.under_way = []
        self.at_place = set()
        self.claims, self.tours = {}, {}
        for name in NAMES:
            self.start(name)
        self.exchange(10)

    @rule(name=ROBOTS)
    def start(self, name):
        """Start a robot, or start it again; somebody has taken it away from the place."""
        self.at_place.discard(name)
        self.claims[name] = Claim(name, [each for each in NAMES if each != name], self.now_s)
        self.tours[name] = WaypointTour(True, True, claim=self.claims[name], shared=SHARED)

    @rule(name=ROBOTS)
    def begin(self, name):
        self.tours[name].begin(COUNT, self.now_s)

    @rule(name=ROBOTS)
    def reach(self, name):
        target = self.tours[name].target
        if target:
            self.tours[name].reached(target.attempt, self.now_s)
            if target.place not in SHARED:
                self.at_place.discard(name)

    @rule(name=ROBOTS, act=st.sampled_from(["pause", "resume", "skip", "end", "failed", "interrupt"]))
    def command_or_report(self, name, act):
        tour = self.tours[name]
        if act not in ("failed", "interrupt"):
            getattr(tour, act)()
        elif tour.target:
            getattr(tour, act)(tour.target.attempt, "why")

    @rule(repeats=st.integers(1, 8))
    def pass_time(self, repeats):
        """Time passes; messages that are too late for a start are lost."""
        for _ in range(repeats):
            self.now_s += REPEAT_S
            for name in NAMES:
                self.under_way += [(self.now_s, each) for each in self.claims[name].messages(self.now_s)]
            self.under_way = [each for each in self.under_way if self.now_s - each[0] <= LATE_S]

    @rule(number=st.integers(0, 10**6), fate=st.sampled_from(["arrives", "arrives twice", "is lost"]))
    def one_message(self, number, fate):
        """Messages arrive in any order."""
        if self.under_way:
            sent = self.under_way.pop(number % len(self.under_way))
            if fate != "is lost":
                self.claims[sent[1].to].receive(sent[1], self.now_s)
            if fate == "arrives twice":
                self.under_way.append(sent)

    @rule(repeats=st.integers(1, 3))
    def exchange(self, repeats):
        """Time passes, and all messages arrive."""
        for _ in range(repeats):
            self.pass_time(1)
            while self.under_way:
                self.one_message(0, "arrives")

    @invariant()
    def one_robot_is_there(self):
        for name, tour in self.tours.items():
            tour.tick(self.now_s)
            if tour.target and tour.target.place in SHARED:
                self.at_place.add(name)
        assert len(self.at_place) <= 1


TestSharedPlace = SharedPlace.TestCase
TestSharedPlace.settings = settings(max_examples=40, stateful_step_count=50)


def test_idleness_is_the_time_since_the_last_visit():
    """Two waypoints, visited at 10 s and at 20 s; the first again at 21 s, by another robot."""
    visited = Idleness(2, 0.0)
    assert (visited.mean_s(0.0), visited.worst_s(0.0)) == (0.0, 0.0)
    visited.visit(0, 10.0)
    visited.visit(1, 20.0)
    assert visited.mean_s(20.0) == pytest.approx((100 + 200) / 20 / 2)  # areas of 100 and 200 s2 in 20 s
    assert (visited.worst_s(20.0), visited.worst_s(45.0)) == (20.0, 35.0)
    visited.visit(0, 21.0)
    assert (visited.visits, visited.worst_s(21.0)) == (3, 20.0)


HERE = (2.0, 1.0, math.pi / 2)  # A robot that looks to the left of the x axis


@pytest.mark.parametrize("points", [[(2.0, 1.0), (2.0, 3.0)], [(2.0, 1.001), (2.0, 1.0), (2.0, 3.0)]])
def test_leg_without_length_is_passed_without_a_turn(points):
    course = Course(points)
    speeds = [course.command(HERE) for _ in range(5)]
    assert all(abs(angular) < 1e-9 for _, angular in speeds) and speeds[-1][0] > 0


def test_course_that_ends_where_it_begins_is_done_at_once():
    course = Course([HERE[:2]])
    assert [course.command(HERE) for _ in range(2)] == [(0.0, 0.0)] * 2 and course.done
