"""Experiments with teams, cut short: wandering, a shared waypoint, a patrol."""

import math
import time
from types import SimpleNamespace

import pytest

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import ORIGIN, Pose
from mrl_driver.navigation.claims import Claim
from mrl_driver.robot import models
from sim_arduino.experiments import mixed_team, patrol, shared_waypoint, team
from sim_arduino.experiments.experiment_robot import Setting
from sim_arduino.experiments.tours import Channel, exchange
from sim_arduino.testing import EmulatedBoard
from sim_arduino.world.world import World

SEED = 1000


def once(run, setting):
    """In place of the runs with many seeds."""
    return [run(setting._replace(seed=SEED))]


def rows(experiment, folder, over_seeds=once, **short):
    """Figures of an experiment by their keys, some of its constants replaced."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in {"over_seeds": over_seeds, **short}.items():
            patch.setattr(experiment, name, value)
        result = experiment.run(Setting(str(folder)))
    for picture in result.pictures:
        assert (folder / picture).read_bytes().startswith(b"\x89PNG")
    return {row.key: row for row in result.rows}


@pytest.mark.parametrize("name", ["front", "left", "right"])
@pytest.mark.parametrize("silent", [{}, math.nan], ids=["absent", "nan"])
def test_wanderer_stands_while_a_sonar_has_no_reading(name, silent):
    ranges = {each: math.inf for each in ("front", "left", "right") if each != name}
    ranges.update({name: silent} if silent else {})
    assert mixed_team.Wanderer(models.load("traxbot").limits).command(ranges) == (0.0, 0.0)


def test_sonar_without_a_reading_is_unknown_although_nothing_stands_in_the_virtual_world():
    model = models.load("traxbot")
    robot = SimpleNamespace(
        model=model, pose=ORIGIN, ranges={"front": math.nan, "left": 2.0}, reset_pose=lambda pose: None
    )
    ranges = team.Player(team.Member("real", ORIGIN, virtual=False), robot, World(), World()).ranges()
    assert math.isnan(ranges["front"]) and ranges["left"] == 2.0


@pytest.fixture(scope="module")
def mixed_rows(tmp_path_factory):
    short = {"DURATION_S": 20.0, "CONTROL_S": 20.0, "SLIPPING_S": 20.0}
    return rows(mixed_team, tmp_path_factory.mktemp("mixed"), **short)


def test_mixed_team_does_not_collide(mixed_rows):
    """Unless real and virtual robots do not see each other."""
    assert mixed_rows["collided"].ours == "0 of 1" and mixed_rows["distance_m"].ours > 7
    assert mixed_rows["collided"].control == "1 of 1"


def test_robot_that_slips_does_not_touch_the_virtual_one_whose_echoes_it_hears(mixed_rows):
    assert (mixed_rows["slip_touched"].ours, mixed_rows["slip_touched"].control) == ("0 of 1", "1 of 1")
    assert mixed_rows["slip_nearest_m"].ours > 0.5 > mixed_rows["slip_nearest_m"].control


@pytest.mark.parametrize(
    "experiment, limit",
    [(mixed_team, "SLIPPING_S"), (shared_waypoint, "TIME_LIMIT_S")],
    ids=["mixed-team", "shared-waypoint"],
)
def test_first_robot_of_a_team_is_the_one_on_the_port(experiment, limit, tmp_path, monkeypatch):
    """It drives in real time, among robots in simulated time, and stands at the end."""
    monkeypatch.setattr(experiment, limit, 1.0)
    with EmulatedBoard(robot="traxbot", world="room") as board:
        start_s = time.monotonic()
        result = experiment.run(Setting(str(tmp_path), port=board.port))
        assert time.monotonic() - start_s >= 1.0
        board.motors.assert_commanded("move_differential")
        board.motors.assert_stopped()
    shown = {row.key: row for row in result.rows}
    assert board.port in result.title and shown["collided"].ours == "0 of 1"


def test_robot_without_sonars_cannot_join_a_team(tmp_path):
    with EmulatedBoard(robot="traxbot", environment=True) as board, pytest.raises(
        ConfigError, match="no sonars"
    ):
        mixed_team.run(Setting(str(tmp_path), port=board.port))


@pytest.fixture(scope="module")
def shared_runs():
    """A round with claims of which many are lost, and one in which every claim is granted at once."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(shared_waypoint, "ROUNDS", 1)
        setting = Setting("/nowhere", seed=SEED)
        return shared_waypoint.claimed(setting, loss=0.5), shared_waypoint.granted_at_once(setting)


def test_robots_that_claim_the_shared_waypoint_do_not_collide(shared_runs):
    """And do if every claim is granted at once."""
    claimed, granted = shared_runs
    assert (claimed.team.collisions, claimed.rounds) == (0, 3)
    assert granted.team.collisions


def test_rows_of_the_shared_waypoint_have_a_control_and_a_run_through_ros(shared_runs, tmp_path):
    claimed, control = shared_runs

    def over_seeds(run, _):
        return [control if run is shared_waypoint.granted_at_once else claimed]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(shared_waypoint, "over_seeds", over_seeds)
        result = shared_waypoint.run(Setting(str(tmp_path)), claimed)
    shown = {row.key: row for row in result.rows}
    assert (shown["collided"].ours, shown["collided"].control) == ("0 of 1", "1 of 1")
    assert shown["lossy_collided"].ours == "0 of 1" and shown["ros_rounds"].ours == 3


def test_team_visits_its_waypoints_and_the_rows_have_a_control(tmp_path):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(patrol, "DURATION_S", 14.0)
        team_run = patrol.patrolled(Setting("/nowhere", seed=SEED), patrol.three)
    shown = rows(patrol, tmp_path, over_seeds=lambda run, setting: [team_run])
    assert team_run.visits >= 2 and team_run.worst_s <= 14.0
    assert shown["team_worst_s"].control == shown["one_worst_s"].ours == team_run.worst_s


def test_random_orders_differ_by_seed_and_no_waypoint_comes_twice_in_a_row():
    orders = [beat.order for seed in (1, 2) for beat in patrol.one_at_random(seed)]
    assert len({tuple(order) for order in orders}) == 2
    assert all(a != b for order in orders for a, b in zip(order, order[1:]))


def test_robots_that_divide_nothing_each_visit_all_waypoints_after_their_start():
    for divided, alone in zip(patrol.three(1), patrol.three_alone(1)):
        assert alone.member == divided.member and sorted(alone.order) == list(patrol.EVERYTHING)
        assert alone.order[-1] == divided.order[-1]


@pytest.mark.parametrize("beats_of", [patrol.one, patrol.three])
def test_each_waypoint_of_the_patrol_is_visited_by_one_robot(beats_of):
    orders = [list(beat.order) for beat in beats_of(1)]
    assert sorted(sum(orders, [])) == list(patrol.EVERYTHING)


def test_other_seeds_are_other_runs():
    """The robots of a patrol share its waypoints, also in the control."""
    beats = [patrol.one(seed)[0] for seed in range(10)]
    assert len({tuple(beat.points) for beat in beats}) == 10 and len({beat.order[0] for beat in beats}) > 3
    assert len({tuple(beat.points) for each in (patrol.three, patrol.three_alone) for beat in each(1)}) == 1
    assert len({mixed_team.pair(seed)[0].start for seed in range(10)}) == 10


@pytest.mark.parametrize("off_m, counted", [(0.2, 1), (0.3, 0)])
def test_visit_counts_once_and_only_if_the_robot_is_truly_there(off_m, counted):
    beats = patrol.one(1)
    visits = patrol.Visits(beats)
    x_m, y_m = beats[0].poses[0][:2]
    for _ in range(2):
        visits.update(0, 1, Pose(x_m + off_m, y_m, 0.0), 5.0)
    assert visits.idleness.visits == counted and visits.off_m == pytest.approx(off_m)


def test_messages_come_late_and_some_never():
    channel = Channel((0.5, 1.0), 0.5, 1)
    for number in range(100):
        channel.send(str(number), 0.0)
    assert channel.arrived(0.49) == [] and 30 < len(channel.arrived(1.0)) < 70


def test_claims_come_through_a_bad_channel():
    claims = [Claim(name, [each for each in "abc" if each != name], 0.0) for name in "abc"]
    channel = Channel((0.02, 0.3), 0.5, 1)
    claims[1].want()
    for tick in range(600):
        exchange(claims, channel, 0.05 * tick)
    assert [claim.held for claim in claims] == [False, True, False]
