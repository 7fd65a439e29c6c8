"""Boards without motors (`drive: none`): sensors arrive, nothing counts as odometry, and driving is refused."""

import contextlib
import math

import pytest

from mrl_driver.driver.options import Options
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import BoardError, ConfigError, MrlError, WrongRobot
from mrl_driver.protocol import REQUESTS, Frame, FrameDecoder
from mrl_driver.robot import models
from mrl_driver.session.events import SensorRead
from mrl_driver.session.handshake import Board
from mrl_driver.session.session import TURNING, Stale
from sim_arduino.hardware.environment_sensors import THERMOPILE_ADDRESS
from sim_arduino.serve import factory
from tests.models import model as packaged_model

WATCHED_S = 3.0
BOARDS = {
    "python": {},
    "image": {"engine": "avr", "robot_id": 7},
    "2013": {"profile": "2013-august", "robot_id": 10},
}
IDENTIFY = Options(ignore_battery=True, any_id=True, identify=True)
WITHOUT_COMPASS = {"alcohol", "dust", "light", "thermopile"}
NO_MOTORS = "robot pioneer is a board without motors .drive: none.: it has sensors, and something else drives"


class Watched:
    """What a driver saw of a board in `WATCHED_S`; with `auto` as its robot."""

    def __init__(self, board):
        self.telemetry, self.batteries, self.read = [], [], set()
        self._emulated = factory.make(factory.Options(robot="pioneer", **board))
        self._sent = b""
        self.driver = SteppedDriver(self)
        self.driver.on_telemetry(self.telemetry.append)
        self.driver.on(Board, self.batteries.append)
        self.driver.on(SensorRead, lambda event: self.read.add(event.name))
        self.driver.connect()
        self.driver.wait(WATCHED_S)

    def receive(self, data):
        self._sent += data
        self._emulated.engine.receive(data)

    def __getattr__(self, name):
        return getattr(self._emulated.engine, name)

    def requests(self):
        return {event.code for event in FrameDecoder(REQUESTS).feed(self._sent) if isinstance(event, Frame)}

    def close(self):
        self.driver.close()
        self._emulated.close()


@pytest.fixture(scope="module", params=BOARDS)
def watched(request):
    seen = Watched(BOARDS[request.param])
    yield seen
    seen.close()


def test_its_model_is_found_by_its_id_and_its_sensors_are_read(watched):
    driver = watched.driver
    assert driver.model.name == "pioneer" and driver.ready
    old = driver.board.version < 2
    assert watched.read == set(driver.sensors) == (WITHOUT_COMPASS if old else {*WITHOUT_COMPASS, "compass"})


def test_its_counters_are_never_odometry(watched):
    """999 in both counters stands for: there are none."""
    driver = watched.driver
    assert driver.link.statistics.streamed > 40 * WATCHED_S
    assert (watched.telemetry, driver.telemetry, tuple(driver.pose)) == ([], None, (0.0, 0.0, 0.0))
    assert driver.link.statistics.refused_counts == 0 and driver.ranges == {}


def test_nothing_of_a_motor_board_is_told(watched):
    """Neither 0 V nor 0 degC, and no missing motor board."""
    driver = watched.driver
    board = driver.board
    assert all(map(math.isnan, (board.battery_v, board.temperature_c, board.motor_board_version)))
    assert (watched.batteries, driver.battery_state, driver.warning) == ([], "ok", "")
    assert driver.status is None or driver.status.faults == ()


@pytest.mark.parametrize(
    "act",
    [
        lambda driver: driver.drive(0.1, 0.0),
        lambda driver: driver.drive(0.0, 0.0, 0.1),
        lambda driver: driver.limited(0.1, 0.0),
        lambda driver: driver.request(1),
        lambda driver: driver.reset_pose(),
    ],
    ids=["drive", "sideways", "limited", "calibrate", "reset_pose"],
)
def test_driving_is_refused_in_one_line(watched, act):
    with pytest.raises(ConfigError, match=NO_MOTORS):
        act(watched.driver)
    assert not watched.requests() & TURNING


def connect(change=lambda plant: None, model="auto", **board):
    """Connect to a board with a change of its plant, and close it again."""
    emulated = factory.make(factory.Options(**board))
    change(emulated.plant)
    try:
        with SteppedDriver(emulated.engine, model, Options(ignore_battery=True)) as driver:
            return driver.board
    finally:
        emulated.close()


@pytest.mark.parametrize(
    "lost, ids, board, words",
    [
        ("motor_board", (1,), {"robot_id": 1}, "the motor board of robot 1 does not answer its Arduino"),
        ("motor_board", (7,), {"robot_id": 7}, "the motor board of robot 7 does not answer its Arduino"),
        (
            "thermopile",
            (),
            {"robot": "pioneer"},
            "the thermopile of robot 6 does not answer its Arduino: check its",
        ),
        ("", (), {"robot_id": 7}, "build sonar, .* flash it with: mrl flash --build environment --port"),
    ],
)
def test_what_a_robot_lacks_is_named(lost, ids, board, words):
    """The model decides, not the id: a missing motor board is a fault of a robot that has wheels."""

    def lose(plant):
        plant.motor_board.present = lost != "motor_board"
        if lost == "thermopile":
            plant.i2c[THERMOPILE_ADDRESS].present = False

    model = packaged_model("traxbot")._replace(ids=ids) if ids else "auto"
    with pytest.raises(BoardError if lost else WrongRobot, match=words):
        connect(lose, model, **board)


@pytest.mark.parametrize("engine", factory.ENGINES)
def test_new_board_gets_its_id_before_it_streams(engine):
    """Without an id a missing motor board is a fault, so that such a board streams nothing yet."""
    emulated = factory.make(factory.Options(robot="pioneer", engine=engine, robot_id=0))
    with SteppedDriver(emulated.engine, "pioneer", IDENTIFY) as driver:
        driver.parameters.save_model(9, models.load("pioneer"))
    emulated.engine.reset()
    with SteppedDriver(emulated.engine) as driver:
        assert driver.board.robot_id == 9
    emulated.close()


@pytest.mark.parametrize("robot", ["traxbot", "pioneer"])
def test_identified_board_stays_ready_without_telemetry(robot):
    emulated, told = factory.make(factory.Options(robot=robot, imu=True)), []
    with SteppedDriver(emulated.engine, "traxbot", IDENTIFY._replace(greeting_s=1.0)) as driver:
        driver.on_event(told.append)
        driver.wait(2.0)
        assert driver.ready and not [each for each in told if isinstance(each, Stale)]
        assert driver.link.statistics.streamed == 0 and emulated.engine.imu_stream is None
        assert driver.ask(34, 0) == (0, models.load(robot).ids[0])
    emulated.close()


@pytest.mark.parametrize("profile", ["current", "2013-august"])
def test_identified_robot_is_not_driven_without_telemetry(profile):
    emulated = factory.make(factory.Options(profile=profile))
    with contextlib.closing(emulated), SteppedDriver(emulated.engine, "traxbot", IDENTIFY) as driver:
        for _ in range(10):
            assert not driver.drive(0.2, 0.0)
            driver.wait(0.05)
        for code in TURNING:
            with pytest.raises(
                MrlError, match="refused while commands are inhibited .the board is only identified"
            ):
                driver.request(code)
        assert emulated.plant.true_pose.x_m == 0.0 and driver.link.age_s == math.inf
