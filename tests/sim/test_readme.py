"""What the emulator's README shows is run as it stands."""

import os
import pathlib
import re
import subprocess
import sys

import pytest
import yaml

from mrl_driver.protocol.table import SENSORS
from sim_arduino.faults.fault_table import FAULTS, parse
from sim_arduino.replay.mirror import main as mirror
from sim_arduino.serve.control import ORDERS
from sim_arduino.serve.main import main
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
    """By what an installation leaves behind beside the packages."""
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
TO_FAIL = TESTS[0].replace("drive(0.3", "drive(0.0").replace("x_m > 0.5)", "x_m > 0.5, 0.2)")
"""The same file, with a robot that is told not to move."""


@pytest.fixture(scope="module")
def said(tmp_path_factory):
    """By pytest of the README's tests without a time limit, and of one that should fail."""
    return run_pytest(tmp_path_factory.mktemp("readme"), {**QUICK, "test_to_fail": TO_FAIL})


@pytest.mark.parametrize("name", QUICK)
def test_tests_of_the_readme_pass(said, name):
    assert re.search(rf"^PASSED {name}\.py::(\w+::)?{name}$", said, re.M), said


def test_a_test_that_should_fail_fails(said):
    assert "not within 0.2 s: the condition; the robot is at x 0.000 m" in said
    assert f"FAILED test_to_fail.py::{name_of(TO_FAIL)}" in said


@pytest.mark.realtime
@pytest.mark.parametrize("text", [text for text in TESTS if "within_s" in text], ids=name_of)
def test_tests_of_the_readme_with_a_time_limit_pass(tmp_path, text):
    out = run_pytest(tmp_path, {"test_robot": text})
    assert "1 passed" in out, out


NEEDS_NO_IMAGE = """import pytest
@pytest.mark.emulated_board(elf="/nope.elf"{})
def test_starts(emulated_board): pass
"""
ENGINES = {"test_avr": "", "test_python": ", engine='python'", "test_2013": ", profile='2013-august'"}


def test_an_option_of_pytest_chooses_the_engine_if_the_test_does_not(tmp_path):
    """Only the avr engine opens the image; a board of 2013 has none."""
    texts = {name: NEEDS_NO_IMAGE.format(marked) for name, marked in ENGINES.items()}
    said = run_pytest(tmp_path, texts, "-p", PLUGIN, "--emulated-engine=avr")
    assert "image /nope.elf does not exist" in said and "ERROR test_avr.py::test_starts" in said
    assert "PASSED test_python.py::test_starts" in said and "PASSED test_2013.py::test_starts" in said


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
    command, options = (mirror, words[2:]) if words[0] == "mrl" else (main, words[1:])
    command.make_context(words[0], options)


def first_column(title):
    table = README[README.index(f"| {title} |") :].split("\n\n")[0]
    return [name for row in table.splitlines()[2:] for name in re.findall(r"`([^`]+)`", row.split("|")[1])]


def test_the_faults_named_are_those_there_are():
    assert sorted(first_column("fault")) == sorted(FAULTS)


def test_the_orders_named_are_those_there_are():
    assert sorted(first_column("order")) == sorted(order for order, _ in ORDERS)


@pytest.mark.parametrize("fault", re.findall(r"--fault (\w+:\S+)", README))
def test_the_faults_spelt_out_can_be_read(fault):
    parse(fault.strip("`"))


def test_the_worlds_named_are_those_there_are():
    named = re.search(r"takes a name \((.*?)\)", README, re.S).group(1)
    assert sorted(re.findall(r"`([\w-]+)`", named)) == world_file.names()
