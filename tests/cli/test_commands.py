"""The command `mrl`: the robot on a port, its radio, bad input, signals, keys, and its help."""

import errno
import io
import json
import os
import pathlib
import re
import shlex
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from unittest import mock

import click
import pytest
from click.shell_completion import BashComplete

from mrl_driver.apps.review import drive_data
from mrl_driver.cli import main
from mrl_driver.cli.commands import progress
from mrl_driver.cli.commands.radio import print_nodes, print_texts
from mrl_driver.driver import Driver
from mrl_driver.driver.recorded import RecordedDriver
from mrl_driver.driver.recording_summary import summarise
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import ConfigError, OutputError
from mrl_driver.recording.recording import Recording
from mrl_driver.robot import models
from mrl_driver.robot.radio import BROADCAST, text_request
from mrl_driver.session.polling import STATUS
from mrl_driver.terminal import keyboard
from mrl_driver.terminal.teleop_keys import HOLD_S, LINEAR_M_S, Teleop
from tests.models import model
from tests.radio_board import PEER, Engine, RadioBoard
from tests.waiting import PATIENCE_S, wait_until

from .run import fails, mrl
from .terminal import MRL, Terminal


def test_info_prints_json(serve):
    facts = json.loads(mrl("info", "--port", serve().path, "--json").stdout)
    assert facts["robot"] == "traxbot" and facts["battery_v"] == 12.0 and facts["protocol_version"] == 2


def test_info_does_not_mind_an_empty_battery(serve):
    port = serve()
    port.board.battery = 20
    assert json.loads(mrl("info", "--port", port.path, "--json").stdout)["battery_v"] == 0.2


def test_a_timed_drive_ends_where_it_should(serve):
    port = serve()
    done = mrl("drive", "--port", port.path, "--linear", "0.2", "--for", "0.5")
    assert done.returncode == 0
    assert float(done.stdout.split()[1]) == pytest.approx(0.1, abs=0.03)
    assert port.board.speeds == (0, 0)


@pytest.mark.emulated_board(imu=True, imu_seed=3)
def test_a_timed_drive_begins_when_the_bias_of_the_gyro_is_known(emulated_board):
    done = mrl("drive", "--port", emulated_board.port, "--angular", "0.5", "--for", "0.2", "--json")
    assert json.loads(done.stdout)["imu"]["state"] == "in use"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGQUIT])
def test_a_signal_stops_the_robot_first(serve, number):
    port = serve()
    command = [*MRL, "drive", "--port", port.path, "--linear", "0.1", "--for", "60"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    wait_until(lambda: port.board.speeds == (100, 0))
    process.send_signal(number)
    _, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == (130 if number == signal.SIGINT else 143)
    wait_until(lambda: port.board.speeds == (0, 0))  # the board reads what was sent before the end
    assert port.board.heard[-1].code != 11
    assert "Traceback" not in err


def test_ctrl_c_says_that_the_robot_was_stopped(serve, monkeypatch):
    monkeypatch.setattr("mrl_driver.cli.commands.drive.drive_for", mock.Mock(side_effect=KeyboardInterrupt))
    done = mrl("drive", "--port", serve().path, "--linear", "0.1", "--for", "60")
    assert (done.returncode, done.stderr.strip()) == (130, "mrl: interrupted; the robot was stopped")


def test_ctrl_c_again_does_not_interrupt_the_close(serve, monkeypatch):
    """Nor does it while it is held; after the close it has its effect again."""
    close = Driver.close
    monkeypatch.setattr(Driver, "close", lambda self: (signal.raise_signal(signal.SIGINT), close(self)))
    assert mrl("info", "--port", serve().path).returncode == 0
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.parametrize("shown", [progress.waiting("asking"), progress.progress("asking", 2)])
def test_the_cursor_stays_visible_while_a_program_waits(shown, monkeypatch):
    """Ctrl-Z would leave it hidden."""
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr("sys.stderr", screen := io.StringIO())
    screen.isatty = lambda: True
    with shown:
        text = screen.getvalue()
    assert text.rindex("\x1b[?25h") > text.rindex("\x1b[?25l")


def is_suspended(process):
    """Whether the kernel has stopped the process."""
    return Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()[0] == "T"


def test_a_program_that_is_suspended_has_stopped_the_robot(serve):
    """As by Ctrl-Z; boards of 2013 would drive on."""
    port = serve(version=1)
    command = [*MRL, "drive", "--port", port.path]
    process = subprocess.Popen(
        [*command, "--linear", "0.1", "--for", "60"],
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
    )
    wait_until(lambda: port.board.speeds == (100, 0))
    process.send_signal(signal.SIGTSTP)
    wait_until(lambda: is_suspended(process))
    wait_until(lambda: port.board.speeds == (0, 0))  # a suspended program sends nothing more
    process.send_signal(signal.SIGCONT)
    _, err = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, port.board.speeds) == (10, (0, 0))
    assert "stopped early" in err


@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", "<&- >&- 2>&-"])
def test_a_program_with_closed_streams_watches_a_robot(serve, closed):
    """As some services start programs.  The port must not get the number of a stream: the board would get messages."""
    port = serve()
    command = [*MRL, "monitor", "--port", port.path, "--seconds", "1"]
    done = subprocess.run(["sh", "-c", f'exec "$@" {closed}', "sh", *command], timeout=PATIENCE_S)
    assert done.returncode == 0 and b"battery" not in port.received


def is_watched(port):
    """Whether a program is done with the greeting: it asks a robot that is ready for its status again and again."""
    return sum(frame.code == STATUS for frame in port.board.heard) > 2


def test_unplugging_has_its_own_exit_code(serve):
    port = serve()
    command = [*MRL, "monitor", "--port", port.path, "--no-reconnect"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    wait_until(lambda: is_watched(port))
    port.unplug()
    _, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 6 and err.count("\n") == 1 and "went away" in err


def test_monitor_finds_a_robot_again_that_was_unplugged(serve, tmp_path):
    """One line when it is lost, one when it is found, one of the way in between; the recording has both ports."""
    link, log = str(tmp_path / "robot"), str(tmp_path / "log")
    port = serve()
    os.symlink(port.path, link)
    command = [*MRL, "record", "--port", link, log]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    wait_until(lambda: is_watched(port))
    os.remove(link)
    port.unplug()
    lost = process.stderr.readline()
    again = serve()
    os.symlink(again.path, link)
    found, way = process.stderr.readline(), process.stderr.readline()
    process.send_signal(signal.SIGINT)
    _, rest = process.communicate(timeout=PATIENCE_S)
    assert "went away" in lost and f"the robot answers again, on {link}" in found
    assert "the wheels could not be followed" in way
    assert (rest, process.returncode) == ("", 0)
    assert [entry.data for entry in Recording(log)].count(b"opened " + link.encode()) == 2


@pytest.mark.parametrize(
    "words, expected",
    [
        ("info", "--port is missing"),
        ("info --port /dev/null --robot nix", f"a model ({', '.join(models.packaged())})"),
        ("info --baud fast", "'fast', expected a whole number"),
        ("set-id 0 --port /dev/null", "0, expected 1 to 32767"),
        ("set-id 99 --port /dev/null", "no packaged model lists robot id 99"),
        ("set-id 4 --robot traxbot --port /dev/null", "expected 1, 2, 3"),
        ("monitor --seconds=0", "0.0, expected above 0;"),
        ("tip-over x --slope=90", "90.0, expected at least 0 and below 90;"),
        ("radio discover --seconds=0", "0.0, expected above 0 and at most 60;"),
        ("calibrate straight --distance=nan", "nan, expected 0.3 to 20"),
        *(
            (f"drive --port /dev/null --linear={each} --for=1", "expected -100 to 100")
            for each in ("nan", "-inf")
        ),
        *(
            (f"drive --port /dev/null --linear=0.1 --for={each}", "expected above 0 and")
            for each in ("0", "1e9")
        ),
        ("drive --port /dev/null", "not a terminal"),
        ("inof", "see: mrl"),
    ],
)
def test_words_that_cannot_be_meant_are_one_line(words, expected):
    assert expected in fails(2, *words.split())


def test_a_port_that_is_not_there():
    assert "does not exist" in fails(3, "info", "--port", "/dev/nowhere")


def test_a_busy_port(serve):
    port = serve()
    command = [*MRL, "monitor", "--port", port.path]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    wait_until(lambda: port.board.period_s is not None)
    assert f"process {process.pid}" in fails(5, "info", "--port", port.path)
    process.terminate()
    process.wait(PATIENCE_S)


def test_an_empty_battery_can_be_overridden(serve):
    port = serve()
    port.board.battery = 840
    drive = ["drive", "--port", port.path, "--linear", "0.1", "--for", "0.2"]
    assert "--ignore-battery" in fails(9, *drive)
    assert mrl(*drive, "--ignore-battery").returncode == 0


def test_driving_in_a_terminal_without_a_full_screen_says_so():
    terminal = Terminal("drive", "--port", "/dev/null", term="dumb")
    assert terminal.end() == 2 and b"TERM is dumb" in terminal.seen


@pytest.mark.parametrize(
    ("data", "keys"),
    [
        (b"\x1b[A\x1bOD", ["up", "left"]),
        (b"wQ ", ["w", "q", "space"]),
        (b"\x1b", ["escape"]),
        (b"\x1b[1;2D\x1b[H\x1b[[A", ["\x1b[1;2d", "\x1b[h", "\x1b[[a"]),
        (b"\xff", ["\ufffd"]),
    ],
)
def test_keys(data, keys):
    assert keyboard.split(data) == keys


def was_driven(port):
    """Whether the board has had the speed of the keys; it may have stopped since."""
    return any(frame.code == 11 and frame.args[:2] == (250, 0) for frame in port.board.heard)


def test_driving_with_the_keyboard(serve):
    """A whole session: a key that is let go of stops the robot.  Ctrl-Z would leave a terminal that shows no input."""
    port = serve()
    terminal = Terminal("drive", "--port", port.path)
    try:
        terminal.wait_for("asked")
        terminal.press(b"\x1a")
        wait_until(lambda: terminal.press(b"\x1b[A") or was_driven(port), step_s=0.1)
        wait_until(lambda: port.board.speeds == (0, 0))
        terminal.press(b"wq")
    except BaseException:
        terminal.end(signal.SIGKILL)
        raise
    assert terminal.end() == 0 and port.board.speeds == (0, 0)


def test_a_terminal_that_takes_no_more_output_stops_the_robot(serve):
    """Ctrl-S, or a connection that hangs: the view waits, and nobody knows whether the key is still held."""
    port = serve()
    terminal = Terminal("drive", "--port", port.path)
    try:
        terminal.wait_for("asked")
        terminal.press(b"\x1b[A")
        wait_until(lambda: port.board.speeds == (250, 0))
        terminal.stalled.set()
        wait_until(lambda: port.board.speeds == (0, 0))
    finally:
        terminal.end(signal.SIGKILL)


@pytest.mark.parametrize(
    "command", [("drive", "--linear", "0.1", "--for", "0.2"), ("monitor", "--seconds", "0.2")]
)
def test_a_2013_board_is_warned_of(serve, command):
    result = mrl(*command, "--port", serve(version=1).path)
    assert result.returncode == 0
    assert "mrl: warning: board firmware 1 (2013) has no watchdog: the robot drives on when" in result.stderr


def test_a_blocked_wheel_has_its_own_exit_code(serve):
    port = serve()
    port.board.dead = {"left"}
    line = fails(14, "drive", "--linear", "0.2", "--for", "20", "--port", port.path)
    assert "left wheel" in line and "blocked" in line


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError(errno.EMFILE, "Too many open files"), "too many files open"),
        (RuntimeError("can't start new thread"), "no thread can be started"),
        (MemoryError(), "no memory is left"),
    ],
)
def test_a_computer_at_its_limits_is_named_in_one_line(monkeypatch, error, words):
    """Not as a full disk, nor as a traceback."""
    monkeypatch.setattr("mrl_driver.transport.port_info.facts", mock.Mock(side_effect=error))
    assert words in fails(1, "ports")


@pytest.mark.emulated_board(robot="omni")
def test_a_timed_drive_to_the_left(emulated_board, tmp_path):
    """The model is found by the board's id; JSON tells the lateral speed as well, and the recording where it went."""
    log = tmp_path / "left.mrllog"
    done = mrl(
        "drive", "--port", emulated_board.port, "--lateral", "0.3", "--for", "1", "--json", "--record", log
    )
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["pose"]["y_m"] > 0.1 > abs(told["pose"]["x_m"])
    assert set(told["twist"]) == {"linear_m_s", "angular_rad_s", "lateral_m_s"}
    there = Recording(str(log))
    assert summarise(RecordedDriver(there))["pose"] == pytest.approx(told["pose"], abs=2e-4)
    seen = drive_data.read(RecordedDriver(there))
    assert tuple(seen.poses.values[-1]) == pytest.approx(tuple(told["pose"].values()), abs=2e-4)
    assert len(seen.ranges["front"].time_s) and [0.0, 0.0, 0.0] in seen.commands.values.tolist()
    assert "sideways" in mrl("monitor", "--port", emulated_board.port, "--seconds", "0.2").stdout


def test_keys_slide():
    teleop = Teleop()
    teleop.press(",", 0.0)
    assert teleop.slide(0.1) == LINEAR_M_S and teleop.command(0.1) == (0.0, 0.0)
    teleop.press(".", 0.2)
    assert teleop.slide(0.3) == -LINEAR_M_S
    assert teleop.slide(0.2 + HOLD_S) == 0.0


@pytest.fixture
def robot():
    engine = Engine(RadioBoard())
    with SteppedDriver(engine, model("traxbot")) as driver:
        driver.engine = engine
        yield driver


def test_discover_as_json(serve):
    board = serve(RadioBoard())
    nodes = json.loads(mrl("radio", "discover", "--port", board.path, "--seconds", "1", "--json").stdout)
    assert nodes[0] == {"address": "0013a20040a1b2c3", "network": "0001"} and len(nodes) == 2


def test_a_search_without_an_answer_names_the_settings_of_the_own_radio(robot, capsys):
    """A radio in API mode 2 escapes bytes of its packets, which the board then cannot read."""
    robot.engine.board.nodes = ()
    print_nodes(robot, 0.1, False)
    assert "API mode 1" in capsys.readouterr().out


def test_texts_of_strangers_give_no_orders_to_the_terminal(robot, capsys):
    board = robot.engine.board
    robot.on_telemetry(lambda _: None if board.told else board.hear(PEER, "a\x1b[2J\r\nb"))
    print_texts(robot, 0.3, False)
    assert capsys.readouterr().out == "0013a20040a1b2c3  a\\x1b[2J\\r\\nb\n"


def test_send_sends_the_text_to_all(serve):
    board = serve(RadioBoard())
    assert mrl("radio", "send", "all", "hello", "--port", board.path).returncode == 0
    wait_until(lambda: board.board.sent)
    assert board.board.sent[0][1] == text_request(BROADCAST, "hello")[1:]


def every(command=main.cli, path=("mrl",)):
    """All commands, each with the words that lead to it."""
    found = [(path, command)]
    if isinstance(command, click.Group):
        ctx = click.Context(command, **command.context_settings)
        for name in command.list_commands(ctx):
            found += every(command.get_command(ctx, name), (*path, name))
    return found


def python(*words, path, executable=sys.executable):
    """Python with these words, in the root of the project, with a path for modules."""
    return subprocess.run(
        [executable, *words],
        cwd=pathlib.Path(__file__).resolve().parents[2],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        env={**os.environ, "PYTHONPATH": str(path)},
    )


COMMANDS = dict(every())
EXAMPLES = sorted(
    {
        part.strip()
        for command in COMMANDS.values()
        for line in (command.help or "").splitlines()
        if line.strip().startswith("mrl ")
        for part in re.split(r";| > |\|", re.split(r"\s{3,}", line.strip())[0])
        if part.strip().startswith("mrl ")
    }
)


@pytest.mark.parametrize("path", COMMANDS, ids=" ".join)
def test_each_command_says_what_it_does(path):
    command = COMMANDS[path]
    assert command.help and len(command.get_short_help_str(200)) > 10
    assert all(option.help for option in command.params if isinstance(option, click.Option))


@pytest.mark.parametrize("example", EXAMPLES)
def test_examples_parse(example, monkeypatch):
    called, words = [], shlex.split(example)
    for path, command in COMMANDS.items():
        if not isinstance(command, click.Group):
            monkeypatch.setattr(command, "callback", lambda *_, path=path, **__: called.append(path))
    main.cli.main(words[1:], "mrl", standalone_mode=False)
    assert len(called) == 1 and set(called[0]) <= set(words)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["mo"], ["monitor"]),
        (["go"], ["goto"]),
        (["config", "set", "ramp"], ["ramp_time", "ramp_gain"]),
        (["info", "--robot", "st"], ["stingbot"]),
        (["--robot", "st"], ["stingbot"]),
    ],
)
def test_what_the_shell_completes(words, expected):
    *before, begun = words
    found = BashComplete(main.cli, {}, "mrl", "_MRL_COMPLETE").get_completions(before, begun)
    assert [each.value for each in found] == expected


@pytest.mark.parametrize(
    ("code", "heavy"),
    [
        (
            "c.cli.get_command(None, 'info'); import mrl_driver.driver.driver",
            ["rich.console", "numpy", "importlib.metadata"],
        ),
        ("c.cli.get_help(c.cli.make_context('mrl', ['info']))", ["rich.console", "numpy", "serial", "yaml"]),
    ],
    ids=["info", "the list of commands"],
)
def test_what_a_quick_command_does_not_load(code, heavy):
    """They start in a tenth, and in two tenths of a second of computing."""
    code = f"import sys, mrl_driver.cli.main as c\n{code}\nprint([m for m in {heavy} if m in sys.modules])"
    assert python("-S", "-c", code, path=os.pathsep.join(sys.path)).stdout.strip() == "[]"


def test_searches_for_garbage_leave_out_what_a_program_imports(tmp_path):
    (tmp_path / "imported.py").write_text(
        "import gc\nmain = lambda: print(gc.isenabled(), gc.get_freeze_count() > 0)\n"
    )
    code = "from mrl_driver import program; program.start('imported', 'imported')"
    assert python("-c", code, path=tmp_path).stdout == "True True\n"


@pytest.mark.parametrize(
    "words, same", [([], ["--help"]), (["help"], ["--help"]), (["help", "drive"], ["drive", "--help"])]
)
def test_help_is_also_a_word(words, same):
    assert mrl(*words) == mrl(*same) != ""


def test_output_that_cannot_be_written_costs_a_line():
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [*MRL, "names"], stdout=full, stderr=subprocess.PIPE, text=True, timeout=PATIENCE_S
        )
    assert done.returncode == OutputError.exit_code
    text = "the output cannot be written: No space left on device; free disk space, or choose another folder"
    assert done.stderr == f"mrl: {text}  [output_error]\n"


@pytest.mark.parametrize("words", [("info", "--port", "/dev/null"), ("ports",)])
def test_a_module_called_serial_that_is_not_pyserial_is_named(tmp_path, words):
    (tmp_path / "serial.py").touch()
    done = python("-m", "mrl_driver", *words, path=tmp_path)
    assert done.returncode == ConfigError.exit_code and done.stderr.count("\n") == 1
    assert f"{tmp_path}/serial.py is not pyserial" in done.stderr


def test_ctrl_c_while_it_ends_says_nothing(tmp_path):
    (tmp_path / "ends.py").write_text(
        "import atexit, signal\ndef main(): atexit.register(signal.raise_signal, signal.SIGINT)\n"
    )
    done = python("-c", "from mrl_driver import program; program.start('ends', 'ends')", path=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_ctrl_c_while_it_still_loads_says_nothing(tmp_path):
    (tmp_path / "click.py").write_text(
        "import os, signal, time\nos.kill(os.getpid(), signal.SIGINT)\ntime.sleep(20)\n"
    )
    done = python("-m", "mrl_driver", "--help", path=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGINT, "", "")


@pytest.mark.parametrize(
    ("missing", "package", "words"),
    [
        ("click", "click", ["mrl_driver", "--help"]),
        ("serial", "pyserial", ["mrl_driver", "info", "--port", "/dev/null"]),
        ("yaml", "PyYAML", ["sim_arduino", "--world", "room"]),
    ],
)
def test_a_package_that_is_missing_costs_a_line(tmp_path, missing, package, words):
    """As with catkin's `mrl` and `mrl-sim`, which come without the dependencies that pip would install."""
    (tmp_path / f"{missing}.py").write_text(f"raise ModuleNotFoundError('No module', name='{missing}')\n")
    done = python("-m", *words, path=tmp_path)
    name = {"mrl_driver": "mrl", "sim_arduino": "mrl-sim"}[words[0]]
    assert (done.returncode, done.stdout) == (ConfigError.exit_code, "")
    assert done.stderr == (
        f"{name}: the Python package {missing} is missing; install it with: sudo apt install python3-{missing}, "
        f"or: pip install {package}\n"
    )


def test_pip_is_not_named_to_a_program_of_the_systems_own_python(tmp_path):
    """As a node is: what pip installs into an environment that is active does not reach it."""
    (tmp_path / "click.py").write_text("raise ModuleNotFoundError('No module', name='click')\n")
    done = python("-m", "mrl_driver", path=tmp_path, executable=f"{sys.base_prefix}/bin/python3")
    assert done.stderr.endswith("is missing; install it with: sudo apt install python3-click\n")


def test_a_package_of_ros_has_a_hyphen_for_an_underscore_and_is_not_one_of_pip(tmp_path):
    (tmp_path / "node.py").write_text("import tf2_none\n")
    done = python("-c", "from mrl_driver import program; program.start('node', 'node')", path=tmp_path)
    assert done.stderr.endswith("sudo apt install python3-tf2-none\n")


def test_the_command_that_builds_a_missing_image_holds_for_a_folder_with_a_space(tmp_path):
    checkout = tmp_path / "my robot"
    shutil.copytree(Path(main.__file__).parents[1], checkout / "mrl_driver", ignore=lambda *_: ["images"])
    (checkout / "Makefile").touch()
    program = "import sys; del sys.path[0]; from mrl_driver.host import firmware_images as i; i.image_path()"
    done = python("-c", program, path=checkout)
    command = done.stderr.partition("build it with: ")[2]
    assert shlex.split(command) == ["make", "-C", str(checkout), "firmware"]
