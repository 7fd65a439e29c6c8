"""The emulated radio: the module as a board sees it, the air, and texts between boards."""

import math
from typing import Iterator, List

import pytest

from mrl_driver.errors import ConfigError
from mrl_driver.protocol import REPLIES, Frame, FrameDecoder, encode_request
from mrl_driver.robot import models
from sim_arduino.board import PythonBoard
from sim_arduino.hardware.wiring import Plant
from sim_arduino.hardware.xbee import BROADCAST, RadioFit, XBee, address_for
from sim_arduino.hardware.xbee_packets import PacketReader, packet
from sim_arduino.world import radio
from sim_arduino.world.radio import RadioMedium
from sim_arduino.world.world import World
from tests.firmware.test_xbee import words

ONE, TWO, THREE = 0x0013A20040000001, 0x0013A20040000002, 0x0013A20040000003
LONG_S = 10.0


class Module:
    """A module whose packets to the board are read at once."""

    def __init__(self, medium: RadioMedium, address: int, x_m: float = 0.0, seed: int = 0, **fit: float):
        self.medium, self.x_m = medium, x_m
        self.xbee = XBee(
            medium, f"robot{address % 16}", RadioFit(address, **fit), lambda: (self.x_m, 0.0), seed
        )

    def give(self, data: bytes, at_s: float = 0.0) -> None:
        """Data of a packet from the board."""
        self.xbee.receive(packet(data), at_s)

    def send(self, to: int, text: bytes, at_s: float = 0.0, frame: int = 1) -> None:
        self.give(bytes([0x10, frame]) + to.to_bytes(8, "big") + b"\xff\xfe\0\0" + text, at_s)

    def packets(self, to_s: float = LONG_S) -> List[bytes]:
        """Data of the packets to the board until a time."""
        return [data for each in self.xbee.take(to_s) for data in PacketReader().feed(each)]

    def texts(self) -> List[bytes]:
        return [each[12:] for each in self.packets() if each[0] == 0x90]

    def statuses(self) -> List[int]:
        """Delivery statuses."""
        return [each[5] for each in self.packets() if each[0] == 0x8B]


@pytest.fixture
def pair():
    medium = RadioMedium()
    return Module(medium, ONE), Module(medium, TWO, 3.0)


def test_text_arrives_with_the_addresses_of_its_sender(pair):
    """As API mode 1 has no escapes, each value of a byte is possible."""
    one, two = pair
    texts = bytes(range(84)), bytes(range(172, 256))
    for number, text in enumerate(texts):
        one.send(TWO, text, at_s=number)
    sender = ONE.to_bytes(8, "big") + one.xbee.station.network.to_bytes(2, "big")
    assert two.packets() == [b"\x90" + sender + b"\x01" + text for text in texts]


def test_sender_gets_the_status_of_its_text(pair):
    """Frame id 0 asks for none."""
    one, two = pair
    one.send(TWO, b"hello", frame=7)
    one.send(TWO, b"hello", frame=0)
    (got,) = one.packets()
    assert got == b"\x8b\x07" + two.xbee.station.network.to_bytes(2, "big") + b"\0\0\x01"


def test_broadcast_reaches_all_others(pair):
    one, two = pair
    three = Module(one.medium, THREE)
    one.send(BROADCAST, b"all")
    marked = [[each[11:] for each in module.packets() if each[0] == 0x90] for module in (two, three, one)]
    assert marked == [[b"\x02all"], [b"\x02all"], []]


@pytest.mark.parametrize(
    "to, text, status", [(THREE, b"hello", 0x24), (ONE, b"hello", 0x23), (TWO, bytes(85), 0x74)]
)
def test_text_to_nobody_or_too_long_fails(pair, to, text, status):
    one, two = pair
    one.send(to, text)
    assert (one.statuses(), two.texts()) == ([status], [])


@pytest.mark.parametrize(
    "command, answer",
    [
        (b"\x01SH", b"\x01SH\0\x00\x13\xa2\x00"),
        (b"\x01SL", b"\x01SL\0\x40\0\0\x01"),
        (b"\x01NI", b"\x01NI\0robot1"),
        (b"\x05ZZ", b"\x05ZZ\x02"),
        (b"\x01SL\0\0\0\1", b"\x01SL\x03"),
    ],
)
def test_at_commands_read_values_and_refuse_what_is_unknown_or_fixed(pair, command, answer):
    one, _ = pair
    one.give(b"\x08" + command)
    assert one.packets() == [b"\x88" + answer]


def test_cut_radio_sends_nothing(pair):
    one, two = pair
    one.xbee.set(cut=True)
    one.send(BROADCAST, b"hello")
    assert two.texts() == []


def test_radio_that_was_met_and_is_gone_does_not_acknowledge(pair):
    one, two = pair
    one.send(TWO, b"hello")
    two.xbee.set(cut=True)
    one.send(TWO, b"again")
    assert one.statuses() == [0x00, 0x21]


def test_each_node_answers_a_search_once_and_no_packet_ends_it(pair):
    one, two = pair
    three = Module(one.medium, THREE)
    one.give(b"\x08\x01ND")
    found = one.packets()
    assert sorted(each[7:15] for each in found) == [each.to_bytes(8, "big") for each in (TWO, THREE)]
    assert {each[:5] for each in found} == {b"\x88\x01ND\0"}
    assert (two.packets(), three.packets()) == ([], [])


def test_answer_to_a_search_has_the_node_identifier(pair):
    one, two = pair
    two.give(b"\x08\x01NIdock")
    one.give(b"\x08\x01ND")
    (found,) = one.packets()
    assert found[15:20] == b"dock\0"


def test_search_for_a_node_that_does_not_answer_ends_with_an_error(pair):
    one, _ = pair
    one.give(b"\x08\x01NDnobody")
    assert one.packets(radio.DISCOVERY_S) == [b"\x88\x01ND\x01"]


def test_packet_with_a_wrong_checksum_is_dropped(pair):
    one, two = pair
    data = bytearray(packet(b"\x10\x01" + TWO.to_bytes(8, "big") + b"\xff\xfe\0\0hello"))
    data[-1] ^= 1
    one.xbee.receive(bytes(data), 0.0)
    assert (two.texts(), one.statuses()) == ([], [])


def test_two_radios_cannot_have_one_address(pair):
    one, _ = pair
    with pytest.raises(ConfigError, match="address 0013a20040000001 is taken"):
        Module(one.medium, ONE)


@pytest.mark.parametrize("x_m, texts", [(5.0, 1), (5.01, 0)])
def test_range_is_the_distance_of_the_robots(x_m, texts):
    medium = RadioMedium()
    one, two = Module(medium, ONE, range_m=5.0), Module(medium, TWO, x_m)
    one.send(BROADCAST, b"hello")
    assert len(two.texts()) == texts


def test_the_shorter_range_of_two_counts():
    medium = RadioMedium()
    one, two = Module(medium, ONE), Module(medium, TWO, 3.0, range_m=2.0)
    one.send(TWO, b"hello")
    assert two.texts() == []


def test_broadcasts_are_lost_as_often_as_all_three_sends_are():
    """Half of the packets lost: an eighth of the broadcasts; four standard deviations of 1000 are 42."""
    medium = RadioMedium()
    one, two = Module(medium, ONE), Module(medium, TWO, loss=0.5)
    for _ in range(1000):
        one.send(BROADCAST, b"hello")
    assert len(two.texts()) == pytest.approx(875, abs=42)


def test_unicasts_are_repeated_until_they_are_acknowledged():
    """Half of the packets lost at the receiver: one attempt fails once in 16, three once in 4096."""
    medium = RadioMedium()
    one, two = Module(medium, ONE), Module(medium, TWO, loss=0.5)
    for _ in range(200):
        one.send(TWO, b"hello")
    assert len(two.texts()) == 200 and one.statuses() == [0] * 200


def test_lost_acknowledgements_deliver_a_text_again():
    """The sender receives nothing: three attempts, three texts, and a status that says it failed."""
    medium = RadioMedium()
    one, two = Module(medium, ONE, loss=1.0), Module(medium, TWO)
    one.send(TWO, b"hello")
    assert (two.texts(), one.statuses()) == ([b"hello"] * 3, [0x21])


def test_a_seed_repeats_the_losses():
    def arrivals(seed: int) -> List[bytes]:
        medium = RadioMedium()
        one, two = Module(medium, ONE, seed=seed), Module(medium, TWO, loss=0.8)
        for number in range(50):
            one.send(BROADCAST, bytes([number]))
        return two.texts()

    assert arrivals(1) == arrivals(1) != arrivals(2)


class Boards:
    """Two boards in one world, run in steps of simulated time."""

    def __init__(self, world: World, x_m: float = 1.0, **fit: float) -> None:
        model = models.load("traxbot")
        self.plants = [
            Plant(model, world, (n * x_m, 0, 0), name=f"robot{n}", radio=RadioFit(**fit)) for n in (0, 1)
        ]
        self.engines = [PythonBoard(plant) for plant in self.plants]
        self._decoders = [FrameDecoder(REPLIES) for _ in self.engines]
        self.now_s = 0.0

    def address(self, number: int) -> List[int]:
        return list(words(self.plants[number].xbee.station.address.to_bytes(8, "big"))[1:])

    def request(self, number: int, code: int, *values: int) -> None:
        self.engines[number].receive(encode_request(code, *values))

    def run(self, seconds: float) -> Iterator[Frame]:
        """Frames of the second board."""
        self.now_s += seconds
        self.engines[0].advance(self.now_s)
        return self._decoders[1].feed(self.engines[1].advance(self.now_s))


@pytest.fixture
def boards():
    made = Boards(World())
    made.run(0.01)
    return made


def test_text_goes_from_host_to_host(boards):
    boards.request(0, 38, *boards.address(1), *words(b"hello"))
    assert list(boards.run(0.1)) == [Frame(39, (*boards.address(0), *words(b"hello")))]


def test_both_lines_take_their_time(boards):
    """23 and 21 bytes at 9600 baud, and 2 to 5 ms in the air, before the frame for the host."""
    boards.request(0, 38, *boards.address(1), *words(b"hello"))
    assert list(boards.run(0.045)) == []


def test_search_reports_each_node(boards):
    boards.request(1, 40)
    boards.run(0.1)
    (frame,) = boards.run(radio.DISCOVERY_S)
    assert frame.args[:4] == tuple(boards.address(0))


def test_text_with_a_wrong_length_is_refused(boards):
    boards.request(0, 38, *boards.address(1), 3, 1)
    boards.run(0.02)
    assert boards.engines[0].health.counters["argument_count"] == 1


def test_texts_faster_than_the_line_are_refused(boards):
    for _ in range(3):
        boards.request(0, 38, *boards.address(1), *words(b"sixteen letters!"))
    boards.run(0.03)
    assert boards.engines[0].health.counters["unavailable"] == 1


def test_board_that_stood_still_has_the_texts_that_fitted_into_its_queue(boards):
    """64 bytes hold three packets of 18 bytes; the fourth is cut short, and the fifth is lost."""
    sender, receiver = boards.plants[0].xbee, boards.engines[1]
    for number in range(5):
        data = (
            b"\x10\x01"
            + boards.plants[1].xbee.station.address.to_bytes(8, "big")
            + b"\xff\xfe\0\0n%d" % number
        )
        sender.receive(packet(data), boards.now_s + 0.1 * number)
    receiver.gap(boards.now_s + 2.0, b"")
    boards.now_s += 2.0
    assert [frame.args[4:] for frame in boards.run(1.0)] == [words(b"n0"), words(b"n1"), words(b"n2")]


def test_address_without_one_given_is_digis_and_the_robots():
    assert address_for("one") >> 32 == 0x0013A200 and address_for("one") != address_for("two")
    assert math.log2(address_for("one")) < 64
