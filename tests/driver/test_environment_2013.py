"""Boards of 2013 with environment sensors, and boards without motors: what the driver reads, and what never moves."""

import contextlib
import math

import pytest

from mrl_driver.driver.options import Options
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import BoardError, ConfigError, MrlError, WrongRobot
from mrl_driver.protocol import REQUESTS_TO_ANY, Frame, FrameDecoder
from mrl_driver.robot import models
from mrl_driver.session.events import SensorRead
from mrl_driver.session.handshake import Board
from mrl_driver.session.session import TURNING, Stale
from sim_arduino.hardware.environment_sensors import THERMOPILE_ADDRESS
from sim_arduino.serve import factory
from tests.models import model as packaged_model

MOST_COMMANDS = 26  # More commands a second than this get lost on a board of 2013 that streams
DRIVEN_S = 3.0


def own_model(folder, robot_id, build=""):
    """A TraxBot's file with another id, and with a build where one is given."""
    path = folder / "own.yaml"
    text = (folder / models.__file__).with_name("traxbot.yaml").read_text(encoding="utf-8")
    path.write_text(text.replace("ids: [1, 2, 3]", f"ids: [{robot_id}]{build}"), encoding="utf-8")
    return str(path)


class Watched:
    """A stepped driver on an emulated board, and the requests that it sends."""

    def __init__(self, model="traxbot", build="environment", **board):
        self.emulated = factory.make(
            factory.Options(**{"profile": "2013-august", "environment": True, **board})
        )
        self.requests = []
        self._engine, self._decoder = self.emulated.engine, FrameDecoder(REQUESTS_TO_ANY)
        self.driver = SteppedDriver(self, model, options=Options(ignore_battery=True, build=build))

    def receive(self, data):
        now = self.driver.now_s
        self.requests += [(now, event) for event in self._decoder.feed(data) if isinstance(event, Frame)]
        self._engine.receive(data)

    def __getattr__(self, name):
        return getattr(self._engine, name)

    def __enter__(self):
        return self.driver.__enter__()

    def __exit__(self, *error):
        self.driver.__exit__(*error)
        self.emulated.close()

    def codes(self, begin_s=0.0):
        return [frame.code for sent_s, frame in self.requests if sent_s >= begin_s]


@pytest.fixture(scope="module")
def driven():
    """A TraxBot with gas sensors that drove for `DRIVEN_S` with another speed every 20 ms, after its session."""
    watched = Watched()
    watched.emulated.plant.environment.light_count = 321
    watched.emulated.plant.environment.dust_pcs_l = 40000.0
    watched.told, watched.telemetry = [], []
    with watched as driver:
        driver.on(SensorRead, lambda event: watched.told.append((driver.now_s, event)))
        driver.on_telemetry(watched.telemetry.append)
        watched.begin_s = driver.now_s
        for i in range(round(DRIVEN_S / 0.02)):
            driver.drive(-0.2, -0.1 * (i % 7))
            driver.wait(0.02)
        watched.sensors, watched.statistics, watched.board = (
            driver.sensors,
            driver.link.statistics,
            driver.board,
        )
        driver.stop()
        driver.wait(0.5)
        watched.pose, watched.true_pose = driver.pose, watched.emulated.plant.true_pose
        watched.model = driver.model
    return watched


def test_sensors_have_the_names_and_units_of_the_table(driven):
    values = {name: found.values for name, found in driven.sensors.items()}
    assert values == {"alcohol": (123,), "light": (321,), "dust": (40000,), "thermopile": (22,) * 8}


def test_sensors_are_reported_twice_a_second_and_the_thermopile_once(driven):
    names = [name for now, (name, _) in driven.told if now < driven.begin_s + DRIVEN_S]
    counts = {name: names.count(name) for name in ("alcohol", "dust", "light")}
    assert set(counts.values()) <= {5, 6} and names.count("thermopile") in (2, 3)


def test_odometry_comes_from_the_sensor_stream(driven):
    """The frames come 163 times a second, and the last one holds all that the wheels did."""
    assert len(driven.telemetry) > 150 * DRIVEN_S and driven.statistics.refused_counts == 0
    assert math.dist(driven.pose[:2], driven.true_pose[:2]) < 1e-3
    assert driven.pose.yaw_rad == pytest.approx(driven.true_pose.yaw_rad, abs=2e-3)


def test_no_second_has_more_commands_than_the_board_takes(driven):
    times = [sent_s for sent_s, _ in driven.requests if sent_s > driven.begin_s]
    most = max(sum(begin <= each < begin + 1.0 for each in times) for begin in times)
    assert 5 < most <= MOST_COMMANDS


def test_neither_sonars_nor_the_compass_are_requested(driven):
    assert not {7, 27, 42} & set(driven.codes())
    assert driven.codes(driven.begin_s).count(22) <= DRIVEN_S + 1


def test_other_streams_are_stopped_before_and_this_one_at_the_end(driven):
    """The streams of 18, 23 and 27 come before that of 25 on a board of 2013."""
    codes = driven.codes()
    streams = [code for code in codes if code in (19, 24, 25, 26, 28)]
    assert streams[:4] == [19, 24, 28, 25] and streams[-2:] == [19, 26]


def test_telemetry_begins_again_after_a_reset():
    with Watched() as driver:
        driver.drive(0.2, 0.0)
        driver.wait(0.4)
        before = driver.pose
        driver._connection.stepped._stepped.reset()
        driver.wait(6.0)
        assert driver.ready and set(driver.sensors) >= {"alcohol", "dust", "light"}
        assert driver.pose.x_m == pytest.approx(before.x_m, abs=0.2) and driver.ranges == {}


def test_january_has_odometry_and_a_warning_but_no_sensors():
    with Watched(profile="2013-january") as driver:
        driver.drive(0.2, 0.0)
        driver.wait(0.4)
        assert driver.pose.x_m > 0 and not driver.sensors and not driver.ranges
        assert "does not send its environment sensors" in driver.warning


@pytest.mark.parametrize(
    "named, board, told", [("environment", {}, "sonar"), ("sonar", {"environment": True}, "environment")]
)
def test_build_that_a_board_of_this_firmware_does_not_have_is_told(named, board, told):
    emulated = factory.make(factory.Options(**board))
    with SteppedDriver(emulated.engine, "traxbot", options=Options(build=named)) as driver:
        driver.wait(0.5)
        assert driver.ranges == {}
        assert f"the board has the build {told}, expected {named}" in driver.warning
    emulated.close()


def test_board_that_returns_without_sonars_leaves_no_old_ranges():
    """It was flashed with another build while the driver waited."""
    watched, other = Watched(build="", profile="current", environment=False), Watched(profile="current")
    with watched as driver:
        driver.wait(0.5)
        before = driver.ranges
        other.emulated.engine.advance(driver.now_s)
        watched._engine = other.emulated.engine
        driver.wait(3.0)
        assert before and driver.ready and not driver.ranges and not driver.telemetry.ranges
    other.emulated.close()


def test_build_that_the_model_or_the_pins_of_its_bridge_exclude_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="has build: environment and no sonars, expected environment"):
        models.with_build(models.load(own_model(tmp_path, 2, "\nbuild: environment")), "sonar")
    with pytest.raises(ConfigError, match="has an H-bridge on the same pins, expected sonar"):
        models.with_build(packaged_model("duo"), "environment")


def told_ranges(model, **board):
    """Ranges of a second with a board, as telemetry and the driver tell them, and the sonars of its model."""
    emulated = factory.make(factory.Options(**board))
    told = {}
    try:
        with SteppedDriver(emulated.engine, model, options=Options(ignore_battery=True)) as driver:
            driver.on_telemetry(lambda each: told.update({name: each.ranges[name] for name in each.fresh}))
            driver.wait(1.0)
            return {**told, **driver.ranges}, set(driver.model.sonars)
    finally:
        emulated.close()


BUILD = "\nbuild: environment"


@pytest.mark.parametrize(
    ("robot_id", "build", "board", "sonars"),
    [
        (2, BUILD, {"profile": "2013-august", "environment": True}, set()),
        (2, BUILD, {"profile": "2013-january", "environment": True}, set()),
        (6, "", {"profile": "2013-august", "environment": True}, set()),
        (10, "", {"profile": "2013-august", "environment": True}, set()),
        (2, "", {"profile": "2013-august"}, {"front", "left", "right"}),
        (7, "", {}, {"front", "left", "right"}),
    ],
)
def test_build_of_the_model_or_ids_of_sensor_boards_leave_no_ranges_unless_the_board_tells_its_build(
    tmp_path, robot_id, build, board, sonars
):
    ranges, known = told_ranges(own_model(tmp_path, robot_id, build), robot_id=robot_id, **board)
    assert set(ranges) == known == sonars


WATCHED_S = 3.0
BOARDS = {
    "python": {},
    "image": {"engine": "avr", "robot_id": 7},
    "2013": {"profile": "2013-august", "robot_id": 10},
}
IDENTIFY = Options(ignore_battery=True, any_id=True, identify=True)
WITHOUT_COMPASS = {"alcohol", "dust", "light", "thermopile"}
NO_MOTORS = "robot pioneer is a board without motors .drive: none.: it has sensors, and something else drives"


class Seen(Watched):
    """What a driver saw of a board in `WATCHED_S`; with `auto` as its robot."""

    def __init__(self, board):
        super().__init__(
            "auto", "", **{"profile": "current", "environment": False, "robot": "pioneer", **board}
        )
        self.telemetry, self.batteries, self.read = [], [], set()
        self.driver.on_telemetry(self.telemetry.append)
        self.driver.on(Board, self.batteries.append)
        self.driver.on(SensorRead, lambda event: self.read.add(event.name))


@pytest.fixture(scope="module", params=BOARDS)
def watched(request):
    seen = Seen(BOARDS[request.param])
    with seen as driver:
        driver.wait(WATCHED_S)
        yield seen


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
    assert not set(watched.codes()) & TURNING


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
