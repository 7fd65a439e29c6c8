"""What the page in Chromium shows: its size, its controls for the keyboard, what it loads."""

import pytest

from mrl_driver.apps.review.page import render
from tests.review.page_drives import FINDING, drive

from .browser import ASKED, DESK, PHONE, PROJECTOR, Size
from .robot_page import RobotPage

CONTROLS = "button, a[href], input, select, textarea, summary, [tabindex]"
REACHABLE = f"""
return [...document.querySelectorAll("{CONTROLS}")]
  .filter(e => e.checkVisibility() && !e.disabled && e.tabIndex >= 0).map(e => e.id || e.outerHTML.slice(0, 80));
"""
FOCUSED = "const e = document.activeElement; return e.id || e.outerHTML.slice(0, 80);"
BEYOND = """
return [...document.body.querySelectorAll("*")].filter(e => e.checkVisibility()).filter(e => {
  const box = e.getBoundingClientRect(); return box.width > 0 && (box.right > innerWidth + 0.5 || box.left < -0.5);
}).map(e => e.id || e.outerHTML.slice(0, 80));
"""


@pytest.fixture
def visit(browser, served, close_later):
    def open_page(size=DESK, before=""):
        page = RobotPage(browser, served.links[0], size, before)
        close_later(page.tab)
        return page.arrive()

    return open_page


@pytest.mark.parametrize("size", [PHONE, DESK, PROJECTOR])
def test_the_page_fits_the_window_with_stop_and_joystick_in_sight(visit, size):
    page = visit(size).take()
    assert page.tab.run("return document.documentElement.scrollWidth") <= size.width
    assert page.tab.run(BEYOND) == []
    for name in ("stop", "joystick"):
        left, top, right, bottom = page.box(name)
        assert left >= 0 and top >= 0 and right <= size.width and bottom <= size.height, name


@pytest.mark.parametrize("size", [PHONE, Size(740, 360, True)])
def test_the_stick_keeps_its_place_when_the_page_tells_of_a_stop(visit, size):
    page = visit(size).take()
    before = page.box("joystick")
    page.tab.press("stop")
    page.wait(latched="yes")
    assert page.box("joystick") == before


def test_the_tab_key_reaches_every_control_and_stop_first(visit):
    page = visit(DESK)
    page.tab.run(
        "document.getElementById('take').click()"
    )  # the tab key goes on from where the mouse clicked
    page.wait(helm="mine")
    expected, reached = page.tab.run(REACHABLE), []
    for _ in expected:
        page.tab.type("Tab")
        reached.append(page.tab.run(FOCUSED))
    assert reached[0] == "stop" and sorted(reached) == sorted(expected)


def test_every_control_has_a_name_for_a_screen_reader(visit):
    page = visit(DESK).take()
    page.tab.tell("Accessibility.enable")
    nodes = page.tab.tell("Accessibility.getFullAXTree")["nodes"]
    roles = set(
        [
            "button",
            "textbox",
            "spinbutton",
            "slider",
            "combobox",
            "link",
            "checkbox",
            "canvas",
            "img",
            "image",
        ]
    )
    found = [node for node in nodes if not node["ignored"] and node["role"]["value"] in roles]
    assert len(found) > 5
    assert [node for node in found if not node.get("name", {}).get("value")] == []


def test_the_page_asks_its_own_server_alone_and_the_browser_keeps_it_to_that(visit, served):
    page = visit(DESK, ASKED).take()
    asked = page.tab.run("return asked()")
    assert len(asked) > 10 and {url.split("/")[2] for url in asked} == {served.links[0].split("/")[2]}
    page.tab.run("fetch('http://example.com/picture').catch(() => 0);")
    page.tab.wait("document.documentElement.dataset.refused === 'http://example.com/picture'")


def test_the_review_of_a_drive_opens_offline_and_a_click_on_a_finding_moves_its_charts_there(
    browser, tmp_path
):
    file = tmp_path / "drive.html"
    file.write_text(
        render(drive(port="</script><script>document.title = 'run'</script>"), [FINDING]), encoding="utf-8"
    )
    tab = browser.open(file.as_uri(), PHONE, ASKED)
    tab.wait("document.documentElement.dataset.ready === 'yes'")
    tab.run("document.getElementById('moment').value = 0; document.querySelector('.goto').click();")
    tab.wait(f"document.documentElement.dataset.moment === '{FINDING.time_s:g}'")
    assert tab.run("return document.getElementById('moment').value") == f"{FINDING.time_s:g}"
    assert tab.run("return document.querySelectorAll('.u-over').length") >= 8
    assert tab.run("return document.documentElement.scrollWidth") == PHONE.width and tab.run(BEYOND) == []
    assert tab.run("return [document.title, document.documentElement.dataset.refused ?? '']") == [
        "Review of drive.mrl",
        "",
    ]
    assert [url for url in tab.run("return asked()") if url != file.as_uri()] == []
    tab.close()
