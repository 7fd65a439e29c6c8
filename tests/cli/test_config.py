"""`mrl config` against an emulated board."""

import json
from pathlib import Path

import pytest

from mrl_driver.protocol.table import PARAMETERS
from mrl_driver.robot import models
from sim_arduino.board import registry
from sim_arduino.testing import EmulatedBoard

from .run import fails, mrl


def get(port, *names):
    return {
        row["name"]: row for row in json.loads(mrl("config", "get", *names, "--json", "--port", port).stdout)
    }


def test_all_parameters_with_the_models_own(emulated_board):
    """All that a board with an OMNI-3MD uses."""
    found = get(emulated_board.port)
    assert list(found) == [row.name for row in PARAMETERS if not row.capability]
    assert found["kp"]["value"] == found["kp"]["default"] == 700


@pytest.fixture
def duo():
    """Port of a board with an H-bridge."""
    with EmulatedBoard(robot="duo") as board:
        yield board.port


def test_an_h_bridge_board_has_all_parameters(duo):
    assert list(get(duo)) == [row.name for row in PARAMETERS if row.capability in ("", "bridge")]


def test_a_bridge_is_set_and_shown_by_its_chip(duo):
    done = mrl("config", "set", "bridge", "l298n", "--yes", "--port", duo)
    assert done.stdout == "bridge 4 to 3: saved\n"
    assert "l298n" in mrl("config", "get", "bridge", "--port", duo).stdout


def test_the_wiring_of_a_robot_differs_from_no_model(duo):
    assert get(duo, "wiring")["wiring"]["default"] is None


EARLIER_PARAMETERS = 19


@pytest.fixture
def earlier_board(emulated_board, monkeypatch):
    """A board with a firmware from before the H-bridge: it refuses the later parameters, and notes that."""
    refused = []

    def guarded(handler):
        def handle(board, index, *value):
            if index < EARLIER_PARAMETERS:
                handler(board, index, *value)
            else:
                refused.append(index)
                board.refuse("argument_range")

        return handle

    for name in ("read_config", "write_config"):
        monkeypatch.setitem(registry.REQUESTS, name, guarded(registry.REQUESTS[name]))
    emulated_board.refused = refused
    return emulated_board


def test_an_earlier_board_is_not_asked_for_later_parameters(earlier_board):
    assert len(get(earlier_board.port)) == EARLIER_PARAMETERS and earlier_board.refused == []


def test_an_earlier_board_gets_its_defaults(earlier_board):
    mrl("config", "set", "kp", "800", "--yes", "--port", earlier_board.port)
    assert mrl("config", "defaults", "--yes", "--port", earlier_board.port).returncode == 0
    assert get(earlier_board.port)["kp"]["value"] == 700 and earlier_board.refused == []


@pytest.mark.parametrize("words", [("get", "wiring"), ("set", "wiring", "1", "--yes")])
def test_a_parameter_of_other_boards_is_refused_with_what_to_do(earlier_board, words):
    line = fails(11, "config", *words, "--port", earlier_board.port)
    assert "no parameter wiring" in line and "capability bridge" in line and "mrl flash" in line
    assert earlier_board.refused == []


def test_a_change_is_saved_and_marked(emulated_board):
    done = mrl("config", "set", "kp", "800", "ki", "350", "--yes", "--port", emulated_board.port)
    assert done.stdout == "kp 700 to 800, ki 400 to 350: saved\n"
    emulated_board.faults.reset()
    assert get(emulated_board.port, "kp", "kd")["kp"]["value"] == 800
    assert "* 700" in mrl("config", "get", "kp", "--port", emulated_board.port).stdout


def test_a_trial_ends_with_the_next_reset(emulated_board):
    mrl("config", "set", "kp", "800", "--try", "--yes", "--port", emulated_board.port)
    emulated_board.faults.reset()
    assert get(emulated_board.port, "kp")["kp"]["value"] == 700


def test_defaults_undo_changes(emulated_board):
    mrl("config", "set", "kp", "800", "--yes", "--port", emulated_board.port)
    assert mrl("config", "defaults", "--yes", "--port", emulated_board.port).returncode == 0
    assert get(emulated_board.port, "kp")["kp"]["value"] == 700


def test_defaults_are_those_of_the_robots_own_file(emulated_board, tmp_path):
    """The firmware knows only the packaged models; with their gearbox, another robot drives at the wrong speed."""
    own = tmp_path / "own.yaml"
    text = Path(models.__file__).with_name("traxbot.yaml").read_text()
    own.write_text(text.replace("gearbox: 437", "gearbox: 300"))
    to = "--robot", own, "--port", emulated_board.port
    assert mrl("config", "defaults", "--yes", *to).returncode == 0
    emulated_board.faults.reset()
    assert get(emulated_board.port, "gearbox")["gearbox"]["value"] == 300


def test_a_negative_value_is_not_taken_for_an_option(emulated_board):
    done = mrl("config", "set", "sonar_c", "-500", "--yes", "--port", emulated_board.port)
    assert done.stdout.endswith("to -500: saved\n"), done


def test_nothing_changes_unasked(emulated_board):
    line = fails(2, "config", "set", "kp", "800", "--port", emulated_board.port)
    assert "Change kp 700 to 800 on robot 1?" in line and "--yes" in line
    assert get(emulated_board.port, "kp")["kp"]["value"] == 700


def test_a_2013_board_keeps_nothing(serve):
    assert "mrl flash" in fails(11, "config", "get", "--port", serve(version=1).path)


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["kq", "1"], "parameter 'kq' is unknown, expected kp, ki, kd"),
        (["kp"], "'kp' has no value"),
        (["kp", "many"], "kp is 'many', expected a whole number from 0 to 32767"),
        (["kp", "1.5"], "kp is '1.5'"),
        (["kp", "-1"], "from 0 to 32767"),
        (["kp", "800", "--tyr", "1"], "parameter '--tyr' is unknown, expected"),
        (["bus_speed", "401"], "expected a whole number from 100 to 400 [kHz]"),
        (["kp", "1", "kp", "2"], "given twice"),
        (["robot_id", "3"], "mrl set-id"),
        (
            ["radio_hold", "14"],
            "radio_hold is 14, expected 0 or 15 to 300 [100 ms]: a holder counts an answer for",
        ),
    ],
)
def test_wrong_words_are_refused_before_the_port_is_opened(words, line):
    assert line in fails(2, "config", "set", "--port", "/dev/nowhere", *words)
