"""What the emulator's README shows is run as it stands."""

import os
import pathlib
import re
import subprocess
import sys

import pytest
import yaml

from sim_arduino import world_file
from sim_arduino.cli import main
from sim_arduino.mirror import main as mirror

ROOT = pathlib.Path(__file__).resolve().parents[2]
README = (ROOT / "sim_arduino" / "README.md").read_text(encoding="utf-8")
PYTHON = re.findall(r"```python\n(.*?)```", README, re.S)
TESTS = [text for text in PYTHON if "def test_" in text]
YAML = re.findall(r"```yaml\n(.*?)```", README, re.S)


def run_pytest(folder, text):
    """The text as a test file of somebody else, with the plugin as pytest loads it when it is installed."""
    (folder / "test_robot.py").write_text(text)
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "sim_arduino.pytest_plugin", "test_robot.py"]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    return done.stdout + done.stderr


@pytest.mark.parametrize("text", TESTS, ids=[re.findall(r"def (test_\w+)", text)[0] for text in TESTS])
def test_tests_of_the_readme_pass(tmp_path, text):
    assert "1 passed" in run_pytest(tmp_path, text)


def test_the_first_one_has_about_ten_lines():
    assert len([line for line in TESTS[0].splitlines() if line.strip()]) <= 10


def test_a_test_that_should_fail_fails(tmp_path):
    """The same file, with a robot that is told not to move."""
    text = TESTS[0].replace("drive(0.3", "drive(0.0").replace("x_m > 0.5)", "x_m > 0.5, 0.2)")
    out = run_pytest(tmp_path, text)
    assert "not within 0.2 s: the condition; the robot is at x 0.000 m" in out


def test_other_code_of_the_readme_runs(tmp_path):
    code = "\n".join(text for text in PYTHON if "def test_" not in text)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, env=environment, check=True)
    assert world_file.load(str(tmp_path / "l-course-map.yaml")).walls


def test_the_world_of_the_readme_loads(tmp_path):
    (tmp_path / "world.yaml").write_text(YAML[0])
    assert len(world_file.load(str(tmp_path / "world.yaml")).walls) == 5
    assert set(yaml.safe_load(YAML[0])) | {"map"} == set(world_file._KEYS)


def commands():
    lines = re.findall(r"^    ((?:mrl-sim|python -m).*)$", README, re.M)
    return [*lines, *re.findall(r"`(python -m [^`]*)`", README)]


@pytest.mark.parametrize("line", commands())
def test_commands_of_the_readme_parse(line):
    words = line.split()
    command = mirror if "sim_arduino.mirror" in words else main
    command.make_context("mrl-sim", words[3:] if words[0] == "python" else words[1:])


def test_the_worlds_named_are_those_there_are():
    named = re.search(r"takes a name \((.*?)\)", README, re.S).group(1)
    assert sorted(re.findall(r"`([\w-]+)`", named)) == world_file.names()


def test_pytest_finds_the_fixtures_once_installed():
    assert '"pytest11": ["mrl_sim=sim_arduino.pytest_plugin"]' in (ROOT / "setup.py").read_text()
