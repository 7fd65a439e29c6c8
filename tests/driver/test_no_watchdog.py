"""A board without watchdog drives on when the line to it is cut: what cannot be known is said."""

from types import SimpleNamespace

import pytest

from mrl_driver.cli.commands.drive import drive_for
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import BoardTimeout
from mrl_driver.session.events import MAY_MOVE, Stale
from mrl_driver.session.motion_command import Motion
from mrl_driver.terminal.live_view import Screen, Settings
from sim_arduino.faults.faulty_engine import FaultyEngine
from sim_arduino.serve import factory
from tests.fake_board import FakeBoard

from .talk import Talk

DRIVE_S, SILENT_S = 0.4, 1.0


@pytest.fixture
def cut():
    """Makes drivers of a board whose cable is pulled while it drives, or stands."""
    ends = []

    def make(profile, speed_m_s=0.2):
        emulated = factory.make(factory.Options(profile=profile))
        line = FaultyEngine(emulated.engine)
        driver = SteppedDriver(line)
        driver.connect()
        events = []
        driver.on_event(events.append)
        ends.append(emulated.close)
        if speed_m_s:
            driver.drive(speed_m_s, 0.0)
        driver.wait(DRIVE_S)
        if not speed_m_s:
            driver.stop()
            driver.wait(SILENT_S)
        line.unplug()
        driver.wait(SILENT_S)
        return SimpleNamespace(driver=driver, line=line, events=events)

    yield make
    for end in ends:
        end()


def stale(bench):
    return next(event for event in bench.events if isinstance(event, Stale))


@pytest.mark.parametrize(
    "profile, speed_m_s, may_move",
    [("2013-august", 0.2, True), ("2013-august", 0.0, False), ("current", 0.2, False)],
    ids=["driving", "standing", "board with a watchdog"],
)
def test_driving_board_of_2013_that_is_cut_off_may_still_be_moving(cut, profile, speed_m_s, may_move):
    """Its silence is told so; a stop of the others is no error without telemetry."""
    bench = cut(profile, speed_m_s)
    assert bench.driver.may_be_moving == stale(bench).may_move == may_move
    if may_move:
        assert not bench.driver.stopped
    else:
        bench.driver.stop()


def test_stop_that_may_not_have_arrived_is_an_error_and_is_sent_when_the_board_is_back(cut):
    bench = cut("2013-august")
    for stop in (bench.driver.stop, lambda: bench.driver.inhibit("stopped")):
        with pytest.raises(BoardTimeout, match=MAY_MOVE):
            stop()
    bench.line.plug()
    bench.driver.wait(5.0)
    assert bench.driver.ready and bench.driver.stopped and not bench.driver.may_be_moving
    bench.driver.stop()


def test_robot_that_is_cut_off_again_when_it_stands_is_not_moving(cut):
    """A view goes on when its stop may not have arrived."""
    bench = cut("2013-august")
    screen = Screen(bench.driver, Settings(), None)
    screen.press("space", 0.0)
    assert not screen.ended and screen.shown(0.0).notice == f"no telemetry arrives: {MAY_MOVE}"
    bench.line.plug()
    bench.driver.wait(5.0)
    bench.line.unplug()
    bench.driver.wait(SILENT_S)
    assert not bench.driver.ready and not bench.driver.may_be_moving


class Clock:
    """Stands for the module time: the driver's own, simulated time."""

    def __init__(self, driver):
        self.monotonic = lambda: driver.now_s


@pytest.mark.parametrize("cut_s", [0.5, 0.98], ids=["on-the-way", "at-the-end"])
def test_timed_drive_says_that_the_robot_may_still_be_moving(monkeypatch, cut_s):
    emulated = factory.make(factory.Options(profile="2013-august"))
    line = FaultyEngine(emulated.engine)
    with SteppedDriver(line) as driver:
        line.add(f"unplug:at={driver.now_s + cut_s},lasts=100")
        monkeypatch.setattr("mrl_driver.cli.commands.drive.time", Clock(driver))
        with pytest.raises(BoardTimeout, match=MAY_MOVE):
            drive_for(driver, 0.2, 0.0, 1.0)
    emulated.close()


@pytest.fixture
def talk():
    """A session with a board of 2013 that drives."""
    made = Talk(FakeBoard(version=1)).until_ready()
    assert not made.session.may_be_moving
    made.session.drive((200, 0), made.now)
    return made.run(0.2)


def test_port_that_is_back_before_the_board_answers_shows_nothing(talk):
    talk.session.lose(talk.now)
    talk.session.relink(talk.now)
    assert talk.session.may_be_moving


@pytest.mark.parametrize(
    "lost, after_s, moves",
    [(False, 0.01, True), (False, 0.5, False), (True, 0.3, True)],
    ids=["still rolling", "standing", "the command is lost on its way"],
)
def test_robot_that_is_cut_off_after_a_command_of_zero_may_move_until_its_wheels_were_seen_to_stand(
    talk, lost, after_s, moves
):
    talk.session.drive((0, 0), talk.now)
    if lost:
        talk.session.take()
    talk.run(after_s)
    talk.session.lose(talk.now)
    assert talk.session.may_be_moving == moves


def test_lost_port_under_a_stop_that_followed_a_command_of_zero_needs_the_wheels_to_stand():
    motion = Motion()
    motion.drive((200, 0), 0.0)
    motion.drive((0, 0), 0.1)
    motion.take(0.1)
    for i in range(10):
        motion.observe(False, 0.1 + i / 20)
    motion.forget("link_lost")
    assert not motion.unconfirmed
