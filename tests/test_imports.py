"""Only nodes know ROS, only links know pyserial; the layers themselves are held by import-linter in `make check`."""

import ast
import functools
import pathlib
import subprocess
import sys
from typing import Set

ROOT = pathlib.Path(__file__).resolve().parent.parent
PACKAGES = ("mrl_driver", "sim_arduino", "ros1_bridge")
FILES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))

NODE_PARTS = {"cmd_vel", "command_topics", "zone_topics", "servo_topics", "xbee", "reconfigure"}


@functools.lru_cache(maxsize=None)
def imported(path: pathlib.Path) -> Set[str]:
    """Top-level packages that a file imports by absolute name."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level:
            found.add((node.module or "").split(".")[0])
    return found


def importers(package: str) -> Set[pathlib.Path]:
    named = [path for path in FILES if package in path.read_text(encoding="utf-8")]
    return {path for path in named if package in imported(path)}


def test_only_nodes_import_rospy():
    """A node's module is named so; the others are the parts of a node that subscribe, serve or publish."""
    nodes = {path for path in FILES if path.stem.endswith("_node") or path.stem in NODE_PARTS}
    assert importers("rospy") and importers("rospy") - nodes == set()


def test_only_links_import_pyserial():
    found = importers("serial")
    assert found and {path for path in found if path.parent != ROOT / "mrl_driver" / "transport"} == set()


def test_driver_loads_neither_numpy_nor_a_terminal_library():
    """The ROS node's memory budget has no room for them."""
    code = "import sys, mrl_driver.driver; print([m for m in ('numpy', 'rich', 'click') if m in sys.modules])"
    out = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"


def test_recordings_are_read_without_ports():
    code = "import sys, mrl_driver.recording.decoded; print(*sys.modules)"
    out = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert not [name for name in out.stdout.split() if name.startswith(("serial", "mrl_driver.transport"))]
