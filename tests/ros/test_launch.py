"""Launch files: roslaunch-check finds nothing, each argument is documented, and they start what they say.

Packages that Debian lacks are stood in for by empty nodes, made for the test; what these take is in
test_launch_packages.py.  `rosversion` and `need_packages`, which roslaunch runs with each file, are stood in for too.
"""

import os
import shlex
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

import pytest
import roslaunch
import rospkg
from nav_msgs.msg import Odometry
from roslaunch import arg_dump
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from mrl_driver.robot import models
from ros1_bridge.node.robot_parameters import ROWS
from tests.waiting import PATIENCE, wait_until

from . import stand_ins
from .rig import ROOT, without_broken_connections

LAUNCH = ROOT / "ros1_bridge" / "launch"
FILES = sorted(LAUNCH.glob("*.launch"))
ROSRUN = """#!/bin/sh
[ "$2" = need_packages ] || exec /usr/bin/rosrun "$@"
shift 2; echo "$@"
"""
LINKS = (("base_link", "odom"), ("sonar_left", "base_link"), ("left_wheel", "base_link"))
"""Some frames with their parents: one of the node, one that stands still, one that turns."""
TROUBLE = ("FAILURE", "cannot find", "unable to find", "Missing", "Traceback", "WARNING")


def program(path, text):
    """Writes an executable."""
    path.write_text(text)
    path.chmod(0o755)


@pytest.fixture(scope="module")
def packages(tmp_path_factory):
    """Environment in which this repository and the stand-ins are packages, in this process too."""
    folder = tmp_path_factory.mktemp("packages")
    stand_ins.install(folder)
    program(folder / "rosversion", "#!/bin/sh\necho 1.15.15\n")
    program(folder / "rosrun", ROSRUN)
    own = {
        "ROS_PACKAGE_PATH": os.pathsep.join((str(ROOT), str(folder))),
        "PATH": os.pathsep.join((str(folder), os.environ["PATH"])),
        "ROS_LOG_DIR": str(folder),
        "ROS_HOME": str(folder),
    }
    with pytest.MonkeyPatch.context() as patch:
        for name, value in own.items():
            patch.setenv(name, value)
        yield {**os.environ}


def loaded(file, *arguments):
    """What roslaunch makes of a file."""
    return roslaunch.config.load_config_default([(str(LAUNCH / file), list(arguments))], None, verbose=False)


def nodes_of(file, *arguments):
    return {node.namespace + node.name for node in loaded(file, *arguments).nodes}


def test_roslaunch_check_finds_nothing(packages, tmp_path):
    script = os.path.join(rospkg.RosPack().get_path("roslaunch"), "scripts", "roslaunch-check")
    command = [sys.executable, script, "-i", "-o", str(tmp_path / "out.xml"), str(LAUNCH)]
    done = subprocess.run(command, env=packages, capture_output=True, text=True, timeout=100 * PATIENCE)
    said = done.stdout + done.stderr
    assert done.returncode == 0 and "passed" in said, said
    assert not any(word in said for word in TROUBLE), said
    assert all(f"checking {path}" in said for path in FILES)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_each_argument_is_documented_and_listed(path, packages):
    listed = arg_dump.get_args([str(path)])
    for argument in ElementTree.parse(path).getroot().iter("arg"):
        if argument.get("value") is None:
            assert argument.get("doc"), f"{path.name}: {argument.get('name')} has no doc"
            assert listed[argument.get("name")][0] == argument.get("doc")


def test_arguments_are_listed_by_the_command(packages):
    start = "import sys, roslaunch; roslaunch.main(sys.argv)"
    command = [sys.executable, "-c", start, "--ros-args", str(LAUNCH / "sim.launch")]
    listed = subprocess.run(
        command, env=packages, capture_output=True, text=True, timeout=60 * PATIENCE
    ).stdout
    assert "engine" in listed and "the firmware binary" in listed


def test_parameters_of_the_launch_file_are_those_of_the_node(packages):
    """A row that robot.launch passes and the node does not know would end the node."""
    given = {name.split("/")[-1] for name in loaded("robot.launch").params if "robot_node/" in name}
    assert given == {row.name for row in ROWS}


@pytest.mark.parametrize("name", [model.name for model in models.driven_models()])
def test_description_of_a_packaged_model_is_the_committed_file(name, packages):
    shown = loaded("describe.launch", f"robot:={name}").params["/robot_description"].value
    assert shown == (ROOT / "ros1_bridge" / "urdf" / f"{name}.urdf").read_text()


def test_board_without_motors_starts_without_a_description(packages):
    assert nodes_of("robot.launch", "robot:=pioneer") == {"/robot_node"}


def test_description_has_the_imu_if_it_is_asked_for(packages):
    assert '"imu_link"' in loaded("describe.launch", "imu:=true").params["/robot_description"].value


def test_description_of_a_models_own_file_is_rendered(packages, tmp_path):
    own = tmp_path / "my robot.yaml"
    own.write_text((ROOT / "mrl_driver" / "robot" / "models" / "traxbot.yaml").read_text())
    shown = loaded("robot.launch", f"robot:={own}").params["/robot_description"].value
    assert "sonar_left" in shown


def test_mount_of_the_imu_is_described_if_the_node_does_not_publish_it(packages):
    params = loaded("robot.launch", "robot:=traxbot", "publish_imu_mount:=false").params
    assert params["/robot_node/publish_imu_mount"].value is False
    assert "imu_link" in params["/robot_description"].value


def test_unknown_model_is_named(packages, capfd):
    with pytest.raises(roslaunch.RLException):
        loaded("sim.launch", "robot:=tank")
    assert "robot 'tank' is unknown, expected" in capfd.readouterr().err


@pytest.mark.parametrize("ns, place", [("", "/"), ("robot1", "/robot1/"), ("/deep/er/", "/deep/er/")])
def test_bag_has_topics_by_their_full_names(ns, place, packages):
    (node,) = loaded("record.launch", f"ns:={ns}", "topics:=odom  sonar/front").nodes
    assert node.args.split()[-5:] == [
        f"{place}odom",
        f"{place}sonar/front",
        "/tf",
        "/tf_static",
        "/diagnostics",
    ]


def test_a_bag_is_for_its_user_alone(packages, tmp_path):
    (node,) = loaded("record.launch").nodes
    subprocess.run([*shlex.split(node.launch_prefix), "touch", str(tmp_path / "a b.bag")], check=True)
    assert (tmp_path / "a b.bag").stat().st_mode & 0o777 == 0o600


def test_team_has_a_robot_for_each_port(packages):
    nodes = nodes_of("team.launch", "ports:=sim,/dev/ttyACM7,sim")
    assert {f"/robot{i}/robot_node" for i in (1, 2, 3)} <= nodes
    assert "/sim_boards" in nodes


def test_team_of_real_robots_has_no_emulated_board(packages):
    assert "/sim_boards" not in nodes_of("team.launch", "ports:=/dev/ttyACM0,/dev/ttyACM1")


def test_team_has_its_descriptions_and_frames_each(rig, packages):
    """Frames of robot_state_publisher meet those of the node; each has one parent."""
    unique = f"{rig.name}_{os.getpid()}"  # names of ports and world are this test's own
    rig.env = {**packages, "USER": unique, **{key: rig.env[key] for key in ("ROS_MASTER_URI", "ROS_IP")}}
    program = "import sys, roslaunch; roslaunch.main(sys.argv)"
    launch = rig.start(
        "roslaunch",
        *(sys.executable, "-c", program, str(LAUNCH / "team.launch"), "ports:=sim,sim"),
        *("models:=stingbot,traxbot", f"world_name:={unique}"),
    )
    static, moving = rig.topic("/tf_static", TFMessage), rig.topic("/tf", TFMessage)
    for name in ("robot1", "robot2"):
        rig.topic(f"/{name}/odom", Odometry).wait()
        rig.topic(f"/{name}/joint_states", JointState).wait()

    def parents():
        every = [t for topic in (static, moving) for m in topic.messages for t in m.transforms]
        return {(t.child_frame_id, t.header.frame_id) for t in every if t.child_frame_id.startswith("robot")}

    wanted = {(f"{n}/{c}", f"{n}/{p}") for n in ("robot1", "robot2") for c, p in LINKS}
    wait_until(lambda: wanted <= parents()), parents()
    assert len({child for child, _ in parents()}) == len(parents())
    said = without_broken_connections("\n".join(launch.output()))
    assert not any(word in said for word in ("WARN", "ERROR", "Traceback")), said
