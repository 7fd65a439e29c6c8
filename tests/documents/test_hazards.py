"""Tables of hazards, pins and message codes: what they name is what the project has."""

import ast
import functools
import re

import pytest
from click.testing import CliRunner

from mrl_driver import errors
from mrl_driver.cli.main import cli
from mrl_driver.problems import PLACEHOLDERS, PROBLEMS
from mrl_driver.protocol.table import NOT_CONNECTED
from mrl_driver.robot import wiring
from mrl_driver.robot.chips import ATMEGA328P
from mrl_driver.view.words import STOPS, stopped_text
from tests.models import model

from .blocks import ROOT

TEXT = (ROOT / "docs" / "hazards.md").read_text(encoding="utf-8")
BENCHMARKS = (ROOT / "BENCHMARKS.md").read_text(encoding="utf-8")
NAMED = sorted(set(re.findall(r"`([\w/]+\.py)::(\w+)`", TEXT)))
ROWS = [
    [cell.strip() for cell in row.split("|")] for row in re.findall(r"^\|( \d+ \|.*)\|$", TEXT, re.MULTILINE)
]
PROPERTIES = set(
    re.findall(
        r"\bP\d\b",
        (ROOT / "tests/long/verify/README.md").read_text(encoding="utf-8").split("## The model")[0],
    )
)
SECTIONS = dict(re.findall(r"^\[(\w+)\]: \.\./BENCHMARKS\.md#(.*)$", TEXT, re.MULTILINE))


@pytest.mark.parametrize("file", sorted({file for file, _ in NAMED}))
def test_named_tests_exist(file):
    text = (ROOT / "tests" / file).read_text(encoding="utf-8")
    assert [name for where, name in NAMED if where == file and f"\ndef {name}(" not in text] == []


def test_each_hazard_has_a_number_a_guard_a_limit_and_a_test():
    """The first 34, except 32, are the faults that a soak counts."""
    assert [int(row[0]) for row in ROWS] == list(range(1, len(ROWS) + 1)) and len(ROWS) >= 53
    assert [row[0] for row in ROWS if len(row) != 7 or not all(row) or "::test_" not in row[6]] == []


def test_each_property_is_one_that_is_verified_and_each_has_a_hazard():
    named = {each for row in ROWS for each in row[4].split()} - {"-"}
    assert named == PROPERTIES == {f"P{number}" for number in range(1, 8)}


def section(anchor):
    """The section of BENCHMARKS.md with this anchor."""
    parts = re.split(r"^## (.*)$", BENCHMARKS, flags=re.MULTILINE)
    titles = {
        re.sub(r"[^\w -]", "", title).lower().replace(" ", "-"): text
        for title, text in zip(parts[1::2], parts[2::2])
    }
    return titles[anchor]


@pytest.mark.parametrize("row", [row for row in ROWS if row[5] != "test"], ids=lambda row: row[0])
def test_what_is_measured_is_in_the_benchmarks(row):
    """The figures are there alone."""
    sources = row[5].split(", ")
    assert sources and all(section(SECTIONS[source[1:-1]]) for source in sources)


def test_all_inputs_that_are_refused_have_tests():
    rows = re.findall(
        r"^\| [^|]+ \| (`[^|]*::test_[^|]*) \|$", TEXT.split("## Input that is refused")[1], re.M
    )
    assert len(rows) == 10


PINS = (ROOT / "firmware" / "mrl_firmware" / "pins.h").read_text(encoding="utf-8")
HARDWARE = (ROOT / "HARDWARE.md").read_text(encoding="utf-8")
BRIDGE = HARDWARE.split("## H-bridge build")[1].split("\n## ")[0]
DRAWN = {"L298N": "L298N module", "TB6612": "TB6612 board"}
"""Bridges with a drawing, and their columns in the table of wires."""


def constants(text):
    """Names and Arduino numbers."""
    return {name: int(pin) for name, pin in re.findall(r"constexpr uint8_t (\w+) = (\d+);", text)}


def in_header():
    """Of every build, the builds with a motor board, a duo, sonars, environment sensors."""
    before, rest = PINS.split("#if MRL_ENVIRONMENT")
    environment, sonar = rest.split("#else")
    common = dict(
        zip(("SERIAL_IN", "SERIAL_OUT", "I2C_DATA", "I2C_CLOCK"), ATMEGA328P.serial + ATMEGA328P.bus)
    )
    motor_board = {name: pin for name, pin in constants(before).items() if "XBEE" in name}
    bridge = {
        wiring.short(name).upper(): pin
        for name, pin in wiring.of_board(model("duo").board).items()
        if name in wiring.PIN_NAMES and pin != NOT_CONNECTED and "sonar" not in name
    }
    return [common, motor_board, bridge, constants(sonar), constants(environment)]


def number(pin):
    return int(pin[1:]) + (14 if pin[0] == "A" else 0)


def rows_of(text):
    """Cells of the rows that begin with a pin."""
    lines = re.findall(r"^\| (?:[AD]\d+) \|.*\|$", text, re.M)
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def column(rows, at):
    """Names in one column and their pins."""
    return {name: number(row[0]) for row in rows for name in re.findall(r"`(\w+)`", row[at])}


def terminals(title):
    """Pins of the terminals of a bridge, in the table of wires."""
    (head,) = re.findall(r"^\| Uno pin \| function \| VNH.*$", BRIDGE, re.M)
    at = [cell.strip() for cell in head.strip("|").split("|")].index(title)
    return {row[at]: row[0] for row in rows_of(BRIDGE) if len(row) > at}


def test_the_pin_table_is_that_of_the_firmware():
    rows = rows_of(HARDWARE.split("## Pins")[1].split("##")[0])
    assert [column(rows, at) for at in range(1, 6)] == in_header()


def test_each_wire_of_a_bridge_is_at_its_pin():
    wires, bridge = column(rows_of(BRIDGE), 1), in_header()[2]
    assert wires == {name: pin for name, pin in bridge.items() if "PWM" in name or "LOGIC" in name}


@pytest.mark.parametrize("name", DRAWN)
def test_a_drawing_shows_the_pins_of_its_table(name):
    drawing = BRIDGE.split(f"### {name}, step by step")[1].split("```")[1]
    drawn = re.findall(r"Uno (D\d+) +-+\| (\w+)", drawing)
    assert {terminal: pin for pin, terminal in drawn} == terminals(DRAWN[name])


def test_the_divider_is_drawn_at_its_pin():
    (pin,) = re.findall(r"Uno ([AD]\d+) -+\+---- 100 nF", BRIDGE)
    assert number(pin) == in_header()[2]["BATTERY"]


PACKAGES = ("mrl_driver", "sim_arduino", "ros1_bridge")
TABLE = ROOT / "mrl_driver" / "problems.py"
ERRORS = [
    each for each in vars(errors).values() if isinstance(each, type) and issubclass(each, errors.MrlError)
]
REVIEW = "".join(each.read_text() for each in (ROOT / "mrl_driver/apps/review/findings").glob("*.py"))
FROM_THE_TABLE = {code for code in PROBLEMS if f'"{code}"' in REVIEW or code.startswith("battery_")}


FROM_THE_TABLE |= {"imu_dead", "imu_frozen", "imu_wrong", "imu_tilted"}
"""Codes whose message is read from the table."""
OF_OTHERS = {"not_found", "no_ros"}
"""Codes whose message is that of the shell or of ROS."""


def text_of(node):
    """A string as it is shown, with a mark for each value in it."""
    if isinstance(node, ast.JoinedStr):
        return "".join(text_of(each) for each in node.values)
    if isinstance(node, ast.Constant):
        return str(node.value)
    return "\0"


@functools.lru_cache(maxsize=None)
def sources():
    """The strings of all modules but the table, one a line, in small letters."""
    found = []
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            if path != TABLE:
                tree = ast.parse(path.read_text(encoding="utf-8"))
                found += [
                    text_of(node)
                    for node in ast.walk(tree)
                    if isinstance(node, (ast.JoinedStr, ast.Constant))
                ]
    return "\n".join(text.replace("\n", " ") for text in found).lower()


MESSAGES = [(row.code, text) for row in PROBLEMS.values() for text in (row.message, *row.also)]
STOPPED = {stopped_text(reason) for reason in STOPS}


def test_the_messages_are_those_that_users_see():
    """A changed message must be changed in the table too."""
    holes, unseen = re.compile("|".join(PLACEHOLDERS)), []
    for code, text in MESSAGES:
        parts = [re.escape(part.lower()) for part in holes.split(text)]
        if text not in STOPPED and not re.search("[^\n]*".join(filter(None, parts)), sources()):
            unseen.append((code, text))
    assert {code for code, _ in unseen} - FROM_THE_TABLE - OF_OTHERS == set(), unseen


@pytest.mark.parametrize(
    ("code", "text"),
    [
        ("not_found", "mrl: command not found"),
        ("no_ros", "[sim.launch] is neither a launch file in package [mrl_robots]"),
    ],
)
def test_what_others_say_is_explained(code, text):
    assert text in PROBLEMS[code].message


def test_a_remedy_for_root_works_in_a_virtual_environment():
    """`sudo mrl` is not found there."""
    remedies = "\n".join(row.remedy for row in PROBLEMS.values())
    assert 'sudo "$(which mrl)" system install' in remedies and not re.search(
        r"sudo mrl|\bmrl system[^;]* as root", remedies
    )


@pytest.mark.parametrize("kind", ERRORS, ids=lambda each: each.__name__)
def test_an_errors_code_is_a_row(kind):
    assert not kind.code or kind.code in PROBLEMS
    assert kind("text").line == (f"text  [{kind.code}]" if kind.code else "text")


@pytest.mark.parametrize("word", ["port_busy", "[port_busy]", "port-busy"])
def test_explain_prints_cause_and_remedy(word):
    row, done = PROBLEMS["port_busy"], CliRunner().invoke(cli, ["explain", word])
    assert done.exit_code == 0 and row.cause in done.output and row.advice in done.output
