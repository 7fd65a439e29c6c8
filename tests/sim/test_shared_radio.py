"""Radios of several processes (two media of one world), and a robot that holds another one by radio."""

import select
import subprocess
import sys
import uuid

import pytest

from mrl_driver.cli.commands.radio import free_others, hold_others
from mrl_driver.driver.options import Options
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import BoardTimeout, ConfigError
from mrl_driver.geometry import Pose
from mrl_driver.navigation.radio_holder import RadioHolder
from mrl_driver.protocol.table import BY_NAME, PARAMETER_BY_NAME
from sim_arduino.hardware.xbee import BROADCAST
from sim_arduino.serve import factory
from sim_arduino.serve.pty import PtyPort
from sim_arduino.serve.server import PtyServer
from sim_arduino.world import shared_radio
from sim_arduino.world.shapes import Footprint
from sim_arduino.world.shared_radio import SharedRadioMedium
from sim_arduino.world.shared_robots import SharedRegistry
from sim_arduino.world.world import World
from tests.sim.test_radio import ONE, TWO, Module

BOX = Footprint(0.2, 0.1)
DEAD = (
    "import sys; from sim_arduino.hardware.xbee import *; from sim_arduino.world.shared_radio import *; "
    "from sim_arduino.world.shared_robots import SharedRegistry as R; name = sys.argv[1]; "
    f"XBee(SharedRadioMedium(name, R(name)), 'two', RadioFit({TWO}), lambda: (0.0, 0.0)); "
    "print(flush=True); input()"
)


@pytest.fixture
def lab(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    return f"lab-{uuid.uuid4().hex[:8]}"


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
def make(lab):
    made = []

    def process(address: int, **options: float) -> Process:
        made.append(Process(lab, address, **options))
        return made[-1]

    yield process
    for each in made:
        each.close()


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


def test_socket_is_readable_when_a_packet_waits(make):
    one, two = make(ONE), make(TWO)

    def waits():
        return bool(select.select([two.module.xbee.fileno()], [], [], 0)[0])

    before = waits()
    one.module.send(TWO, b"hello")
    assert (before, waits()) == (False, True)


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
def pair():
    made = Pair()
    yield made
    made.close()


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
