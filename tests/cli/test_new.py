"""`mrl new`: questions, the file it writes, and the way to a calibrated robot."""

import os
import pathlib
import re

import pytest

from mrl_driver.apps.calibration.wiring_check import BITS
from mrl_driver.protocol.table import BRIDGES
from mrl_driver.robot import models
from tests.calibration.kit import Kit

from .run import fails, mrl
from .terminal import Terminal

ROVER = [
    "--wheel-diameter",
    "65",
    "--separation",
    "150",
    "--counts",
    "11x4x34",
    "--bridge",
    "TB6612",
    "--file-only",
]


def test_the_options_make_a_robot_that_all_programs_know():
    done = mrl("new", "rover", *ROVER, "--yes")
    assert done.returncode == 0 and "all programs know the robot as --robot rover" in done.stdout
    model = models.load("rover")
    assert (model.ids, BRIDGES[model.board["bridge"]]) == ((11,), "tb6612")


def test_questions_come_with_a_picture(tmp_path):
    terminal = Terminal("new", "--file-only", folder=tmp_path)
    for question, picture, answer in (
        ("Name of the robot", b"", "rover"),
        ("Wheel diameter [mm]", b"measure across the tyre", "6.5"),  # centimetres by mistake
        ("expected 10 to 650", b"", "65"),
        ("Wheel separation [mm]", b"from the middle of one tyre", "150"),
        ("Counts of a wheel turn", b"Counts of a wheel turn = lines x 4 x ratio", "0"),
        ("expected a number from 4 to 100000", b"", "11x4x34"),
        ("Which H-bridge drives the motors?", b"modules with an L298N", "l298n"),
        ("1496 counts a turn, L298N, with robot id 11?", b"", "y"),
    ):
        terminal.answer(question, answer)
        assert picture in terminal.seen
    assert terminal.end() == 0, terminal.seen.decode()
    assert b"EN                D5           D11" in terminal.seen
    assert models.load("rover").board["bridge"] == BRIDGES.index("l298n")


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("rover", *ROVER), "Write .* stdin is not a terminal; give --yes to agree"),
        (
            ("rover", "--yes", *ROVER[:6]),
            "Which H-bridge drives the motors. stdin is not a terminal; give --bridge",
        ),
        (
            ("../rover", *ROVER, "--yes"),
            "name is '../rover', expected a letter .a to z, A to Z. and up to 31",
        ),
        (
            ("rover", *ROVER, "--yes", "--counts", "0"),
            "counts of a wheel turn are '0', expected a number from 4",
        ),
        (("rover", *ROVER, "--yes", "--separation", "nan"), "nan, expected 30"),
    ],
)
def test_wrong_answers_are_refused_in_one_line(words, line):
    assert re.search(line, fails(2, "new", *words))
    assert "rover" not in models.names()


def test_a_robot_that_exists_is_not_replaced():
    mrl("new", "rover", *ROVER, "--yes")
    path = os.path.join(models.own_folder(), "rover.yaml")
    before = pathlib.Path(path).read_text()
    line = fails(2, "new", "rover", *ROVER, "--yes", "--separation", "200")
    assert f"already exists; give another name, or go on with: mrl calibrate wiring --robot {path}" in line
    assert pathlib.Path(path).read_text() == before


def test_an_unknown_kit_becomes_a_robot_that_knows_its_wires(serve, tmp_path):
    """The board has no id and no wiring; motors are exchanged, and the right one is reversed."""
    hidden = BITS["set"] | BITS["motors_swapped"] | BITS["right_motor_reversed"]
    board = serve(Kit(hidden, robot_id=0))
    terminal = Terminal(
        "new", "rover", *ROVER[:-1], "--no-flash", "--port", board.path, "--answers", "right,back,forward,yes"
    )
    for question in ("with robot id 11?", "driven by a TB6612. Are the wheels off the ground?"):
        terminal.answer(question, "y")
    terminal.answer("Go on with mrl calibrate gains?", "n")
    assert terminal.end() == 130, terminal.seen.decode()
    assert b"the wiring is stored; go on later with: mrl calibrate gains --robot " in terminal.seen
    saved = board.board.saved
    assert [saved[name] for name in ("robot_id", "bridge", "wiring")] == [11, BRIDGES.index("tb6612"), hidden]
    assert (saved["encoder_counts"], saved["axis_radius"]) == (14960, 7500)
