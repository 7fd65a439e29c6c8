"""What the emulator's README shows is run as it stands."""

import os
import pathlib
import re
import subprocess
import sys

import pytest
import yaml

from mrl_driver.protocol.table import SENSORS
from sim_arduino.faults.fault_table import FAULTS
from sim_arduino.replay.mirror import main as mirror
from sim_arduino.serve.control import ORDERS
from sim_arduino.serve.main import parser
from sim_arduino.world import world_file

ROOT = pathlib.Path(__file__).resolve().parents[2]
README = (ROOT / "sim_arduino" / "README.md").read_text(encoding="utf-8")
PYTHON = re.findall(r"```python\n(.*?)```", README, re.S)
TESTS = [text for text in PYTHON if "def test_" in text]
YAML = re.findall(r"```yaml\n(.*?)```", README, re.S)

SETUP = (ROOT / "setup.py").read_text(encoding="utf-8")
ENTRY_POINT = re.search(r'"pytest11": \["(.*?)"\]', SETUP).group(1)
PLUGIN = ENTRY_POINT.partition("=")[2]


def run_pytest(folder, texts, *options, **environment):
    """What pytest says of somebody else's files; the plugin is named unless `options` do otherwise."""
    for name, text in texts.items():
        (folder / f"{name}.py").write_text(text)
    environment = {
        **os.environ,
        "PYTHONPATH": str(ROOT),
        "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1",
        **environment,
    }
    command = [sys.executable, "-m", "pytest", "-q", "-rA", *(options or ("-p", PLUGIN))]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    return done.stdout + done.stderr


def test_pytest_finds_the_fixtures_once_installed(tmp_path):
    installed = tmp_path / "mrl_driver-0.dist-info"
    installed.mkdir()
    (installed / "METADATA").write_text("Metadata-Version: 2.1\nName: mrl-driver\nVersion: 0\n")
    (installed / "entry_points.txt").write_text(f"[pytest11]\n{ENTRY_POINT}\n")
    found = {"PYTHONPATH": f"{ROOT}:{tmp_path}", "PYTEST_DISABLE_PLUGIN_AUTOLOAD": ""}
    out = run_pytest(tmp_path, {}, "--fixtures", **found)
    assert "emulated_board" in out
    assert "true_pose" in out


def name_of(text):
    return re.findall(r"def (test_\w+)", text)[0]


QUICK = {name_of(text): text for text in TESTS if "within_s" not in text}


NOBODY = """import pytest
@pytest.mark.emulated_board(robot="nobody")
def test_nobody(emulated_board): pass
"""


@pytest.fixture(scope="module")
def said(tmp_path_factory):
    return run_pytest(tmp_path_factory.mktemp("readme"), {**QUICK, "test_nobody": NOBODY})


@pytest.mark.parametrize("name", QUICK)
def test_tests_of_the_readme_pass(said, name):
    assert re.search(rf"^PASSED {name}\.py::(\w+::)?{name}$", said, re.M), said


def test_a_board_that_cannot_be_made_is_told_in_one_line(said):
    told, _, summary = said.partition("short test summary info")  # which repeats the message
    assert told.count("robot 'nobody' is unknown, expected duo") == 1 and "ERROR test_nobody.py" in summary
    assert "factory.py" not in said


@pytest.mark.realtime
@pytest.mark.parametrize("text", [text for text in TESTS if "within_s" in text], ids=name_of)
def test_tests_of_the_readme_with_a_time_limit_pass(tmp_path, text):
    out = run_pytest(tmp_path, {"test_robot": text})
    assert "1 passed" in out, out


def test_other_code_of_the_readme_runs(tmp_path):
    code = "\n".join(text for text in PYTHON if "def test_" not in text)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, env=environment, check=True)
    assert world_file.load(str(tmp_path / "l-course-map.yaml")).walls


def test_the_world_of_the_readme_loads(tmp_path):
    (tmp_path / "world.yaml").write_text(YAML[0])
    assert len(world_file.load(str(tmp_path / "world.yaml")).walls) == 5
    assert set(world_file.KEYS) - {*yaml.safe_load(YAML[0]), "map"} <= {row.name for row in SENSORS}


def commands():
    return re.findall(r"^    (?:.*\| )?(mrl-sim .*|mrl mirror .*)$", README, re.M)


@pytest.mark.parametrize("line", commands())
def test_commands_of_the_readme_parse(line):
    words = line.split()
    if words[0] == "mrl":
        mirror.make_context("mirror", words[2:])
    else:
        parser().parse_args(words[1:])


def first_column(title):
    table = README[README.index(f"| {title} |") :].split("\n\n")[0]
    return [name for row in table.splitlines()[2:] for name in re.findall(r"`([^`]+)`", row.split("|")[1])]


def test_the_faults_named_are_those_there_are():
    assert sorted(first_column("fault")) == sorted(FAULTS)


def test_the_orders_named_are_those_there_are():
    assert sorted(first_column("order")) == sorted(order for order, _ in ORDERS)


def test_the_worlds_named_are_those_there_are():
    named = re.search(r"takes a name \((.*?)\)", README, re.S).group(1)
    assert sorted(re.findall(r"`([\w-]+)`", named)) == world_file.names()
