"""One ROS master for each test worker, and rigs on it; ROS is imported late, because some tests here need none."""

import os
import signal

import pytest

from tests.waiting import wait_until


@pytest.fixture(scope="session")
def master(tmp_path_factory):
    """Environment of a master on a port of its own, with this process as a node."""
    import rospy
    from rosgraph.masterapi import is_online

    from ros1_bridge.node.processes import Child

    from . import rig as bench

    folder = tmp_path_factory.mktemp("ros")
    for _ in range(5):
        uri = f"http://127.0.0.1:{bench.free_port()}"
        os.environ.update(ROS_MASTER_URI=uri, ROS_IP="127.0.0.1", ROS_LOG_DIR=str(folder))
        command = ["rosmaster", "--core", "-p", uri.rsplit(":", 1)[1]]
        child = Child("rosmaster", command, folder / "rosmaster.log", dict(os.environ), bench.ROOT)
        wait_until(lambda: is_online(uri) or child.exit_code is not None, step_s=0.02)  # noqa: B023
        if child.exit_code is None:
            break
    rospy.init_node("tests", anonymous=True, disable_signals=True)
    yield dict(os.environ)
    rospy.signal_shutdown("the tests are over")
    child.signal(signal.SIGTERM)
    child.finish(3.0)


@pytest.fixture
def rig(master, tmp_path):
    """A rig for one test."""
    yield from _rig(tmp_path, master)


@pytest.fixture(scope="module")
def module_rig(master, tmp_path_factory):
    """A rig for all tests of a module."""
    yield from _rig(tmp_path_factory.mktemp("rig"), master)


def _rig(folder, master):
    from .rig import Rig

    made = Rig(folder, master)
    yield made
    made.close()


ROSRUN = """#!/bin/sh
[ "$2" = need_packages ] || exec /usr/bin/rosrun "$@"
shift 2; echo "$@"
"""


@pytest.fixture(scope="module")
def config_of(tmp_path_factory):
    """What roslaunch makes of a file and its arguments; `config_of.folder` has the packages besides ours.

    Packages that Debian lacks are stood in for by empty nodes, and so are `rosversion` and `need_packages`, which
    roslaunch runs with each file.  The checkout's path has a space and an umlaut.
    """
    import roslaunch
    from roslaunch import substitution_args

    from . import stand_ins
    from .rig import ROOT

    folder, made = tmp_path_factory.mktemp("packages"), {}
    stand_ins.install(folder)
    (folder / "my Röboter").symlink_to(ROOT)
    for name, text in (("rosversion", "#!/bin/sh\necho 1.15.15\n"), ("rosrun", ROSRUN)):
        (folder / name).write_text(text)
        (folder / name).chmod(0o755)

    def load(file, *arguments):
        if (file, arguments) not in made:
            given = [(str(ROOT / "ros1_bridge" / "launch" / file), list(arguments))]
            made[file, arguments] = roslaunch.config.load_config_default(given, None, verbose=False)
        return made[file, arguments]

    load.folder = folder
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(
            "ROS_PACKAGE_PATH", os.pathsep.join((str(folder / "my Röboter"), str(folder), "/usr/share"))
        )
        patch.setenv("PATH", f"{folder}{os.pathsep}{os.environ['PATH']}")
        patch.setenv("ROS_LOG_DIR", str(folder))
        patch.setenv("ROS_HOME", str(folder))
        patch.setattr(substitution_args, "_rospack", None)
        yield load
