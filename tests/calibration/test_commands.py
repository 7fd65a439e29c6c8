"""`mrl calibrate` as a whole, on emulated boards in simulated time."""

import contextlib
import itertools
import json
import math
import os
import pathlib
import sys
from unittest import mock

import click
import numpy as np
import pytest
import yaml

from mrl_driver.apps.calibration import gain_procedures, geometry_procedures, ground_truth, manoeuvres
from mrl_driver.apps.calibration.commands import calibrate_job
from mrl_driver.apps.calibration.gains import Gains
from mrl_driver.apps.calibration.ground_truth import Truth
from mrl_driver.cli import main
from mrl_driver.driver.options import Options
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import BoardTimeout, ConfigError
from mrl_driver.geometry import Pose
from mrl_driver.protocol import encode_reply
from mrl_driver.robot import models
from mrl_driver.robot.sonar_curve import THESIS, Curve
from sim_arduino.serve import factory

from . import paths
from .kit import calibrate

END_M = 0.01
STEPS = len(gain_procedures.MOTOR_BOARD.percents) + 2  # with the present and with the suggested gains
BELIEVED = models.load("traxbot").drive


class Lab:
    """Emulated robots, a new one for each command, and the command line; robots are recorded to `recording`."""

    def __init__(self, capsys):
        self.options, self.rewire, self.emulated, self.recording = {}, None, None, None
        self._capsys = capsys

    @contextlib.contextmanager
    def connect(self, job, **_):
        with self.robot(job.target.model) as robot:
            yield robot

    def robot(self, model, period_ms=100):
        self.emulated = factory.make(
            factory.Options(robot="traxbot", **{"footprint": "none", **self.options})
        )
        if self.rewire:
            self.rewire(self.emulated.plant.motor_board)
        return SteppedDriver(self.emulated.engine, model, recorded(self.recording, period_ms=period_ms))

    def pose(self):
        return Pose(*self.emulated.plant.true_pose)

    def mrl(self, *args):
        return calibrate(self._capsys, *args)

    def refused(self, *args):
        """Run it, expect exit code 2; the last line of stderr."""
        code, _, lines = self.mrl(*args)
        assert code == 2, lines
        return lines[-1]


def recorded(path, **options):
    """Options of a driver that is recorded to a new file, or not at all."""
    if path and path.exists():
        path.unlink()
    return Options(check=path is None, record=path and str(path), **options)


@pytest.fixture
def lab(monkeypatch, tmp_path, capsys):
    made = Lab(capsys)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.setattr(calibrate_job, "connect", made.connect)
    monkeypatch.setattr(ground_truth, "truth_file", lambda path: made.pose)
    return made


@pytest.mark.parametrize("robot_id, mass_kg", [(1, 3.21), (2, models.load("traxbot").body.mass_kg)])
def test_a_calibration_goes_on_from_the_file_that_lists_the_boards_id_whatever_name_is_in_it(
    lab, robot_id, mass_kg
):
    """A copy of a packaged file for one of its robots, of which only some numbers were changed."""
    lab.options = {"robot_id": robot_id}
    file = yaml.safe_load(pathlib.Path(models.path_of("traxbot")).read_text())
    file["ids"] = [1]
    file["body"]["mass_kg"] = 3.21
    own = pathlib.Path(models.own_folder()) / "lab7.yaml"
    own.parent.mkdir(parents=True)
    own.write_text(yaml.safe_dump(file))
    code, _, lines = lab.mrl("straight", "--count", 2, "--distance", 0.5, "--truth", "t", "--yes")
    assert code == 0, lines
    assert models.load(f"traxbot-{robot_id}.yaml").body.mass_kg == mass_kg


def swap_encoders(board):
    counts = board.counts
    board.counts = lambda: counts()[::-1]


@pytest.mark.parametrize(
    ("name", "text", "procedure", "said"),
    [
        ("traxbot-1.yaml", "mine", "straight", "traxbot-1.yaml already exists"),
        (
            "traxbot-1.calibration.json",
            '{"version": 1',
            "turn",
            "not the state of a calibration; move it away",
        ),
    ],
)
def test_a_file_of_something_else_is_not_replaced(lab, tmp_path, name, text, procedure, said):
    (tmp_path / name).write_text(text)
    assert said in lab.refused(procedure, "--truth", "t", "--yes")
    assert (tmp_path / name).read_text() == text


@pytest.mark.parametrize(
    ("args", "said"),
    [
        (("straight", "--plot", "a.png", "--truth", "t"), "pip install 'mrl-driver[plot]'"),
        (("turn", "--yes"), "stdin is not a terminal; give --truth FILE"),
        (
            ("straight", "--port", "tcp://kit:1", "--record", "run.mrl", "--truth", "t"),
            "run.mrl already exists. Replace it?",
        ),
        (("gains", "--recording", "lab.mrl"), "--robot is missing"),
        (("turn", "--robot", "traxbot", "--output", "a.yaml", "--run", "lab.mrl"), "expected FILE:X,Y"),
    ],
)
def test_what_cannot_be_done_is_refused_before_anything_moves(lab, monkeypatch, tmp_path, args, said):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    (tmp_path / "run.mrl").write_text("precious\n")
    assert said in lab.refused(*args)
    assert lab.emulated is None


@pytest.mark.parametrize("interruption", [KeyboardInterrupt, click.Abort])
def test_an_interrupted_calibration_goes_on_where_it_was(lab, monkeypatch, interruption):
    lab.options = {"error": "slip=0.1"}
    end, calls = Truth.end, []

    def interrupted(self, run, check):
        calls.append(run)
        if len(calls) == 2:
            raise interruption
        return end(self, run, check)

    monkeypatch.setattr(Truth, "end", interrupted)
    turn = ("turn", "--count", 2, "--turns", 1, "--truth", "t", "--yes")
    code, _, lines = lab.mrl(*turn)
    assert code == main.INTERRUPTED and any("1 of 2 runs are kept in" in line for line in lines)
    assert "runs of turn with turns 1, count 2" in lab.refused("turn", "--count", 4, "--turns", 1, *turn[5:])
    code, _, lines = lab.mrl(*turn)
    assert code == 0 and lines[1].startswith("1 of 2 runs are already in") and len(calls) == 3
    assert models.load("traxbot-1.yaml").drive.turn_slip == pytest.approx(0.1, abs=2e-3)


UNMEASURED = "distances by the wheels, which nobody measured: run mrl calibrate straight first"


def test_a_turn_waits_for_the_result_of_a_straight_and_says_that_there_was_none(lab, monkeypatch):
    turn = ("turn", "--count", 2, "--turns", 1, "--truth", "t", "--yes")
    assert any(UNMEASURED in line for line in lab.mrl(*turn, "--output", "other.yaml")[2])
    straight = ("straight", "--count", 2, "--distance", 0.5, *turn[5:])
    with monkeypatch.context() as patch:
        patch.setattr(geometry_procedures, "evaluate", mock.Mock(side_effect=ConfigError("an outlier")))
        lab.refused(*straight)
    assert "holds runs of straight without a result" in lab.refused(*turn)
    assert lab.mrl(*straight)[0] == 0
    code, _, lines = lab.mrl(*turn, "--robot", "traxbot-1.yaml")
    assert code == 0 and not any(UNMEASURED in line for line in lines)
    again = "turns were measured with the distances of before: run mrl calibrate turn again"
    assert again in lab.mrl(*straight, "--robot", "traxbot-1.yaml")[1]


def test_counts_that_jump_spoil_the_run(lab, tmp_path):
    """An encoder that reads 9000 more for a moment; the odometry bridges that, a calibration does not take it."""

    def jump(board):
        counts = board.counts
        board.counts = lambda: tuple(each + 9000 * (2.0 < board.time_s < 2.1) for each in counts())

    lab.rewire = jump
    line = lab.refused("straight", "--count", 2, "--distance", 0.5, "--truth", "t", "--yes")
    assert "the counts jumped" in line and os.listdir(tmp_path) == []


def test_sonar_curve_is_fitted_to_a_wall_and_saved_on_the_board(lab):
    """Front sonar 0.10 m ahead of base_link, wall at x = 2 m."""
    lab.options = {"pose": "0.4,0,0", "sonar": "noise=0.01,missed=0.1", "footprint": "box"}
    sonar = ("sonar", "--start", 1.5, "--step", 0.15, "--yes", "--eeprom", "--plot", "curve.png", "--json")
    code, out, lines = lab.mrl(*sonar)
    assert code == 0 and json.loads(out)["r2"] > 0.999, lines
    board = models.load("traxbot-1.yaml").board
    assert lab.emulated.engine.config["sonar_a"] == board["sonar_a"] != 11767


@pytest.mark.parametrize("row", ["150,1.5", "1.5,150", "0,1.5", "nan,1.5"])
def test_points_that_are_not_in_metres_are_refused(lab, tmp_path, row):
    (tmp_path / "wall.csv").write_text(f"0.5,0.51\n{row}\n")
    line = lab.refused("sonar", "--robot", "traxbot", "--points", "wall.csv", "--output", "a.yaml", "--yes")
    assert f"wall.csv:2: got '{row}', expected distance,reading in metres, at most 6.45" in line


@pytest.mark.parametrize(
    "seen, words", [((math.nan, 0.4, 0.4), "measures 0.40 m"), ((math.nan,), "gives no reading")]
)
def test_a_front_sonar_that_often_gives_no_reading_does_not_let_the_robot_drive(
    lab, monkeypatch, seen, words
):
    readings = itertools.cycle(seen)
    lab.options = {"pose": "0.4,0,0", "footprint": "box"}
    wait = SteppedDriver.wait

    def then_read(robot, seconds):
        wait(robot, seconds)
        robot.telemetry.ranges["front"] = next(readings)

    monkeypatch.setattr(SteppedDriver, "wait", then_read)
    assert f"the front sonar {words}" in lab.refused("sonar", "--start", 1.5, "--step", 0.15, "--yes")
    assert lab.pose().x_m == pytest.approx(0.4, abs=END_M)


def test_gains_with_which_a_wheel_did_not_turn_are_refused(lab, monkeypatch, tmp_path):
    """A motor board does not stop by itself."""
    step, calls = gain_procedures.step, []

    def blocked_in_the_last(*args):
        calls.append(args)
        lab.emulated.plant.robot.motors[0].blocked = len(calls) == STEPS
        return step(*args)

    monkeypatch.setattr(gain_procedures, "step", blocked_in_the_last)
    words = "the left wheel made 0 counts with the suggested gains, expected at least "
    assert words in lab.refused("gains", "--yes")
    assert not list(tmp_path.glob("*.yaml"))


def test_gains_are_suggested_and_the_ramp_comes_back(lab):
    code, out, _ = lab.mrl("gains", "--yes", "--json", "--plot", "gains.png")
    found = json.loads(out)
    assert code == 0 and found["after"]["left"]["rise_s"] < found["before"]["left"]["rise_s"]
    assert models.load("traxbot-1.yaml").board["kp"] == found["gains_after"]["kp"]
    gains = lab.emulated.plant.robot.gains
    assert (gains.kp, gains.ki, gains.kd, gains.ramp_ms) == (700, 400, 200, 2500)


# -- recordings


def record(path, moves, start=(30000, -30000), jump=0):
    """A recording of these moves as the believed drive makes them, 20 readings a second, counters near their wrap.

    First the robot stands: without a greeting, a reader begins with the third reading.
    """
    sums = (
        np.concatenate(([(0, 0)] * 5, np.cumsum(paths.counts(moves, BELIEVED), axis=0))).astype(int) + start
    )
    lines = ["#mrl-recording 1 {}"]
    for i, (right, left) in enumerate(sums.tolist()):
        right += jump * (len(sums) // 2 <= i < len(sums) // 2 + 2)
        counts = [(value + 0x8000 & 0xFFFF) - 0x8000 for value in (right, left)]
        lines.append(f"{i * 0.05:.6f} < {encode_reply(6, *counts).decode().strip()}\\r\\n")
    path.write_text("\n".join(lines) + "\n")
    return path


def run(path, moves, true):
    x, y, yaw = paths.end(paths.counts(moves, BELIEVED), true)
    return "--run", f"{record(path, moves)}:{x:.4f},{y:.4f},{math.degrees(yaw):.3f}"


FROM_RECORDING = ("--robot", "traxbot", "--output", "recorded_lab.yaml", "--yes", "--recording", "lab.mrl")


@pytest.fixture
def recorded_lab(lab, tmp_path):
    """The laboratory; what its robots say and hear is kept in lab.mrl."""
    lab.recording = tmp_path / "lab.mrl"
    return lab


@pytest.mark.parametrize(
    ("procedure", "keys"),
    [(("gains",), Gains._fields), (("sonar", "--start", 1.5, "--step", 0.15), models.CURVE_KEYS)],
)
def test_a_recording_of_a_calibration_says_what_the_calibration_said(recorded_lab, procedure, keys):
    recorded_lab.options = {"pose": "0.4,0,0", "footprint": "box"}
    assert recorded_lab.mrl(*procedure, "--yes")[0] == 0
    code, _, lines = recorded_lab.mrl(*procedure, *FROM_RECORDING)
    assert code == 0, lines
    live, replayed = (models.load(f"{name}.yaml").board for name in ("traxbot-1", "recorded_lab"))
    assert [replayed[key] for key in keys] == pytest.approx([live[key] for key in keys], rel=0.02)


UNWITNESSED = "the counters fit the commands; nobody saw which wheel turned, or in which direction\n"


def test_the_wires_are_judged_from_a_recording_too(recorded_lab):
    assert recorded_lab.mrl("wiring", "--unseen", "--yes")[0] == 0
    code, out, _ = recorded_lab.mrl("wiring", *FROM_RECORDING)
    assert (code, out) == (0, UNWITNESSED)


def test_only_who_saw_the_wheels_calls_the_wiring_right(lab):
    assert lab.mrl("wiring", "--unseen", "--yes")[1] == UNWITNESSED
    assert lab.mrl("wiring", "--yes", "--answers", "left,forward,unseen")[1] == UNWITNESSED
    right = "the wiring of motors and encoders is right\n"
    assert lab.mrl("wiring", "--yes", "--answers", "left,forward,right,forward")[1] == right


def test_half_a_recording_of_the_wires_is_refused(recorded_lab, tmp_path):
    recorded_lab.mrl("wiring", "--unseen", "--yes")
    file = tmp_path / "lab.mrl"
    file.write_text(file.read_text().partition("@10,0,35e")[0].rpartition("\n")[0] + "\n")
    line = recorded_lab.refused("wiring", *FROM_RECORDING)
    assert "lab.mrl: only the left motor was turned alone, expected both in turn" in line


def test_a_recorded_run_in_which_the_board_restarted_is_refused(recorded_lab):
    """The way between the last frame before the restart and the first one after it is not in the counts."""
    recorded_lab.options = {"faults": ("reset:at=2.0",), "footprint": "none"}
    assert recorded_lab.mrl(*STRAIGHT, "--yes")[0] == BoardTimeout.exit_code
    runs = ["--run", f"lab.mrl:{recorded_lab.pose().x_m:.3f},0"] * 2
    line = recorded_lab.refused("straight", "--robot", "traxbot", "--output", "a.yaml", "--yes", *runs)
    assert "lab.mrl: the board restarted in this run" in line


def test_swapped_wires_are_found_and_in_a_recording_too(recorded_lab):
    recorded_lab.rewire = swap_encoders
    code, _, lines = recorded_lab.mrl("wiring", "--truth", "t")
    assert code == 14
    assert lines[-1] == "mrl: encoders swapped: exchange the plugs of encoder 1 and encoder 3  [wheel_fault]"
    code, out, _ = recorded_lab.mrl("wiring", "--unseen", "--yes", "--json")
    assert code == 14 and json.loads(out)["findings"][0].startswith("encoders or motors swapped")
    code, _, lines = recorded_lab.mrl("wiring", *FROM_RECORDING)
    assert code == 14 and "encoders or motors swapped" in lines[-1]


STRAIGHT = ("straight", "--count", 2, "--distance", 0.5, "--truth", "t")
UNSEEN = ("wiring", "--unseen")


@pytest.mark.parametrize(
    ("recorded", "wanted", "robot", "said"),
    [
        (STRAIGHT, "wiring", "traxbot", "no motor was turned alone"),
        (STRAIGHT, "gains", "traxbot", "lab.mrl: no step turns both motors"),
        (UNSEEN, "gains", "traxbot", "lab.mrl: no step turns both motors"),
        (UNSEEN, "wiring", "stingbot", "lab.mrl is a recording of robot id 1, expected a stingbot"),
        (None, "gains", "traxbot", "lab.mrl holds 0 readings of the counters"),
    ],
)
def test_a_recording_of_something_else_is_refused(recorded_lab, tmp_path, recorded, wanted, robot, said):
    (tmp_path / "lab.mrl").write_text("#mrl-recording 1 {}\n0.0 ! opened x\n")
    if recorded:
        recorded_lab.mrl(*recorded, "--yes")
    assert said in recorded_lab.refused(wanted, "--robot", robot, *FROM_RECORDING[2:])


def test_umbmark_from_recordings(lab, tmp_path):
    true = BELIEVED._replace(wheel_offset=0.004, turn_slip=0.02)
    runs = [
        word
        for left in (True, False)
        for i in (1, 2)
        for word in run(tmp_path / f"{left}{i}.mrl", paths.square(1 + i / 50, left), true)
    ]
    words = ("umbmark", "--robot", "traxbot", "--output", "mine.yaml", "--yes")
    for way, jump, end, said in (
        (paths.straight(1.0), 0, "1,0", "went straight, expected a run of mrl calibrate umbmark"),
        (paths.square(), 9000, "0,0", "a.mrl: the counts jumped 2 times"),
        (paths.square(), 0, "0,0", "there are 1 counter-clockwise laps, expected at least 2"),
    ):
        file = record(tmp_path / "a.mrl", way, jump=jump)
        assert said in lab.refused(*words, "--run", f"{file}:{end}")
        assert not (tmp_path / "mine.yaml").exists()
    code, _, lines = lab.mrl(*words, *runs)
    assert code == 0, lines
    assert models.load("mine.yaml").drive == pytest.approx(true, abs=2e-4)


def test_a_recording_counts_once(lab, tmp_path):
    once = ("--run", f"{record(tmp_path / 'a.mrl', paths.straight(0.8))}:0.81,0.004")
    words = ("straight", "--robot", "traxbot", "--output", "mine.yaml", "--yes")
    assert "--run 1 and 2 have the same counts" in lab.refused(*words, *once, *once)
    other = ("--run", f"{record(tmp_path / 'b.mrl', paths.straight(0.82))}:0.83,0.004")
    assert "--run 1 and 3 have the same counts" in lab.refused(*words, *once, *other, *once)
    assert lab.mrl(*words, *once, *other)[0] == 0


def test_recorded_turns_without_a_heading_are_refused(lab, tmp_path):
    runs = [
        word
        for i, sign in enumerate((1, -1))
        for word in ("--run", f"{record(tmp_path / f'{i}.mrl', paths.turn(sign * 6.2))}:0.004,-0.003")
    ]
    line = lab.refused("turn", "--robot", "traxbot", "--output", "mine.yaml", "--yes", *runs)
    assert "run 1 of 2 has no heading, expected x y [m] and the heading [deg]" in line


@pytest.mark.parametrize(
    ("x_m", "world", "said"),
    [(1.1, None, "the front sonar measures 0.8"), (0.0, "walls: []\n", "the front sonar measures inf")],
    ids=["0.8 m away, said to be 1.5", "no wall"],
)
def test_a_robot_that_was_put_too_near_to_the_wall_does_not_drive_into_it(lab, tmp_path, x_m, world, said):
    lab.options = {"pose": f"{x_m},0,0", "footprint": "box"}
    if world:
        (tmp_path / "empty.yaml").write_text(world)
        lab.options["world"] = str(tmp_path / "empty.yaml")
    assert said in lab.refused("sonar", "--start", 1.5, "--step", 0.15, "--yes")
    assert not (tmp_path / "traxbot-1.yaml").exists()
    assert world or lab.pose().x_m == pytest.approx(1.1, abs=END_M)


SONAR_M = 0.01
SONAR = ("sonar", "--start", 1.5, "--step", 0.15)


def test_an_interrupted_sonar_goes_on_where_it_was(lab, monkeypatch, tmp_path):
    """Ctrl-C at the fourth distance; the same command begins there, in the middle of the way to the wall."""
    straight, legs = manoeuvres.straight, []

    def interrupted(*args):
        legs.append(args)
        if len(legs) == 3:
            raise KeyboardInterrupt
        straight(*args)

    monkeypatch.setattr(manoeuvres, "straight", interrupted)
    lab.options = {"pose": "0.4,0,0", "footprint": "box"}
    code, _, lines = lab.mrl(*SONAR, "--yes")
    assert code == main.INTERRUPTED
    assert "mrl: 3 distances are kept in traxbot-1.sonar.csv; repeat the command to continue" in lines
    lab.options = {"pose": "0.85,0,0", "footprint": "box"}
    code, _, lines = lab.mrl(*SONAR, "--yes")
    assert code == 0 and lines[1].startswith("3 of 9 distances are already in traxbot-1.sonar.csv")
    board, distances_m = models.load("traxbot-1.yaml").board, np.arange(0.3, 1.51, 0.1)
    found = Curve(*(board[name] / 1e4 for name in models.CURVE_KEYS))
    assert found.range_m(THESIS.counts(distances_m)) == pytest.approx(distances_m, abs=SONAR_M)
    assert sorted(os.listdir(tmp_path)) == ["traxbot-1.yaml"]


def test_a_sonar_run_that_is_refused_says_how_to_measure_again(lab):
    """Its readings are kept; the wheels only spun."""
    good = {"pose": "0.4,0,0", "footprint": "box"}
    spins = tuple(f"wheel_slips:wheel={wheel},grip=0" for wheel in ("left", "right"))
    lab.options = {**good, "sonar": "noise=0.01", "faults": spins}
    assert lab.refused(*SONAR, "--yes").endswith("sees the wall; measure again with --restart")
    lab.options = good
    code, _, lines = lab.mrl(*SONAR, "--yes", "--restart")
    assert code == 0, lines


# -- the terminal, and what may be wrong with files


@pytest.fixture
def person(lab, monkeypatch):
    """Measures where the robot has come to, and answers what `answer` makes of that; returns all questions."""
    start, answers = [], []

    def make(answer):
        def ask(question, **_):
            if str(question).startswith("Press Enter"):
                start[:] = [lab.pose()]
                return ""
            answers.append(question)
            return answer(len(answers), *lab.pose().relative_to(start[0]))

        monkeypatch.setattr(ground_truth, "require_terminal", lambda instead: None)
        monkeypatch.setattr(ground_truth.click, "prompt", ask)
        return answers

    return make


@pytest.mark.parametrize(
    ("slip", "said"),
    [
        (lambda pose: "0.1; 2", "got '0.1; 2', expected x y [m]"),
        (lambda pose: pose.rpartition(",")[0], "1 turn counter-clockwise has no heading"),
    ],
    ids=["mistyped", "no heading"],
)
def test_a_person_is_guided_and_asked_again_after_a_slip_of_the_pen(lab, person, slip, said):
    """A turn each way measured with a protractor, one answer not as it must be."""
    lab.options = {"error": "slip=0.1"}
    measured = "{:.3f}, {:.3f}, {:.1f}".format
    answers = person(lambda n, x, y, yaw: (slip if n == 1 else str)(measured(x, y, math.degrees(yaw))))
    code, _, lines = lab.mrl("turn", "--count", 2, "--turns", 1, "--yes")
    assert code == 0 and any(said in line for line in lines)
    assert len(answers) == 3
    assert models.load("traxbot-1.yaml").drive.turn_slip == pytest.approx(0.1, abs=5e-3)


def test_a_measurement_that_cannot_be_is_asked_for_again(lab, person):
    """Metres for centimetres, in the second run: neither it nor the first has to be driven again."""
    answers = person(lambda n, x, y, yaw: f"{100 * x:.3f} {100 * y:.3f}" if n == 2 else f"{x:.3f} {y:.3f}")
    code, _, lines = lab.mrl("straight", "--count", 2, "--distance", 0.5, "--yes")
    assert code == 0 and len(answers) == 3
    words = "m from the end by the counts, expected at most"
    assert any(words in line and "; measure again" in line for line in lines)


def test_a_step_is_not_cut_by_the_stop_of_the_greeting(lab):
    """The driver repeats its first stop until it is confirmed; a motor turned meanwhile would stand again."""
    with lab.robot("traxbot", period_ms=20) as robot:
        robot.drive(0.1, 0.0)
        robot.wait(0.5)
        robot.stop()
        taken = gain_procedures.step(robot, manoeuvres.Track(robot), manoeuvres.MOVE, 40, 1.5)["right"]
    speeds = np.diff(taken.travel) / np.diff(taken.times_s)
    assert taken.travel[0] == 0 and speeds[10:].min() > 4000
