"""Wiring and gains of H-bridge boards: what follows from what was seen, what the board stores, and the commands."""

import contextlib
import json
import math
import re
from pathlib import Path

import pytest

from mrl_driver.apps.calibration import gain_procedures, ground_truth, wiring_check
from mrl_driver.apps.calibration.commands import calibrate_job
from mrl_driver.apps.calibration.gains import BridgeGains
from mrl_driver.apps.calibration.wiring_check import BITS, SET, SINGLE_CHANNEL, Trial
from mrl_driver.cli import main
from mrl_driver.driver.options import Options
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import ConfigError, WheelFault
from mrl_driver.robot import models, wiring
from sim_arduino.serve import factory
from tests.models import four_wheels

from .kit import MODEL, Kit, calibrate, counted, turned_by
from .test_commands import recorded

COUNTS_A_TURN = 1496.0
SEEN_COUNTS = 140  # Counts of a slow move: 0.3 s at 20 % of 170 1/min, less what the start takes
HIDDEN = [SET | sum_ << 1 for sum_ in range(2**6)]
"""Every way to exchange or reverse two motors and two encoders."""
SIDES = ("left", "right")
PLACES = {"left": "D18 and A8", "right": "D19"}


def trial_of(hidden, output):
    """What is seen of a kit with this wiring when one output is driven forward."""
    wheels = turned_by(hidden, (1.0, 0.0) if output == "left" else (0.0, 1.0))
    left, right = (round(SEEN_COUNTS * each) for each in counted(hidden, wheels))
    turned = SIDES[0] if wheels[0] else SIDES[1]
    return Trial(output, {"left": left, "right": right}, turned, 1 if max(wheels) > 0 else -1)


def trials_of(hidden):
    return [trial_of(hidden, output) for output in SIDES]


def test_the_sum_that_is_stored_is_the_kits_wiring():
    assert [wiring_check.wiring_of(PLACES, trials_of(each), COUNTS_A_TURN) for each in HIDDEN] == HIDDEN


def test_an_encoder_with_one_channel_is_never_reversed():
    encoders = BITS["left_encoder_reversed"] | BITS["right_encoder_reversed"]
    found = [wiring_check.wiring_of(PLACES, trials_of(each), COUNTS_A_TURN, True) for each in HIDDEN]
    assert found == [(hidden & ~encoders) | SINGLE_CHANNEL for hidden in HIDDEN]


@pytest.mark.parametrize(
    ("first", "second", "words"),
    [
        (
            Trial("left", {"left": 9, "right": 0}, "left", 1),
            None,
            "the left wheel turned, but no encoder counted .left 9, right 0.: check",
        ),
        (
            Trial("left", {"left": 140, "right": 60}, "left", 1),
            None,
            "turned alone, but other encoders counted too .left 140, right 60.",
        ),
        (
            Trial("left", {"left": 140, "right": 0}, "right", 1),
            None,
            "both motor outputs turned the right wheel, expected one wheel each",
        ),
        (
            None,
            Trial("right", {"left": 140, "right": 0}, "right", 1),
            "the left encoder input counted both wheels.* on D18 and A8",
        ),
    ],
)
def test_what_does_not_fit_together_is_said(first, second, words):
    trials = [first or trial_of(SET, "left"), second or trial_of(SET, "right")]
    with pytest.raises(WheelFault, match=words) as refused:
        wiring_check.wiring_of(PLACES, trials, COUNTS_A_TURN)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("counts", [(-140, 140), (-140, -140), (140, 140), (10, -140), (140, -10)])
def test_a_proof_needs_the_left_wheel_forward_and_the_right_one_back(counts):
    with pytest.raises(WheelFault, match="the wiring that was found does not hold"):
        wiring_check.require_right_turn(dict(zip(SIDES, counts)), COUNTS_A_TURN)
    wiring_check.require_right_turn({"left": 140, "right": -140}, COUNTS_A_TURN)


class Bench:
    """`mrl calibrate` on one kit."""

    def __init__(self, capsys):
        self.kit, self._capsys = Kit(), capsys

    @contextlib.contextmanager
    def connect(self, job, **_):
        with SteppedDriver(self.kit, MODEL, Options()) as driver:
            yield driver

    def wiring(self, *args):
        return calibrate(self._capsys, "wiring", *args)


@pytest.fixture
def bench(monkeypatch, capsys, tmp_path):
    made = Bench(capsys)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(calibrate_job, "connect", made.connect)
    monkeypatch.setattr(ground_truth, "truth_file", lambda path: lambda: made.kit.pose)
    return made


@pytest.mark.parametrize("hidden", HIDDEN[::7])
def test_the_wiring_is_stored(bench, hidden):
    """Moves are slow and short: at most 20 % duty, three requests in 0.3 s, and the last one is the proof."""
    bench.kit = Kit(hidden)
    code, out, _ = bench.wiring("--truth", "t", "--json")
    assert code == 0 and json.loads(out)["wiring"] == hidden
    assert (bench.kit.saved["bridge"], bench.kit.saved["wiring"]) == (4, hidden)
    assert bench.kit.saved["ramp_time"] == MODEL.board["ramp_time"]  # it is off during the moves
    assert len(bench.kit.seen) == 9 and bench.kit.seen[:6] == [(20, 0)] * 3 + [(0, 20)] * 3
    assert {tuple(map(abs, duties)) for duties in bench.kit.seen[6:]} == {(20, 20)}


def test_pins_that_the_board_does_not_accept_are_named_before_anything_turns(bench):
    bench.kit.problem = wiring.Problem("no_pwm", "pin_left_pwm_a").reply
    code, _, lines = bench.wiring("--truth", "t")
    assert code == 11 and bench.kit.seen == [] and bench.kit.config["bridge"] == 0
    words = "left_pwm_a is on D5: the function needs PWM, and no timer makes it on this pin; store the robot's file"
    assert words in lines[-1]


def test_the_result_may_stay_in_force_until_the_board_restarts(bench):
    code, out, _ = bench.wiring("--truth", "t", "--no-eeprom")
    assert code == 0 and "the wires are as in the robot's file: wiring 1, in force until" in out
    assert (bench.kit.config["wiring"], bench.kit.saved["wiring"]) == (1, 0)


def test_a_user_is_asked_only_what_the_encoders_do_not_show(bench):
    """Motors exchanged, the right one reversed: the second wheel follows from the first."""
    bench.kit = Kit(SET | BITS["motors_swapped"] | BITS["right_motor_reversed"])
    code, out, err = bench.wiring("--yes", "--answers", "right,back,forward,yes")
    assert code == 0, err
    assert out == "motors swapped, right motor reversed: wiring 11, stored in the board's EEPROM\n"


@pytest.mark.parametrize(
    ("answers", "code", "words"),
    [
        ("none", 14, "no wheel turned when the left motor output was driven"),
        ("left,none", 14, "no wheel turned when the left motor output was driven"),
        ("left,forward,forward,no", 14, "the wheels did not turn the robot to the right"),
        (
            "left,forward",
            2,
            "--answers has nothing for the question: In which direction did the right wheel turn?",
        ),
        ("up", 2, "--answers has up for the question: Which wheel turned? expected left, right, none"),
    ],
)
def test_answers_that_do_not_fit_leave_the_board_unset(bench, answers, code, words):
    ended, _, err = bench.wiring("--yes", "--answers", answers)
    assert ended == code and words in "".join(err)
    assert (bench.kit.config["bridge"], bench.kit.config["wiring"]) == (0, 0)
    assert bench.kit.saved["wiring"] == 0


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (
            ("--answers", "left,forward,forward,yes"),
            "Are the wheels off the ground? stdin is not a terminal; give --yes",
        ),
        (("--unseen", "--yes"), "the encoders of an H-bridge board do not show which wheel turned"),
        (("--truth", "t", "--bridge", "l293d"), "vnh5019"),
    ],
)
def test_nothing_moves_without_the_wheels_off_the_ground(bench, args, words):
    code, _, err = bench.wiring(*args)
    assert code == 2 and len(err) == 1 and words in err[0]
    assert bench.kit.seen == [] and bench.kit.config["wiring"] == 0


@pytest.mark.parametrize("move", [1, 4, 8])
@pytest.mark.parametrize("before", [0, 37])
def test_an_interrupted_calibration_leaves_the_board_as_it_was(bench, move, before):
    bench.kit = Kit(wiring=before, bridge=3 if before else 0)

    def interrupt():
        if len(bench.kit.seen) == move:
            raise KeyboardInterrupt

    bench.kit.on_move = interrupt
    code, _, _ = bench.wiring("--truth", "t", "--bridge", "TB6612")
    assert code == main.INTERRUPTED
    assert (bench.kit.config["bridge"], bench.kit.config["wiring"]) == (3 if before else 0, before)
    assert bench.kit.saved["wiring"] == before


@pytest.mark.parametrize(
    ("part", "number", "words"),
    [
        ("dead_inputs", 0, "the left wheel turned, but no encoder counted"),
        ("stuck_outputs", 1, "no wheel turned when the right motor output was driven"),
    ],
)
def test_what_is_not_connected_is_named(bench, part, number, words):
    setattr(bench.kit, part, (number,))
    code, _, err = bench.wiring("--truth", "t")
    assert code == 14 and words in "".join(err)
    assert bench.kit.config["wiring"] == 0


@pytest.mark.parametrize("model", [MODEL, MODEL._replace(board={**MODEL.board, "wiring": 33})])
def test_a_new_id_leaves_the_wiring_as_it_is(model):
    """It belongs to the cables; only a model that names a wiring sets it."""
    kit = Kit(wiring=37, bridge=model.board["bridge"])
    with SteppedDriver(kit, model) as driver:
        assert not driver.parameters.save_model(24, model)
    assert (kit.saved["robot_id"], kit.saved["wiring"]) == (24, model.board.get("wiring", 37))


@pytest.mark.parametrize(
    "change",
    [
        lambda board: board.save_model(24, MODEL),
        lambda board: board.replace({"bridge": MODEL.board["bridge"]}),
    ],
    ids=["model", "parameter"],
)
def test_a_wiring_that_was_found_with_another_bridge_does_not_hold(change):
    kit = Kit(wiring=37, bridge=MODEL.board["bridge"] - 1)
    with SteppedDriver(kit, MODEL) as driver:
        assert change(driver.parameters)
    assert kit.saved["wiring"] == 0


def test_a_board_with_bridges_does_not_get_the_parameters_of_a_motor_board():
    kit = Kit(wiring=37)
    with SteppedDriver(kit, MODEL) as driver, pytest.raises(ConfigError, match="has a motor board, but this"):
        driver.parameters.save_model(1, models.load("traxbot"))
    assert kit.saved["wiring"] == 37


OVERSHOOT, SETTLED_S, OFFSET = 0.05, 0.25, 0.01
"""Limits of a step of the speed, as for the firmware; the speeds are means over 50 ms."""
SOFT = BridgeGains(kp=200, ki=1000, friction_duty=0, full_speed=200)  # Gains that settle late
STEPS = len(gain_procedures.BRIDGE_BOARD.percents) + 2


class Lab:
    """One emulated kit, and the command line."""

    def __init__(self, capsys):
        self.made = factory.make(factory.Options(robot="duo", footprint="none"))
        self._capsys, self.record, self.robot = capsys, None, "duo"

    @contextlib.contextmanager
    def connect(self, job, **_):
        with SteppedDriver(self.made.engine, self.robot, recorded(self.record)) as robot:
            robot.parameters.write(SOFT._asdict())
            yield robot

    def mrl(self, *args):
        own = ("--robot", self.robot, "--output", "kit.yaml", "--yes")
        return calibrate(self._capsys, "gains", *own, *args)

    @property
    def in_force(self):
        return BridgeGains(*(self.made.engine.config[name] for name in BridgeGains._fields))


@pytest.fixture
def lab(monkeypatch, tmp_path, capsys):
    made = Lab(capsys)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.setattr(calibrate_job, "connect", made.connect)
    yield made
    made.made.close()


def test_suggested_gains_keep_a_step_within_its_limits(lab, tmp_path):
    """They go to the file and the EEPROM."""
    code, out, _ = lab.mrl("--json", "--plot", "gains.png", "--eeprom")
    found = json.loads(out)
    assert code == 0
    for wheel in ("left", "right"):
        before, after = found["before"][wheel], found["after"][wheel]
        assert after["overshoot"] < OVERSHOOT and abs(after["offset"]) < OFFSET
        assert after["settle_s"] < SETTLED_S
        assert before["settle_s"] is None or before["settle_s"] > SETTLED_S
    assert (tmp_path / "gains.png").stat().st_size > 5000
    board, gains = models.load("kit.yaml").board, found["gains_after"]
    assert {name: board[name] for name in gains} == gains
    assert lab.in_force == BridgeGains(**gains)


def test_speeds_that_the_motors_do_not_reach_are_lowered(lab, tmp_path):
    """The ceilings become 0.85 of full speed; the limit of turns was lower already."""
    fast = Path(models.SCHEMA).with_name("duo.yaml").read_text()
    for old, new in (("linear_ceiling: 500", "linear_ceiling: 900"), ("linear_m_s: 0.4", "linear_m_s: 0.8")):
        assert fast.count(old) == 1
        fast = fast.replace(old, new)
    (tmp_path / "fast.yaml").write_text(fast)
    lab.robot = "fast.yaml"
    assert lab.mrl()[0] == 0
    slow, before = models.load("kit.yaml"), models.load("duo")
    full_m_s = slow.board["full_speed"] / 60 * math.pi * 0.065
    assert slow.board["linear_ceiling"] / 1000 == pytest.approx(0.85 * full_m_s, abs=0.001)
    assert slow.limits.linear_m_s == slow.board["linear_ceiling"] / 1000
    assert slow.board["angular_ceiling"] == before.board["angular_ceiling"]


def test_mecanum_wheels_take_the_full_speed_of_their_motors():
    base = four_wheels("mecanum")
    values = gain_procedures.values_of({"full_speed": 100}, base)
    assert values["drive", "full_speed_m_s"] == pytest.approx(
        100 / 60 * 2 * math.pi * base.drive.wheel_radius_m
    )


def test_the_former_gains_and_the_ramp_come_back(lab):
    ramp = lab.made.engine.config["ramp_time"]
    code, out, _ = lab.mrl()
    assert code == 0 and lab.in_force == SOFT
    assert lab.made.engine.config["ramp_time"] == ramp != 0
    assert re.search(
        r"right motor: turns from 5\.\d% duty, 17\d 1/min at full duty, time constant \d+ ms", out
    )


@pytest.mark.parametrize("steps", [0, STEPS - 1])
def test_an_interruption_brings_them_back_too(lab, monkeypatch, steps):
    step, calls = gain_procedures.step, []

    def interrupted(*args):
        calls.append(args)
        if len(calls) > steps:
            raise KeyboardInterrupt
        return step(*args)

    monkeypatch.setattr(gain_procedures, "step", interrupted)
    ramp = lab.made.engine.config["ramp_time"]
    code, _, _ = lab.mrl()
    assert code == main.INTERRUPTED and lab.in_force == SOFT
    assert lab.made.engine.config["ramp_time"] == ramp


def test_a_motor_that_does_not_turn_is_named(lab, tmp_path):
    lab.made.plant.bridge.motor(0).blocked = True
    code, _, lines = lab.mrl()
    assert code == 2 and "left motor: the wheel turned at 0 of 3 duties" in lines[-1]
    assert not (tmp_path / "kit.yaml").exists()


def test_gains_with_which_the_board_stopped_a_wheel_are_refused(lab, monkeypatch, tmp_path):
    step, calls = gain_procedures.step, []

    def blocked_in_the_last(*args):
        calls.append(args)
        lab.made.plant.bridge.motor(0).blocked = len(calls) == STEPS
        return step(*args)

    monkeypatch.setattr(gain_procedures, "step", blocked_in_the_last)
    code, _, lines = lab.mrl()
    assert code == 10 and "a wheel did not turn at full drive" in lines[-1]
    assert not (tmp_path / "kit.yaml").exists() and lab.in_force == SOFT


def test_a_recording_gives_the_gains_of_its_drive(lab, tmp_path):
    lab.record = tmp_path / "drive.mrl"
    _, out, _ = lab.mrl("--json")
    driven = json.loads(out)["gains_after"]
    (tmp_path / "kit.yaml").unlink()
    code, _, lines = lab.mrl("--recording", str(lab.record))
    board = models.load("kit.yaml").board
    assert code == 0, lines
    assert {name: board[name] for name in driven} == pytest.approx(driven, rel=0.03)
