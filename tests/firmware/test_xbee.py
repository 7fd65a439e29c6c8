"""Texts by radio: packets of the XBee's API mode, and frames 38 to 40."""

import pytest

from mrl_driver.protocol import Frame
from tests.firmware.pc_board import XBEE

ADDRESS = bytes.fromhex("0013a20040a1b2c3")
ADDRESS_WORDS = (0x0013, 0xA200 - 0x10000, 0x40A1, 0xB2C3 - 0x10000)
NETWORK = 0x1234
SEND, DISCOVER = "send_xbee", "discover_xbee"


def packet(data: bytes) -> bytes:
    """API mode 1: delimiter, length, data, check sum."""
    return b"\x7e" + len(data).to_bytes(2, "big") + data + bytes([0xFF - sum(data) % 256])


def received(text: bytes) -> bytes:
    return packet(b"\x90" + ADDRESS + NETWORK.to_bytes(2, "big") + b"\x01" + text)


def node(status: int = 0) -> bytes:
    name = b"ROBOT\0" + bytes.fromhex("fffe01000c105101")
    return packet(b"\x88\x01ND" + bytes([status]) + NETWORK.to_bytes(2, "big") + ADDRESS + name)


def words(text: bytes):
    """A text as the wire's fields: its length, then two bytes a number."""
    padded = text + b"\0" * (len(text) % 2)
    pairs = (padded[i : i + 2] for i in range(0, len(padded), 2))
    return (len(text), *(int.from_bytes(pair, "big", signed=True) for pair in pairs))


@pytest.fixture
def radio(bench):
    board = bench(library=XBEE)

    def hear(data: bytes, wait_s: float = 0.05):
        for byte in data:
            board.board.native.pc_radio_receive(byte)
        board.run(wait_s)

    board.hear, board.radio_sent = hear, board.board.radio_sent
    return board


@pytest.mark.parametrize("text", [b"a", b"ab", b"hello", b"sixteen letters!"])
def test_send(radio, text):
    """A transmit request to the 64-bit address; the network address is left to the XBee."""
    radio.send(SEND, *ADDRESS_WORDS, *words(text))
    assert radio.radio_sent() == packet(b"\x10\x01" + ADDRESS + b"\xff\xfe\0\0" + text)


@pytest.mark.parametrize("length, given", [(2, 2), (3, 1), (16, 7)])
def test_length_must_match_the_text(radio, length, given):
    radio.send(SEND, *ADDRESS_WORDS, length, *[0] * given)
    assert radio.radio_sent() == b"" and radio.counter("argument_count") == 1


def test_send_faster_than_the_radio_is_refused(radio):
    """64 bytes wait for the radio: one packet of 34 fits, the second does not."""
    for _ in range(2):
        radio.send(SEND, *ADDRESS_WORDS, *words(b"sixteen letters!"))
    assert radio.counter("unavailable") == 1


@pytest.mark.parametrize("text", [b"x", b"hello", b"sixteen letters!"])
def test_received_text(radio, text):
    radio.hear(received(text))
    assert radio.frames() == [Frame(39, (*ADDRESS_WORDS, *words(text)))]


def test_long_text_comes_in_pieces(radio):
    text = bytes(range(0x20, 0x20 + 72))
    radio.hear(received(text), wait_s=0.2)
    pieces = [text[i : i + 16] for i in range(0, 72, 16)]
    assert [frame.args[4:] for frame in radio.frames()] == [words(piece) for piece in pieces]


def test_texts_behind_each_other(radio):
    radio.hear(received(b"one") + received(b"two"), wait_s=0.2)
    assert [frame.args[4:] for frame in radio.frames()] == [words(b"one"), words(b"two")]


def test_texts_come_behind_a_full_stream(radio):
    radio.send("start_stream")
    radio.hear(received(b"hello"), wait_s=0.1)
    assert Frame(39, (*ADDRESS_WORDS, *words(b"hello"))) in radio.frames()


@pytest.mark.parametrize("place", range(1, 20))
def test_damaged_packets_are_dropped(radio, place):
    """Wrong in one byte behind the delimiter; the next one is received."""
    data = bytearray(received(b"hello"))
    data[place] ^= 0x01
    radio.hear(bytes(data), wait_s=0.2)
    radio.forget()
    radio.hear(received(b"next"), wait_s=0.1)
    assert radio.frames() == [Frame(39, (*ADDRESS_WORDS, *words(b"next")))]


def test_packet_that_breaks_off_is_forgotten(radio):
    radio.hear(received(b"hello")[:10], wait_s=0.1)
    radio.hear(received(b"next"), wait_s=0.1)
    assert [frame.args[4:] for frame in radio.frames()] == [words(b"next")]


@pytest.mark.parametrize(
    "noise", [b"", b"OK\r", b"\x7e\x7e\x7e", b"\x7e\x01\x00", b"\x7e\x00\x00", b"\x7e\x00\xff"]
)
def test_noise_before_a_packet(radio, noise):
    radio.hear(noise, wait_s=0.1)
    radio.hear(received(b"next"), wait_s=0.1)
    assert [frame.args[4:] for frame in radio.frames()] == [words(b"next")]


@pytest.mark.parametrize("length", [97, 200, 255])
def test_packet_longer_than_any_is_not_waited_for(radio, length):
    radio.hear(b"\x7e\x00" + bytes([length]) + received(b"next"), wait_s=0.04)
    assert [frame.args[4:] for frame in radio.frames()] == [words(b"next")]


@pytest.mark.parametrize(
    "data", [b"\x90", b"\x90" + ADDRESS + b"\0\0\1", b"\x88\x01ND\0", b"\x8b\x01\0\0\0\0\0"]
)
def test_packets_without_anything_for_the_host(radio, data):
    radio.hear(packet(data), wait_s=0.1)
    assert radio.frames() == []


def test_discovery(radio):
    """The request is an AT command ND; each node that answers is one frame."""
    radio.send(DISCOVER)
    asked = radio.radio_sent()
    radio.hear(node() + node(), wait_s=0.1)
    assert asked == packet(b"\x08\x01ND")
    assert radio.frames() == [Frame(40, (*ADDRESS_WORDS, NETWORK))] * 2


def test_failed_discovery_is_no_node(radio):
    radio.hear(node(status=1), wait_s=0.1)
    assert radio.frames() == []
