"""The relay without ROS: frames, the newest of each publisher, ages, and two ends over a real socket."""

import math
import socket
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrl_driver.errors import ConfigError
from mrl_driver.navigation.claims import LATE_S, REPEAT_S, Claim, read_messages, write_messages
from mrl_driver.safety.message_age import MessageAge
from ros1_bridge.relay.relay_frames import (
    LONGEST_BYTES,
    PROTOCOL,
    FrameReader,
    Hello,
    Message,
    Ping,
    Pong,
    RelayError,
    Source,
    Taken,
    encode,
)
from ros1_bridge.relay.relay_settings import Address, Settings, read_settings
from ros1_bridge.relay.topic_receiver import AHEAD_S, ERROR, OK, WARN, WINDOW_S, TopicReceiver
from ros1_bridge.relay.topic_sender import (
    MOST_BYTES,
    MOST_OF_ONE,
    SETTLE_S,
    SLOWER_S,
    MessageType,
    Outbox,
    TopicSender,
)
from tests.shortage import threads_left
from tests.waiting import wait_until

EVENTS = [
    Hello(PROTOCOL, "robot1", "a1", ["odom", "tf"]),
    Source(1, "odom", "/robot_node", "nav_msgs/Odometry", "cd5e73d190d741a2f92e", "Header h", False),
    Message(1, 7, 12.5, b"\x00body\xff"),
    Taken(3),
    Ping(1.5),
    Pong(1.5, 99.25),
]
LATCHED = MessageType("std_msgs/String", "1", "string data")
PLAIN = MessageType("std_msgs/Bool", "2", "bool data")
TWIST = MessageType("geometry_msgs/Twist", "3", "")
TIMEOUT_S = 5.0  # No connection of these tests is silent for this time, even on a busy machine


def test_frames_are_read_as_they_were_written_however_they_are_cut():
    data, reader = b"".join(map(encode, EVENTS)), FrameReader()
    assert FrameReader().feed(data) == EVENTS
    assert [event for byte in data for event in reader.feed(bytes([byte]))] == EVENTS


@settings(max_examples=30)
@given(st.binary(max_size=80), st.sampled_from([0, 1, 2, 3, 4, 5, 6]))
def test_bytes_of_others_are_refused_or_one_event(junk, kind):
    try:
        (event,) = FrameReader().feed(struct.pack("<BI", kind, len(junk)) + junk)
    except RelayError:
        return
    assert isinstance(event, (Message, Taken, Ping, Pong))


@pytest.mark.parametrize(
    "data, words",
    [
        (b"GET / HTTP/1.1\r\n", "kind 71"),
        (struct.pack("<BI", 3, LONGEST_BYTES), "expected at most 65536"),
        (encode(EVENTS[0]) + struct.pack("<BI", 3, LONGEST_BYTES + 1), f"at most {LONGEST_BYTES}"),
        (encode(EVENTS[0]._replace(topics=[1])), "topics is \\[1\\]"),
        (encode(EVENTS[1]._replace(number="1")), "number is '1'"),
        (struct.pack("<BI", 1, 9000) + b"[" * 9000, "does not parse"),
    ],
)
def test_frame_that_is_none_is_named(data, words):
    with pytest.raises(RelayError, match=words):
        FrameReader().feed(data)


def messages(number, count, size=100):
    return [Message(number, sequence, 0.0, bytes(size)) for sequence in range(1, count + 1)]


def filled(*of):
    box = Outbox()
    for message in of:
        box.put(message)
    return box


def leaving(box, now_s=0.0):
    return list(iter(lambda: box.next(now_s), None))


def test_newer_message_takes_the_place_of_the_one_that_waits_of_the_same_publisher():
    box = filled(*messages(1, 2), *messages(2, 3), *messages(1, 4))
    assert [(message.number, message.sequence) for message in leaving(box)] == [(1, 4), (2, 3)]


def test_robot_of_a_team_gets_its_place_over_relays():
    """Each robot speaks to three others at once, and of each robot the newest text leaves."""
    names = ("a", "b", "c", "d")
    claims = {name: Claim(name, [each for each in names if each != name], -LATE_S) for name in names}
    claims["a"].want()
    for number in range(1, 9):
        box = Outbox()
        for publisher, claim in enumerate(claims.values()):
            text = write_messages(claim.messages(number * REPEAT_S))
            box.put(Message(publisher, number, 0.0, text.encode()))
        for message in leaving(box):
            for each in read_messages(message.body.decode()):
                claims[each.to].receive(each, number * REPEAT_S)
    assert claims["a"].held


def test_few_messages_of_a_publisher_are_in_transit():
    box, sent = Outbox(), []
    for message in messages(1, 10):
        box.put(message)
        sent += leaving(box)
    assert [message.sequence for message in sent] == list(range(1, MOST_OF_ONE + 1))
    box.taken(1, 0.0)
    assert [message.sequence for message in leaving(box)] == [10]


@pytest.mark.parametrize("rate_hz, rtt_s", [(10.0, 0.0), (30.0, 0.001), (1000.0, 0.07)])
def test_slow_link_delivers_new_messages_and_a_fast_one_keeps_its_rate(rate_hz, rtt_s):
    """50 messages a second on a link that passes them one after the other; the answer takes `rtt_s`."""
    box, free_s, answers, ages = Outbox(), 0.0, [], []
    for step in range(20000):
        now_s = step * 0.001
        while answers and answers[0] <= now_s:
            answers.pop(0)
            box.taken(len(ages) - len(answers), now_s)
        if step % 20 == 0:
            box.put(Message(1, step // 20, now_s, bytes(100)))
        for message in leaving(box, now_s):
            free_s = max(now_s, free_s) + 1 / rate_hz
            ages.append(free_s - message.stamp_s)
            answers.append(free_s + rtt_s)
    after = ages[len(ages) // 2 :]
    assert max(after) < 3 / rate_hz + SLOWER_S + rtt_s, "a queue of 4 would take one more"
    assert len(ages) > (0.95 * 50 if rate_hz > 50 else 0.8 / (1 / rate_hz + rtt_s)) * 20


def test_few_bytes_are_in_transit_but_one_long_message_may_be():
    box = filled(Message(1, 1, 0.0, bytes(3 * MOST_BYTES)), *messages(2, 1))
    assert [message.number for message in leaving(box)] == [1]
    box.taken(1, 0.0)
    assert [message.number for message in leaving(box)] == [2]


def test_age_is_never_too_small_whatever_the_clocks_show():
    age, behind_s = MessageAge(WINDOW_S, AHEAD_S), -5000.0
    for sent_s, there_s, _back_s in ((10.0, 0.200, 0.001), (11.0, 0.003, 0.300), (12.0, 0.050, 0.050)):
        age.heard(sent_s, sent_s + there_s + behind_s)
    stamp_s = 12.1 + behind_s
    assert age.age_s(stamp_s, 12.5) == pytest.approx(0.4 + 0.003)


def test_age_is_unknown_until_the_next_heartbeat_when_the_senders_clock_was_set_ahead():
    """Otherwise a message of 9 s ago would be one of the future, and pass."""
    age = MessageAge(WINDOW_S, AHEAD_S)
    assert age.age_s(1.0, 1.0) == math.inf, "there was no heartbeat yet"
    age.heard(10.0, 10.0)
    assert (
        age.age_s(stamp_s=11.0 + 100.0, now_s=20.0) == age.age_s(stamp_s=20.0 + 100.0, now_s=20.0) == math.inf
    )
    age.heard(21.0, 21.0 + 100.0)
    assert age.age_s(stamp_s=20.0 + 100.0, now_s=22.0) == pytest.approx(2.0)


def test_age_follows_a_clock_that_drifts():
    age = MessageAge(WINDOW_S, AHEAD_S)
    for second in range(1000):
        age.heard(float(second), second * 1.0001)
    assert age.age_s(999 * 1.0001, 999.0) == pytest.approx(0.0, abs=1e-4 * WINDOW_S + 1e-9)


GOOD = {"name": "robot1"}


def test_topics_have_the_name_of_their_relay_unless_they_get_another():
    given = {
        "name": "desk",
        "peers": "robot1=10.0.0.1:11411, robot2=10.0.0.2:11411",
        "send": "robot1/cmd_vel, /clock",
    }
    settings = read_settings({**given, "receive": ["robot1/odom", "robot1//tf=/tf", "robot2/odom"]}, "/relay")
    assert settings.receive == {
        "robot1": {"odom": "robot1/odom", "tf": "/tf"},
        "robot2": {"odom": "robot2/odom"},
    }
    assert settings.send == {"robot1/cmd_vel": "robot1/cmd_vel", "clock": "/clock"}
    assert settings.peers["robot2"] == Address("10.0.0.2", 11411)
    assert settings.listen.host == "127.0.0.1", "on this computer alone unless told"


@pytest.mark.parametrize(
    "given_values, words",
    [
        ({}, "/relay/name is missing"),
        ({"name": "robot 1"}, "name is 'robot 1', expected a name such as robot1"),
        ({**GOOD, "listen": "11411"}, "listen has '11411', expected HOST:PORT"),
        ({**GOOD, "peers": "robot2"}, "peers has 'robot2', expected NAME=HOST:PORT"),
        ({**GOOD, "peers": "a=h:1,a=h:2"}, "peers has a name twice"),
        ({**GOOD, "send": "odom, /odom"}, "send has a name twice"),
        ({**GOOD, "send": "od om"}, "send has 'od om'"),
        ({**GOOD, "receive": "robot2/odom"}, "one of /relay/peers, which is empty"),
        ({**GOOD, "peers": "a=h:1", "receive": "odom"}, "receive has 'odom', expected NAME/TOPIC"),
        ({**GOOD, "peers": "a=h:1", "receive": "a/odom,a/odom=x"}, "a/odom twice"),
        ({**GOOD, "sends": "odom"}, "sends is unknown"),
    ],
)
def test_wrong_settings_are_refused_in_one_line(given_values, words):
    with pytest.raises(ConfigError) as caught:
        read_settings(given_values, "/relay")
    assert words in str(caught.value) and "\n" not in str(caught.value)


FREE = Address("127.0.0.1", 0)


def sends(topics, listen=FREE, timeout_s=TIMEOUT_S):
    """Settings of robot1, which sends topics."""
    return Settings("robot1", listen, {topic: topic for topic in topics}, {}, {}, TIMEOUT_S, timeout_s)


def fetches(address, topics=(), peer="robot1", max_age_s=TIMEOUT_S, timeout_s=TIMEOUT_S):
    """Settings of desk, which fetches topics."""
    received = {peer: {topic: topic for topic in topics}}
    return Settings("desk", FREE, {}, {peer: address}, received, max_age_s, timeout_s)


class Ends:
    """A sender and what receivers have got of it."""

    def __init__(self, topics=("state", "event", "cmd_vel")):
        self.told, self.got, self.links, self._all = [], [], [], []
        self.sender = TopicSender(sends(topics), self.told.append)

    def receiver(
        self, topics=("state", "event", "cmd_vel"), peer="robot1", max_age_s=TIMEOUT_S, address=None
    ):
        take, tell = (
            lambda source, body: self.got.append((source.topic, body)),
            lambda *link: self.links.append(link),
        )
        settings = fetches(address or self.sender.address, topics, peer, max_age_s)
        made = TopicReceiver(settings, peer, take, tell)
        self._all.append(made)
        made.start()
        return made

    def connected(self, **options):
        """A receiver that is connected."""
        made = self.receiver(**options)
        wait_until(lambda: made.is_connected)
        return made

    def publish(self, topic, body, kind=PLAIN, latched=False):
        self.sender.publish(topic, "/node", kind, latched, body)

    def close(self):
        for each in self._all:
            each.close()
        self.sender.close()


@pytest.fixture
def ends(close_later):
    return close_later(Ends())


def test_messages_arrive_with_their_age(ends):
    receiver = ends.connected()
    ends.publish("event", b"one")
    wait_until(lambda: ends.got == [("event", b"one")])
    counts = receiver.counts["event"]
    assert (counts.taken, counts.lost, counts.late) == (1, 0, 0)
    assert receiver.health == (OK, "connected")
    assert 0.0 < counts.age_s < TIMEOUT_S


def test_only_topics_that_are_named_at_both_ends_cross(ends):
    receiver = ends.connected(topics=("event", "secret"))
    ends.publish("state", b"not asked for")
    ends.sender.publish("secret", "/node", PLAIN, False, b"not offered")
    ends.publish("event", b"last")
    wait_until(lambda: ends.got == [("event", b"last")])
    assert receiver.missing == ["secret"] and receiver.health[0] == WARN
    assert "does not send secret" in ends.links[0][1]


def test_last_latched_message_comes_again_after_a_reconnect_and_others_do_not(ends):
    first = ends.connected()
    ends.publish("state", b"old", LATCHED, latched=True)
    ends.publish("state", b"new", LATCHED, latched=True)
    ends.publish("event", b"event")
    wait_until(lambda: ("state", b"new") in ends.got and ("event", b"event") in ends.got)
    first.close()
    ends.got.clear()
    ends.publish("event", b"while nobody listens")
    ends.connected()
    ends.publish("event", b"last")
    wait_until(lambda: ("event", b"last") in ends.got)
    assert ends.got == [("state", b"new"), ("event", b"last")]


@pytest.mark.parametrize(
    "kind", ["geometry_msgs/Twist", "nav_msgs/Path", "geometry_msgs/PoseArray", "std_msgs/Float64"]
)
def test_latched_command_is_not_repeated_after_a_reconnect(ends, kind):
    """`rostopic pub` latches by default."""
    ends.sender.began_s -= SETTLE_S
    ends.publish("cmd_vel", b"drive", MessageType(kind, "3", ""), latched=True)
    ends.publish("state", b"latched", LATCHED, latched=True)
    ends.connected()
    wait_until(lambda: ends.got == [("state", b"latched")])


@pytest.mark.parametrize(
    "kind", ["geometry_msgs/Twist", "nav_msgs/Path", "move_base_msgs/MoveBaseActionGoal"]
)
def test_latched_command_of_before_a_start_is_not_sent(ends, kind):
    """A publisher that latches sends it again to the relay that has just started."""
    ends.connected()
    for since_s, body in ((0.0, b"of before"), (SETTLE_S, b"new")):
        ends.sender.began_s -= since_s
        ends.publish("cmd_vel", body, MessageType(kind, "3", ""), latched=True)
    wait_until(lambda: ends.got)
    assert ends.got == [("cmd_vel", b"new")]
    assert any("cmd_vel of /node: not sent" in line for line in ends.told)


def test_latched_message_of_a_publisher_that_has_gone_is_not_repeated(ends):
    ends.sender.close()
    ends.sender = TopicSender(sends(["state"]), ends.told.append, lambda _, node: node != "/gone")
    for node in ("/gone", "/there"):
        ends.sender.publish("state", node, LATCHED, True, node.encode())
    ends.connected(topics=("state",))
    wait_until(lambda: ends.got == [("state", b"/there")])


def test_relay_with_another_name_is_refused(ends):
    receiver = ends.receiver(peer="robot2")
    wait_until(lambda: ends.links)
    assert not ends.links[0][0] and "is 'robot1', expected 'robot2'" in ends.links[0][1]
    assert receiver.health[0] == ERROR


def test_receiver_connects_when_the_other_relay_starts_and_says_each_reason_once(ends):
    with socket.create_server(("127.0.0.1", 0)) as place:
        address = Address(*place.getsockname())
    receiver = ends.receiver(address=address)
    wait_until(lambda: "refused" in receiver.reason)
    ends.sender.close()
    ends.sender = TopicSender(sends(["event"], address), ends.told.append)
    wait_until(lambda: receiver.is_connected)
    assert [yes for yes, _ in ends.links] == [False, True]


class Peer:
    """The sending end of a link, by hand."""

    def __init__(self):
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.address = Address(*self.listener.getsockname())
        self.link = socket.socket()

    def accept(self, clock_s=0.0, run="1"):
        self.link.close()
        self.link, _ = self.listener.accept()
        reader, events = FrameReader(), []
        while not any(isinstance(event, Ping) for event in events):
            events += reader.feed(self.link.recv(4096))
        (ping,) = (event for event in events if isinstance(event, Ping))
        self.clock_s = clock_s
        self.send(Hello(PROTOCOL, "robot1", run, events[0].topics), Pong(ping.sent_s, clock_s))

    def send(self, *events):
        self.link.sendall(b"".join(map(encode, events)))

    def close(self):
        self.link.close()
        self.listener.close()


@pytest.fixture
def peer(close_later):
    return close_later(Peer())


EVENT = Source(1, "event", "/node", *PLAIN, False)


@pytest.mark.parametrize(
    "source", [EVENT, Source(1, "cmd_vel", "/node", *TWIST, True)], ids=["plain", "command"]
)
def test_messages_older_than_the_limit_are_dropped_and_counted(ends, peer, source):
    """However the clocks differ; these two differ by half a century."""
    receiver = ends.receiver(max_age_s=60.0, address=peer.address)
    peer.accept(clock_s=1.6e9)
    peer.send(source, Message(1, 1, 1.6e9 - 61.0, b"old"))
    wait_until(lambda: receiver.counts[source.topic].late == 1)
    peer.send(Message(1, 2, 1.6e9, b"new"))
    wait_until(lambda: ends.got == [(source.topic, b"new")])


def test_only_the_newest_of_messages_that_arrive_together_is_taken(ends, peer):
    ends.receiver(address=peer.address)
    peer.accept()
    peer.send(EVENT, *(Message(1, sequence, 0.0, b"%d" % sequence) for sequence in range(1, 6)))
    wait_until(lambda: ends.got)
    assert ends.got == [("event", b"5")]


def test_what_was_lost_is_counted_over_reconnects_but_not_over_a_restart_of_the_sender(ends, peer):
    receiver = ends.receiver(address=peer.address)
    for run, sequence, lost in (("1", 1, 0), ("1", 5, 3), ("2", 9, 3)):
        peer.accept(run=run)
        peer.send(EVENT, Message(1, sequence, 0.0, b"%d" % sequence))
        wait_until(lambda: ends.got and ends.got[-1][1] == b"%d" % sequence)  # noqa: B023
        assert receiver.counts["event"].lost == lost
        peer.link.close()
    assert receiver.report()["event Received"] == "3"


def test_silent_relay_is_given_up(peer):
    told = []
    settings = fetches(peer.address, timeout_s=0.2)
    receiver = TopicReceiver(settings, "robot1", print, lambda *words: told.append(words))
    receiver.start()
    wait_until(lambda: told)
    receiver.close()
    assert not told[0][0] and "silent for 0.2 s" in told[0][1]


def test_heartbeats_come_whatever_the_receivers_own_timeout_is(peer):
    """The sender may have a shorter one."""
    receiver = TopicReceiver(fetches(peer.address, timeout_s=1000.0), "robot1", print, lambda *_: None)
    receiver.start()
    peer.accept()
    peer.link.settimeout(TIMEOUT_S)
    assert FrameReader().feed(peer.link.recv(4096))
    receiver.close()


def test_silent_receiver_is_given_up():
    told = []
    sender = TopicSender(sends(["event"], timeout_s=0.2), told.append)
    try:
        with socket.create_connection(sender.address):
            wait_until(lambda: told)
        assert "disconnected: silent for" in told[0]
    finally:
        sender.close()


def test_a_relay_for_which_there_is_no_thread_is_refused_and_the_next_one_served():
    told = []
    sender = TopicSender(sends([]), told.append)
    with threads_left(0), socket.create_connection(sender.address) as refused:
        assert refused.recv(1) == b""
    with socket.create_connection(sender.address) as served:
        served.settimeout(TIMEOUT_S)
        served.sendall(encode(Hello(PROTOCOL, "robot2", "b2", [])))
        assert served.recv(1)
    sender.close()
    assert "refused: no thread can be started" in told[0]
