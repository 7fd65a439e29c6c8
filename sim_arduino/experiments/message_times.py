"""Times of messages between a PC and the motor board, on firmware images that run on the simulated chip.

Ours is compared with two sketches of `firmware/comparison`.  A message is a request for both counters, which the board
reads from the motor board, and what it sends back.
"""

import os
import random
from typing import List, NamedTuple, Optional, Sequence, Tuple

from mrl_driver.errors import BoardTimeout
from mrl_driver.protocol import REPLIES, Frame, FrameDecoder, encode_request
from mrl_driver.protocol.table import BAUD, BY_NAME
from sim_arduino.avr.machine import AvrMachine
from sim_arduino.board.avr_board import AvrEngine
from sim_arduino.serve import factory

from .experiment_robot import Setting

FOLDER = os.path.join(
    os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))), "build", "comparison"
)
"""Images of the sketches in a checkout, after `make comparison`."""
RATE_HZ = 50  # messages in a second
BOOT_S, PAUSE_S, PATIENCE_S = 2.5, 0.1, 1.0
"""Time for the start of the board, pause after a request without a reply, and longest wait for a reply [s]."""
STEP_S, LINE_END_S = 2e-4, 2e-3
"""Time between two looks at what has arrived, and time in which the end of a line follows its frame [s]."""
REQUEST, CHECK = BY_NAME["read_encoders"].code, BY_NAME["set_check"].code
READ_TOPIC, RIGHT_TOPIC, LEFT_TOPIC = 100, 101, 102
"""Topics of the sketch that speaks the protocol of rosserial: the request, and the counters."""
LEFT_WHEEL, RIGHT_WHEEL = 1, 3


class Counts(NamedTuple):
    """Counters in the reply."""

    right: int
    left: int


LONG, SHORT = Counts(1234, -567), Counts(0, 0)
"""Counters of 3 and 4 digits, as in `make bench-firmware`, and the shortest."""


class Subject(NamedTuple):
    """A firmware in one of its modes."""

    key: str
    text: str
    sketch: bool = True  # it is a sketch, whose image in `FOLDER` has the name `key`; else our own firmware
    baud: int = BAUD
    rosserial: bool = False  # it speaks the protocol of rosserial instead of frames
    checked: bool = False  # frames carry a checksum, and replies a sequence number and board time too

    @property
    def path(self) -> Optional[str]:
        """The ELF file of a sketch; None for our own firmware, which the emulator finds by itself."""
        return os.path.join(FOLDER, f"{self.key}.elf") if self.sketch else None


_ROSSERIAL_TEXT = "our sketch with rosserial's protocol at {} baud"
PLAIN = Subject("plain", "frames", sketch=False)
TIMING_2013 = Subject("timing_2013", "frames, our sketch with 2013's timing")
CHECKED = Subject(
    "checked", "frames with checksum, sequence number and board time", sketch=False, checked=True
)
ROSSERIAL = Subject("rosserial_115200", _ROSSERIAL_TEXT.format(115200), rosserial=True)
ROSSERIAL_DEFAULT = ROSSERIAL._replace(
    key="rosserial_57600", text=f"{_ROSSERIAL_TEXT.format(57600)}, its default", baud=57600
)
SUBJECTS = (PLAIN, TIMING_2013, CHECKED, ROSSERIAL, ROSSERIAL_DEFAULT)


class Message(NamedTuple):
    """Times of one message [s]."""

    total_s: float  # from the first bit of the request to the end of the last byte that the host needs
    reply_s: float  # from the end of the request to the end of the reply, the end of its line included
    link_s: float  # part of `total_s` in which bytes are on the serial link


def packet(topic: int, data: bytes = b"") -> bytes:
    """A packet of rosserial, as of ROS Hydro (`wiki.ros.org/rosserial/Overview/Protocol`)."""
    length, head = len(data).to_bytes(2, "little"), topic.to_bytes(2, "little")
    return b"\xff\xfe" + length + _checksum(length) + head + data + _checksum(head + data)


def _checksum(data: bytes) -> bytes:
    return bytes([255 - sum(data) % 256])


def _is_complete(subject: Subject, counts: Counts, got: bytes) -> bool:
    """Whether the message with the right counters has come."""
    if subject.rosserial:
        topics = zip((RIGHT_TOPIC, LEFT_TOPIC), counts)
        return (
            b"".join(packet(topic, count.to_bytes(2, "little", signed=True)) for topic, count in topics)
            in got
        )
    return any(
        isinstance(event, Frame) and (event.code, tuple(event.args[:2])) == (REQUEST, tuple(counts))
        for event in FrameDecoder(REPLIES, checked=subject.checked).feed(got)
    )


def measure(
    setting: Setting, subject: Subject, messages: int = RATE_HZ, counts: Counts = LONG
) -> List[Message]:
    """The times of messages that come `RATE_HZ` times in a second, at phases that the seed of the setting draws.

    Raises:
        BoardTimeout: a message did not come back.
    """
    options = factory.Options(robot=setting.robot, engine="avr", seed=setting.seed, elf=subject.path)
    # a sketch has no parameters in its EEPROM; id 0 leaves it blank.
    made = factory.make(options._replace(robot_id=0) if subject.sketch else options)
    rng = random.Random(f"phase {setting.seed}")
    try:
        engine = made.board.engine
        assert isinstance(engine, AvrEngine)
        chip = engine.machine
        chip.set_host_baud(subject.baud)
        chip.run(BOOT_S)
        for wheel, count in ((RIGHT_WHEEL, counts.right), (LEFT_WHEEL, counts.left)):
            made.plant.motor_board.preset_encoder(chip.time_s, wheel, count)
        if subject.checked:
            chip.send(encode_request(CHECK, 1))
            chip.run(PAUSE_S)
        start = chip.cycle
        slots = [(number + rng.random() / 2) / RATE_HZ for number in range(messages)]
        return [_exchange(chip, subject, counts, start + round(at * chip.frequency_hz)) for at in slots]
    finally:
        made.close()


def _exchange(chip: AvrMachine, subject: Subject, counts: Counts, begin: int) -> Message:
    """One message whose request begins at a cycle."""
    chip.run_until(begin)
    chip.sent()
    begin = chip.cycle
    request = packet(READ_TOPIC) if subject.rosserial else encode_request(REQUEST, checked=subject.checked)
    asked, got, times = chip.send(request), b"", []
    while chip.cycle < begin + PATIENCE_S * chip.frequency_hz:
        chip.run(STEP_S)
        for byte in chip.sent():
            got += bytes([byte.data])
            times.append((byte.start_cycle, byte.end_cycle))
            if _is_complete(subject, counts, got):
                return _timed(chip, begin, asked, times)
    raise BoardTimeout(
        f"the image of {subject.text} does not answer within {PATIENCE_S:g} s; build it again: make firmware comparison"
    )


def _timed(chip: AvrMachine, begin: int, asked: int, got: Sequence[Tuple[int, int]]) -> Message:
    """The times of a message whose bytes that the host needs have arrived, `got` (begin and end of each)."""
    end = got[-1][1]
    chip.run(LINE_END_S)
    last = max((byte.end_cycle for byte in chip.sent()), default=end)
    link = asked - begin + sum(stop - start for start, stop in got)
    return Message(*(cycles / chip.frequency_hz for cycles in (end - begin, max(end, last) - asked, link)))
