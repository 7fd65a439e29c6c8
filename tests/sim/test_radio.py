"""The emulated radio: the module as a board sees it, the air, and texts between boards."""

from typing import List

import pytest

from mrl_driver.protocol import REPLIES, FrameDecoder
from mrl_driver.robot import models
from sim_arduino.board import PythonBoard
from sim_arduino.hardware.wiring import Plant
from sim_arduino.hardware.xbee import BROADCAST, PacketReader, RadioFit, XBee, packet
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
        self.xbee.receive(packet(data), at_s)

    def send(self, to: int, text: bytes, at_s: float = 0.0, frame: int = 1) -> None:
        self.give(bytes([0x10, frame]) + to.to_bytes(8, "big") + b"\xff\xfe\0\0" + text, at_s)

    def packets(self, to_s: float = LONG_S) -> List[bytes]:
        return [data for each in self.xbee.take(to_s) for data in PacketReader().feed(each)]

    def texts(self) -> List[bytes]:
        return [each[12:] for each in self.packets() if each[0] == 0x90]

    def statuses(self) -> List[int]:
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


@pytest.mark.parametrize("x_m, texts", [(5.0, 1), (5.01, 0)])
def test_range_is_the_distance_of_the_robots(x_m, texts):
    medium = RadioMedium()
    one, two = Module(medium, ONE, range_m=5.0), Module(medium, TWO, x_m)
    one.send(BROADCAST, b"hello")
    assert len(two.texts()) == texts


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


def test_board_that_stood_still_has_the_texts_that_fitted_into_its_queue():
    """64 bytes hold three packets of 18 bytes; the fourth is cut short, and the fifth is lost."""
    world, model = World(), models.load("traxbot")
    plants = [Plant(model, world, (n, 0, 0), name=f"robot{n}", radio=RadioFit()) for n in (0, 1)]
    to, board = plants[1].xbee.station.address.to_bytes(8, "big"), PythonBoard(plants[1])
    board.advance(0.01)
    for number in range(5):
        plants[0].xbee.receive(packet(b"\x10\x01" + to + b"\xff\xfe\0\0n%d" % number), 0.1 * (number + 1))
    board.gap(2.0, b"")
    frames = FrameDecoder(REPLIES).feed(board.advance(3.0))
    assert [frame.args[4:] for frame in frames] == [words(b"n0"), words(b"n1"), words(b"n2")]
