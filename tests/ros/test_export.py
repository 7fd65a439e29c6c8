"""A bag that `rosbag record` writes, and one that is exported from the node's recording of the same drive."""

import signal

import pytest
import rosgraph
import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from std_srvs.srv import Trigger

from tests.cli.run import mrl
from tests.waiting import wait_until

from .rig import end, links_of

FRAMES, LEAST = 30, 10
"""Frames of the drive, and those that both bags have at least: rosbag is ended while it may still be reading."""


def topics_of(rig):
    return ["/tf", *(f"{rig.ns}/{name}" for name in ("odom", "sonar/front", "sonar/left", "sonar/right"))]


@pytest.fixture(scope="module")
def drive(module_rig, tmp_path_factory):
    """The node's bag and recording of a drive on which the odometry is set back, in a folder."""
    rig, folder = module_rig, tmp_path_factory.mktemp("drive")
    board, name = rig.board(), f"recorder_{rig.name}"
    recorder = rig.start(
        "rosbag", "rosbag", "record", "-O", str(folder / "node.bag"), f"__name:={name}", *topics_of(rig)
    )
    master = rosgraph.Master(rospy.get_name())
    odom = f"{rig.ns}/odom"
    wait_until(lambda: f"/{name}" in dict(master.getSystemState()[1]).get(odom, []), what="rosbag record")
    node = rig.node(board.port, "_rate:=25", f"_record:={folder / 'drive.mrl'}")
    seen = rig.topic("odom", Odometry)
    seen.wait()
    command = rig.publisher("cmd_vel", Twist)
    wanted = set(topics_of(rig))
    address = master.lookupNode(f"{rig.ns}/robot_node")
    wait_until(
        lambda: {link[4] for link in links_of(address) if link[1] == f"/{name}"} >= wanted,
        step_s=0.02,
        what="rosbag record at the node",
    )
    twist, reset = Twist(), rospy.ServiceProxy(f"{rig.ns}/reset_odometry", Trigger)
    twist.linear.x, twist.angular.z = 0.2, 0.3
    for _ in range(2):
        until = len(seen.arrived) + FRAMES // 2
        wait_until(
            lambda: command.publish(twist) or len(seen.arrived) > until,  # noqa: B023
            step_s=0.05,
            what="the drive",
        )
        wait_until(
            lambda: reset().success, step_s=0.1, what="the reset of the odometry, which needs standstill"
        )
    end(node)
    recorder.signal(signal.SIGINT)
    assert recorder.wait(30.0), recorder.last_words()
    wait_until(
        (folder / "node.bag").exists, what="the bag"
    )  # `rosbag` does not wait for the program that writes it
    return folder


@pytest.fixture(scope="module")
def from_recording(drive, module_rig):
    """The messages that are exported from the node's recording."""
    return read(module_rig, exported(module_rig, drive / "drive.mrl"))


def exported(rig, recording):
    bag = recording.with_suffix(".bag")
    done = mrl("export", recording, bag, "--name", rig.name)
    assert done.returncode == 0, done.stderr
    return bag


def header_of(message):
    return message.transforms[0].header if hasattr(message, "transforms") else message.header


def read(rig, path):
    """The messages of each topic in their order, without the numbers that the publishers gave them."""
    import rosbag

    found = {topic: [] for topic in topics_of(rig)}
    with rosbag.Bag(str(path)) as bag:
        for topic, message, _ in bag.read_messages(list(found)):
            header = header_of(message)
            if header.frame_id.startswith(f"{rig.name}/"):
                header.seq = 0
                found[topic].append(message)
    return found


def common(one, other):
    """The messages of both, by topic, between the first and the last stamp that both have: one may begin earlier."""
    found = {}
    for topic, messages in one.items():
        shared = {header_of(each).stamp for each in messages} & {
            header_of(each).stamp for each in other[topic]
        }
        assert shared, topic
        found[topic] = [
            [each for each in bag[topic] if min(shared) <= header_of(each).stamp <= max(shared)]
            for bag in (one, other)
        ]
    return found


def test_an_exported_bag_has_the_messages_of_the_nodes_bag(drive, module_rig, from_recording):
    """All fields but `seq` are the same."""
    found = common(read(module_rig, drive / "node.bag"), from_recording)
    assert all(of_node == of_recording for of_node, of_recording in found.values())
    assert len(found["/tf"][0]) >= LEAST


def test_another_time_of_a_few_bytes_gives_other_messages(drive, module_rig, from_recording):
    """The control: what the test above compares does depend on the recording."""
    lines = (drive / "drive.mrl").read_text().splitlines(keepends=True)
    times = [float(line.split(" ")[0]) if line[0].isdigit() else 0.0 for line in lines]
    frames = [at for at in range(len(lines) // 2, len(lines)) if " < @8," in lines[at]]
    late = max(frames, key=lambda at: times[at] - times[at - 1])
    sooner_s = times[late] - 0.9 * (times[late] - times[late - 1])
    lines[late] = f"{sooner_s:.6f} {lines[late].partition(' ')[2]}"
    changed = drive / "changed.mrl"
    changed.write_text("".join(lines))
    assert read(module_rig, exported(module_rig, changed)) != from_recording
