"""A port that goes away and comes back, on ptys behind a symbolic link."""

import math
import os
import threading
import time

import pytest

from mrl_driver.driver import Driver, Options
from mrl_driver.errors import BoardTimeout, LinkLost, PortMissing, WrongRobot
from mrl_driver.session.events import Lost, Reconnected
from mrl_driver.transport import reconnect
from mrl_driver.transport.link import SerialLink
from mrl_driver.transport.port_info import Port
from tests.waiting import PATIENCE_S, drive_until, is_decided, require_median, wait_until

from .conftest import Cable

NOTICED_S, BACK_S, CLOSE_S, RUNS = 0.1, 2.0, 1.0, 5  # Limits for the medians of so many runs at most


@pytest.fixture
def robot(cable):
    with Driver(cable.path, options=Options(reconnect=True, command_timeout_s=None)) as driver:
        driver.heard = []
        driver.on_event(driver.heard.append)
        yield driver


def further(robot, frames=15):
    """Waits for telemetry: what was sent before it has arrived."""
    until = robot.link.statistics.frames + frames
    wait_until(lambda: robot.link.statistics.frames > until)


def heard(robot, kind):
    return [event for event in robot.heard if isinstance(event, kind)]


def take_up_to(name):
    """Descriptors of pseudo terminals up to one, so that the next has another name: numbers are given out again."""
    number, taken = int(name.rpartition("/")[2]), []
    while not taken or int(os.ttyname(taken[-1]).rpartition("/")[2]) < number:
        taken += os.openpty()
    return taken


def test_an_unplugged_port_is_noticed_and_told(robot, cable):
    robot.drive(0.2, 0)
    cable.unplug()
    wait_until(lambda: heard(robot, Lost))
    assert heard(robot, Lost) == [Lost(cable.path, heard(robot, Lost)[0].reason)]
    assert "went away" in heard(robot, Lost)[0].reason
    assert not robot.ready and robot.error is None and robot.command is None


def test_an_unplugged_robot_that_drives_without_a_watchdog_may_still_be_moving(cable):
    cable.plug(version=1)
    events = []
    with Driver(cable.path, options=Options(reconnect=True, command_timeout_s=None)) as driver:
        driver.on_event(events.append)
        driver.drive(0.2, 0)
        cable.unplug()
        lost = wait_until(lambda: [event for event in events if isinstance(event, Lost)])
    assert lost[0].may_move


def test_a_robot_comes_back_under_another_name(robot, cable):
    cable.unplug()
    wait_until(lambda: heard(robot, Lost))
    before = cable.port.path
    taken = take_up_to(before)
    cable.plug()
    wait_until(lambda: heard(robot, Reconnected))
    assert robot.ready and robot.link.statistics.reconnects == 1
    assert cable.port.path != before
    for descriptor in taken:
        os.close(descriptor)


@pytest.mark.realtime
def test_a_lost_robot_is_noticed_and_found_again_in_time(robot, cable):
    noticed, back = [], []
    while not is_decided(noticed, NOTICED_S, RUNS) or not is_decided(back, BACK_S, RUNS):
        robot.heard.clear()
        start_s = time.monotonic()
        cable.unplug()
        wait_until(lambda: heard(robot, Lost))
        noticed.append(time.monotonic() - start_s)
        start_s = time.monotonic()
        cable.plug()
        wait_until(lambda: heard(robot, Reconnected))
        back.append(time.monotonic() - start_s)
    require_median(noticed, NOTICED_S, "noticing the loss")
    require_median(back, BACK_S, "the return")


def test_it_waits_for_a_new_command(robot, cable):
    robot.drive(0.2, 0)
    cable.unplug()
    wait_until(lambda: heard(robot, Lost))
    assert not robot.drive(0.2, 0)
    cable.plug()
    wait_until(lambda: heard(robot, Reconnected))
    further(robot)
    assert cable.port.board.moves == [] and robot.command is None
    drive_until(robot, 0.2, 0, lambda: cable.port.board.speeds == (200, 0))


def test_the_pose_goes_on_where_it_was(robot, cable):
    drive_until(robot, 0.3, 0.5, lambda: robot.pose.x_m > 0.05)
    cable.unplug()
    wait_until(lambda: heard(robot, Lost))
    before = robot.pose
    cable.plug()
    cable.port.board.right = cable.port.board.left = 12345.0
    wait_until(lambda: heard(robot, Reconnected))
    further(robot)
    assert robot.pose == before
    drive_until(robot, 0.3, 0, lambda: math.dist(robot.pose[:2], before[:2]) > 0.02)


def test_another_robot_is_not_taken(robot, cable):
    cable.unplug()
    wait_until(lambda: heard(robot, Lost))
    cable.plug(robot_id=2)
    wait_until(lambda: sum(frame.code == 5 for frame in cable.port.board.heard) > 1, what="a second try")
    assert not robot.ready and not heard(robot, Reconnected) and robot.error is None
    assert cable.port.board.period_s is None


@pytest.mark.realtime
def test_closing_in_the_search(serve, tmp_path):
    times = []
    while not is_decided(times, CLOSE_S, RUNS):
        cable = Cable(serve, tmp_path / f"robot{len(times)}")
        with Driver(cable.path, options=Options(reconnect=True)) as robot:
            cable.unplug()
            wait_until(lambda robot=robot: not robot.ready)
            start_s = time.monotonic()
            robot.close()
            times.append(time.monotonic() - start_s)
            assert robot.wait(0)
    require_median(times, CLOSE_S, "closing")


@pytest.mark.parametrize("error", [LinkLost, BoardTimeout])
def test_a_line_that_cannot_be_raised_in_the_search_is_tried_again(cable, monkeypatch, error):
    failures = []

    def speed_up(link):
        if failures:
            raise failures.pop()
        return False

    monkeypatch.setattr("mrl_driver.driver.link_source.speed_up", speed_up)
    with Driver(cable.path, options=Options(reconnect=True, fast=True)) as robot:
        failures.append(error("the port accepts no data"))
        cable.unplug()
        cable.plug()
        wait_until(lambda: not failures and robot.ready)


def test_a_write_that_fails_on_the_lost_link_does_not_break_the_new_one(robot, cable, monkeypatch):
    """The thread that wrote learns only after the reconnection that its write failed."""
    write, begun, found = SerialLink.write, threading.Event(), threading.Event()

    def drive():
        while not begun.is_set():  # one command may fall into a pause of the host
            robot.drive(0.1, 0.0)
            begun.wait(0.02)

    user = threading.Thread(target=drive, daemon=True)

    def failing(link, data):
        if threading.current_thread() is user and not begun.is_set():
            begun.set()
            assert found.wait(PATIENCE_S)
            raise LinkLost("the port went away")
        write(link, data)

    monkeypatch.setattr(SerialLink, "write", failing)
    user.start()
    assert begun.wait(PATIENCE_S)
    cable.unplug()
    wait_until(lambda: heard(robot, Lost))
    cable.plug()
    wait_until(lambda: cable.port.board.period_s is not None or heard(robot, Reconnected))
    found.set()
    user.join(PATIENCE_S)
    drive_until(robot, 0.1, 0.0, lambda: cable.port.board.speeds == (100, 0))
    assert not user.is_alive() and len(heard(robot, Lost)) == 1 and robot.error is None


def test_a_port_with_usb_ids_is_found_under_its_new_device(serve, cable, monkeypatch):
    """As the kernel hands out ttyACM1 while ttyACM0 is still held open."""
    there = []
    monkeypatch.setattr(reconnect, "described", lambda: list(there))
    foreign = serve()
    there[:] = [Port(cable.port.path, (), 1, 2, "A"), Port(foreign.path, (), 1, 3, "F")]
    with Driver(cable.path, options=Options(reconnect=True)) as robot:
        there.pop(0)
        cable.unplug()
        wait_until(lambda: not robot.ready)
        second, sister = serve(), serve(robot_id=2)
        there += [Port(sister.path, (), 1, 2, "B"), Port(second.path, (), 1, 2, "A")]
        wait_until(lambda: robot.ready)
        assert second.received and not sister.received and not foreign.received


def test_of_two_with_the_robots_id_none_is_taken_until_one_is_unplugged(serve, cable, monkeypatch):
    """Copies without serial number, both plugged in after the robot was lost."""
    there = []
    monkeypatch.setattr(reconnect, "described", lambda: list(there))
    there[:] = [Port(cable.port.path, (), 1, 2)]
    with Driver(cable.path, options=Options(reconnect=True)) as robot:
        told = []
        robot.on_event(lambda event: told.append(str(event)))
        twins = [serve(), serve()]
        there[:] = [Port(twin.path, (), 1, 2) for twin in twins]
        cable.unplug()
        wait_until(lambda: any("nothing tells them apart" in text for text in told))
        assert not robot.ready and not robot.drive(0.1, 0)
        wait_until(lambda: all(twin.board.period_s is None for twin in twins))
        del there[0]
        wait_until(lambda: robot.ready)
        assert twins[1].board.period_s and robot.drive(0.1, 0)


# -- the search itself


def refuse(name):
    raise PortMissing(f"{name} is not there")


@pytest.mark.parametrize(
    ("name", "error", "same"),
    [
        ("/dev/robot", WrongRobot("another id"), False),
        ("/dev/robot", LinkLost("gone again"), False),
        ("tcp://robot:7", WrongRobot("another id"), False),
        ("tcp://robot:7", LinkLost("nobody there yet"), True),
    ],
)
def test_an_address_where_nobody_answers_does_not_mean_another_board(name, error, same):
    search = reconnect.Reconnection(name, refuse, 1.0)
    assert search.lose(LinkLost("gone"), 0.0) and not search.lose(error, 0.1)
    assert search.same_board is same


def test_a_name_on_which_another_robot_has_answered_is_left_alone_for_longer(monkeypatch, tmp_path):
    now, opened, name = [0.0], [], str(tmp_path / "robot")
    open(name, "w").close()
    monkeypatch.setattr(reconnect.time, "monotonic", lambda: now[0])
    search = reconnect.Reconnection(name, opened.append, 1.0)
    search.lose(LinkLost("gone"), 0.0)
    search.lose(WrongRobot("another id"), 0.0)
    for now[0] in (reconnect.AGAIN_S, reconnect.WRONG_AGAIN_S - 0.1, reconnect.WRONG_AGAIN_S):
        search.look()
    assert opened == [name]


def test_a_board_has_its_time_to_answer(monkeypatch, tmp_path):
    monkeypatch.setattr(reconnect.time, "monotonic", lambda: 5.0)
    search = reconnect.Reconnection(str(tmp_path), str, 1.5)
    search.lose(LinkLost("gone"), 5.0)
    search.look()
    assert not search.judge(False, 6.4)
    with pytest.raises(BoardTimeout, match=f"{tmp_path} does not answer"):
        search.judge(False, 6.5)


def test_a_robot_that_was_found_elsewhere_is_looked_for_as_it_is_there(monkeypatch, tmp_path):
    """At the second loss, what was beside the second port then stays unopened."""
    one, two, three = (str(tmp_path / name) for name in ("one", "two", "three"))
    there = [Port(one, (), 1, 2, "A")]
    monkeypatch.setattr(reconnect, "described", lambda: list(there))
    opened = []
    search = reconnect.Reconnection(one, lambda name: opened.append(name) or name, 1.0)
    search.lose(LinkLost("gone"), 0.0)
    for name in (two, three):
        open(name, "w").close()
    there[:] = [Port(two, (), 1, 2, "A"), Port(three, (), 1, 2, "B")]
    search.look()
    assert search.judge(True, 0.1) and opened == [two]
    search.lose(LinkLost("gone"), 1.0)
    there.pop(0)
    assert search.look() is None and opened == [two]


@pytest.mark.parametrize("opens", [False, True])
def test_a_port_that_another_program_uses_or_that_does_not_open_gives_way_to_the_next(
    monkeypatch, tmp_path, opens
):
    one, two = (str(tmp_path / name) for name in ("one", "two"))
    there, opened = [Port(one, (), 1, 2)], []
    monkeypatch.setattr(reconnect, "described", lambda: list(there))
    monkeypatch.setattr(reconnect, "opened_by", lambda name: "cat" if name == one and opens else "")
    search = reconnect.Reconnection(
        one, lambda name: refuse(name) if name == one else opened.append(name), 1.0
    )
    search.lose(LinkLost("gone"), 0.0)
    for name in (one, two):
        open(name, "w").close()
    there.append(Port(two, (), 1, 2))
    search.look()
    search.look()
    assert opened == [two]


def test_a_robot_that_was_one_of_several_may_be_another_board(monkeypatch, tmp_path):
    one, *two = (Port(str(tmp_path / name), (), 1, 2) for name in "abc")
    there = [one]
    monkeypatch.setattr(reconnect, "described", lambda: there)
    search = reconnect.Reconnection(one.device, str, 1.0)
    search.lose(LinkLost("gone"), 0.0)
    there[:] = two
    for port in two:
        open(port.device, "w").close()
    search.look()
    with pytest.raises(WrongRobot, match="others like it must be asked first") as undecided:
        search.judge(True, 0.1)
    assert not search.lose(undecided.value, 0.2) and not search.same_board


@pytest.fixture
def terminal():
    """The name of a pseudo terminal."""
    ends = os.openpty()
    yield os.ttyname(ends[1])
    for end in ends:
        os.close(end)


def give_away(terminal):
    """Its time changes as that of a new one would.  The clock of files takes steps of some milliseconds."""
    before = os.stat(terminal).st_ctime
    wait_until(lambda: os.chmod(terminal, 0o622) or os.stat(terminal).st_ctime != before, step_s=0.001)


def searched(name, meanwhile):
    """The names that a search opens after `meanwhile`."""
    opened = []
    search = reconnect.Reconnection(name, opened.append, 1.0)
    search.lose(LinkLost("gone"), time.monotonic())
    meanwhile()
    search.look()
    return opened


@pytest.mark.parametrize("linked", [False, True])
def test_a_terminal_that_has_the_number_of_the_lost_one_is_not_opened(terminal, tmp_path, linked):
    """It belongs to another program, such as a shell.  Its time differs from that of the lost one."""
    name = str(tmp_path / "robot") if linked else terminal
    if linked:
        os.symlink(terminal, name)
    assert searched(name, lambda: None) == [name]
    assert searched(name, lambda: give_away(terminal)) == []


def test_a_terminal_under_a_new_link_is_opened(terminal, tmp_path):
    """The emulator has begun again, and got the number that its terminal had before."""
    name = str(tmp_path / "robot")
    os.symlink(terminal, name)

    def begin_again():
        give_away(terminal)
        os.symlink(terminal, name + ".new")
        os.replace(name + ".new", name)

    assert searched(name, begin_again) == [name]
