"""`mrl doctor`: what it finds, what it advises, and that nothing moves unasked."""

import contextlib
import json
import math
from types import SimpleNamespace

import pytest

from mrl_driver.cli.commands import doctor
from mrl_driver.cli.doctor import board, computer, parameters, wheels
from mrl_driver.cli.doctor.findings import FAULT, NOTE, OK, WARNING
from mrl_driver.cli.doctor.wheels import Moved
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import PortMissing
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.protocol.table import FAULTS, PARAMETER_BY_NAME
from mrl_driver.recording.recording import Recording
from mrl_driver.robot import models
from mrl_driver.robot.hold import Hold
from mrl_driver.safety.wheel_monitor import DEAD, Mismatch
from mrl_driver.session.handshake import Board
from mrl_driver.session.session import Status
from mrl_driver.transport.link import SerialLink
from mrl_driver.transport.port_info import Port
from sim_arduino.serve import factory as boards
from tests.waiting import PATIENCE_S

from .run import fails, mrl
from .terminal import Terminal

TRAXBOT = models.load("traxbot")
GOOD = Board(1, 2, 1.72, 12.0, 25.0, 2, frozenset(["check", "watchdog", "period", "config", "sonars"]))
HEALTHY = Status(100, "power_on", "host", (), 0)


@pytest.fixture
def quick(monkeypatch):
    """Moments instead of seconds, and a link that is as slow as a busy machine makes it."""
    monkeypatch.setattr(board.watch, "__defaults__", (0.3, 5))
    monkeypatch.setattr(board, "MIN_SHARE", 0.0)
    monkeypatch.setattr(board, "SLOW_ROUND_TRIP_S", PATIENCE_S)
    monkeypatch.setattr(doctor, "FIRST_SONARS_S", PATIENCE_S)
    monkeypatch.setattr(wheels, "TURN_S", 0.6)


def levels(findings):
    return {finding.subject: finding.level for finding in findings}


def examine(*args):
    done = mrl("doctor", "--json", *args)
    found = json.loads(done.stdout)
    return done.returncode, {each["subject"]: each for each in found["findings"]}, found


def test_a_sound_robot_is_in_order_and_stands_still(quick, emulated_board, emulated_motors):
    code, findings, found = examine("--port", emulated_board.port)
    assert [each for each in findings.values() if each["level"] not in (OK, NOTE)] == []
    assert (code, found["verdict"]) == (0, "no problem found")
    assert {"permission", "robot", "firmware", "battery", "latency", "sonar front"} <= set(findings)
    assert not [each for each in emulated_motors.commands("move_differential") if any(each.values)]


def test_wheels_turn_one_after_the_other_when_asked(quick, emulated_board):
    _, findings, _ = examine("--drive", "--yes", "--port", emulated_board.port)
    assert findings["right wheel"]["level"] == findings["left wheel"]["level"] == OK
    assert emulated_board.true_speed_m_s == 0.0


def test_wheels_do_not_turn_without_an_answer(serve):
    port = serve()
    assert "wheels lifted" in fails(2, "doctor", "--drive", "--port", port.path)
    assert not port.received


def test_a_board_with_other_parameters_than_the_model_is_found(quick, serve):
    port = serve()
    port.board.parameters[PARAMETER_BY_NAME["gearbox"].number] = 300
    code, findings, found = examine("--port", port.path)
    assert code == 1 and found["facts"]["parameters"]["gearbox"] == 300
    assert findings["gearbox"]["advice"].startswith(
        f"if the model is right: mrl config set gearbox 437 --port {port.path};"
    )


def test_a_2013_board_gets_the_advice_to_flash_it(quick, serve):
    port = serve(version=1)
    code, findings, found = examine("--port", port.path)
    assert [each["subject"] for each in findings.values() if each["level"] not in (OK, NOTE)] == ["firmware"]
    assert (code, found["verdict"]) == (0, "1 warning; the robot can be used")
    assert findings["firmware"]["advice"] == f"upload the current firmware with: mrl flash --port {port.path}"


def test_an_id_that_is_not_set_is_told_and_the_rest_examined(quick, serve):
    code, findings, _ = examine("--port", serve(robot_id=0).path)
    assert code == 1 and "mrl set-id" in findings["board"]["advice"] and findings["battery"]["level"] == OK


def test_a_port_that_another_program_has_open_is_in_use(quick, serve):
    port = serve()
    with contextlib.closing(SerialLink(port.path)):
        code, findings, _ = examine("--port", port.path)
    assert code == 5 and findings["in use"]["level"] == FAULT


@pytest.mark.parametrize(("port", "code"), [("/dev/nowhere", 3), ("/", 3), (__file__, 3), ("/dev/null", 3)])
def test_a_port_that_is_none(port, code):
    done, findings, _ = examine("--port", port)
    assert done == code and findings["port"]["level"] == FAULT
    assert findings["port"]["advice"].startswith(("ports there", "there is no serial port"))


@pytest.mark.parametrize(("volts", "level"), [(12.0, OK), (8.9, WARNING), (8.4, FAULT), (0.3, FAULT)])
def test_battery(volts, level):
    assert levels(board.supply(GOOD._replace(battery_v=volts), TRAXBOT))["battery"] == level


@pytest.mark.parametrize("fault", [name for name, _ in FAULTS])
def test_each_fault_of_the_board_has_its_advice(fault):
    found = [each for each in board.health(HEALTHY._replace(faults=(fault,))) if each.level == FAULT]
    assert len(found) == 1 and found[0].advice
    assert "HC-SR04" not in found[0].text or "HC-SR04" in found[0].advice


@pytest.mark.parametrize(
    ("reason", "level"),
    [("host", None), ("wheel_blocked", WARNING), ("encoder", WARNING), ("undervoltage", WARNING)],
)
def test_a_stop_that_needs_attention(reason, level):
    status = HEALTHY._replace(stop_reason=StopReason(reason))
    assert levels(board.health(status)).get("last stop") == level


@pytest.mark.parametrize(
    ("state", "level", "words"),
    [
        ("free", None, ""),
        ("held", WARNING, "radio 0013a20040a1b2c3 holds"),
        ("silent", WARNING, "and is silent"),
    ],
)
def test_a_robot_that_is_held_by_radio(state, level, words):
    found = list(board.hold(Hold(state, 1, 0, 0, 0x0013A20040A1B2C3)))
    assert levels(found).get("radio") == level
    assert all(words in each.text for each in found)


def test_a_battery_that_is_not_measured_is_not_empty():
    bare = GOOD._replace(battery_v=0.0, capabilities=GOOD.capabilities | {"no_battery"})
    assert levels(board.supply(bare, TRAXBOT))["battery"] == NOTE


@pytest.mark.parametrize(
    ("seen", "subject"),
    [
        (board.LinkFigures(30.0, 50.0, 0, {}, [0.003]), "telemetry"),
        (board.LinkFigures(50.0, 50.0, 2, {}, [0.003]), "damage"),
        (board.LinkFigures(50.0, 50.0, 0, {"noise": 3}, [0.003]), "damage"),
        (board.LinkFigures(50.0, 50.0, 0, {}, [0.001, 0.08, 0.09]), "latency"),
    ],
)
def test_a_poor_link(seen, subject):
    found = levels(board.link(seen))
    assert found.pop(subject) == WARNING and set(found.values()) == {OK}


@pytest.mark.parametrize(
    "state, level, words",
    [
        ("in use", OK, "-1.50 deg/s"),
        ("learning bias", WARNING, "stand still"),
        ("off", NOTE, "not read"),
        ("silent", FAULT, "A4 (SDA)"),
        ("tilted", FAULT, "mrl calibrate imu"),
        ("absent", FAULT, "no IMU any more"),
        ("waiting", FAULT, "A4 (SDA)"),
    ],
)
def test_the_use_of_an_imu(state, level, words):
    reading = SimpleNamespace(bias_known=True, bias_rad_s=math.radians(-1.5))
    (found,) = board.gyro(SimpleNamespace(imu_state=state, imu=reading))
    assert found.level == level and words in found.text + found.advice


DUO = models.load("duo")


def compared(model, **values):
    """Findings for a board with the model's parameters but these, by subject."""
    found = parameters.check({**models.COMMON_BOARD, **model.board, **values}, model)
    return {each.subject: each for each in found}


@pytest.mark.parametrize("model", [TRAXBOT, DUO, models.load("omni")], ids=lambda model: model.name)
def test_a_board_with_the_parameters_of_its_model(model):
    assert [(each.subject, each.level) for each in compared(model).values()] == [("parameters", OK)]


@pytest.mark.parametrize(
    ("model", "values", "level", "words"),
    [
        (TRAXBOT, {"gearbox": 300}, FAULT, "the robot drives 31.4 % slower than commanded; if"),
        (TRAXBOT, {"encoder_counts": 672}, WARNING, "drives 5 % faster than commanded"),
        (TRAXBOT, {"axis_radius": 8787}, NOTE, "turns 1 % faster than commanded"),
        (DUO, {"axis_radius": 6000}, FAULT, "odometry gives turns 20 % too short"),
        (DUO, {"wheel_radius": 6500}, FAULT, "odometry gives distances 50 % too short"),
        (
            TRAXBOT,
            {"linear_ceiling": 200},
            WARNING,
            "commands up to 0.3 m/s, and the board drives at most 0.2 m/s",
        ),
        (TRAXBOT, {"kp": 800}, NOTE, "800 on the board, 700 in the model traxbot: the wheels follow"),
        (DUO, {"bridge": 3}, FAULT, "l298n on the board, tb6612 in the model duo"),
    ],
)
def test_a_parameter_that_differs_from_the_model(model, values, level, words):
    ((name, found),) = compared(model, **values).items()
    assert name in values and found.level == level and words in found.text


@pytest.mark.parametrize(
    "values, level, words",
    [({"sonar_a": 12250}, WARNING, "4.12 % long"), ({"sonar_b": 1}, FAULT, "99.2 % short")],
)
def test_another_curve_of_the_sonars(values, level, words):
    """100 cm are 109.6 counts by the model: 1.225 x 109.6^0.9466 - 0.376 is 104.1 cm, 1.1767 - 0.376 is 0.80 cm."""
    found = compared(TRAXBOT, **values)["sonars"]
    assert found.level == level and f"at 1 m ranges are {words}" in found.text


@pytest.mark.parametrize(
    ("right_m", "left_m", "words"),
    [
        (0.1, 0.0, "turns and counts forward"),
        (-0.1, 0.0, "counts backwards"),
        (0.0, 0.1, "the other wheel's counter moved"),
        (0.0, 0.0, "no counter moved"),
        (0.1, 0.1, "both counters moved"),
    ],
)
def test_what_the_counters_say_of_a_wheel(right_m, left_m, words):
    assert words in wheels.evaluate("right", Moved(right_m, left_m)).text
    assert words in wheels.evaluate("left", Moved(left_m, right_m)).text


def test_a_wheel_for_which_the_driver_stopped_the_robot_is_not_sound():
    """It had turned far enough before it was blocked."""
    found = wheels.evaluate("right", Moved(0.06, 0.0, Mismatch("right", DEAD, 0.013)))
    assert (found.level, found.code) == (FAULT, "wheel_dead")


def test_a_pause_of_this_computer_does_not_shorten_a_wheels_turn():
    class Paused(SteppedDriver):
        def wait(self, timeout_s=None):
            if not self.paused and self.now_s > self.start_s + wheels.TURN_S / 2:
                self.paused = True
                self.pause(wheels.TURN_S)
            return super().wait(timeout_s)

    def moved_m(paused):
        with Paused(boards.make(boards.Options(robot="traxbot")).engine) as robot:
            robot.start_s, robot.paused = robot.now_s, not paused
            return wheels.turn(robot, "left").left_m

    assert moved_m(paused=False) == pytest.approx(wheels.WHEEL_M_S * wheels.TURN_S, rel=0.2)
    assert moved_m(paused=True) >= 0.9 * moved_m(paused=False)


@pytest.mark.parametrize(
    ("place", "words"), [("left", "trigger chain"), ("range_1", "its wires to the board")]
)
def test_a_silent_sonar_has_the_remedy_of_its_kind(place, words):
    mounts = {"nose": models.SonarMount(0.0, 0.0, 0.0, place)}
    (found,) = board.sonars({"nose": math.nan}, GOOD, mounts)
    assert found.code == "sonar_dead" and words in found.advice


@pytest.mark.parametrize(
    ("ranges", "name"),
    [
        ({"front": 0.3, "left": 1.0, "right": math.inf}, "front"),
        ({"front": 1.0, "left": -math.inf, "right": 1.0}, "left"),
        ({"front": 0.3, "left": 0.4, "right": 1.0}, ""),
        ({"front": 0.5, "left": 0.65, "right": 1.0}, ""),
        ({"front": math.nan, "left": 0.3, "right": 1.0}, "left"),
        ({"front": 1.0, "left": 1.0, "right": 1.0}, ""),
    ],
)
def test_the_sonar_with_a_hand_before_it(ranges, name):
    assert wheels.nearest(ranges) == name


def test_the_users_eyes_overrule_the_counters(monkeypatch):
    monkeypatch.setattr(
        wheels, "turn", lambda driver, side: Moved(*((0.1, 0.0) if side == "right" else (0.0, 0.1)))
    )

    class Driver:
        battery_state = "ok"

    found = list(wheels.check(Driver(), lambda question: "left" in question))
    assert [(each.subject, each.level) for each in found] == [("right wheel", FAULT), ("left wheel", OK)]


def test_modem_manager_matters_to_usb_ports_alone(monkeypatch):
    monkeypatch.setattr(computer, "programs_named", lambda name: [1])

    def levels(port):
        return [each.level for each in computer.check(port.device, port) if each.subject == "ModemManager"]

    assert levels(Port("/dev/ttyS0")) == []
    copy = Port("/dev/ttyUSB7", (), 0x1A86, 0x7523)
    assert levels(copy) == [WARNING]
    monkeypatch.setattr(computer, "udev_properties", lambda device: {"ID_MM_DEVICE_IGNORE": "1"})
    assert levels(copy) == [OK]


def test_a_command_for_root_is_whole_in_a_folder_with_a_space(monkeypatch):
    """The shell must take the path of `mrl` as one word."""
    monkeypatch.setattr(computer, "programs_named", lambda name: [1])
    monkeypatch.setattr(computer.sys, "argv", ["/my robots/.venv/bin/mrl", "doctor"])
    copy = Port("/dev/ttyUSB7", (), 0x1A86, 0x7523)
    (found,) = (each for each in computer.check(copy.device, copy) if each.subject == "ModemManager")
    assert "sudo '/my robots/.venv/bin/mrl' system install" in found.advice


MOVES = [
    (("calibrate", "wiring"), "Each wheel turns forward"),
    (("calibrate", "gains"), "The robot turns in place"),
    (("calibrate", "sonar"), "The robot drives 1.80 m forward"),
    (("experiment", "power"), "drives by itself (power)"),
    (("goto", "1", "0"), "The robot drives by itself to 1 m, 0 m"),
]


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def motion_of(port):
    """Requests to the motors, without stops."""
    return [frame for frame in port.board.heard if frame.code in (9, 10, 11, 12) and any(frame.args)]


@pytest.mark.parametrize(("command", "question"), MOVES)
def test_nothing_moves_without_a_terminal_or_yes(serve, here, command, question):
    port = serve()
    unseen = ["--unseen"] if command[1] == "wiring" else []
    done = mrl(*command, *unseen, "--port", port.path)
    assert done.returncode == 2 and "give --yes to agree" in done.stdout + done.stderr
    assert question in done.stdout + done.stderr and motion_of(port) == []


@pytest.mark.parametrize(("command", "question"), MOVES)
def test_nothing_moves_after_a_no(serve, here, command, question):
    port = serve()
    terminal = Terminal(*command, "--port", port.path, folder=here)
    terminal.answer(question, "n")
    assert terminal.end() == 130 and motion_of(port) == []
    if command[0] != "experiment":
        assert b"mrl: the robot was not moved" in terminal.seen


def test_the_doctor_leaves_out_the_wheels_after_a_no(serve):
    port = serve()
    terminal = Terminal("doctor", "--drive", "--port", port.path)
    terminal.answer("Are the wheels lifted off the ground?", "maybe")
    terminal.answer("'maybe' is not one of 'y', 'yes', 'n', 'no'", "n")
    assert terminal.end() == 0 and motion_of(port) == [], terminal.seen.decode()
    assert b"telemetry" in terminal.seen and b"not checked" in terminal.seen


def test_a_speed_that_the_model_does_not_allow_is_said_to_be_limited(serve):
    done = mrl("drive", "--port", serve().path, "--linear", "5", "--angular", "1", "--for", "0.2", "--json")
    assert (
        "limited to --linear 0.3 m/s, --angular 0.06 rad/s: the model traxbot allows 0.3 m/s" in done.stderr
    )
    assert json.loads(done.stdout)["pose"]["x_m"] < 0.2


@pytest.fixture(params=["drive", "monitor", "record"])
def recording(request, serve, tmp_path):
    """A command that records for a moment, and its file."""
    file, port = tmp_path / "drive.mrl", serve()
    words = {
        "drive": ("drive", "--linear", "0.1", "--for", "0.2", "--record", file),
        "monitor": ("monitor", "--seconds", "0.2", "--record", file),
        "record": ("record", "--seconds", "0.2", file),
    }
    return (*words[request.param], "--port", port.path), file


def test_a_recording_is_not_replaced_without_a_question(recording):
    command, file = recording
    file.write_text("precious\n")
    assert "already exists. Replace it?" in fails(2, *command)
    terminal = Terminal(*command)
    terminal.answer("already exists. Replace it?", "n")
    assert terminal.end() == 130 and file.read_text() == "precious\n"


@pytest.mark.parametrize(
    "command",
    [
        "drive --linear 0.1 --for 1 --record old",
        "monitor --record old",
        "record old",
        "goto 1 0 --record old",
        "calibrate straight --record old",
        "measure -o old.json",
        "config dump old",
        "experiment power",
        "doctor --drive",
        "new rover --wheel-diameter 65 --separation 150 --no-encoders --wiring mrl_duo --bridge tb6612",
    ],
)
@pytest.mark.parametrize("yes", [[], ["--yes"]])
def test_a_port_that_is_missing_is_found_before_a_question_and_before_a_file_is_written(here, command, yes):
    for name in ("old", "old.json"):
        (here / name).write_text("precious\n")
    done = mrl(*command.split(), *yes, "--port", "/dev/nothing")
    assert (done.returncode, done.stderr.count("\n")) == (PortMissing.exit_code, command != "doctor --drive")
    assert "'/dev/nothing' does not exist" in done.stderr + done.stdout
    assert {each.read_text() for each in here.rglob("*") if each.is_file()} == {"precious\n"}


def test_a_recording_is_replaced_with_yes_and_an_empty_file_always(recording):
    command, file = recording
    file.touch()
    assert mrl(*command).returncode == 0 and list(Recording(str(file)))
    assert mrl(*command, "--yes").returncode == 0
