"""`mrl config` against an emulated board, robots by name, and `mrl new`."""

import json
import os
import pathlib
import re
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrl_driver import yaml_file
from mrl_driver.apps.calibration.wiring_check import BITS
from mrl_driver.driver import parameter_file
from mrl_driver.driver.parameter_file import SETTABLE, ParameterFile
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import BoardRefused, BoardTimeout
from mrl_driver.host import named_robots
from mrl_driver.protocol.table import BRIDGES, PARAMETERS
from mrl_driver.robot import models, wiring
from mrl_driver.session.events import Reply
from mrl_driver.transport.port_info import Port
from sim_arduino.board import handlers
from sim_arduino.serve import factory
from sim_arduino.testing import EmulatedBoard
from tests.calibration.kit import Kit

from .run import fails, mrl
from .terminal import Terminal


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


@pytest.mark.parametrize(
    "words",
    [
        ("drive", "--linear", "0.1", "--for", "1"),
        ("goto", "1", "0"),
        ("calibrate", "gains", "--yes"),
        ("measure", "--wheels-off-ground", "--yes"),
    ],
    ids=lambda words: words[0],
)
def test_a_board_without_wiring_is_refused_before_anything_moves(duo, words):
    mrl("config", "set", "wiring", "0", "--yes", "--port", duo)
    line = fails(11, *words, "--port", duo)
    assert "the board refuses to move: its bridge or its wiring is not set; store the robot's file" in line


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
    own = {**wiring.EMPTY, **models.COMMON_BOARD, **model.board}
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
    assert done == (0, "kp 1600 to 800: saved\n", "mrl: the board keeps its own bridge, wiring, pins\n")


def test_a_refused_parameter_puts_those_before_it_back(monkeypatch):
    handler = handlers.REQUESTS["write_config"]

    def guarded(board, index, value):
        if PARAMETERS[index].name == "ki":
            board.refuse("argument_range")
        else:
            handler(board, index, value)

    monkeypatch.setitem(handlers.REQUESTS, "write_config", guarded)
    with SteppedDriver(factory.make(factory.Options(robot="traxbot")).engine) as driver:
        with pytest.raises(BoardTimeout):
            driver.parameters.replace({"kp": 800, "ki": 900})
        assert driver.parameters.read("kp", "ki") == {"kp": 700, "ki": 400}


@pytest.mark.parametrize(("tried", "heard"), [({}, 800), ({"kp": 800}, 400)], ids=["stored", "tried before"])
def test_a_restart_between_two_parameters_saves_no_mixture(tried, heard):
    engine = factory.make(factory.Options(robot="traxbot")).engine
    with SteppedDriver(engine) as driver:
        driver.parameters.write(tried)
        driver.on_event(
            lambda event: isinstance(event, Reply) and heard in event.frame.args and engine.reset()
        )
        with pytest.raises(BoardRefused, match="expected"):
            driver.parameters.replace({"kp": 800, "ki": 900})
        engine.reset()
        assert driver.parameters.read("kp", "ki") == {"kp": 700, "ki": 400}


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("kp: ", "kq: ", "key parameters.kq is unknown, expected axis_radius, "),
        ("  kp:  ", "  # ", "key parameters.kp is missing"),
        (" 700 ", " 70000 ", "parameters.kp is 70000, expected a whole number from 0 to 32767"),
        ("tb6612", "tb6613", "parameters.bridge is 'tb6613', expected unset, vnh5019"),
        (
            "radio_hold:          0",
            "radio_hold:          3",
            "parameters.radio_hold is 3, expected 0 or 15 to 300",
        ),
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


def write(text):
    os.makedirs(os.path.dirname(named_robots.path()), exist_ok=True)
    with open(named_robots.path(), "w", encoding="utf-8") as file:
        file.write(text)


@pytest.fixture
def link(serve, tmp_path):
    """A link that leads to robot 1, as udev's of an adapter whose serial number another one has, too."""
    path = tmp_path / "usb-1a86"
    path.symlink_to(serve(robot_id=1).path)
    return path


def lead_to_robot_2(link, serve):
    link.unlink()
    link.symlink_to(serve(robot_id=2).path)


@pytest.mark.parametrize("given", [(), ("--id", 1)], ids=["asked", "given"])
def test_a_name_never_stands_for_another_board_that_its_port_leads_to(link, serve, given):
    assert "lab3 is robot 1 on" in mrl("names", "add", "lab3", "--port", link, *given).stdout
    assert json.loads(mrl("--robot", "lab3", "info", "--json").stdout)["robot_id"] == 1
    lead_to_robot_2(link, serve)
    line = fails(8, "--robot", "lab3", "drive", "--linear", 0.1, "--for", 0.1)
    assert "robot id 2 answers, expected 1: another board is on this port" in line


def test_another_id_for_the_board_is_the_names_from_then_on():
    with EmulatedBoard() as board:
        mrl("names", "add", "lab3", "--port", board.port)
        assert named_robots.read()["lab3"].id == 1
        assert mrl("--robot", "lab3", "set-id", 2, "--yes").returncode == 0
    assert named_robots.read()["lab3"].id == 2


@pytest.mark.parametrize(("there", "code"), [(0, 0), (1, 2)])
def test_only_a_board_that_has_an_id_is_changed_after_a_question(there, code):
    with EmulatedBoard(robot_id=there) as board:
        assert mrl("set-id", 1, "--port", board.port).returncode == code


CP2102 = Port("/dev/ttyUSB0", ("/dev/serial/by-id/usb-Silicon_Labs-if00",), 0x10C4, 0xEA60, "0001")
FTDI = Port("/dev/ttyUSB0", ("/dev/serial/by-id/usb-FTDI_A50285BI-if00",), 0x0403, 0x6001, "A50285BI")


@pytest.mark.parametrize(
    ("there", "promises"),
    [
        ([FTDI], True),
        ([CP2102], False),
        ([FTDI, FTDI._replace(device="/dev/ttyUSB1")], False),
        ([FTDI._replace(serial=None)], False),
    ],
    ids=["own number", "number of all", "number of two", "no number"],
)
def test_a_name_promises_every_socket_only_if_the_serial_number_is_the_boards_own(
    monkeypatch, there, promises
):
    monkeypatch.setattr("mrl_driver.transport.port_info.described", lambda: there)
    done = mrl("names", "add", "lab3", "--port", "/dev/ttyUSB0", "--id", "3")
    assert (", wherever it is plugged in" in done.stdout) is promises
    assert named_robots.read()["lab3"].port == (FTDI.links[0] if promises else "/dev/ttyUSB0")


def test_an_explicit_port_wins_over_the_name_and_the_name_over_the_environment(monkeypatch):
    write("lab3: {port: /dev/one}\n")
    monkeypatch.setenv("MRL_PORT", "/dev/two")
    assert "'/dev/one' does not exist" in fails(3, "info", "--robot", "lab3")
    assert "'/dev/three' does not exist" in fails(3, "info", "--robot", "lab3", "--port", "/dev/three")
    assert "'/dev/two' does not exist" in fails(3, "info")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("lab3: {prot: /dev/one}\n", "key lab3.prot is unknown, expected port, model, baud, id"),
        ("lab3: {model: traxbot}\n", "key lab3.port is missing"),
        ("lab3: {port: 7}\n", "lab3.port is 7, expected a serial port"),
        ("lab3: {port: /dev/one, baud: fast}\n", "lab3.baud is 'fast', expected a whole number from 300"),
        ("lab3: {port: /dev/one, baud: .nan}\n", "lab3.baud is nan"),
        ("lab3: {port: /dev/one, id: 0}\n", "lab3.id is 0"),
        ("lab3: /dev/one\n", "lab3 is '/dev/one', expected a mapping"),
        ("- lab3\n", "expected a mapping of names, each with a port"),
        ("traxbot: {port: /dev/one}\n", "name 'traxbot' is a robot model"),
        ("'a b': {port: /dev/one}\n", "name is 'a b'"),
        ("lab3: {port: [\n", "no YAML"),
        pytest.param("[" * 5000, "no YAML", id="deep"),
    ],
)
def test_a_wrong_file_names_key_value_and_what_was_expected(text, words):
    write(text)
    line = fails(2, "info", "--robot", "lab3")
    assert words in line and named_robots.path() in line


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (["auto", "--port", "/dev/one"], "is a robot model"),
        (["3lab", "--port", "/dev/one"], "name is '3lab'"),
        (["lab3", "--port", " "], "--port is ' '"),
        (["lab3", "--port", "/dev/one", "--baud", "1"], "1, expected 300 to 4000000"),
        (["lab3", "--port", "/dev/one", "--model", "nix"], "robot 'nix' is unknown"),
    ],
)
def test_nothing_wrong_gets_into_the_file(args, words):
    assert words in fails(2, "names", "add", *args)
    assert not os.path.exists(named_robots.path())


ROVER = [
    "--wheel-diameter",
    "65",
    "--separation",
    "150",
    "--counts",
    "11x4x34",
    "--wiring",
    "mrl_duo",
    "--bridge",
    "TB6612",
    "--file-only",
]


def test_a_new_robot_has_no_id_of_another_one():
    assert "--id is 23, the id of duo, expected a free one, such as 11" in fails(
        2, "new", "rover", *ROVER, "--id", 23
    )


def test_a_bridge_that_coasts_is_named_if_nothing_measures_the_speed():
    chosen = [*ROVER[:4], "--wiring", "ardumoto", "--no-encoders", "--file-only", "--yes"]
    assert "without encoders slow commands drive much too fast" in mrl("new", "rover", *chosen).stderr


def test_the_options_make_a_robot_that_all_programs_know():
    done = mrl("new", "rover", *ROVER, "--yes")
    assert done.returncode == 0 and "all programs know the robot as --robot rover" in done.stdout
    model = models.load("rover")
    assert (model.ids, BRIDGES[model.board["bridge"]]) == ((11,), "tb6612")


def test_the_list_of_pins_has_that_of_the_batterys_divider():
    assert "  battery's divider     A3\n" in mrl("new", "rover", *ROVER, "--yes").stdout


def test_range_sensors_come_with_their_pins():
    own = ["--pin", "sonar_front=-", "--pin", "sonar_left=-", "--pin", "sonar_trigger=-"]
    sonars = ["--sonar", "front=hc-sr04:12,A0", "--sonar", "rear=GP2Y0A02:A1"]
    done = mrl("new", "rover", *ROVER, *own, *sonars, "--yes")
    assert done.returncode == 0 and "the places of the range sensors are assumed" in done.stdout
    assert "  front trigger         D12\n" in done.stdout
    model = models.load("rover")
    assert {name: each[3:5] for name, each in model.sonars.items()} == {
        "front": ("range_1", "HC-SR04"),
        "rear": ("range_2", "GP2Y0A02"),
    }
    pins = [model.board[f"pin_range_{name}"] for name in ("1_trigger", "1_echo", "2_trigger", "2_echo")]
    assert pins == [12, 14, -1, 15]


def asked(terminal, *steps):
    """Answers question after question; each comes with a picture, or an empty text."""
    for question, picture, answer in steps:
        terminal.answer(question, answer)
        assert picture in terminal.seen
    assert terminal.end() == 0, terminal.seen.decode()


def test_questions_come_with_a_picture(tmp_path):
    terminal = Terminal("new", "--file-only", folder=tmp_path)
    asked(
        terminal,
        ("Name of the robot", b"", "rover"),
        ("Wheel diameter [mm]", b"measure across the tyre", "6.5"),  # centimetres by mistake
        ("expected 10 to 650", b"", "65"),
        ("Wheel separation [mm]", b"from the middle of one tyre", "150"),
        ("Counts of a wheel turn", b"Counts of a wheel turn = lines x 4 x ratio", "0"),
        ("expected a number from 4 to 100000", b"", "11x4x34"),
        ("Which wiring?", b"L298N module with PWM on its enables: ENA D9", "mrl_duo"),
        ("Which H-bridge drives the motors?", b"modules with an L298N", "l298n"),
        ("1496 counts a turn, L298N, with robot id 11?", b"", "y"),
    )
    assert b"EN                    D5           D11" in terminal.seen
    assert b"mega_four_wheels" not in terminal.seen
    assert models.load("rover").board["bridge"] == BRIDGES.index("l298n")


def test_pins_are_asked_one_by_one_and_again_where_they_conflict(tmp_path):
    facts = [*ROVER[:6], "--wiring", "own", "--bridge", "l298n_enable", "--file-only"]
    terminal = Terminal("new", "rover", *facts, folder=tmp_path)
    asked(
        terminal,
        ("Which Arduino?", b"", "uno"),
        ("Are devices on the I2C bus", b"|        |---- motor        pin ----- A", "y"),
        ("left motor, EN", b"", "8"),
        ("no timer makes it on this pin", b"", "9"),
        ("left motor, IN1", b"", "-"),
        ("needs this pin", b"", "8"),
        ("left motor, IN2", b"", "9"),
        ("left_logic is on D9, as left_pwm_a", b"", "7"),
        ("left encoder, A", b"", "2"),
        ("left encoder, B", b"", ""),
        ("right motor, EN", b"", "10"),
        ("right motor, IN1", b"", "d5"),
        ("right motor, IN2", b"", "4"),
        ("right encoder, A", b"", "A4"),
        ("the I2C bus is in use", b"", "3"),
        ("right encoder, B", b"", "-"),
        ("enable of its own", b"", "12"),
        ("enable of its own", b"", ""),
        ("servo 1", b"", "x"),
        ("servo 1 is 'x', expected a pin", b"", "13"),
        ("servo_1 is on D13: servo pulses need an output", b"", "-"),
        ("divider of the battery's voltage", b"", "A0"),
        ("Are there range sensors", b"", "y"),
        ("Range sensor, front", b"1 VO ----- analog pin, and 100 kOhm to GND", "hc-sr04"),
        ("front HC-SR04, TRIG", b"", "11"),
        ("front HC-SR04, ECHO", b"", "-"),
        ("the sensor needs this pin", b"", "A0"),
        ("range_1_echo is on A0, as battery", b"", "A3"),
        ("Range sensor, left", b"", "GP2Y0A21"),
        ("left GP2Y0A21, VO", b"", "6"),
        ("the function needs an analog input", b"", "-"),
        ("the sensor needs this pin", b"", "13"),
        ("the function needs an analog input", b"", "A1"),
        *((f"Range sensor, {place}", b"", "") for place in ("right", "rear", "rear left", "rear right")),
        ("bumpers, cliff sensors or an emergency stop", b"", "y"),
        ("bumper left", b"cuts the motors' power", "A0"),
        ("bumper_left is on A0, as battery", b"", "6"),
        *((name, b"", "") for name in ("bumper right", "bumper rear", "cliff left", "cliff right")),
        ("emergency stop", b"", "A2"),
        ("with robot id 11?", b"", "y"),
    )
    found = wiring.of_board(models.load("rover").board)
    own = [9, 8, 7, 10, 5, 4, 2, -1, 3, -1, -1, -1, -1, -1, -1, 14, 12, -1, 1]
    assert list(found.values())[: len(own)] == own
    assert [found[name] for name in wiring.STOP_INPUTS] == [6, -1, -1, -1, -1, 16]
    assert [(name, each.input, each.type) for name, each in models.load("rover").sonars.items()] == [
        ("front", "range_1", "HC-SR04"),
        ("left", "range_2", "GP2Y0A21"),
    ]


def test_what_an_option_gives_is_the_default_of_its_question(tmp_path):
    given = {"left_pwm_a": "5", "left_encoder_b": "A3", "battery": "A0", "bumper_rear": "A1"}
    pins = [word for pair in given.items() for word in ("--pin", "=".join(pair))]
    facts = [*ROVER[:6], "--wiring", "own", "--bridge", "cytron", "--board", "uno", "--i2c", "--servo", "10"]
    terminal = Terminal("new", "rover", *facts, *pins, "--file-only", folder=tmp_path)
    needed = ("left motor, DIR", b"", "4"), ("left encoder, A", b"", "2"), ("left encoder, B", b"", "")
    asked(
        terminal,
        ("Are devices on the I2C bus", b"", ""),
        *(("left motor, PWM", b"", ""), ("left motor, brake", b"", ""), *needed),
        *(("right motor, PWM", b"", "6"), ("right motor, brake", b"", ""), ("right motor, DIR", b"", "7")),
        *(("right encoder, A", b"", "3"), ("right encoder, B", b"", "8")),
        *((name, b"", "") for name in ("enable of its own", "enable of its own", "servo 1", "servo 2")),
        *(
            (name, b"", "")
            for name in ("divider of the", "Are there range", "bumpers, cliff sensors or an emergency")
        ),
        *((name.replace("pin_", "").replace("_", " "), b"", "") for name in wiring.STOP_INPUTS),
        ("with robot id 11?", b"", "y"),
    )
    found = wiring.of_board(models.load("rover").board)
    names = [f"pin_{name}" for name in (*given, "servo_1")]
    assert [found[name] for name in names] == [5, 17, 14, 15, 10] and found["i2c"] == 1


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("rover", *ROVER), "Write .* stdin is not a terminal; give --yes to agree"),
        (
            ("rover", "--yes", "--file-only", *ROVER[:6]),
            r"Which wiring. stdin is not a terminal; give --wiring \(or --pin\) with one of arduino_motor_shield_r3",
        ),
        (
            ("rover", "--yes", "--file-only", *ROVER[:8]),
            "Which H-bridge drives the motors. stdin is not a terminal; give --bridge",
        ),
        (
            ("rover", "--yes", *ROVER, "--pin", "battery=D7"),
            "battery is on D7, as left_logic: another function has the same pin; nothing was written",
        ),
        (("rover", "--yes", *ROVER, "--pin", "left_logic=A4"), "left_logic is on A4: the I2C bus is in use"),
        (
            ("rover", "--yes", *ROVER, "--pin", "left_encoder_b=-"),
            "rover.yaml: wiring has right_encoder_b, but not left_encoder_b, expected all or none",
        ),
        (
            ("rover", "--yes", *ROVER, "--counts", "100000"),
            "give 51 mm/s at most, expected at least 65: the board cannot control that",
        ),
        (
            ("rover", "--yes", *ROVER, "--pin", "battery=A7"),
            "--pin battery is 'A7', expected a pin of the Uno or Nano: D0 to D13 or A0 to A5",
        ),
        (
            ("rover", "--yes", *ROVER, "--pin", "5"),
            "--pin is '5', expected NAME=PIN with one of left_pwm_a, ",
        ),
        (
            ("rover", "--yes", *ROVER, "--servo", "3"),
            "servo_1 is on D3, as right_pwm_b: another function has the same pin; nothing was written",
        ),
        (
            ("rover", "--yes", *ROVER, "--servo", "A3", "--pin", "battery=-"),
            "servo_1 is on A3: servo pulses need .* .D9, D10.",
        ),
        (
            (
                "rover",
                "--yes",
                *ROVER,
                "--servo",
                "10",
                "--pin",
                "right_encoder_b=-",
                "--pin",
                "right_pwm_a=9",
            )
            + (
                "--pin",
                "right_logic=-",
            )
            + ("--bridge", "bts7960"),
            "servo_1 is on D10: servo pulses need an output of a 16-bit timer that makes no PWM for a motor",
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
        (("rover", *ROVER, "--yes", "--no-encoders"), "--counts has no use with --no-encoders; leave one"),
        (("rover", *ROVER, "--yes", "--wheelbase", "90"), "--wheelbase has no use with --kind differential"),
        (
            ("rover", "--yes", *ROVER, "--sonar", "front=hc-sr04:A0"),
            "--sonar is 'front=hc-sr04:A0', expected PLACE=TYPE:PINS, such as front=hc-sr04:A0,A1 .trigger, echo.",
        ),
        (
            ("rover", "--yes", *ROVER, "--sonar", "left=gp2y0a21:A0"),
            "range_1_echo is on A0, as sonar_front: another function has the same pin; nothing was written",
        ),
        (
            ("rover", "--yes", *ROVER)
            + tuple(
                word
                for place in ("front", "left", "right", "rear")
                for word in ("--sonar", f"{place}=gp2y0a02:A3")
            ),
            "rear GP2Y0A02 is one range sensor too many: the Uno or Nano has inputs for 3",
        ),
        (
            ("rover", "--yes", *ROVER, "--board", "mega"),
            "board is the Mega 2560, but --wiring is for the Uno or Nano; give --wiring own to be asked for each",
        ),
        (("rover", "--yes", *ROVER, *3 * ("--servo", "9")), "--servo names 3 pins, expected at most 2"),
    ],
)
def test_wrong_answers_are_refused_in_one_line(words, line):
    assert re.search(line, fails(2, "new", *words))
    assert "rover" not in models.names()


def test_a_missing_board_is_told_before_the_questions(monkeypatch):
    """Nothing is asked, although most answers are missing."""
    monkeypatch.setattr("mrl_driver.transport.port_info.facts", list)
    line = fails(2, "new", "rover")
    assert "no board made by Arduino is plugged in" in line
    assert "without a board, --file-only writes the robot's file" in line


@pytest.mark.parametrize("board, offered", [("uno", "arduino_motor_shield_r3, .*, own"), ("mega", "own")])
def test_only_wirings_of_the_board_are_offered(board, offered):
    line = fails(2, "new", "rover", "--yes", "--file-only", *ROVER[:6], "--board", board)
    assert re.search(f"with one of {offered}$", line)


def test_a_robot_that_exists_is_not_replaced():
    mrl("new", "rover", *ROVER, "--yes")
    path = os.path.join(models.own_folder(), "rover.yaml")
    before = pathlib.Path(path).read_text()
    line = fails(2, "new", "rover", *ROVER, "--yes", "--separation", "200")
    assert "already exists; give another name, delete it to begin again, or go on with: " in line
    assert f"mrl calibrate wiring --robot {path}" in line
    assert pathlib.Path(path).read_text() == before


def test_the_next_command_can_be_copied_if_the_path_has_a_space(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "a b"))
    mrl("new", "rover", *ROVER, "--yes")
    path = os.path.join(models.own_folder(), "rover.yaml")
    assert f"--robot '{path}' --port" in fails(2, "new", "rover", *ROVER, "--yes")


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
