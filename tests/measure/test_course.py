"""The parts of `mrl measure --drive` that need no drive: who knows the end, what is allowed, what is smooth."""

import contextlib
import math

import numpy as np
import pytest

from mrl_driver.apps.calibration.fit import BY_TAPE, BY_TRUTH
from mrl_driver.apps.calibration.ground_truth import TAPE_MEASURE, Truth
from mrl_driver.apps.measure import course
from mrl_driver.apps.measure.rows import AGREES, WORSE, causes, failed
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import ConfigError
from mrl_driver.geometry import ORIGIN, Pose
from mrl_driver.problems import PROBLEMS
from mrl_driver.robot import models
from mrl_driver.robot.models import ON_WHEELS
from sim_arduino.serve import factory
from sim_arduino.testing import EmulatedBoard
from tests.cli.run import fails
from tests.models import four_wheels, model

DUO = models.load("duo")
LINE_STEPS = np.full((50, 2), 147)  # 1 m in 50 steps


class Standing:
    """A robot that is asked, and does not drive; its front sonar sees the `ranges` one after the other."""

    def __init__(self, *ranges, virtual=False):
        self.board = self
        self.virtual = virtual
        self._ranges = list(ranges)
        self.pose_mm = (1200, 900, 1571)

    def wait(self, seconds):
        """Time passes, and a reading with it."""
        if seconds == course.READING_S and len(self._ranges) > 1:
            self._ranges.pop(0)

    @property
    def ranges(self):
        return {"front": self._ranges[0]} if self._ranges else {}

    def ask(self, code):
        return self.pose_mm


def test_an_emulated_robot_is_measured_by_its_file(tmp_path):
    path = tmp_path / "truth"
    path.write_text('{"x": 1.0, "y": 2.0, "yaw": 0.5}\n')
    found = course.source(Standing(), str(path), asks=True)
    assert isinstance(found.ruler, Truth) and found.measured == BY_TRUTH


def test_a_virtual_board_tells_its_own_pose():
    robot = Standing(virtual=True)
    found = course.source(robot, None, asks=True)
    found.ruler.begin("a run")
    robot.pose_mm = (1200, 1900, 1571)
    end = found.ruler.end("a run", lambda pose: None)
    assert end == pytest.approx((1.0, 0.0, 0.0), abs=1e-3)


@pytest.mark.parametrize(("asks", "ranges"), [(True, [2.0]), (False, [])])
def test_without_them_a_person_measures_or_nobody(asks, ranges):
    assert course.source(Standing(*ranges), None, asks).ruler is (TAPE_MEASURE if asks else None)


def test_a_wall_tells_how_much_nearer_it_is_and_nothing_else():
    robot = Standing(*[2.0] * 6, *[1.5] * 6)
    wall = course.source(robot, None, asks=False).ruler
    wall.begin("straight")
    end = wall.end("straight", lambda pose: None)
    assert end.x_m == pytest.approx(0.5) and math.isnan(end.y_m) and math.isnan(end.yaw_rad)


@pytest.mark.parametrize("seen", [0.1, 3.5, math.inf, -math.inf, math.nan])
def test_a_range_that_cannot_be_a_wall_is_no_measurement(seen):
    assert math.isnan(course.front_m(Standing(seen)))


def judged(key, end, steps=LINE_STEPS, measured=BY_TAPE):
    """The row of a run with these steps that ended there."""
    ruler = Truth(iter([ORIGIN, end]).__next__)
    return course.judged(key, DUO, steps, ruler_end(ruler), measured)


def ruler_end(ruler):
    ruler.begin("a run")
    return ruler.end("a run", lambda pose: None)


@pytest.mark.parametrize(
    ("end", "verdict", "cause"),
    [
        (Pose(1.003, 0.0, 0.0), AGREES, ""),
        (Pose(1.03, 0.0, 0.0), AGREES, ""),
        (Pose(0.9, 0.0, 0.0), WORSE, "wheel_size"),
        (Pose(0.99, 0.17, 0.34), WORSE, "wheel_ratio"),
    ],
)
def test_a_line_is_judged_by_the_noise_of_the_model_and_its_cause_by_the_kind_of_error(end, verdict, cause):
    row = judged("straight", end)
    assert (row.verdict, row.likely) == (verdict, cause)


def test_a_calibrated_robot_has_a_smaller_mark():
    small = ON_WHEELS._replace(distance_scale_sd=2e-4, wheel_ratio_sd=2e-4, turn_scale_sd=2e-4)
    marks = [
        course.spread(DUO._replace(noise=noise), LINE_STEPS, BY_TRUTH)[0, 0] for noise in (ON_WHEELS, small)
    ]
    assert marks[1] < marks[0] / 4


@pytest.mark.parametrize(("end", "verdict"), [(Pose(1.0, 0.0, 0.0), AGREES), (Pose(0.9, 0.0, 0.0), WORSE)])
def test_a_base_with_four_wheels_is_judged_too(end, verdict):
    steps = np.tile(LINE_STEPS, 2)
    assert course.judged("straight", four_wheels("skid"), steps, end, BY_TAPE).verdict == verdict


def test_a_turn_needs_its_heading():
    row = judged("turn", Pose(0.0, 0.0, math.nan), np.stack([np.full(50, 100), np.full(50, -100)], axis=1))
    assert row.value is None and "heading" in row.note


def test_a_run_that_nobody_measured_is_not_judged():
    assert judged("square", Pose(math.nan, math.nan, math.nan)).value is None


@pytest.mark.parametrize(
    ("counts", "smooth"),
    [
        (lambda t: 200 * t, True),
        (lambda t: -200 * t, True),
        (lambda t: 0 * t, False),
        (lambda t: 200 * np.floor(t * 2) / 2, False),
    ],
    ids=["even", "backward", "still", "by jerks"],
)
def test_a_wheel_that_turns_by_jerks_or_not_at_all_is_not_smooth(counts, smooth):
    times = np.arange(0.0, 2.5, 0.02)
    assert course.smooth(times, counts(times)) is smooth


def test_a_cause_of_the_wheels_hides_what_follows_from_it():
    rows = [judged("straight", Pose(0.99, 0.17, 0.34)), judged("arc", Pose(0.5, 0.5, 0.5))]
    assert [each.code for each in causes(rows)] == ["wheel_ratio"]


def test_the_kind_of_a_row_mends_only_its_own_cause():
    """A wheel that stops the first manoeuvre is not mended by a calibration of the sonars."""
    found = causes([failed("sonar_wall", "stopped early", "encoder_dead")])
    assert found[0].remedy == PROBLEMS["encoder_dead"].remedy


def test_what_mrl_calibrate_cannot_measure_is_mended_in_the_file():
    row = course.judged(
        "straight", model("omni"), np.tile((120, -120, 0), (150, 1)), Pose(0.8, 0.0, 0.0), BY_TRUTH
    )
    assert "metres_per_count" in causes([row])[0].remedy


@pytest.mark.parametrize(("name", "other"), [("duo", "sideways"), ("omni", "arc")])
def test_a_base_that_moves_sideways_does_so_in_place_of_the_circle(name, other):
    keys = course.keys(model(name))
    assert other not in keys and len(keys) == 10


@contextlib.contextmanager
def duo(*faults):
    """A duo in simulated time; nobody knows its true pose, so it drives what counts alone judge."""
    with contextlib.closing(factory.make(factory.Options("duo", faults=faults))) as made, SteppedDriver(
        made.engine
    ) as robot:
        yield robot, made.plant


def test_a_manoeuvre_whose_counts_jumped_is_a_row_and_the_next_one_is_driven(monkeypatch):
    def jumped(track):
        raise ConfigError("the counts jumped")

    monkeypatch.setattr(course.Track, "rows", jumped)
    with duo() as (robot, _):
        found = {row.key: row for row in course.rows(robot, course.Source(None))}
    assert set(found) == set(course.keys(DUO))
    assert found["slowest_mm_s"].value is None and found["slowest_mm_s"].note == "the counts jumped"
    assert found["full_speed"].verdict == AGREES


def test_sonars_of_a_robot_that_did_not_turn_are_not_compared():
    """Each looked in another direction: one that saw nothing there need not be deaf."""
    with duo() as (robot, _):
        found = {row.key: row for row in course.rows(robot, course.Source(None))}
    assert found["sonars_alike"].value is None


def test_a_board_that_falls_silent_in_a_manoeuvre_ends_it_and_all_others():
    with duo("freeze:at=8,lasts=1e6") as (robot, _):
        found = {row.key: row for row in course.rows(robot, course.Source(None))}
    assert set(found) == set(course.keys(DUO))
    assert [row.verdict for row in found.values()].count(WORSE) == 1
    assert found["square"].note == "the robot did not drive it to its end"


def test_without_a_yes_nothing_drives(tmp_path):
    with EmulatedBoard(robot="duo") as board:
        said = fails(2, "measure", "--port", board.port, "--drive", "-o", tmp_path / "a.json")
        assert board.true_pose == ORIGIN
    assert course.SPACE in said and "--yes" in said


def test_wheels_off_the_ground_cannot_drive_on_it():
    assert "expected one of them" in fails(2, "measure", "--port", "x", "--drive", "--wheels-off-ground")
