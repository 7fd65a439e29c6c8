"""package.xml names what the package uses, by keys that rosdep knows."""

import ast
import importlib.util
import os
import subprocess
import sysconfig
import xml.etree.ElementTree as ElementTree

import pytest
import rospkg

from ros1_bridge.node.packages import PACKAGES
from tests.waiting import PATIENCE

from .rig import ROOT

ROOTS = ElementTree.parse(ROOT / "package.xml").getroot()
DEPENDS = {element.text for element in ROOTS if element.tag.endswith("depend")}
CONDITIONAL = {element.text for element in ROOTS if element.get("condition")}
SYSTEM = {
    "click": "python3-click",
    "matplotlib": "python3-matplotlib",
    "numpy": "python3-numpy",
    "rospkg": "python3-rospkg",
    "serial": "python3-serial",
    "yaml": "python3-yaml",
    "pytest": "python3-pytest",
    "setuptools": "python3-setuptools",
    "check_urdf": "liburdfdom-tools",
}
"""Programs and modules by their key in rosdep's base.yaml and python.yaml."""
BY_PIP = {"rich", "aiohttp", "cryptography", "segno", "mcap", "mcap_ros1", "rosbags", "PIL"}
"""Ubuntu 20.04, on which Noetic runs, has no package of it, or one that is too old: rosdep would stop or bring it."""
STDLIB = sysconfig.get_paths()["stdlib"]
OWN = {"mrl_driver", "sim_arduino", "ros1_bridge"}


def imported(path):
    """Top-level names that a module imports."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            yield node.module.split(".")[0]


def is_pythons_own(name):
    """A module of Python's own library."""
    found = importlib.util.find_spec(name)
    origin = found.origin if found and found.origin else ""
    return origin in ("built-in", "frozen") or os.path.dirname(origin).startswith(STDLIB)


def test_modules_that_are_imported_are_dependencies():
    used = {name for package in OWN for path in (ROOT / package).rglob("*.py") for name in imported(path)}
    used = {name for name in used - OWN - BY_PIP if not is_pythons_own(name)}
    assert "rospy" in used
    assert {SYSTEM.get(name, name) for name in used} <= DEPENDS
    assert not {f"python3-{name}" for name in BY_PIP} & DEPENDS


def test_packages_that_launch_files_start_are_dependencies():
    files = [*(ROOT / "ros1_bridge" / "launch").iterdir(), ROOT / "tests" / "ros" / "robot.test"]
    parts = [part for path in files for part in ElementTree.parse(path).getroot().iter()]
    used = {part.get("pkg") for part in parts if part.tag in ("node", "test")}
    assert used - {"mrl_robots"} <= DEPENDS


def test_packages_that_debian_lacks_are_asked_for_with_a_condition_alone():
    """And what a robot does without; not those that have no Debian package anywhere: rosdep would stop at them."""
    lacked = {name for name, origin in PACKAGES.items() if origin.released and name != "tf2_ros"}
    assert lacked | {"rviz"} == CONDITIONAL - set(SYSTEM.values())


@pytest.mark.parametrize("key", sorted(DEPENDS - CONDITIONAL))
def test_key_is_one_that_rosdep_knows(key):
    """A ROS package's name is its key; of some Debian has the Python modules alone."""
    is_ros = key in rospkg.RosPack().list() or importlib.util.find_spec(key) is not None
    assert key in SYSTEM.values() or is_ros


@pytest.mark.parametrize("program", sorted(path.name for path in (ROOT / "ros1_bridge" / "nodes").iterdir()))
def test_each_program_says_how_it_is_started_without_a_master(program):
    command, env = [str(ROOT / "ros1_bridge" / "nodes" / program), "--help"], dict(os.environ)
    env["ROS_MASTER_URI"] = "http://127.0.0.1:1"
    done = subprocess.run(command, env=env, capture_output=True, text=True, timeout=60 * PATIENCE)
    assert (done.returncode, done.stdout[:7], done.stderr) == (0, "usage: ", "")
