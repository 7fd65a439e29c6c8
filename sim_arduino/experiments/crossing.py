"""Two robots meet at a blind crossing: the second one waits until the first reports by radio that it has left.

The robots do not see each other, so that only the claims keep them apart.  The claims go from driver to board, from the
board to its emulated XBee, through the air, and back: no other message passes between the robots.
"""

import math
import random
from contextlib import ExitStack
from functools import partial
from typing import Dict, List, Mapping

from mrl_driver.geometry import Pose
from mrl_driver.navigation.claims import RADIO_LATE_S, Claim, RadioTeam
from mrl_driver.navigation.waypoint_tour import CLAIMING, WaypointTour
from mrl_driver.robot.radio import RadioText
from sim_arduino.world.world import World
from sim_arduino.world.world_file import pose_text

from . import disturbances
from .experiment_report import Measure, Result, figures, over_seeds
from .experiment_robot import TICK_S, ExperimentRobot, Setting, open_robot
from .mixed_team import result
from .team import Member, Player, Team
from .tours import DURATION, TourDriver, drive_tours, tour_rows

RADIOS: Dict[str, int] = {"1": 0x0013A20040000001, "2": 0x0013A20040000002}
"""Name and radio address of each robot."""
LANES_DEG = {"1": 0.0, "2": 90.0}
BEFORE_M, BEYOND_M, END_M = 0.5, 0.5, 0.9
"""Distances of the waypoints from the crossing: a robot waits before it, and releases it at the end of its lane."""
START_M = (1.0, 1.1)
"""Smallest and largest distance of a start from the crossing; the robots arrive at nearly the same time."""
LOSS = 0.1  # share of the radio packets that each radio does not receive: assumed
CUT_S, CUT_FOR_S = (0.5, 12.0), 15.0
"""The radio of one robot fails at a time between these, for this time [s]."""
TIME_LIMIT_S = 90.0
MEASURES = (
    Measure("crossed", "robots that crossed", of=lambda run: run.tours.arrived, worst=min),
    Measure("waited_s", "time before the crossing", "s", lambda run: run.tours.waited_s),
    DURATION._replace(of=lambda run: run.tours.duration_s),
)
CUT_MEASURES = (
    Measure("entered", "claims that were granted during the cut"),
    Measure("unnamed", "robots that did not name the silent one"),
)
NAMED = Measure("named_s", "time until a waiting robot names the silent one", "s")
REMARK = (
    f"In simulated time; each radio loses {LOSS:.0%} of the packets. The robots use no sonars. In the control every "
    "claim is granted at once; its runs end with the first collision. In the runs with a cut, one radio is off for "
    f"{CUT_FOR_S:g} s."
)


class BlindPlayer(Player):
    """A robot that does not use its sonars."""

    def ranges(self) -> Dict[str, float]:
        """No ranges."""
        return {}


class RadioRobot:
    """A robot's claim of the crossing, over the radio of its board."""

    def __init__(self, name: str, robot: ExperimentRobot) -> None:
        self.robot = robot
        self.claim = Claim(name, [each for each in RADIOS if each != name], -RADIO_LATE_S, RADIO_LATE_S)
        self._team, self._now_s = RadioTeam(name, RADIOS), 0.0
        robot.driver.radio.on_text(self._on_text)

    def _on_text(self, text: RadioText) -> None:
        message = self._team.message_of(text.address, text.text)
        if message is not None:
            self.claim.receive(message, self._now_s)

    def talk(self, now_s: float) -> None:
        """Sends the messages that are due."""
        self._now_s = now_s
        for message in self.claim.messages(now_s):
            self.robot.driver.radio.send(*self._team.text_to(message))

    def cut(self, cut: bool) -> None:
        """Switches the radio off or on."""
        assert self.robot.plant is not None and self.robot.plant.xbee is not None
        self.robot.plant.xbee.set(cut=cut)


def run(setting: Setting) -> Result:
    """Lets two robots meet at the crossing with many seeds, and draws the paths of the first run."""
    runs, control = over_seeds(cross, setting), over_seeds(partial(cross, claims=False), setting)
    cut = over_seeds(partial(cross, cut=True), setting)
    rows, named = tour_rows(MEASURES, runs, control), [each for each in cut if each.named_s > 0]
    cut_rows = [
        *tour_rows(MEASURES, cut),
        *figures(CUT_MEASURES, cut),
        *([NAMED.figure(named)] if named else []),
    ]
    rows += [row._replace(key=f"cut_{row.key}", text=f"radio cut: {row.text}") for row in cut_rows]
    rows = [row._replace(published="") for row in rows]
    title = "Two robots at a blind crossing, by radio alone"
    return result("crossing", title, rows, runs[0].tours.team, setting, REMARK)


def cross(setting: Setting, cut: bool = False, claims: bool = True) -> "Crossing":
    """A run in which the robots claim the crossing by radio.

    With `cut`, the radio of one robot fails for a while; without `claims`, each claim is granted at once, until the
    first collision.
    """
    rng = random.Random(f"crossing {setting.seed}")
    with ExitStack() as stack:
        team = _gather(stack, setting, rng)
        names = [player.member.name for player in team.players]
        talkers = {name: RadioRobot(name, player.robot) for name, player in zip(names, team.players)}
        cut_s = rng.uniform(*CUT_S) if cut else math.inf
        return Crossing(team, talkers if claims else {}, cut_s, rng.choice(list(RADIOS)))


def lane(name: str, distance_m: float) -> Pose:
    """The pose on a robot's lane at this distance beyond the crossing; it looks along the lane."""
    return Pose(0.0, 0.0, math.radians(LANES_DEG[name])).compose(distance_m, 0.0)


def _gather(stack: ExitStack, setting: Setting, rng: random.Random) -> Team:
    """Both robots before the crossing, each with a radio; calibrated, with random errors."""
    world, players = World(), []
    for number, (name, address) in enumerate(RADIOS.items()):
        member = Member(name, lane(name, -rng.uniform(*START_M)), virtual=False)
        pose = pose_text(disturbances.placed(member.start, setting.seed, name))
        its = setting._replace(seed=setting.seed + number)
        made = open_robot(
            its, world, name=name, pose=pose, error=disturbances.WANDER, radio=f"{address:x}", radio_loss=LOSS
        )
        players.append(BlindPlayer(member, stack.enter_context(made), world, World()))
    return Team(players)


class Crossing:
    """One run, and what came out of its `tours`; `claims` is empty if every claim is granted at once."""

    def __init__(self, team: Team, claims: Mapping[str, RadioRobot], cut_s: float, cut_name: str) -> None:
        self._claims, self._cut_s, self._cut_name = claims, cut_s, cut_name
        self._cut, self.entered = False, 0
        self._held: List[str] = []
        self._named: Dict[str, float] = {}
        self._waits: Dict[str, float] = {}
        self._drivers = [self._driver(player) for player in team.players]
        self.tours = drive_tours(team, self._drivers, TIME_LIMIT_S, not claims, self._talk, self._watch)

    @property
    def team(self) -> Team:
        """The robots."""
        return self.tours.team

    @property
    def named_s(self) -> float:
        """Time from the cut until each robot that waited had named the other one as silent [s]; the longest."""
        return max(self._named.values(), default=0.0)

    @property
    def unnamed(self) -> int:
        """Number of robots that waited during the whole cut and did not name the other one."""
        long = [name for name, wait_s in self._waits.items() if wait_s > CUT_FOR_S - TICK_S]
        return sum(name not in self._named for name in long)

    def _driver(self, player: Player) -> TourDriver:
        name = player.member.name
        poses = [lane(name, at_m) for at_m in (-BEFORE_M, BEYOND_M, END_M)]
        claim = self._claims[name].claim if self._claims else None
        return TourDriver(player, WaypointTour(claim=claim, shared={1}), poses, 0.0)

    def _talk(self, now_s: float) -> None:
        self._held = self._holders()
        cut = self._cut_s <= now_s < self._cut_s + CUT_FOR_S
        if cut != self._cut:
            self._cut = cut
            self._claims[self._cut_name].cut(cut)
        for each in self._claims.values():
            each.talk(now_s)

    def _holders(self) -> List[str]:
        return [name for name, each in self._claims.items() if each.claim.held]

    def _watch(self, now_s: float) -> None:
        """Notes the claims that are granted, and the robots that are named as silent, while the radio is cut."""
        if not self._cut:
            return
        self.entered += len(set(self._holders()) - set(self._held))
        for driver in self._drivers:
            name = driver.player.member.name
            if driver.tour.state == CLAIMING:
                self._waits[name] = self._waits.get(name, 0.0) + TICK_S
                if driver.tour.reason and name not in self._named:
                    self._named[name] = now_s - self._cut_s
