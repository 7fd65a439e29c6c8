"""Bags that the page records."""

import datetime
import io
from types import SimpleNamespace
from unittest import mock

import pytest
import rospy
from geometry_msgs.msg import Twist
from std_msgs.msg import Header

from mrl_driver.errors import ConfigError
from ros1_bridge.web.bag_recording import BagRecording


def raw(message):
    """A message as rospy gives it to a subscriber of AnyMsg."""
    data = io.BytesIO()
    message.serialize(data)
    return rospy.AnyMsg().deserialize(data.getvalue())


def header(message):
    return {
        "type": message._type,
        "md5sum": message._md5sum,
        "message_definition": message._full_text,
        "callerid": "/tests",
        "latching": "0",
        "topic": "/other",
    }


class Topics(dict):
    """Subscriptions by topic; `say` sends a message to one, as `form` makes it."""

    form = staticmethod(raw)

    def __call__(self, topic, take):
        self[topic] = take
        return lambda: self.pop(topic)

    def say(self, topic, message):
        given = self.form(message)
        given._connection_header = header(message)
        self[topic](given)


@pytest.fixture
def bench(tmp_path):
    topics = Topics()
    times = iter(range(1, 100))
    recording = BagRecording(
        tmp_path / "bags", topics, lambda: ["/odom", "/cmd_vel"], lambda: rospy.Time(next(times))
    )
    return SimpleNamespace(topics=topics, recording=recording)


def read(path):
    import rosbag

    with rosbag.Bag(str(path)) as bag:
        return [(topic, message, time.secs) for topic, message, time in bag.read_messages()]


@pytest.mark.parametrize("form", [raw, lambda message: message], ids=["any", "typed"])
def test_a_bag_has_each_message_with_topic_type_and_time(bench, form):
    """The node itself subscribes to some topics, and rospy gives it their messages by type."""
    bench.topics.form = form
    name = bench.recording.start()
    twist = Twist()
    twist.linear.x = 0.25
    bench.topics.say("/cmd_vel", twist)
    bench.topics.say("/odom", Header(seq=7, frame_id="odom"))
    assert bench.recording.stop() == ""
    (one, speed, first), (other, head, second) = read(bench.recording.path(name))
    assert (one, speed.linear.x, first) == ("/cmd_vel", 0.25, 1)
    assert (other, head.frame_id, second) == ("/odom", "odom", 2)


def test_a_bag_that_is_written_is_listed_and_cannot_be_fetched(bench):
    name = bench.recording.start()
    assert set(bench.topics) == {"/odom", "/cmd_vel"}
    with pytest.raises(ConfigError, match="stop it first"):
        bench.recording.start()
    (bag,) = bench.recording.files()
    assert (bag.name, bag.on) == (name, True)
    with pytest.raises(ConfigError, match="there is no recording"):
        bench.recording.path(name)
    bench.recording.stop()
    assert not bench.recording.files()[0].on and not bench.topics


@pytest.mark.parametrize("name", ["", "..", "../secret.bag", "/etc/passwd"])
def test_no_other_file_can_be_fetched(bench, tmp_path, name):
    (tmp_path / "secret.bag").write_text("")
    with pytest.raises(ConfigError, match="there is no recording"):
        bench.recording.path(name)


def test_bags_of_one_second_have_different_names_and_are_for_their_user_alone(bench, tmp_path):
    """A bag that is complete, and one that a crash has left, are kept."""
    made = set()
    for _ in range(3):
        made.add(bench.recording.start())
        bench.recording.stop()
    assert len(made) == len(bench.recording.files()) == 3
    files = [tmp_path / "bags", *(tmp_path / "bags").iterdir()]
    assert [file.stat().st_mode & 0o777 for file in files] == [0o700, 0o600, 0o600, 0o600]


@pytest.mark.parametrize("ending", ["", ".active"])
def test_no_bag_replaces_another(bench, monkeypatch, ending, tmp_path):
    moment = datetime.datetime(2026, 3, 1, 12, 0, 0)
    monkeypatch.setattr("datetime.datetime", mock.Mock(now=lambda: moment))
    kept = tmp_path / "bags" / f"robot_2026-03-01-12-00-00.bag{ending}"
    kept.parent.mkdir()
    kept.write_bytes(b"kept")
    assert bench.recording.start() == "robot_2026-03-01-12-00-00-2.bag"
    bench.recording.stop()
    assert kept.read_bytes() == b"kept"


def test_messages_that_do_not_fit_on_the_disk_are_counted(bench, monkeypatch):
    import rosbag

    bench.recording.start()

    def full(*args, **options):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(rosbag.Bag, "write", full)
    for _ in range(2):
        bench.topics.say("/odom", Header())
    assert bench.recording.stop() == "2 messages are missing: No space left on device"
