"""Several processes in one world: bodies and radios; two media of one world are those of two processes."""

import inspect
import json
import os
import subprocess
import sys
import tempfile
import uuid
from contextlib import closing

import pytest

from mrl_driver.cli.commands.radio import free_others, hold_others
from mrl_driver.driver.options import Options
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import BoardTimeout, ConfigError
from mrl_driver.geometry import Pose
from mrl_driver.navigation.radio_holder import RadioHolder
from mrl_driver.protocol.table import BY_NAME, PARAMETER_BY_NAME
from sim_arduino.hardware.mirror import Mirror
from sim_arduino.hardware.xbee import BROADCAST
from sim_arduino.replay.mirror import follow
from sim_arduino.serve import factory
from sim_arduino.serve.pty import PtyPort
from sim_arduino.serve.server import PtyServer
from sim_arduino.world import shared_radio, shared_robots
from sim_arduino.world.shapes import Footprint
from sim_arduino.world.shared_radio import SharedRadioMedium
from sim_arduino.world.shared_robots import SharedRegistry
from sim_arduino.world.world import World
from tests.shortage import descriptors_left, errors_of_each_step
from tests.sim.simulator import Client, Simulator
from tests.sim.test_radio import ONE, TWO, Module
from tests.waiting import wait_until

BOX = Footprint(0.2, 0.1)


@pytest.fixture
def lab(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setattr(shared_robots, "LOOK_S", 0.0)
    return f"lab-{uuid.uuid4().hex[:8]}"


@pytest.fixture
def registries(lab):
    """Two processes' views of one world, as far as locks and files go."""
    made = [SharedRegistry(lab), SharedRegistry(lab)]
    yield made
    for registry in made:
        registry.close()


def test_a_symbolic_link_of_another_user_is_not_followed(tmp_path, monkeypatch):
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    (tmp_path / "own").mkdir()
    (tmp_path / f"mrl-sim-{os.getuid()}").symlink_to(tmp_path / "own")
    with pytest.raises(ConfigError, match="is a symbolic link or belongs to another user"):
        SharedRegistry("lab")
    assert not list((tmp_path / "own").iterdir())


def test_a_robot_is_seen_by_all_but_by_itself(registries):
    """A process that scans for a robot of another one leaves it out: a laser must not see the robot that carries it."""
    registries[0].place("one", Pose(1.0, 2.0, 3.0), BOX)
    for registry in registries:
        assert registry.others("two") == [("one", Pose(1.0, 2.0, 3.0), BOX)]
        assert registry.others("one") == []


def test_a_name_is_taken_once(registries):
    registries[0].place("one", Pose(1.0, 2.0, 3.0), BOX)
    with pytest.raises(ConfigError, match="robot 'one' is in world .* already"):
        registries[1].place("one", Pose(1.0, 2.0, 3.0), BOX)


def test_a_robot_whose_process_was_killed_is_gone(registries, lab):
    code = (
        f"from sim_arduino.world.shared_robots import *; c = SharedRegistry({lab!r}); "
        "c.place('dead', Pose(0, 0, 0), Footprint(1, 1)); print(flush=True); input()"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    process.stdout.readline()
    before = [mover.name for mover in registries[0].others("")]
    process.kill()
    process.communicate()
    assert (before, registries[0].others("")) == (["dead"], [])


@pytest.mark.parametrize("name", ["", "a b", "../x", "x" * 41])
def test_bad_world_names(name):
    with pytest.raises(ConfigError, match="expected 1 to 40 letters, digits, - or _"):
        SharedRegistry(name)


def shared(registry):
    world = World()
    world.registry = registry
    return world


@pytest.mark.parametrize("line", ["POSE", '{"pose": POSE, "battery_v": 12.1}'])
def test_a_mirror_stands_where_the_odometry_says(registries, line):
    """Odometry that began at (1, 0), looking along y."""
    with closing(Mirror(shared(registries[1]), "real", BOX, Pose(1.0, 0.0, 1.5707963267948966))) as mirror:
        pose = '{"x_m": 0.5, "y_m": 0.0, "yaw_rad": 0.0}'
        follow(mirror, [line.replace("POSE", pose), "\n"])
        assert registries[0].others("")[0].pose == pytest.approx((1.0, 0.5, 1.5707963))
    assert registries[0].others("") == []


@pytest.mark.parametrize(
    "line",
    ["junk", '{"x_m": 1, "y_m": NaN, "yaw_rad": 0}', '{"pose": 7}', pytest.param("[" * 100000, id="deep")],
)
def test_a_bad_line_is_named_by_its_number(line):
    with closing(Mirror(World(), "real", BOX)) as mirror, pytest.raises(ConfigError, match="line 2 is"):
        follow(mirror, ["\n", line])


def test_boards_of_two_processes_bump_into_each_other(lab, tmp_path):
    """One drives 1 m towards the other, which stands; bow to bow they are 0.225 m apart."""
    truth = tmp_path / "truth"
    shared = ("--world-name", lab, "--world", "square")
    moving = ("--name", "one", "--truth", str(truth), "--speed", "4")
    other = Simulator(*shared, "--name", "two", "--pose", "0.6,0,180")
    with other, Simulator(*shared, *moving) as one, Client(one.path) as client:
        client.ask(b"@15e")
        client.send(b"@11,400,0e")
        wait_until(lambda: last(truth) > 0.37)
        rows = truth.read_text().count("\n")
        wait_until(lambda: truth.read_text().count("\n") > rows + 10)
    assert last(truth) == pytest.approx(0.6 - 0.225, abs=1e-3)


def last(truth):
    rows = truth.read_text().splitlines()
    return json.loads(rows[-1])["x"] if rows and rows[-1].endswith("}") else 0.0


def at_each_step(action, look):
    """Does `action`, and calls `look` before each of its Python instructions."""

    looks = []

    def trace(frame, event, _):
        frame.f_trace_opcodes = True
        if event == "opcode":
            looks.append(look())
        return trace

    before = sys.gettrace()
    inspect.currentframe().f_trace_opcodes = True  # Python 3.12 counts only those that ask before `settrace`
    sys.settrace(trace)
    try:
        action()
    finally:
        sys.settrace(before)
    assert looks


def test_reader_in_the_middle_of_a_move_sees_the_place_before_or_after(registries):
    before, after = Pose(1.0, 2.0, 3.0), Pose(4.0, 5.0, 6.0)
    registries[0].place("one", before, BOX)
    seen = [registries[1].others("")[0].pose]
    at_each_step(
        lambda: registries[0].place("one", after, BOX), lambda: seen.append(registries[1].others("")[0].pose)
    )
    assert set(seen) <= {before, after} and (seen[0], registries[1].others("")[0].pose) == (before, after)


def test_a_process_that_runs_out_of_descriptors_leaves_none_open(lab):
    def join():
        registry = SharedRegistry(lab)
        registry.place("one", Pose(0.0, 0.0, 0.0), Footprint(0.2, 0.1))
        return registry

    assert errors_of_each_step(join, descriptors_left, OSError)


DEAD = (
    "import sys; from sim_arduino.hardware.xbee import *; from sim_arduino.world.shared_radio import *; "
    "from sim_arduino.world.shared_robots import SharedRegistry as R; name = sys.argv[1]; "
    f"XBee(SharedRadioMedium(name, R(name)), 'two', RadioFit({TWO}), lambda: (0.0, 0.0)); "
    "print(flush=True); input()"
)


class Process:
    """What a process has of a world: its registry, and a radio."""

    def __init__(self, lab: str, address: int, x_m: float = 0.0, **fit: float) -> None:
        self.registry = SharedRegistry(lab)
        self.medium = SharedRadioMedium(lab, self.registry)
        self.module = Module(self.medium, address, x_m, **fit)
        self.module.xbee.live = True
        self.registry.place(self.module.xbee.station.robot, Pose(x_m, 0.0, 0.0), BOX)

    def texts(self):
        self.module.xbee.poll()
        return self.module.texts()

    def close(self):
        self.module.xbee.close()
        self.registry.close()


@pytest.fixture
def make(lab, close_later):
    return lambda address, **options: close_later(Process(lab, address, **options))


def test_radios_of_two_processes_receive_each_other(make):
    one, two = make(ONE), make(TWO)
    one.module.send(TWO, b"hello")
    two.module.send(ONE, b"\x00\xff")
    assert (two.texts(), one.texts()) == ([b"hello"], [b"\x00\xff"])


def test_distance_is_that_of_the_robots(make):
    near, far = make(ONE, range_m=5.0), make(TWO, x_m=5.1)
    near.module.send(BROADCAST, b"too far")
    far.registry.place("robot2", Pose(4.9, 0.0, 0.0), BOX)
    near.module.send(BROADCAST, b"hello")
    assert far.texts() == [b"hello"]


def test_packets_that_a_process_did_not_take_in_time_are_lost(make, monkeypatch):
    one, two = make(ONE), make(TWO)
    one.module.send(TWO, b"old")
    monkeypatch.setattr(shared_radio, "OLD_S", -1.0)
    assert two.texts() == []


def test_one_address_is_taken_once(make):
    make(ONE)
    with pytest.raises(ConfigError, match="radio address 0013a20040000001 is in world .* already"):
        make(ONE)


def test_radio_of_a_killed_process_is_gone_and_its_address_free(make, lab):
    one = make(ONE)
    process = subprocess.Popen(
        [sys.executable, "-c", DEAD, lab], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    process.stdout.readline()
    one.module.send(TWO, b"there")
    process.kill()
    process.communicate()
    one.module.send(TWO, b"gone", at_s=1.0)
    stations = one.medium.stations()
    heir = make(TWO)
    one.module.send(TWO, b"hello", at_s=7.0)
    assert stations == [one.module.xbee.station]
    assert one.module.statuses() == [0x00, 0x21, 0x00] and heir.texts() == [b"hello"]


def test_a_world_with_a_long_name_has_a_socket(monkeypatch, tmp_path):
    """A socket's path has at most 107 bytes; the folder's is longer."""
    folder = tmp_path / ("x" * 100)
    folder.mkdir()
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder))
    Process("y" * 40, ONE).close()


def options(**given):
    return factory.Options(**{"radio": "auto", **given})


@pytest.mark.parametrize(
    "given, message",
    [
        ({"radio": "robot"}, "radio address is 'robot', expected a 64-bit address in hexadecimal"),
        ({"radio_loss": 1.5}, "radio_loss is 1.5, expected 0 to 1"),
        ({"radio": None, "radio_loss": 0.1}, "--radio-loss is given without a radio, expected --radio too"),
        ({"environment": True}, "--radio is given for robot traxbot, expected a board with sonars"),
    ],
)
def test_options_that_do_not_fit_are_named(given, message):
    with pytest.raises(ConfigError, match=message):
        factory.make(options(**given))


def test_server_waits_for_packets_of_other_processes(lab):
    robot = factory.make(options(world_name=lab))
    port = PtyPort()
    server = PtyServer(robot.engine, port, robot.plant)
    server.step()
    watched, fd = server.watched, robot.plant.xbee.fileno()
    server.waker.close()
    port.close()
    robot.close()
    assert fd in watched


WRITE, HOLD = BY_NAME["write_config"].code, PARAMETER_BY_NAME["radio_hold"].number
SILENT = 20
SPEED_M_S = 0.2
LASTING = Options(command_timeout_s=None)


class Pair:
    """Robot `one` holds; robot `two` drives beside it in time."""

    def __init__(self):
        world = World()
        self.made = [
            factory.make(factory.Options(name=name, pose=pose, radio=f"{address:x}"), world)
            for name, pose, address in (("one", "0,0,0", ONE), ("two", "0,1,0", TWO))
        ]
        self.one, self.two = (SteppedDriver(each.engine, "traxbot", LASTING) for each in self.made)
        self.one.connect()
        self.two.connect()
        self.holder = RadioHolder([TWO])
        self.one.radio.on_text(lambda text: self.holder.receive(text, self.one.now_s))
        self.one.on_telemetry(lambda _: self.two.wait(max(0.0, self.one.now_s - self.two.now_s)))

    @property
    def moves(self):
        """Whether robot `two` moves half a second later."""
        self.one.wait(0.5)
        return abs(self.two.twist.linear_m_s) > 0.01

    def close(self):
        for each in (self.two, self.one, *self.made):
            each.close()


@pytest.fixture
def pair(close_later):
    return close_later(Pair())


def test_held_robot_stops_refuses_and_stands_after_it_is_free(pair, capsys):
    pair.two.ask(WRITE, HOLD, SILENT)
    pair.one.wait(2.5)  # after its start, a board listens for holders
    pair.two.drive(SPEED_M_S, 0.0)
    assert pair.moves
    hold_others(pair.one, pair.holder, 1.0)
    assert capsys.readouterr().out == "no answer from 0013a20040000002\nall are held\n"
    assert not pair.moves
    pair.two.drive(SPEED_M_S, 0.0)
    assert not pair.moves
    pair.two.stop()
    free_others(pair.one, pair.holder)
    assert not pair.moves
    pair.two.drive(SPEED_M_S, 0.0)
    assert pair.moves


def test_robot_that_does_not_allow_a_hold_drives_on_and_is_named(pair, capsys):
    pair.two.drive(SPEED_M_S, 0.0)
    hold_others(pair.one, pair.holder, 1.0)
    assert pair.moves and capsys.readouterr().out == "no answer from 0013a20040000002\n"
    with pytest.raises(BoardTimeout, match="no answer from 0013a20040000002: it may still be held"):
        free_others(pair.one, pair.holder)
