"""One drive by the page in Chromium; the other files of this folder have the details."""

import pytest

from tests.waiting import wait_until

from .browser import PHONE
from .robot_page import RobotPage

pytestmark = pytest.mark.realtime  # the page's limits for late commands are the wall clock's


def test_a_finger_on_the_joystick_drives_until_it_is_lifted(browser, served):
    phone = RobotPage(browser, served.links[0], PHONE).take()
    phone.hold_until(lambda: served.robot.moves, phone.push, phone.tab.lift)
    phone.tab.lift()
    wait_until(lambda: not served.robot.moves)
    phone.wait(held="no")
