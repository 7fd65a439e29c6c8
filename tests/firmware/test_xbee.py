"""Radio: packets of the XBee's API mode, frames 38 to 40, and holds at the limits of numbers, places and times."""

from typing import List

import pytest

from mrl_driver.protocol import Frame
from mrl_driver.protocol.hold_text import HoldText
from mrl_driver.protocol.table import BY_NAME, HOLD_STATES, PARAMETER_BY_NAME
from tests.firmware.pc_board import XBEE
from tests.firmware.test_failsafe import STOP

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


SILENCE = 10
SILENCE_S = SILENCE * 0.1  # Parameter 26 [100 ms]
HALF_MS = 0.5e-3
PLACES = 4
ANSWER = 22  # Size of the packet with an answer [byte]
READ_RADIO = BY_NAME["read_radio"].code
STATE = [name for name, _ in HOLD_STATES]
A, B, C, D, E = (bytes.fromhex(f"0013a200400000{last:02x}") for last in range(1, 6))
NOBODY = bytes(8)


class Radio:
    """A board whose parameter 26 is set, on the bench, and the packets of its radio module."""

    def __init__(self, board):
        self.board, self._sent = board, b""

    def hear(self, *texts, wait_s: float = 0.01) -> None:
        """Hold texts arrive: an address, then a kind and a number."""
        for address, kind, number in texts:
            self.hear_bytes(address, HoldText(kind, number).data)
            self._sent += self.board.board.radio_sent()
        self.board.run(wait_s)

    def hear_bytes(self, address: bytes, text: bytes, wait_s: float = 0.002) -> None:
        """A text arrives; the radio takes nothing meanwhile."""
        for byte in packet(b"\x90" + address + b"\xff\xfe\x01" + text):
            self.board.board.native.pc_radio_receive(byte)
        self.board.run(wait_s)

    def sent(self) -> bytes:
        """What has been sent to the radio since the last call."""
        sent, self._sent = self._sent + self.board.board.radio_sent(), b""
        return sent

    def say(self, address: bytes, kind: str, number: int) -> List[HoldText]:
        self.sent()
        self.hear((address, kind, number))
        return self.answers(address)

    def answers(self, address: bytes) -> List[HoldText]:
        """What has been sent since the last call: only answers, all to this address."""
        sent = self.sent()
        texts = [HoldText.parse(sent[end - 5 : end - 1]) for end in range(ANSWER, len(sent) + 1, ANSWER)]
        assert sent == b"".join(answer(address, text.kind, text.number) for text in texts)
        return texts

    def asked(self, field: str) -> int:
        return self.board.field("read_radio", field)

    def state(self) -> str:
        return STATE[self.asked("state")]

    def named(self) -> bytes:
        words = self.board.ask("read_radio").args[4:]
        return b"".join((word & 0xFFFF).to_bytes(2, "big") for word in words)

    def told(self) -> List[str]:
        """The states that the board has sent since the last `forget`."""
        return [STATE[frame.args[0]] for frame in self.board.frames() if frame.code == READ_RADIO]

    def is_refused(self) -> bool:
        """Whether a move is refused because the robot is held."""
        before = self.board.field("read_counters", "held")
        self.board.send("move_differential", 100, 0)
        return self.board.field("read_counters", "held") > before


def answer(address: bytes, kind: str, number: int) -> bytes:
    """The packet that carries an answer: no status is asked for (frame id 0), the network address is not known."""
    return packet(b"\x10\0" + address + b"\xff\xfe\0\0" + HoldText(kind, number).data)


@pytest.fixture
def start(bench):
    """Starts a board whose parameter 26 is set in the EEPROM."""

    def make(silence: int = SILENCE, first_tick: int = 0) -> Radio:
        board = bench(library=XBEE, sonars=False)
        board.send("write_config", PARAMETER_BY_NAME["radio_hold"].number, silence)
        board.send("save_config", wait_s=0.3)
        eeprom = board.board.eeprom
        return Radio(bench(library=XBEE, sonars=False, eeprom=eeprom, boot=False, first_tick=first_tick))

    return make


@pytest.fixture
def settled(bench):
    """A board that listens no more: parameter 26 is set after the start."""
    board = bench(library=XBEE, sonars=False)
    board.send("write_config", PARAMETER_BY_NAME["radio_hold"].number, SILENCE)
    board.forget()
    return Radio(board)


def write_silence(settled: Radio, value: int) -> None:
    settled.board.send("write_config", PARAMETER_BY_NAME["radio_hold"].number, value)


@pytest.mark.parametrize("first", [0, 0x1234, 0xC000])
@pytest.mark.parametrize("ahead, state", [(32767, "held"), (32768, "free")])
def test_a_number_up_to_32767_ahead_is_newer(settled, first, ahead, state):
    settled.hear((A, "hold", first), (A, "free", first))
    settled.hear((A, "hold", (first + ahead) % 65536))
    assert settled.state() == state


def test_a_repeated_end_of_a_hold_is_answered_and_stops_nothing(settled):
    settled.hear((A, "hold", 7), (A, "free", 7))
    settled.board.send("move_differential", 100, 0)
    settled.board.forget()
    assert settled.say(A, "free", 7) == [HoldText("freed", 7)]
    assert settled.board.writes(STOP[0]) == [] and settled.asked("ignored") == 0


def test_a_newer_end_frees_the_robot(settled):
    settled.hear((A, "hold", 7))
    assert settled.say(A, "free", 8) == [HoldText("freed", 8)]
    assert settled.state() == "free"


@pytest.mark.parametrize("place", range(8))
def test_addresses_differ_if_one_byte_does(settled, place):
    other = bytearray(A)
    other[place] ^= 1
    settled.hear((A, "hold", 1), (bytes(other), "hold", 1))
    assert settled.asked("holders") == 2


def test_the_place_of_a_radio_that_holds_no_more_goes_to_another_one(settled):
    """Whose numbers are its own: those of the radio before count no more."""
    for address in (A, B, C, D):
        settled.hear((address, "hold", 100), (address, "free", 100))
    assert settled.say(E, "hold", 1) == [HoldText("held", 1)]
    assert settled.state() == "held"


def test_a_place_is_not_taken_from_a_radio_that_holds(settled):
    for address in (A, B, C):
        settled.hear((address, "hold", 1))
    settled.hear((D, "hold", 1), (D, "free", 1), (E, "hold", 1))
    assert settled.asked("holders") == PLACES
    for address in (A, B, C, E):
        assert settled.say(address, "free", 1) == [HoldText("freed", 1)]
    assert (settled.state(), settled.asked("ignored")) == ("free", 0)


def test_a_radio_stays_known_while_places_are_left_that_nobody_used(settled):
    """Its old text has no effect, although another radio came in between."""
    settled.hear((A, "hold", 5), (A, "free", 5), (B, "hold", 1), (B, "free", 1))
    assert settled.say(A, "hold", 5) == [HoldText("freed", 5)]


def test_parameter_26_off_forgets_the_radios(settled):
    settled.hear((A, "hold", 5))
    write_silence(settled, 0)
    assert settled.state() == "off"
    write_silence(settled, SILENCE)
    assert settled.say(A, "hold", 5) == [HoldText("held", 5)]
    assert settled.state() == "held"


@pytest.mark.parametrize("kind", ["hold", "free"])
@pytest.mark.parametrize("held", [0, PLACES])
def test_hold_texts_do_not_reach_the_host(settled, kind, held):
    settled.hear(*((address, "hold", 1) for address in (A, B, C, D)[:held]), (E, kind, 1), wait_s=0.05)
    assert settled.board.frames() == []


def test_an_answer_waits_for_room_at_the_radio(settled):
    """Two answers of 22 bytes fit into 64; the third radio's comes after these."""
    for number, address in enumerate((A, B, C)):
        settled.hear_bytes(address, HoldText("hold", number).data, wait_s=0.1)
    assert settled.sent() == answer(A, "held", 0) + answer(B, "held", 1)
    settled.board.run(0.01)
    assert settled.sent() == answer(C, "held", 2)


def test_a_repeated_hold_stops_again(settled):
    settled.hear((A, "hold", 1))
    settled.board.forget()
    settled.hear((A, "hold", 1))
    assert settled.board.writes() == [STOP]


def test_a_held_robot_takes_commands_that_do_not_move_it(settled):
    settled.hear((A, "hold", 1))
    settled.board.forget()
    settled.board.send("preset_encoder", 1, 5)
    assert settled.board.writes(0xEF) and settled.board.field("read_counters", "held") == 0


def test_a_held_robot_without_its_motor_board_refuses_for_that(settled):
    settled.hear((A, "hold", 1))
    settled.board.plant.motor_board.present = False
    settled.board.run(0.2)
    assert not settled.is_refused()
    assert settled.board.counter("unavailable") == 1


def changed_s(settled: Radio, state: str, begun_s: float) -> float:
    """Time from `begun_s` to the report of this state, seen in steps of 0.1 ms [s]."""
    board = settled.board
    while settled.told()[-1:] != [state]:
        assert board.board.now_s < begun_s + 2 * SILENCE_S, f"never {state}"
        board.run(0.1e-3)
    return board.board.now_s - begun_s


REPORT_S = len(b"@49,4,1,0,0,19,-24064,16384,1e") * 10 / 115200


def test_a_holder_counts_as_silent_after_its_time(settled):
    settled.asked("state")
    settled.board.forget()
    begun_s = settled.board.board.now_s
    settled.hear((A, "hold", 1), wait_s=0.99 * SILENCE_S)
    assert settled.told() == ["held"]
    assert changed_s(settled, "silent", begun_s) - REPORT_S == pytest.approx(SILENCE_S + HALF_MS, abs=HALF_MS)


def test_a_holder_that_repeats_its_hold_is_silent_that_much_later(settled):
    settled.asked("state")
    settled.hear((A, "hold", 1), wait_s=0.5)
    begun_s = settled.board.board.now_s
    settled.hear((A, "hold", 1), wait_s=0.99 * SILENCE_S)
    assert changed_s(settled, "silent", begun_s) - REPORT_S == pytest.approx(SILENCE_S + HALF_MS, abs=HALF_MS)


@pytest.mark.parametrize("first_tick", [0, 30000, 60000])
def test_a_board_listens_from_its_start_on(start, first_tick):
    settled = start(first_tick=first_tick)
    settled.board.run(SILENCE_S - 0.1)
    before = settled.is_refused()
    settled.board.run(0.1)
    assert (before, settled.is_refused()) == (True, False)


def test_a_hold_from_address_0_does_not_end_the_listening(start):
    settled = start()
    settled.board.run(0.1)
    settled.hear((NOBODY, "hold", 1), (NOBODY, "free", 1))
    assert settled.state() == "listening"


def test_an_end_from_address_0_is_ignored_after_the_listening(start):
    settled = start()
    settled.board.run(SILENCE_S + 0.1)
    settled.hear((NOBODY, "free", 1))
    assert (settled.state(), settled.asked("ignored")) == ("free", 1)


def test_a_repeated_hold_is_no_news(settled):
    settled.asked("state")
    settled.board.forget()
    settled.hear((A, "hold", 1), wait_s=0.05)
    settled.hear((A, "hold", 1), wait_s=0.05)
    assert settled.told() == ["held"]


def test_a_silent_holder_that_speaks_again_is_news(settled):
    settled.hear((A, "hold", 1), wait_s=SILENCE_S + 0.05)
    assert settled.state() == "silent"
    settled.board.forget()
    settled.hear((A, "hold", 1), wait_s=0.05)
    assert settled.told() == ["held"]


def test_the_end_of_the_listening_is_told_once(start):
    settled = start()
    settled.board.run(0.1)
    assert settled.state() == "listening"
    settled.board.forget()
    settled.board.run(SILENCE_S)
    assert settled.told() == ["free"]


def test_news_waits_while_eight_answers_do(settled):
    settled.asked("state")
    settled.board.forget()
    settled.board.raw(b"@31e" * 8, wait_s=0.004)
    settled.hear((A, "hold", 1), wait_s=0.1)
    assert settled.told() == ["held"] and settled.board.frames()[-1].code == READ_RADIO
    assert settled.board.counter("overrun") == 0


@pytest.mark.parametrize("speaking, silent", [(A, B), (B, A)])
def test_the_silent_holder_is_named(settled, speaking, silent):
    settled.hear((A, "hold", 1), (B, "hold", 1), wait_s=0.6 * SILENCE_S)
    settled.hear((speaking, "hold", 1), wait_s=0.6 * SILENCE_S)
    assert (settled.state(), settled.asked("holders"), settled.named()) == ("silent", 2, silent)


def release(settled: Radio) -> int:
    settled.board.check(True)
    held = settled.board.ask("release_hold").args[0]
    settled.board.check(False)
    return held


def test_a_release_leaves_those_that_speak(settled):
    settled.hear((A, "hold", 1), (B, "hold", 1), wait_s=0.6 * SILENCE_S)
    settled.hear((B, "hold", 1), wait_s=0.6 * SILENCE_S)
    assert release(settled) == 1
    assert (settled.state(), settled.asked("holders"), settled.named()) == ("held", 1, B)


def test_a_release_is_told(settled):
    settled.hear((A, "hold", 1), wait_s=SILENCE_S + 0.05)
    settled.asked("state")
    settled.board.check(True)
    settled.board.forget()
    settled.board.send("release_hold", wait_s=0.05)
    codes = [frame.code for frame in settled.board.frames()]
    assert codes == [BY_NAME["release_hold"].code, READ_RADIO] and settled.told() == ["free"]


def test_a_release_does_not_end_the_listening(start):
    settled = start()
    settled.board.run(0.1)
    assert release(settled) == 1
    assert settled.state() == "listening"
