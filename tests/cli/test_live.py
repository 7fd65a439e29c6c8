"""The live view: what is drawn, what the keys do, what the frame log keeps, sensors, and numbers by `--udp`."""

import contextlib
import io
import json
import os
import pty
import select
import socket
import time
from dataclasses import replace
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from mrl_driver.apps.calibration import sonar_procedures
from mrl_driver.cli.commands import monitor
from mrl_driver.cli.commands.shared import await_sensors
from mrl_driver.cli.doctor import board
from mrl_driver.cli.doctor.findings import NOTE, OK
from mrl_driver.clocks import clock_s
from mrl_driver.driver import Driver
from mrl_driver.driver.link_status import LinkStatus
from mrl_driver.driver.options import Options
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose
from mrl_driver.robot.battery import EMPTY_AFTER_S
from mrl_driver.robot.models import SonarMount
from mrl_driver.safety.wheel_monitor import DEAD, Mismatch
from mrl_driver.terminal import keyboard as keyboard_module
from mrl_driver.terminal import live_panels, live_view
from mrl_driver.terminal.canvas import Canvas, fit
from mrl_driver.terminal.frame_log import MOST_LINES, FrameLog
from mrl_driver.terminal.keyboard import Keyboard
from mrl_driver.terminal.live_panels import render
from mrl_driver.terminal.live_view import Screen, Settings
from mrl_driver.terminal.teleop_keys import HOLD_S, LINEAR_M_S, Teleop
from mrl_driver.view import trail
from mrl_driver.view.rows import sections
from sim_arduino.serve import factory
from sim_arduino.testing import EmulatedBoard
from tests.waiting import PATIENCE_S, wait_until

from .run import fails, mrl

METRES = st.floats(-50, 50)


@pytest.fixture
def watched(serve):
    """A connected driver, its board, and its frame log."""
    port, log = serve(), FrameLog()
    with Driver(
        port.path,
        options=Options(tap=lambda direction, data: log.add_bytes(direction, data, clock_s())),
    ) as driver:
        yield driver, port.board, log


def picture(screen, width, height, color=None):
    out = io.StringIO()
    console = Console(file=out, width=width, height=height, color_system=color, force_terminal=True)
    console.print(render(screen.content(clock_s()), width, height), end="")
    return out.getvalue()


@pytest.mark.parametrize("size", [(80, 24), (120, 40), (60, 16), (20, 6), (200, 60)])
def test_the_view_fits_terminals_of_all_sizes(watched, size):
    driver, _, log = watched
    lines = picture(Screen(driver, Settings("/dev/ttyACM7"), log), *size).split("\n")
    assert any(lines) and all(len(line) <= size[0] for line in lines) and len(lines) <= size[1] + 1


def test_the_terminal_says_what_every_view_says(watched):
    driver, _, log = watched
    content = Screen(driver, Settings(), log).content(clock_s())
    console = Console(file=io.StringIO(), width=120, height=40)
    console.print(render(content, 120, 40))
    text, told = console.file.getvalue(), sections(content.shown)
    words = [
        word for each in told for row in each.rows for word in (each.title, row.name, *row.value.split())
    ]
    assert len(words) > 40 and [word for word in words if word not in text] == []


@pytest.mark.parametrize("size", [(80, 24), (100, 30), (120, 40)])
def test_nothing_that_went_wrong_is_cut(watched, monkeypatch, size):
    """However long it is."""
    driver, _, log = watched
    wrong = replace(driver.link.statistics, lost=12345, garbage={"checksum": 678}, restarts=12)
    status = driver.status._replace(faults=("motor_board", "bus_hung", "eeprom", "id_unset"))
    cause = Mismatch("both", DEAD, 0.037, 0.0)
    monkeypatch.setattr(LinkStatus, "statistics", wrong)
    for name, value in (("status", status), ("mismatch", cause)):
        monkeypatch.setattr(Driver, name, value)
    text = picture(Screen(driver, Settings("/dev/" + "x" * 80 + "-if00", "d" * 80 + ".mrl"), log), *size)
    words = f"12345 lost, 678 bad, 12 resets id unset {cause}; space goes on quit -if00 .mrl 00:00"
    assert [word for word in words.split() if word not in text] == []


class Delayed:
    """The driver's place behind a link with a delay."""

    def __init__(self, driver):
        self._driver = driver
        self.link = SimpleNamespace(delay_s=0.03, age_s=0.0, statistics=driver.link.statistics)

    def __getattr__(self, name):
        return getattr(self._driver, name)


@pytest.fixture
def delayed():
    """A view of a robot in simulated time, whose keys drive: screen, driver."""
    emulated = factory.make(factory.Options(robot="traxbot"))
    with contextlib.closing(emulated), SteppedDriver(emulated.engine) as robot:
        driver = Delayed(robot)
        yield Screen(driver, Settings(keys_drive=True), FrameLog(), lambda: robot.now_s), driver


def hold(screen, driver, seconds, key="up", late_s=0.0):
    """Hold a key that is pressed again every 50 ms, each time seen `late_s` later."""
    for _ in range(round(seconds / 0.05)):
        screen.press(key, driver.now_s - late_s)
        screen.steer(driver.now_s)
        driver.wait(0.05)


def test_keys_stop_driving_above_the_longest_delay_until_they_are_released(delayed):
    screen, driver = delayed
    hold(screen, driver, 0.1)
    assert driver.command is not None
    driver.link.delay_s = 0.51
    hold(screen, driver, 0.05)
    assert driver.command is None
    assert "above the limit of 500 ms: computer or network is too slow" in picture(screen, 100, 30)
    driver.link.delay_s = 0.03
    hold(screen, driver, 0.5)
    assert driver.command is None
    hold(screen, driver, HOLD_S + 0.1, key="f")
    hold(screen, driver, 0.05)
    assert driver.command is not None


def test_keys_that_waited_too_long_do_not_drive(delayed):
    """As in a terminal that stood still."""
    screen, driver = delayed
    hold(screen, driver, 0.3, late_s=0.55)
    assert driver.command is None and "above the limit" in screen.shown(driver.now_s).notice


@pytest.fixture
def terminal(monkeypatch):
    """The end of a terminal at which a person writes; the program reads the other one."""
    user, program = pty.openpty()
    monkeypatch.setattr("sys.stdin", SimpleNamespace(fileno=lambda: program, isatty=lambda: True))

    def write(keys):
        os.write(user, keys)
        wait_until(lambda: select.select([program], [], [], 0)[0])

    yield write
    for end in (user, program):
        os.close(end)


def test_a_key_that_waited_counts_from_the_look_before(terminal):
    """It may have been pressed at any time since then."""
    with Keyboard() as keyboard:
        keyboard.read(0.0)
        before_s = clock_s()
        terminal(b"w")
        assert keyboard.read(1.0) == ["w"] and keyboard.pressed_s <= before_s


def test_a_terminal_that_was_closed_is_no_error(monkeypatch):
    """An error would replace the signal that ends the program."""
    user, program = pty.openpty()
    monkeypatch.setattr("sys.stdin", SimpleNamespace(fileno=lambda: program, isatty=lambda: True))
    with Keyboard() as keyboard:
        os.close(user)
        assert keyboard.read(1.0) == ["q"]
    os.close(program)


@pytest.fixture
def suspended(terminal, monkeypatch):
    """The program stands still for 3 s from here on, and `w` is typed meanwhile; when that began [s, `clock_s`]."""

    def suspend():
        began_s = clock_s()
        monkeypatch.setattr("mrl_driver.terminal.keyboard.clock_s", lambda: clock_s() + 3.0)
        terminal(b"w")
        return began_s

    return suspend


def test_a_key_that_was_typed_while_a_waiting_program_was_suspended_is_old(suspended, monkeypatch):
    began_s = []

    def wait(*args):
        if args[-1]:
            began_s.append(suspended())
        return select.select(*args)

    with Keyboard() as keyboard:
        monkeypatch.setattr("mrl_driver.terminal.keyboard.select", SimpleNamespace(select=wait))
        assert keyboard.read(0.05) == ["w"] and keyboard.pressed_s < began_s[0] + 1.0


def test_a_key_that_was_typed_while_a_program_was_suspended_behind_another_key_is_old(
    suspended, terminal, monkeypatch
):
    began_s, split = [], keyboard_module.split
    monkeypatch.setattr(keyboard_module, "split", lambda data: began_s.append(suspended()) or split(data))
    with Keyboard() as keyboard:
        terminal(b"s")
        assert keyboard.read(1.0) == ["s"]
        assert keyboard.read(1.0) == ["w"] and keyboard.pressed_s < began_s[0] + 1.0


def test_an_arrow_in_two_parts_is_no_other_key(terminal):
    """The ESC of `ESC [ D`, left, was the key Escape, which ends the program, and the D was d: right."""
    with Keyboard() as keyboard:
        terminal(b"\x1b[")
        assert keyboard.read(1.0) == []
        terminal(b"D")
        assert keyboard.read(1.0) == ["left"]


def test_arrows_that_waited_do_not_end_the_program(terminal):
    """The last one that is read at once is cut; its ESC was the key Escape."""
    with Keyboard() as keyboard:
        terminal(b"\x1b[A" * 30)
        assert keyboard.read(1.0) + keyboard.read(0.0) == ["up"] * 30


@pytest.mark.parametrize("begun", [b"\x1b[", b"\x1b[7", b"\x1bO"])
def test_a_space_stops_after_a_key_that_was_cut(begun, terminal):
    with Keyboard() as keyboard:
        terminal(begun)
        assert keyboard.read(1.0) == []
        terminal(b" ")
        assert keyboard.read(1.0)[-1] == "space"


def test_the_view_drives_by_the_times_of_the_presses(monkeypatch):
    class Keys:
        pressed_s = 77.0
        read = lambda self, timeout_s: ["w", "q"]  # noqa: E731
        __enter__ = lambda self: self  # noqa: E731
        __exit__ = lambda self, *_: None  # noqa: E731

    seen = []
    screen = SimpleNamespace(ended=False, steer=lambda now_s: None)
    screen.press = lambda key, at_s: (seen.append(at_s), setattr(screen, "ended", key == "q"))
    screen.content = lambda now_s: None
    monkeypatch.setattr(live_view, "Keyboard", Keys)
    monkeypatch.setattr(live_panels, "render", lambda *_: "")
    monkeypatch.setattr("sys.stdin", SimpleNamespace(isatty=lambda: True))
    live_view.run(SimpleNamespace(wait=lambda seconds: False), screen)
    assert seen == [77.0, 77.0]


def test_a_key_that_was_held_when_the_computer_was_suspended_does_not_drive_after_it(terminal, monkeypatch):
    """The clock of timers stands still meanwhile; only that of the boot goes on."""
    teleop, speeds, since_boot_s = Teleop(), [], time.clock_gettime

    def steer(now_s):
        speeds.append(teleop.command(now_s)[0])
        if speeds == [0.0]:
            terminal(b"w")
        elif speeds[-1]:
            monkeypatch.setattr(time, "clock_gettime", lambda clock: since_boot_s(clock) + 3600.0)
            terminal(b"q")

    screen = SimpleNamespace(ended=False, steer=steer, content=lambda now_s: None)
    screen.press = lambda key, at_s: (teleop.press(key, at_s), setattr(screen, "ended", key == "q"))
    monkeypatch.setattr(live_panels, "render", lambda *_: "")
    live_view.run(SimpleNamespace(wait=lambda seconds: False), screen)
    assert speeds == [0.0, LINEAR_M_S, 0.0]


def test_a_computer_that_draws_slowly_draws_less_often(monkeypatch):
    """A picture takes 0.1 s of its processor, and the view may take a fifth of it."""
    now_s, pictures = [1000.0], []

    def read(timeout_s):
        now_s[0] += timeout_s
        return ()

    keyboard = contextlib.nullcontext(SimpleNamespace(read=read))
    monkeypatch.setattr(live_view, "Keyboard", lambda: keyboard)
    monkeypatch.setattr(live_panels, "render", lambda *_: pictures.append(now_s[0]) or "")
    monkeypatch.setattr(time, "thread_time", lambda: 0.1 * len(pictures))
    monkeypatch.setattr(live_view, "clock_s", lambda: now_s[0])
    screen = SimpleNamespace(ended=False, steer=lambda now_s: None, content=lambda now_s: None)
    live_view.run(SimpleNamespace(wait=lambda seconds: False), screen, 5.0)
    assert len(pictures) == pytest.approx(5.0 / 0.5, abs=1)


def test_keys_drive_only_after_enter(watched):
    driver, board, log = watched
    screen = Screen(driver, Settings(), log)
    screen.press("up", 0.0)
    screen.steer(0.0)
    assert driver.command is None and "press Enter first" in picture(screen, 80, 24)
    screen.press("\n", 0.0)
    screen.press("up", 0.0)
    screen.steer(0.1)
    assert driver.command == (0.25, 0.0)
    screen.steer(5.0)
    assert driver.command is None


def test_an_empty_battery_cannot_be_driven_by_keys():
    emulated = factory.make(factory.Options(robot="traxbot"))
    with contextlib.closing(emulated), SteppedDriver(emulated.engine) as driver:
        emulated.plant.robot.set_battery(driver.model.battery.empty_v - 0.2)
        driver.wait(EMPTY_AFTER_S + 3.0)
        screen = Screen(driver, Settings(), FrameLog())
        screen.press("\n", 0.0)
        assert "the battery is empty" in picture(screen, 80, 24)
        screen.press("up", 0.0)
        screen.steer(0.0)
        assert driver.command is None


def test_a_mismatch_is_told_and_space_goes_on(watched):
    driver, board, log = watched
    board.dead = {"left"}

    def blocked():
        driver.drive(0.2, 0.0)
        return driver.mismatch

    wait_until(blocked)
    screen = Screen(driver, Settings(), log)
    assert "left wheel" in picture(screen, 120, 24)
    screen.press("space", 0.0)
    assert driver.mismatch is None


def test_a_long_way_is_thinned_out_and_keeps_its_length(monkeypatch):
    monkeypatch.setattr(trail, "MOST_POSES", 100)
    way = trail.Trail()
    for i in range(1001):
        way.add(Pose(i * 0.01, 0.0, 0.0), 0.02 * i)
    assert len(way.poses) <= 101 and way.distance_m == pytest.approx(10.0, abs=0.3)


def test_a_pose_that_is_set_begins_a_new_path():
    way = trail.Trail()
    for i, x_m in enumerate((0.0, 0.02, 0.04, 7.0, 7.02)):
        way.add(Pose(x_m, 0.0, 0.0), 0.02 * i)
    assert way.distance_m == pytest.approx(0.02) and [pose.x_m for pose in way.poses] == [7.0, 7.02]


@given(st.lists(st.tuples(METRES, METRES), min_size=1, max_size=20), st.integers(4, 200), st.integers(2, 60))
def test_every_point_is_in_view(points, columns, rows):
    canvas = Canvas(columns, rows, fit(points, columns, rows))
    for point in points:
        column, row = canvas.at(point)
        assert 0 <= column < columns * 2 and 0 <= row < rows * 4


def test_frames_are_kept_by_kind_with_the_newest_text():
    log = FrameLog()
    log.add_bytes("<", b"@6,1,2e\r\n@6,3,4e\r\n", 1.0)
    log.add_bytes(">", b"@13e", 2.0)
    assert [(line.direction, line.name, line.text, line.times) for line in log.lines()] == [
        ("<", "read_encoders", "@6,3,4e", 2),
        (">", "stop", "@13e", 1),
    ]


@given(st.data())
def test_pieces_do_not_matter(data):
    wire = b"@5,2500,172,1200,2,1e\r\nboot\r\n@6,1,2e\r\n@8,1,2,3,4,5e\r\n"
    cuts = sorted(data.draw(st.lists(st.integers(0, len(wire)))))
    whole, pieces = FrameLog(), FrameLog()
    whole.add_bytes("<", wire, 0.0)
    for start, end in zip([0, *cuts], [*cuts, len(wire)]):
        pieces.add_bytes("<", wire[start:end], 0.0)
    frames = [line for line in whole.lines() if line.name != "text"]
    assert [line for line in pieces.lines() if line.name != "text"] == frames and len(frames) == 3


def test_the_log_does_not_grow():
    log = FrameLog()
    for code in range(100, 400):
        log.add_bytes("<", f"@{code},1e\r\n".encode(), float(code))
    assert len(log.lines()) == MOST_LINES and log.lines()[-1].name == "command 399"


@pytest.fixture(scope="module")
def gas_robot():
    emulated = factory.make(factory.Options(profile="2013-august", environment=True))
    with SteppedDriver(emulated.engine, "traxbot", options=Options(build="environment")) as robot:
        assert await_sensors(robot) == []
        yield robot
    emulated.close()


@pytest.mark.parametrize("sonars", [None, {"front": SonarMount(0.0, 0.0, 0.0, "range_1")}])
def test_curve_of_the_sonars_is_not_measured_without_one(gas_robot, sonars):
    """The robot would drive up to the wall without seeing it, or an HC-SR04 has no such curve."""
    model = gas_robot.model if sonars is None else gas_robot.model._replace(sonars=sonars)
    with pytest.raises(ConfigError, match="this board has no front sonar of type MB1300"):
        sonar_procedures.require_sonars(SimpleNamespace(model=model))


NO_MOTORS = "robot pioneer is a board without motors (drive: none): it has sensors, and something else drives"


@pytest.fixture(scope="module")
def port():
    with EmulatedBoard(robot="pioneer", robot_id=7) as board:
        yield board.port


def test_doctor_shows_the_sensors_and_no_fault(port, monkeypatch):
    monkeypatch.setattr(board.watch, "__defaults__", (0.3, 5))
    monkeypatch.setattr(board, "MIN_SHARE", 0.0)
    done = mrl("doctor", "--json", "--drive", "--yes", "--port", port)
    found = json.loads(done.stdout)["findings"]
    assert {each["level"] for each in found if each["subject"] not in ("latency", "ModemManager")} <= {
        OK,
        NOTE,
    }
    texts = {each["subject"]: each["text"] for each in found}
    assert texts["light"] == "500 count" and "this board has no motors" in texts["wheels"]
    assert not {"battery", "motor board"} & set(texts)
    assert "hardware that does not answer" not in texts.get("refused by board", "")


@pytest.mark.parametrize(
    "words",
    [("drive", "--linear", 0.1, "--for", 1), ("goto", 1, 0, "--yes"), ("calibrate", "gains", "--yes")],
    ids=lambda words: words[0],
)
def test_what_needs_motors_is_refused(port, words):
    assert NO_MOTORS in fails(2, *words, "--port", port)


def test_live_view_shows_the_sensors_without_a_map_and_drives_nothing():
    emulated = factory.make(factory.Options(robot="pioneer"))
    with contextlib.closing(emulated), SteppedDriver(emulated.engine) as driver:
        driver.wait(1.0)
        screen = Screen(driver, Settings(), FrameLog())
        screen.press("\n", 0.0)
        screen.press("up", 0.0)
        screen.steer(0.0)
        console = Console(file=io.StringIO(), width=100, height=30)
        console.print(render(screen.content(clock_s()), 100, 30))
        text = console.file.getvalue()
    assert "this board has no motors: no driving" in text and "500 count" in text
    assert not [words for words in ("path", "motion", "battery", "last stop") if words in text]


@pytest.fixture
def receiver():
    """A program that listens to datagrams."""
    with socket.socket(type=socket.SOCK_DGRAM) as end:
        end.settimeout(PATIENCE_S)
        end.bind(("127.0.0.1", 0))
        yield end


def address_of(receiver):
    return "127.0.0.1:{1}".format(*receiver.getsockname())


def received(receiver):
    return [json.loads(receiver.recv(4096)) for _ in range(2)]


@pytest.fixture
def sent(monkeypatch):
    """Each line is printed after telemetry was sent."""

    def line(driver):
        for _ in range(2):  # the first has been sent when the second one is there
            before = driver.telemetry
            wait_until(lambda before=before: driver.telemetry is not before)
        return "a line"

    monkeypatch.setattr(monitor, "line", line)
    monkeypatch.setattr(monitor, "LINE_S", 0.05)


@pytest.mark.parametrize("name, option", [("line", []), ("snapshot", ["--json"])])
def test_telemetry_goes_to_another_program_beside_what_is_printed(serve, receiver, monkeypatch, name, option):
    monkeypatch.setattr(monitor, name, lambda driver: received(receiver)[1]["battery_v"])
    done = mrl("monitor", "--port", serve().path, "--seconds", "0.05", "--udp", address_of(receiver), *option)
    assert (done.returncode, done.stderr) == (0, "") and done.stdout.splitlines()[0] == "12.0"


@pytest.mark.usefixtures("sent")
def test_datagrams_that_the_system_refuses_are_said_at_once_and_counted_at_the_end(serve):
    """A program may not send to all computers unless it says so."""
    done = mrl("monitor", "--port", serve().path, "--seconds", "0.1", "--udp", "127.255.255.255:9")
    first, last = done.stderr.splitlines()
    for line in (first, last):
        assert line.startswith("mrl: warning: --udp 127.255.255.255:9: ") and "permission denied" in line
    assert done.returncode == 0 and int(first.split()[4]) <= int(last.split()[4])
