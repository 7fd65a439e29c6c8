"""Holds by radio at their limits: numbers, places for radios, times, and what the host and the holder are told."""

from typing import List

import pytest

from mrl_driver.protocol.hold_text import HoldText
from mrl_driver.protocol.table import BY_NAME, HOLD_STATES, PARAMETER_BY_NAME
from tests.firmware.pc_board import XBEE
from tests.firmware.test_failsafe import STOP
from tests.firmware.test_xbee import packet

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
def radio(bench):
    """A board that listens no more: parameter 26 is set after the start."""
    board = bench(library=XBEE, sonars=False)
    board.send("write_config", PARAMETER_BY_NAME["radio_hold"].number, SILENCE)
    board.forget()
    return Radio(board)


def write_silence(radio: Radio, value: int) -> None:
    radio.board.send("write_config", PARAMETER_BY_NAME["radio_hold"].number, value)


# ---- numbers


@pytest.mark.parametrize("first", [0, 0x1234, 0xC000])
@pytest.mark.parametrize("ahead, state", [(32767, "held"), (32768, "free")])
def test_a_number_up_to_32767_ahead_is_newer(radio, first, ahead, state):
    radio.hear((A, "hold", first), (A, "free", first))
    radio.hear((A, "hold", (first + ahead) % 65536))
    assert radio.state() == state


def test_a_repeated_end_of_a_hold_is_answered_and_stops_nothing(radio):
    radio.hear((A, "hold", 7), (A, "free", 7))
    radio.board.send("move_differential", 100, 0)
    radio.board.forget()
    assert radio.say(A, "free", 7) == [HoldText("freed", 7)]
    assert radio.board.writes(STOP[0]) == [] and radio.asked("ignored") == 0


def test_a_newer_end_frees_the_robot(radio):
    radio.hear((A, "hold", 7))
    assert radio.say(A, "free", 8) == [HoldText("freed", 8)]
    assert radio.state() == "free"


def test_an_end_from_an_unknown_radio_is_answered_with_its_number(radio):
    assert radio.say(A, "free", 9) == [HoldText("freed", 9)]
    assert radio.asked("ignored") == 1


# ---- the places of four radios


@pytest.mark.parametrize("place", range(8))
def test_addresses_differ_if_one_byte_does(radio, place):
    other = bytearray(A)
    other[place] ^= 1
    radio.hear((A, "hold", 1), (bytes(other), "hold", 1))
    assert radio.asked("holders") == 2


def test_the_place_of_a_radio_that_holds_no_more_goes_to_another_one(radio):
    """Whose numbers are its own: those of the radio before count no more."""
    for address in (A, B, C, D):
        radio.hear((address, "hold", 100), (address, "free", 100))
    assert radio.say(E, "hold", 1) == [HoldText("held", 1)]
    assert radio.state() == "held"


def test_a_place_is_not_taken_from_a_radio_that_holds(radio):
    for address in (A, B, C):
        radio.hear((address, "hold", 1))
    radio.hear((D, "hold", 1), (D, "free", 1), (E, "hold", 1))
    assert radio.asked("holders") == PLACES
    for address in (A, B, C, E):
        assert radio.say(address, "free", 1) == [HoldText("freed", 1)]
    assert (radio.state(), radio.asked("ignored")) == ("free", 0)


def test_a_radio_stays_known_while_places_are_left_that_nobody_used(radio):
    """Its old text has no effect, although another radio came in between."""
    radio.hear((A, "hold", 5), (A, "free", 5), (B, "hold", 1), (B, "free", 1))
    assert radio.say(A, "hold", 5) == [HoldText("freed", 5)]


def test_parameter_26_off_forgets_the_radios(radio):
    radio.hear((A, "hold", 5))
    write_silence(radio, 0)
    assert radio.state() == "off"
    write_silence(radio, SILENCE)
    assert radio.say(A, "hold", 5) == [HoldText("held", 5)]
    assert radio.state() == "held"


# ---- texts


@pytest.mark.parametrize("kind", ["hold", "free"])
@pytest.mark.parametrize("held", [0, PLACES])
def test_hold_texts_do_not_reach_the_host(radio, kind, held):
    radio.hear(*((address, "hold", 1) for address in (A, B, C, D)[:held]), (E, kind, 1), wait_s=0.05)
    assert radio.board.frames() == []


def test_an_answer_waits_for_room_at_the_radio(radio):
    """Two answers of 22 bytes fit into 64; the third radio's comes after these."""
    for number, address in enumerate((A, B, C)):
        radio.hear_bytes(address, HoldText("hold", number).data, wait_s=0.1)
    assert radio.sent() == answer(A, "held", 0) + answer(B, "held", 1)
    radio.board.run(0.01)
    assert radio.sent() == answer(C, "held", 2)


def test_each_text_is_answered_once(radio):
    assert radio.say(A, "hold", 1) == [HoldText("held", 1)]
    radio.board.run(0.1)
    assert radio.answers(A) == []


def test_a_repeated_hold_stops_again(radio):
    radio.hear((A, "hold", 1))
    radio.board.forget()
    radio.hear((A, "hold", 1))
    assert radio.board.writes() == [STOP]


# ---- refusals


def test_a_held_robot_takes_commands_that_do_not_move_it(radio):
    radio.hear((A, "hold", 1))
    radio.board.forget()
    radio.board.send("preset_encoder", 1, 5)
    assert radio.board.writes(0xEF) and radio.board.field("read_counters", "held") == 0


def test_a_held_robot_without_its_motor_board_refuses_for_that(radio):
    radio.hear((A, "hold", 1))
    radio.board.plant.motor_board.present = False
    radio.board.run(0.2)
    assert not radio.is_refused()
    assert radio.board.counter("unavailable") == 1


# ---- times


def changed_s(radio: Radio, state: str, begun_s: float) -> float:
    """Time from `begun_s` to the report of this state, seen in steps of 0.1 ms [s]."""
    board = radio.board
    while radio.told()[-1:] != [state]:
        assert board.board.now_s < begun_s + 2 * SILENCE_S, f"never {state}"
        board.run(0.1e-3)
    return board.board.now_s - begun_s


REPORT_S = len(b"@49,4,1,0,0,19,-24064,16384,1e") * 10 / 115200


def test_a_holder_counts_as_silent_after_its_time(radio):
    radio.asked("state")
    radio.board.forget()
    begun_s = radio.board.board.now_s
    radio.hear((A, "hold", 1), wait_s=0.99 * SILENCE_S)
    assert radio.told() == ["held"]
    assert changed_s(radio, "silent", begun_s) - REPORT_S == pytest.approx(SILENCE_S + HALF_MS, abs=HALF_MS)


def test_a_holder_that_repeats_its_hold_is_silent_that_much_later(radio):
    radio.asked("state")
    radio.hear((A, "hold", 1), wait_s=0.5)
    begun_s = radio.board.board.now_s
    radio.hear((A, "hold", 1), wait_s=0.99 * SILENCE_S)
    assert changed_s(radio, "silent", begun_s) - REPORT_S == pytest.approx(SILENCE_S + HALF_MS, abs=HALF_MS)


@pytest.mark.parametrize("first_tick", [0, 30000, 60000])
def test_a_board_listens_from_its_start_on(start, first_tick):
    radio = start(first_tick=first_tick)
    radio.board.run(SILENCE_S - 0.1)
    before = radio.is_refused()
    radio.board.run(0.1)
    assert (before, radio.is_refused()) == (True, False)


def test_a_hold_from_address_0_does_not_end_the_listening(start):
    radio = start()
    radio.board.run(0.1)
    radio.hear((NOBODY, "hold", 1), (NOBODY, "free", 1))
    assert radio.state() == "listening"


def test_an_end_from_address_0_is_ignored_after_the_listening(start):
    radio = start()
    radio.board.run(SILENCE_S + 0.1)
    radio.hear((NOBODY, "free", 1))
    assert (radio.state(), radio.asked("ignored")) == ("free", 1)


# ---- what the host is told


def test_a_repeated_hold_is_no_news(radio):
    radio.asked("state")
    radio.board.forget()
    radio.hear((A, "hold", 1), wait_s=0.05)
    radio.hear((A, "hold", 1), wait_s=0.05)
    assert radio.told() == ["held"]


def test_a_silent_holder_that_speaks_again_is_news(radio):
    radio.hear((A, "hold", 1), wait_s=SILENCE_S + 0.05)
    assert radio.state() == "silent"
    radio.board.forget()
    radio.hear((A, "hold", 1), wait_s=0.05)
    assert radio.told() == ["held"]


def test_the_end_of_the_listening_is_told_once(start):
    radio = start()
    radio.board.run(0.1)
    assert radio.state() == "listening"
    radio.board.forget()
    radio.board.run(SILENCE_S)
    assert radio.told() == ["free"]


def test_news_waits_while_eight_answers_do(radio):
    radio.asked("state")
    radio.board.forget()
    radio.board.raw(b"@31e" * 8, wait_s=0.004)
    radio.hear((A, "hold", 1), wait_s=0.1)
    assert radio.told() == ["held"] and radio.board.frames()[-1].code == READ_RADIO
    assert radio.board.counter("overrun") == 0


@pytest.mark.parametrize("speaking, silent", [(A, B), (B, A)])
def test_the_silent_holder_is_named(radio, speaking, silent):
    radio.hear((A, "hold", 1), (B, "hold", 1), wait_s=0.6 * SILENCE_S)
    radio.hear((speaking, "hold", 1), wait_s=0.6 * SILENCE_S)
    assert (radio.state(), radio.asked("holders"), radio.named()) == ("silent", 2, silent)


# ---- release


def release(radio: Radio) -> int:
    radio.board.check(True)
    held = radio.board.ask("release_hold").args[0]
    radio.board.check(False)
    return held


def test_a_release_leaves_those_that_speak(radio):
    radio.hear((A, "hold", 1), (B, "hold", 1), wait_s=0.6 * SILENCE_S)
    radio.hear((B, "hold", 1), wait_s=0.6 * SILENCE_S)
    assert release(radio) == 1
    assert (radio.state(), radio.asked("holders"), radio.named()) == ("held", 1, B)


def test_a_release_is_told(radio):
    radio.hear((A, "hold", 1), wait_s=SILENCE_S + 0.05)
    radio.asked("state")
    radio.board.check(True)
    radio.board.forget()
    radio.board.send("release_hold", wait_s=0.05)
    codes = [frame.code for frame in radio.board.frames()]
    assert codes == [BY_NAME["release_hold"].code, READ_RADIO] and radio.told() == ["free"]


def test_a_release_does_not_end_the_listening(start):
    radio = start()
    radio.board.run(0.1)
    assert release(radio) == 1
    assert radio.state() == "listening"


# ---- builds without a radio
