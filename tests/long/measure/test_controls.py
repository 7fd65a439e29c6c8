"""`mrl measure` on boards with one known fault, and on sound ones, in simulated time: the table of controls.yaml."""

import fnmatch
from pathlib import Path

import pytest
import yaml

from mrl_driver.apps.measure import course, host, line
from mrl_driver.apps.measure.rows import (
    ABSENT,
    AGREES,
    COURSE,
    KINDS,
    LINE,
    WORSE,
    causes,
    compared,
    keys_of,
    kind_of,
)
from mrl_driver.protocol.table import VIRTUAL_FAULTS
from mrl_driver.robot.models import kit
from tests.conftest import EXPLORE
from tests.models import four_wheel_kit

from . import boards
from .__main__ import IMAGES, ROOT
from .__main__ import measured as measured_image

CONTROLS = yaml.safe_load(Path(__file__).with_name("controls.yaml").read_text(encoding="utf-8"))
FAULTS = CONTROLS["faults"]
OLD_FAULTS = ("encoder_reversed", "damage_0_1_percent", "wheel_5_percent_smaller", "sonar_dead")


def controls():
    """Each fault on one of the robots that can have it, in turn, if possible none with H-bridges, which take four
    times as long; an exploring run has all.
    """
    for number, (fault, expected) in enumerate(FAULTS.items()):
        robots = expected.get("robots", boards.ROBOTS)
        quick = [robot for robot in robots if robot != "duo"] or robots
        yield from ((fault, robot) for robot in (robots if EXPLORE else [quick[number % len(quick)]]))


def measured(bench, drives=True):
    """All rows of a board, without those of the manoeuvres unless it drives."""
    with bench.driver(imu_period_ms=0) as driver:
        kind, old = kind_of(driver.board), driver.board.protocol < 2
        rows = list(host.rows(driver, moves=True))
        rows += course.rows(driver, boards.truth(driver)) if drives else ()
    with bench.link() as (link, clock):
        rows += line.rows(link, clock, moves=True, old=old)
    return [compared(row, kind) for row in rows]


def named(patterns):
    """The rows that these names of the table stand for."""
    found = {key for pattern in patterns for key in fnmatch.filter(KINDS, pattern)}
    assert found or not patterns, f"no row is named {patterns}"
    return found


def worse(rows):
    return {row.key for row in rows if row.verdict == WORSE}


@pytest.mark.parametrize(("fault", "robot"), list(controls()))
def test_a_fault_fails_its_rows_and_no_other_and_its_cause_is_named_first(fault, robot):
    """A fault of no manoeuvre's row is driven with in an exploring run: the manoeuvres take most of the time."""
    expected = FAULTS[fault]
    must, some, may = (named(expected.get(each, [])) for each in ("must", "some", "may"))
    drives = bool(EXPLORE or (must | some) & {*keys_of(COURSE)})
    rows = measured(boards.bench(robot, **boards.FAULTS[fault]), drives)
    found, first = worse(rows), causes(rows)[0].code
    assert must <= found <= must | some | may and (found & some or not some)
    assert first == (expected["cause"][robot] if isinstance(expected["cause"], dict) else expected["cause"])


@pytest.mark.parametrize("seed", range(1, 4 if EXPLORE else 2))
def test_damaged_requests_do_not_end_the_measurement(seed):
    """A start of a stream may be damaged, or two requests that keep the checksums of the board on."""
    with boards.bench("duo", **{**boards.FAULTS["damage_0_1_percent"], "seed": seed}).link() as (link, clock):
        found = {row.key: row for row in line.rows(link, clock, moves=True)}
    assert {*keys_of(LINE)} == set(found) and found["delay_ms"].value is not None


def sound():
    """One robot that is driven sideways; an exploring run has all, and one with mecanum wheels."""
    robots = (*boards.ROBOTS, "mecanum")
    seeds = range(CONTROLS["sound"]) if EXPLORE else [robots.index("omni")]
    return [(robots[seed % len(robots)], seed) for seed in seeds]


@pytest.mark.parametrize(("robot", "seed"), sound())
def test_a_sound_board_passes(robot, seed, tmp_path):
    if robot == "mecanum":
        robot = str(tmp_path / "mecanum_bot.yaml")
        Path(robot).write_text(kit.text_of(four_wheel_kit("mecanum")))
    rows = measured(boards.sound(robot, seed))
    assert not worse(rows) and not causes(rows)
    assert "square" in {row.key for row in rows if row.verdict == AGREES}


@pytest.mark.parametrize("profile", ["2013-january", *(["2013-august"] if EXPLORE else [])])
def test_a_sound_board_of_2013_drives_all_manoeuvres_and_passes(profile):
    rows = measured(boards.bench("traxbot", profile=profile))
    driven = {row.key for row in rows if row.kind.section == COURSE and row.value is not None}
    assert not worse(rows) and driven == {*keys_of(COURSE)} - {"sideways"}


@pytest.mark.parametrize("fault", OLD_FAULTS if EXPLORE else OLD_FAULTS[:1])
def test_on_a_board_of_2013_the_same_cause_is_named_first(fault):
    """Its frames have no checksum: damage makes counts jump, and is no noise of the encoders."""
    cause = FAULTS[fault]["cause"]
    found = causes(measured(boards.bench("traxbot", profile="2013-august", **boards.FAULTS[fault])))
    assert found[0].code == (cause["traxbot"] if isinstance(cause, dict) else cause)
    assert "encoder_noise" not in {each.code for each in found}


def test_a_fault_that_is_set_in_a_virtual_board_is_what_is_looked_for():
    image = boards.bench(
        "duo", engine="avr", elf=str(ROOT / "build" / "firmware" / "mrl_firmware_virtual.elf")
    )
    with image.driver() as driver:
        driver.parameters.write(
            {"virtual_faults": 1 << [name for name, _ in VIRTUAL_FAULTS].index("left_blocked")}
        )
        first = causes(course.rows(driver, boards.truth(driver)))[0]
    assert "virtual_faults" in first.remedy


def test_the_virtual_image_passes_on_a_simulated_chip(monkeypatch):
    """The manoeuvres, which other tests of the image drive, in an exploring run."""
    if not EXPLORE:
        monkeypatch.setattr(course, "rows", lambda *_: ())
    result = measured_image(*IMAGES["simulated_uno_virtual"])
    assert "virtual" in result["board"]["capabilities"] and result["causes"] == []
    assert not [row["key"] for row in result["rows"] if row["verdict"] in (WORSE, ABSENT)]
