"""Imports run one way."""

import ast
import pathlib
import subprocess
import sys
from typing import Iterator, Set

import pytest

ROOT = pathlib.Path(__file__).resolve().parent.parent
FILES = sorted(p for d in ("mrl_driver", "sim_arduino", "ros1_bridge") for p in (ROOT / d).rglob("*.py"))
NODES = {
    "robot_node",
    "demo_view",
    "teleop_keyboard",
    "teleop_joystick",
    "go_to_goal",
    "world_node",
    "cmd_vel",
}
"""Modules of ros1_bridge that are nodes, or part of them: the ones that may import rospy."""
EXPERIMENTS = {"team_node", "turnaround_node", "step_node"}
"""The same of its experiments, which also use the emulator and its experiments."""
SHARED = {
    "table",
    "codec",
    "errors",
    "folders",
    "robots",
    "images",
    "pictures",
    "address",
    "listener",
    "yaml_file",
}
"""Modules of mrl_driver that the emulator may use."""
COMMANDS = {"replay": {"recording", "log_summary"}, "playback": {"recording"}}
"""What else the sub-commands of `mrl` that live with the emulator use."""
BELOW = {
    "errors": set(),
    "table": set(),
    "frames": set(),
    "runs": {"frames", "table"},
    "directions": {"runs", "table"},
    "encoder": {"errors", "frames", "table"},
    "codec": {"directions", "encoder", "frames", "table"},
    "yaml_file": {"errors"},
    "folders": set(),
    "robots": {"errors", "folders", "table", "yaml_file"},
    "odometry": {"errors", "table"},
    "kinematics": {"errors", "odometry", "robots"},
    "omni": {"errors", "table", "odometry", "robots", "kinematics"},
    "sonar": {"errors", "table"},
    "clock": {"table"},
    "ports": set(),
    "forks": set(),
    "address": {"errors"},
    "listener": {"errors", "address"},
    "link": {"errors", "ports", "forks"},
    "session": None,
    "driver": None,
    "cli": None,
}


def imported(path: pathlib.Path) -> Iterator[str]:
    """Absolute names of the modules that a file imports."""
    package = list(path.relative_to(ROOT).with_suffix("").parts[:-1])
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(package[: len(package) - node.level + 1]) if node.level else ""
            module = ".".join(part for part in (base, node.module) if part)
            yield module
            yield from (f"{module}.{alias.name}" for alias in node.names)


def tops(path: pathlib.Path) -> Set[str]:
    return {name.split(".")[0] for name in imported(path)}


def parts_of(path: pathlib.Path, package: str) -> Set[str]:
    """Modules of `package` that a file imports."""
    return {name.split(".")[1] for name in imported(path) if name.startswith(package + ".")}


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_run_one_way(path):
    package = path.relative_to(ROOT).parts[0]
    if package == "mrl_driver":
        assert not tops(path) & {"sim_arduino", "ros1_bridge", "rospy"}
    elif package == "sim_arduino":
        assert not tops(path) & {"ros1_bridge", "rospy", "serial"}
        if path.parent.name != "experiments":
            assert parts_of(path, "mrl_driver") <= SHARED | COMMANDS.get(path.stem, set())
    else:
        experiment = path.parent.name == "experiments"
        assert "sim_arduino" not in tops(path) or path.stem == "world_node" or experiment
        assert "rospy" not in tops(path) or path.stem in (EXPERIMENTS if experiment else NODES)


@pytest.mark.parametrize("path", sorted((ROOT / "mrl_driver").glob("*.py")), ids=lambda p: p.stem)
def test_layers_of_the_driver(path):
    """A lower module never imports a higher one; only the links know pyserial."""
    allowed = BELOW.get(path.stem)
    modules = {p.stem for p in (ROOT / "mrl_driver").glob("*.py")} | {"robots"}
    if allowed is not None:
        assert parts_of(path, "mrl_driver") & modules <= allowed
    assert "serial" not in tops(path) or path.stem in {"link", "url_link"}


def test_driver_loads_neither_numpy_nor_a_terminal_library():
    """The ROS node's memory budget has no room for them."""
    code = "import sys, mrl_driver.driver; print([m for m in ('numpy', 'rich', 'click') if m in sys.modules])"
    out = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"
