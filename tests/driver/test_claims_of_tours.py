"""One robot at a time at a shared place: tours and claims under any order of commands, message faults and starts."""

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from mrl_driver.navigation.claims import LATE_S, REPEAT_S, Claim
from mrl_driver.navigation.waypoint_tour import WaypointTour

NAMES = ("a", "b", "c")
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
