"""`mrl config` against an emulated board."""

import json
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrl_driver import yaml_file
from mrl_driver.driver import parameter_file
from mrl_driver.driver.parameter_file import SETTABLE, ParameterFile
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import BoardTimeout
from mrl_driver.protocol.table import PARAMETERS
from mrl_driver.robot import models
from sim_arduino.board import registry
from sim_arduino.serve import factory
from sim_arduino.testing import EmulatedBoard

from .run import fails, mrl


def get(port, *names):
    return {
        row["name"]: row for row in json.loads(mrl("config", "get", *names, "--json", "--port", port).stdout)
    }


def test_all_parameters_with_the_models_own(emulated_board):
    """All that a board with an OMNI-3MD uses."""
    found = get(emulated_board.port)
    assert list(found) == [row.name for row in PARAMETERS if row.capability in ("", "omni")]
    assert found["kp"]["value"] == found["kp"]["default"] == 700


@pytest.fixture
def duo():
    """Port of a board with an H-bridge."""
    with EmulatedBoard(robot="duo") as board:
        yield board.port


@pytest.mark.parametrize("words", [("get", "wiring"), ("set", "wiring", "1", "--yes")])
def test_a_parameter_of_other_boards_is_refused_with_what_to_do(emulated_board, words):
    line = fails(11, "config", *words, "--port", emulated_board.port)
    assert "no parameter wiring" in line and "capability bridge" in line and "mrl flash" in line


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


def test_defaults_are_those_of_the_robots_own_file(emulated_board, tmp_path):
    """The firmware knows only the packaged models; with their gearbox, another robot drives at the wrong speed."""
    own = tmp_path / "own.yaml"
    text = Path(models.__file__).with_name("traxbot.yaml").read_text()
    own.write_text(text.replace("gearbox: 437", "gearbox: 300"))
    to = "--robot", own, "--port", emulated_board.port
    assert mrl("config", "defaults", "--yes", *to).returncode == 0
    emulated_board.faults.reset()
    assert get(emulated_board.port, "gearbox")["gearbox"]["value"] == 300


def test_nothing_changes_unasked(emulated_board):
    line = fails(2, "config", "set", "kp", "800", "--port", emulated_board.port)
    assert "Change kp 700 to 800 on robot 1?" in line and "--yes" in line
    assert get(emulated_board.port, "kp")["kp"]["value"] == 700


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["kq", "1"], "parameter 'kq' is unknown, expected kp, ki, kd"),
        (["kp"], "'kp' has no value"),
        (["kp", "many"], "kp is 'many', expected a whole number from 0 to 32767"),
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


# -- files


def configured(port, *args):
    return mrl("config", *args, "--port", port)


@pytest.mark.parametrize(
    ("robot", "change"),
    [("traxbot", ("kp", "800", "sonar_c", "-500")), ("duo", ("bridge", "l298n", "ki", "9"))],
)
def test_a_loaded_dump_leaves_no_difference(robot, change, tmp_path):
    """After a reset."""
    file = str(tmp_path / "kept.yaml")
    with EmulatedBoard(robot=robot) as board:
        configured(board.port, "set", *change, "--yes")
        assert "parameters of robot" in configured(board.port, "dump", file).stdout
        configured(board.port, "defaults", "--yes")
        configured(board.port, "set", *change[:2], "--yes")
        differs = configured(board.port, "diff", file, "--json")
        assert differs.returncode == 1
        assert [row["name"] for row in json.loads(differs.stdout)] == [change[2]]
        assert configured(board.port, "load", file, "--yes").stdout.startswith(f"{change[2]} ")
        board.faults.reset()
        assert configured(board.port, "diff", file) == (
            0,
            f"robot {first_id(robot)} has the parameters of {file}\n",
            "",
        )


def first_id(robot):
    return models.load_packaged(robot).ids[0]


def dumped(robot_id, name, *capabilities, **values):
    """A file of a robot, with the defaults of its model and other values."""
    model = models.load_packaged(name)
    own = {row.name: {**models.COMMON_BOARD, **model.board}[row.name] for row in SETTABLE}
    used = {row.name: own[row.name] for row in SETTABLE if row.capability in ("", *capabilities)}
    return ParameterFile(robot_id, name, 2, 2, capabilities, {**used, **values})


def written(folder, file):
    path = folder / "robot.yaml"
    path.write_text(parameter_file.text_of(file))
    return str(path)


@pytest.mark.parametrize(
    ("file", "words"),
    [
        (dumped(2, "traxbot"), "is of robot 2 (traxbot), but this is robot 1 (traxbot); give --other-robot"),
        (dumped(1, "stingbot"), "is of robot 1 (stingbot), but this is robot 1 (traxbot)"),
        (dumped(1, "traxbot", "bridge"), "of a board with an H-bridge, but this board has a motor board"),
    ],
)
def test_a_file_of_another_robot_is_refused(emulated_board, tmp_path, file, words):
    assert words in fails(
        2, "config", "load", written(tmp_path, file), "--yes", "--port", emulated_board.port
    )


def test_parameters_of_another_robot_leave_the_cables_alone(duo, tmp_path):
    file = written(tmp_path, dumped(24, "duo", "bridge", kp=800, bridge=1, wiring=15))
    done = configured(duo, "load", file, "--other-robot", "--yes")
    assert done == (0, "kp 1600 to 800: saved\n", "mrl: the board keeps its own bridge, wiring\n")


def test_a_refused_parameter_puts_those_before_it_back(monkeypatch):
    handler = registry.REQUESTS["write_config"]

    def guarded(board, index, value):
        if PARAMETERS[index].name == "ki":
            board.refuse("argument_range")
        else:
            handler(board, index, value)

    monkeypatch.setitem(registry.REQUESTS, "write_config", guarded)
    with SteppedDriver(factory.make(factory.Options(robot="traxbot")).engine) as driver:
        with pytest.raises(BoardTimeout):
            driver.parameters.replace({"kp": 800, "ki": 900})
        assert driver.parameters.read("kp", "ki") == {"kp": 700, "ki": 400}


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("kp: ", "kq: ", "key parameters.kq is unknown, expected axis_radius, "),
        ("  kp:  ", "  # ", "key parameters.kp is missing"),
        (" 700 ", " 70000 ", "parameters.kp is 70000, expected a whole number from 0 to 32767"),
        ("tb6612", "tb6613", "parameters.bridge is 'tb6613', expected unset, vnh5019"),
        ("radio_hold:      0", "radio_hold:      3", "parameters.radio_hold is 3, expected 0 or 15 to 300"),
        ("robot_id: 1", "robot: 1", "key robot is unknown, expected robot_id, model"),
        ("[bridge, hold]", "7", "capabilities is 7, expected a list of names"),
        ("parameters:", "parameters: [", "no YAML"),
    ],
)
def test_a_wrong_file_is_refused_before_the_port_is_opened(tmp_path, old, new, words):
    text = parameter_file.text_of(dumped(1, "traxbot", "bridge", "hold", bridge=4))
    assert text.count(old) >= 1
    path = tmp_path / "wrong.yaml"
    path.write_text(text.replace(old, new, 1))
    assert words in fails(2, "config", "load", path, "--yes", "--port", "/dev/nowhere")


VALUES = {row.name: st.integers(row.low, row.high) for row in SETTABLE if row.name != "radio_hold"}


@given(
    st.builds(
        ParameterFile,
        robot_id=st.integers(0, 32767),
        model=st.text(st.characters(blacklist_categories=("Cs", "Cc")), min_size=1),
        firmware=st.integers(0, 9),
        protocol=st.integers(1, 2),
        capabilities=st.just(("bridge",)),
        values=st.fixed_dictionaries(VALUES),
    )
)
@settings(max_examples=30)
def test_a_file_reads_back_as_it_was(file):
    assert parameter_file.parse(yaml_file.parse(parameter_file.text_of(file), "f"), "f") == file
