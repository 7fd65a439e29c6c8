"""Which waypoint follow_waypoints drives to next."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrl_driver.navigation.claims import LATE_S, REPEAT_S, SILENT_S, Claim
from mrl_driver.navigation.waypoint_tour import CLAIMING, DONE, DRIVING, IDLE, PAUSED, WAITING, WaypointTour


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


@given(st.lists(st.sampled_from(["reach", "fail", "pause", "resume", "skip", "end", "begin"])), st.booleans())
def test_the_target_is_always_a_waypoint_of_the_list(acts, repeat):
    tour = begun(2, repeat=repeat, skip_failed=True)
    for act in acts:
        target = tour.target
        if act in ("reach", "fail") and target:
            (arrive if act == "reach" else fail)(tour)
        elif act in ("pause", "resume", "skip", "end"):
            getattr(tour, act)()
        elif act == "begin":
            tour.begin(2, 0.0)
        assert (tour.target is None) == (tour.state != DRIVING)
        assert tour.target is None or 0 <= tour.target.place < tour.count


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
