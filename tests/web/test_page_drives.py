"""The page in Chromium drives an emulated robot through `mrl web`, with TLS and a token."""

import pytest

from mrl_driver.recording.recording import Recording
from tests.driver.emulator import MOVE, STOP
from tests.waiting import wait_until

from .browser import DESK, LOST_STOP, NO_PLACE, NO_WEBSOCKET, PAD, PHONE, RELEASED
from .robot_page import RobotPage

pytestmark = pytest.mark.realtime  # the page's limits for late commands are the wall clock's

FURTHER = 4  # The robot still stands when the page has sent so many more messages
HOLD_PAD = "window.pad.buttons[4] = {pressed: arguments[0], touched: arguments[0], value: +arguments[0]};"


@pytest.fixture
def visit(browser, shared):
    """Opens pages, and closes them at the end."""
    pages = []

    def open_page(size=DESK, before="", link=0):
        pages.append(RobotPage(browser, shared.links[link], size, before))
        return pages[-1]

    yield open_page
    for page in pages:
        page.tab.close()
    wait_until(lambda: not shared.robot.moves)


@pytest.fixture
def robot(shared):
    return shared.robot


@pytest.fixture
def still_stands(shared):
    """Whether the robot did not move again since it stopped; pages have sent more by then."""

    def ask():
        stopped_s = shared.robot.wait_for(STOP, shared.robot.times(MOVE)[-1])
        sent = len(shared.proxy.sent)
        wait_until(lambda: len(shared.proxy.sent) > sent + FURTHER)
        return not shared.robot.times(MOVE, stopped_s)

    return ask


def moves_and_stops(robot, page, begin, end):
    """The robot moves after `begin` and stops after `end`."""
    page.hold_until(lambda: robot.moves, begin, end)
    end()
    wait_until(lambda: not robot.moves)


def key(page, name):
    """Functions that press and release a key."""
    return lambda: page.tab.key("keyDown", name), lambda: page.tab.key("keyUp", name)


def test_a_key_drives_until_it_is_released(visit, robot):
    desk = visit(DESK).take()
    for name in ("w", "ArrowLeft"):
        moves_and_stops(robot, desk, *key(desk, name))


@pytest.mark.parametrize("button", ["forward", "zoom-in"])
def test_space_stops_after_a_click_on_a_button(visit, button):
    desk = visit(DESK).take()
    for kind in ("mousePressed", "mouseReleased"):
        desk.tab.mouse(kind, button)
    desk.tab.type(" ")
    desk.wait(latched="yes")
    desk.take()


def test_space_stops_a_robot_that_keys_drive_wherever_the_focus_is(visit, robot):
    desk = visit(DESK).take()
    begin, end = key(desk, "w")
    desk.tab.run("document.getElementById('forward').focus()")
    desk.hold_until(lambda: robot.moves, begin, end)
    desk.tab.type(" ")
    desk.wait(latched="yes")
    end()
    desk.take()


def test_space_on_a_button_with_the_focus_drives_until_it_is_released(visit, robot):
    """Its key repeats meanwhile."""
    desk = visit(DESK).take()
    desk.tab.run("document.getElementById('forward').focus()")
    begin, end = key(desk, " ")
    moves_and_stops(robot, desk, lambda: (begin(), desk.tab.key("keyDown", " ", autoRepeat=True)), end)
    assert desk.state["latched"] == "no"


def test_a_gamepad_drives_while_its_shoulder_button_is_held(visit, robot):
    desk = visit(DESK, PAD).take()
    desk.tab.run("dispatchEvent(Object.assign(new Event('gamepadconnected'), {gamepad: window.pad}));")
    desk.tab.run("window.pad.axes[1] = -1;")
    moves_and_stops(robot, desk, lambda: desk.tab.run(HOLD_PAD, True), lambda: desk.tab.run(HOLD_PAD, False))


def test_a_goal_is_driven_to_while_its_button_is_held(visit, robot):
    phone = visit(PHONE).take()
    phone.set(**{"goal-x": robot.plant.true_pose.x_m + 2.0, "goal-y": robot.plant.true_pose.y_m})
    at = phone.tab.centre("go")
    moves_and_stops(robot, phone, lambda: phone.tab.touch(at), phone.tab.lift)


def test_who_watches_can_stop_and_only_who_drives_can_release(visit, robot, still_stands):
    driver, watcher = visit(PHONE).take(), visit(DESK, link=1)
    watcher.arrive().wait(helm="other")
    driver.push_until(lambda: robot.moves)
    watcher.tab.press("stop")
    driver.wait(latched="yes", spent="yes")
    assert still_stands()
    assert not watcher.usable("release")
    assert "Release it to drive on" in driver.text("state") and "release" not in watcher.text("state").lower()
    driver.tab.lift()
    driver.tab.press("release")
    watcher.wait(latched="no")
    moves_and_stops(robot, driver, driver.push, driver.tab.lift)


def test_after_a_stop_the_finger_must_be_lifted(visit, robot, still_stands):
    phone = visit(PHONE).take()
    phone.push_until(lambda: robot.moves)
    phone.tab.type("Escape")
    phone.wait(latched="yes", spent="yes")
    phone.tab.press("release")
    phone.tab.touch(phone.stick(0.0), phone.stick(0.5))
    assert still_stands()
    phone.tab.lift()
    moves_and_stops(robot, phone, phone.push, phone.tab.lift)


def test_handing_over_stops_the_robot_first(visit, robot, still_stands):
    first, second = visit(PHONE).take(), visit(DESK)
    second.arrive().wait(helm="other")
    first.push_until(lambda: robot.moves)
    first.tab.press("yield")
    assert still_stands()
    first.tab.lift()
    second.take()
    first.wait(helm="other")
    moves_and_stops(robot, second, *key(second, "w"))


def test_a_watch_only_page_has_a_stop_and_nothing_to_drive_with(visit):
    page = visit(DESK, link=1)
    page.arrive().wait(role="watch")
    shown = [name for name in ("joystick", "forward", "go", "take", "release", "speed") if page.shows(name)]
    assert shown == [] and page.usable("stop")


def test_a_page_without_a_place_sends_its_stop_when_there_is_one(visit):
    page = visit(DESK, NO_PLACE)
    page.wait(link="closed")
    assert "16 pages show this robot" in page.text("state")
    page.tab.press("stop")
    page.tab.run("window.free = true")
    page.wait(latched="yes", transport="websocket")
    assert "Take the helm, then release it" in page.text("state") and not page.shows("phone-panel")
    page.take()


@pytest.mark.parametrize("before", ["", NO_WEBSOCKET], ids=["websocket", "events"])
def test_a_stop_that_the_network_has_lost_is_sent_again(visit, shared, before):
    page = visit(DESK, before).arrive()
    shared.proxy.flows.clear()
    try:
        page.tab.press("stop")
        shared.proxy.cut()
    finally:
        shared.proxy.flows.set()
    page.wait(latched="yes")
    page.take()


def test_a_stop_that_is_lost_alone_is_sent_again(visit):
    page = visit(DESK, LOST_STOP).arrive()
    page.tab.press("stop")
    page.wait(latched="yes")
    assert page.tab.run("return window.lost")
    page.take()


def test_a_stop_that_another_program_has_released_is_not_shown_as_one(visit):
    page = visit(DESK, RELEASED).arrive()
    page.tab.wait("document.getElementById('state').innerText.includes('the robot may move')")


def test_values_from_before_the_link_was_lost_are_not_shown(visit, shared):
    page, names = visit(DESK).arrive(), ("tile-speed", "tile-nearest", "tile-battery")
    wait_until(lambda: "–" not in map(page.text, names))
    shared.proxy.flows.clear()
    try:
        page.wait(link="closed")
        wait_until(lambda: {*map(page.text, names)} == {"–"})
        assert not page.usable("record")
    finally:
        shared.proxy.flows.set()


def test_where_websockets_are_refused_the_page_drives_all_the_same(visit, robot):
    phone = visit(PHONE, NO_WEBSOCKET).take()
    assert phone.state["transport"] == "events"
    moves_and_stops(robot, phone, phone.push, phone.tab.lift)


def size_of(path):
    """The file's size: until a download is complete, Chromium keeps an empty file of its name."""
    return path.stat().st_size


def test_a_drive_is_recorded_and_downloaded(visit, robot, browser):
    desk = visit(DESK).take()
    desk.tab.press("record")
    desk.wait(recording="yes")
    moves_and_stops(robot, desk, *key(desk, "w"))
    desk.tab.press("record")
    desk.wait(recording="no")
    desk.tab.wait("document.querySelector('#recordings a')")
    desk.tab.press("#recordings a")
    file = wait_until(lambda: next(filter(size_of, browser.downloads.glob("*.mrl")), None))
    assert any(b"@11," in entry.data for entry in Recording(str(file)))
