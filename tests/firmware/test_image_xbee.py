"""The radio build's image on the simulated chip: its second serial line, and two robots with it from host to host."""

from pathlib import Path

import pytest

from mrl_driver.protocol import REPLIES, Frame, FrameDecoder, encode_request
from sim_arduino.avr.bit_serial import BitReceiver, edges
from sim_arduino.avr.machine import UNO_HZ, AvrMachine
from sim_arduino.board.avr_board import IN, OUT
from sim_arduino.hardware.xbee import BAUD
from tests.firmware.test_xbee import ADDRESS, ADDRESS_WORDS, packet, received, words
from tests.long.bench.firmware_board import MotorBoard

IMAGE = Path(__file__).resolve().parent.parent.parent / "build" / "firmware" / "mrl_firmware_xbee.elf"
MOVE = 0xEB


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
    assert [
        int.from_bytes(data[1:3], "big") for _, data in chip.i2c[0x18].commands if data[0] == MOVE
    ] == speeds
    assert all(isinstance(event, Frame) for event in events[1:-1])
    assert heard == [Frame(39, (*ADDRESS_WORDS, *words(b"0123456789")))] * 40
    assert spoken(chip) == packet(b"\x10\x01" + ADDRESS + b"\xff\xfe\0\0ping") * TEXTS
