"""Built by catkin, in devel and in install space, the package is what it is unbuilt; a run of it is clean."""

import contextlib
import os
import re
import shutil
import signal
import subprocess
from pathlib import Path

import pytest
from rosgraph.masterapi import is_online

from ros1_bridge.node.processes import Child
from tests.waiting import PATIENCE, wait_until

from .rig import ROOT, START_S, free_port, without_a_busy_machine

pytestmark = pytest.mark.timeout(300)
SPACES = ("devel", "install")
PARTS = ("LICENSE", "README.md", "package.xml", "CMakeLists.txt", "setup.py")
PACKAGES = ("mrl_driver", "sim_arduino", "ros1_bridge")
TESTS = ("tests/ros/robot.test", "tests/ros/drive_and_stop")


class Workspace:
    """A catkin workspace with this package alone."""

    def __init__(self, folder):
        self.folder, self.source = folder, folder / "src" / "mrl_robots"
        self.env = {
            k: v for k, v in os.environ.items() if k.startswith(("ROS_D", "CMAKE", "PYTHON", "LD_", "PKG"))
        }
        self.env.update(
            PATH=os.pathsep.join(("/usr/bin:/bin", os.environ["PATH"])),  # Debian's python3, no other
            HOME=str(folder),
            USER=folder.name,
            ROS_IP="127.0.0.1",
            ROS_MASTER_URI=f"http://127.0.0.1:{free_port()}",
            ROS_ROOT=str(folder / "ros"),
        )

    def build(self):
        """Copies what belongs to the package, and installs it."""
        unwanted = shutil.ignore_patterns("__pycache__", "*.pyc", "*.png")
        for name in PACKAGES:
            shutil.copytree(ROOT / name, self.source / name, ignore=unwanted)
        (self.source / "tests" / "ros").mkdir(parents=True)
        (self.folder / "ros").mkdir()
        for name in (*PARTS, *TESTS):
            shutil.copy(ROOT / name, self.source / name)
        build = self.folder / "build"
        prefixes = [
            f"-DCATKIN_DEVEL_PREFIX={self.folder}/devel",
            f"-DCMAKE_INSTALL_PREFIX={self.folder}/install",
        ]
        self.require("cmake", "-S", str(self.source), "-B", str(build), *prefixes)
        return self.require("cmake", "--build", str(build), "--target", "install")

    def build_messages(self):
        """Writes the optional package of typed messages, and builds it; what runs from now on can import it."""
        source, build, devel = (
            self.folder / each for each in ("messages", "messages_build", "messages_devel")
        )
        source.mkdir()
        self.require("make", "-s", "-C", str(ROOT), "mrl-msgs", f"DIR={source}")
        source /= "mrl_msgs"
        self.require("cmake", "-S", str(source), "-B", str(build), f"-DCATKIN_DEVEL_PREFIX={devel}")
        self.require("cmake", "--build", str(build))
        (module,) = devel.glob("lib/python3*/*-packages")
        self.env["PYTHONPATH"] = os.pathsep.join((str(module), self.env.get("PYTHONPATH", "")))
        return source

    def in_space(self, space, *command):
        """A command as it runs in a shell that has sourced a space."""
        return ("sh", "-c", '. "$0" && exec "$@"', f"{self.folder}/{space}/setup.sh", *command)

    def require(self, *command):
        """Run it and return what it said; it must succeed."""
        done = subprocess.run(
            command,
            env=self.env,
            cwd=str(self.folder),
            capture_output=True,
            text=True,
            timeout=200 * PATIENCE,
        )
        said = done.stdout + done.stderr
        assert done.returncode == 0, said
        return said


@pytest.fixture(scope="module")
def workspace(tmp_path_factory):
    made = Workspace(tmp_path_factory.mktemp("catkin"))
    made.build()
    return made


@contextlib.contextmanager
def running(workspace):
    """A running, installed sim.launch, ended by Ctrl-C; requires that it ends without a rest and without a warning."""
    folder, uri = workspace.folder, workspace.env["ROS_MASTER_URI"]
    port, name = uri.rsplit(":", 1)[1], f"name:={folder.name}"
    launch = ("roslaunch", "-p", port, "mrl_robots", "sim.launch", name, "imu:=true")
    command = workspace.in_space("install", *launch)
    log = folder / "log"
    env = {**workspace.env, "ROS_LOG_DIR": str(log)}
    child = Child("roslaunch", command, folder / "launch.log", env, folder)
    try:
        wait_until(lambda: is_online(uri) or child.exit_code is not None, step_s=0.05)
        assert child.exit_code is None, child.last_words()
        yield child
    finally:
        child.signal(signal.SIGINT)
        child.finish(START_S)
    assert child.exit_code == 0
    assert processes(folder) == ""
    logs = [path for path in log.rglob("*.log") if "master" not in path.name]
    said = child.output() + [line for path in logs for line in path.read_text(errors="replace").splitlines()]
    said = without_a_busy_machine(said)
    assert logs and "shutting down" in said
    assert not re.search(r"WARN|\[ERROR|Traceback|escalating", said), said


def processes(folder):
    """Command lines that name the folder, as that of each process of the workspace does."""
    found = []
    for file in Path("/proc").glob("[0-9]*/cmdline"):
        with contextlib.suppress(OSError):
            found.append(file.read_text(errors="replace").replace("\0", " "))
    return "\n".join(line for line in found if str(folder) in line)


def test_catkin_lint_is_clean(workspace):
    said = workspace.require("catkin_lint", "-W2", "--strict", "--offline", str(workspace.source))
    assert "found 0 problems" in said


@pytest.mark.parametrize("space", SPACES)
def test_nodes_modules_and_files_are_those_of_the_workspace(workspace, space):
    found = Path(workspace.require(*workspace.in_space(space, "rospack", "find", "mrl_robots")).strip())
    assert workspace.folder in found.parents
    folders = [ROOT / "ros1_bridge" / part for part in ("launch", "navigation", "rviz", "status", "urdf")]
    files = [
        path for folder in folders for path in folder.iterdir() if path.is_file() and path.suffix != ".py"
    ]
    assert files and all((found / path.relative_to(ROOT)).is_file() for path in files)
    programs = (workspace.folder / space / "lib" / "mrl_robots").iterdir()
    nodes = {path.name for path in (ROOT / "ros1_bridge" / "nodes").iterdir()}
    assert nodes == {path.name for path in programs if os.access(path, os.X_OK)}
    code = "import mrl_driver.driver as a, sim_arduino.board as b, ros1_bridge.robot.robot_node as c; "
    code += "print(*(m.__file__ for m in (a, b, c)))"
    modules = workspace.require(*workspace.in_space(space, "/usr/bin/python3", "-c", code)).split()
    assert len(modules) == 3 and all(file.startswith(str(workspace.folder)) for file in modules)


@pytest.mark.parametrize("space", SPACES)
def test_description_is_rendered_by_the_workspace(workspace, space):
    command = ("roslaunch", "--dump-params", "mrl_robots", "describe.launch", "imu:=true")
    assert "imu_link" in workspace.require(*workspace.in_space(space, *command))


def test_installed_nodes_pass_the_rostest_of_the_devel_space_with_typed_messages(workspace, monkeypatch):
    monkeypatch.setattr(workspace, "env", dict(workspace.env))
    source = workspace.build_messages()
    assert "found 0 problems" in workspace.require("catkin_lint", "-W2", "--strict", "--offline", str(source))
    with running(workspace):
        command = ("rostest", "-r", "mrl_robots", "robot.test", "sim:=false")
        assert "RESULT: SUCCESS" in workspace.require(*workspace.in_space("devel", *command))
        status = workspace.require(
            *workspace.in_space("devel", "rostopic", "echo", "-n", "1", "/robot_status")
        )
        assert "protective_zone: 0" in status
        assert f"{workspace.folder}/install/lib/mrl_robots/robot_node" in processes(workspace.folder)
