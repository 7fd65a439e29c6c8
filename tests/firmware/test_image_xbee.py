"""The radio build's image on the simulated chip: its second serial line, and two robots with it from host to host."""

from pathlib import Path
from typing import List, Optional, Tuple

import pytest

from mrl_driver.protocol import REPLIES, Frame, FrameDecoder, encode_request
from mrl_driver.robot import models
from sim_arduino.avr.bit_serial import BitReceiver, edges
from sim_arduino.avr.machine import UNO_HZ, AvrMachine
from sim_arduino.board.avr_board import IN, OUT, AvrEngine
from sim_arduino.hardware.wiring import Plant
from sim_arduino.hardware.xbee import BAUD, RadioFit
from sim_arduino.world.world import World
from tests.firmware.test_xbee import ADDRESS, ADDRESS_WORDS, packet, received, words
from tests.long.bench import bench_hold

IMAGE = Path(__file__).resolve().parent.parent.parent / "build" / "firmware" / "mrl_firmware_xbee.elf"
MOVE = 0xEB


class MotorBoard:
    """Answers every read with zeros and keeps what is written."""

    present = True

    def __init__(self):
        self.moves: List[int] = []

    def write(self, data, time_s):
        if data[0] == MOVE:
            self.moves.append(int.from_bytes(data[1:3], "big"))
        return True

    def read(self, count, time_s):
        return bytes(count)


@pytest.fixture
def chip():
    machine = AvrMachine(IMAGE)
    machine.i2c[0x18] = MotorBoard()
    machine.watch_pins([OUT])
    machine.set_pin(IN, 1)
    machine.run(0.2)
    machine.sent()
    yield machine
    machine.close()


def say(machine: AvrMachine, data: bytes, baud: float = BAUD) -> None:
    """Puts bytes on the radio's line to the board, from now on."""
    for at_s, level in edges(data, machine.time_s, 1.0 / baud):
        machine.set_pin(IN, level, int(at_s * UNO_HZ))


def spoken(machine: AvrMachine) -> bytes:
    """Bytes that the board has put on the radio's line."""
    receiver = BitReceiver(1.0 / BAUD)
    for change in machine.pin_changes():
        if change.pin == OUT:
            receiver.changed(change.level, change.cycle / UNO_HZ)
    return receiver.take(machine.time_s)


def frames(machine: AvrMachine):
    return FrameDecoder(REPLIES).feed(bytes(byte.data for byte in machine.sent()))


def test_text_to_the_radio(chip):
    chip.send(encode_request(38, *ADDRESS_WORDS, *words(b"hello")))
    chip.run(0.06)
    assert spoken(chip)[-6:-1] == b"hello"


@pytest.mark.parametrize("baud", [9600 * 0.98, 9600, 9600 * 1.02])
def test_text_from_the_radio(chip, baud):
    """The XBee's clock may be 2 % off."""
    say(chip, received(bytes(range(64))), baud)
    chip.run(0.2)
    assert b"".join(b"%d" % len(frame.args) for frame in frames(chip)) == b"13" * 4


def test_a_spike_is_no_byte(chip):
    """10 us low, then a text."""
    chip.set_pin(IN, 0, chip.cycle + 1000)
    chip.set_pin(IN, 1, chip.cycle + 1160)
    chip.run(0.01)
    say(chip, received(b"hello"))
    chip.run(0.05)
    assert frames(chip) == [Frame(39, (*ADDRESS_WORDS, *words(b"hello")))]


TEXTS, COMMANDS_BETWEEN = 20, 44  # 44 commands take 50 ms, a text of 4 bytes 23 ms on the radio's line


def test_radio_costs_no_byte_on_usb(chip):
    """Both lines full both ways for a second: commands as fast as the wire, a full-rate stream, texts without pause.

    Each command arrives as it was sent and in order, each frame of the stream is whole, and the radio's texts are too.
    """
    speeds = [100 + n % 500 for n in range(TEXTS * COMMANDS_BETWEEN)]
    moves = [b"@11,%d,-100e" % speed for speed in speeds]
    text = encode_request(38, *ADDRESS_WORDS, *words(b"ping"))
    chip.send(b"@18e")
    chip.run(0.05)
    chip.sent()
    for first in range(0, len(moves), COMMANDS_BETWEEN):
        chip.send(b"".join(moves[first : first + COMMANDS_BETWEEN]) + text)
    say(chip, received(b"0123456789") * 40)
    chip.run(1.2)
    events = frames(chip)
    heard = [event for event in events if isinstance(event, Frame) and event.code == 39]
    assert chip.bytes_lost == 0
    assert chip.i2c[0x18].moves == speeds
    assert all(isinstance(event, Frame) for event in events[1:-1])
    assert heard == [Frame(39, (*ADDRESS_WORDS, *words(b"0123456789")))] * 40
    assert spoken(chip) == packet(b"\x10\x01" + ADDRESS + b"\xff\xfe\0\0ping") * TEXTS


STEP_S = 2e-3
BYTES_S = 10 / 9600
SENT_BYTES, RECEIVED_BYTES = 18 + 5, 16 + 5
"""Packets with a text of five characters, to a module and from one."""
REST_S = 17e-3
"""Two frames on USB 8 ms, the packet in the air 4 ms with the longest wait before it, slices and steps 4 ms [s]."""


class Pair:
    """Two boards; times in simulated seconds."""

    def __init__(self) -> None:
        world, model = World(), models.load("traxbot")
        self.plants = [Plant(model, world, (n, 0, 0), name=f"robot{n}", radio=RadioFit()) for n in (0, 1)]
        self.boards = [AvrEngine(plant, IMAGE) for plant in self.plants]
        self._decoders = [FrameDecoder(REPLIES) for _ in self.boards]
        self.now_s = 0.0
        self.run(0.1)

    def words(self, number: int) -> Tuple[int, ...]:
        return words(self.plants[number].xbee.station.address.to_bytes(8, "big"))[1:]

    def send(self, number: int, to: Tuple[int, ...], text: bytes) -> None:
        self.boards[number].receive(encode_request(38, *to, *words(text)))

    def run(self, seconds: float, step_s: float = STEP_S) -> List[Tuple[float, int, Frame]]:
        """Frames to the hosts: time [s], number of the board, frame."""
        found, end_s = [], self.now_s + seconds
        while self.now_s < end_s:
            self.now_s += step_s
            for number, board in enumerate(self.boards):
                frames = self._decoders[number].feed(board.advance(self.now_s))
                found += [(self.now_s, number, frame) for frame in frames]
        return found

    def next_frame(self, within_s: float = 0.2, step_s: float = STEP_S) -> Optional[Tuple[float, int, Frame]]:
        end_s = self.now_s + within_s
        while self.now_s < end_s:
            found = self.run(step_s, step_s)
            if found:
                return found[0]
        return None


@pytest.fixture(scope="module")
def pair():
    made = Pair()
    yield made
    for board in made.boards:
        board.close()


def test_text_goes_from_host_to_host(pair):
    pair.send(0, pair.words(1), b"hello")
    _, number, frame = pair.next_frame()
    assert (number, frame) == (1, Frame(39, (*pair.words(0), *words(b"hello"))))


def test_text_takes_the_time_of_two_lines_and_the_air(pair):
    pair.run(0.1)
    start_s = pair.now_s
    pair.send(1, pair.words(0), b"hello")
    lines_s = (SENT_BYTES + RECEIVED_BYTES) * BYTES_S
    took_s = pair.next_frame()[0] - start_s
    assert lines_s < took_s < lines_s + REST_S


LATEST_S = 0.06
"""`make bench-hold` has the figures; the text alone takes 23 ms on each of the two lines of the modules."""


def test_hold_stops_the_other_robot_in_time():
    times = bench_hold.measure(bench_hold.SILENCE, 2)
    assert len(times) == 2 and all(time_s is not None and time_s < LATEST_S for time_s in times)
