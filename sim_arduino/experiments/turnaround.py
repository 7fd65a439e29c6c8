"""Measures the time of messages between a PC and the motor board, on firmware images that run on the simulated chip.

Ours is compared with two sketches of `firmware/comparison`, each in the same mode.  A message is a request for both
counters, which the board reads from the motor board, and what it sends back.
"""

import os
import random
from itertools import accumulate
from statistics import median
from typing import Any, Dict, List, NamedTuple, Optional, Sequence, Tuple

from mrl_driver.errors import BoardTimeout
from mrl_driver.protocol import REPLIES, Frame, FrameDecoder, encode_request
from mrl_driver.protocol.table import BAUD, BY_NAME
from sim_arduino.avr.machine import AvrMachine
from sim_arduino.board.avr_board import FIRMWARE, AvrEngine
from sim_arduino.serve import factory

from . import plot_style
from .experiment_report import Figure, Measure, Result, over_seeds
from .experiment_robot import Setting

FOLDER = FIRMWARE.parents[1] / "comparison"
"""Images of the sketches in a checkout, after `make comparison`."""
RATE_HZ = 50  # messages in a second
BOOT_S, PAUSE_S, PATIENCE_S = 2.5, 0.1, 1.0
"""Time for the start of the board, pause after a request without a reply, and longest wait for a reply [s]."""
STEP_S, LINE_END_S = 2e-4, 2e-3
"""Time between two looks at what has arrived, and time in which the end of a line follows its frame [s]."""
REQUEST, CHECK = BY_NAME["read_encoders"].code, BY_NAME["set_check"].code
READ_TOPIC, COUNT_TOPICS = 100, (101, 102)
"""Topics of the sketch that speaks the protocol of rosserial: the request, and both counters."""
ENCODERS = 3, 1  # number of the right and of the left encoder
Counts = Tuple[int, int]
"""Right and left counter."""
LONG, SHORT = (1234, -567), (0, 0)
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
        words = (count.to_bytes(2, "little", signed=True) for count in counts)
        return b"".join(map(packet, COUNT_TOPICS, words)) in got
    return any(
        isinstance(event, Frame) and (event.code, tuple(event.args[:2])) == (REQUEST, counts)
        for event in FrameDecoder(REPLIES, checked=subject.checked).feed(got)
    )


def measure(
    setting: Setting, subject: Subject, messages: int = RATE_HZ, counts: Counts = LONG
) -> List[Message]:
    """The times of messages that come `RATE_HZ` times in a second, at phases that the seed of the setting draws.

    BoardTimeout if a message does not come back.
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
        for encoder, count in zip(ENCODERS, counts):
            made.plant.motor_board.preset_encoder(chip.time_s, encoder, count)
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


# -- the experiment

COUNT = 20  # number of messages in the figures
PUBLISHED_MS, LESS = 36.0, 0.35
"""Time of 20 messages with rosserial, and share by which the frame driver of 2012 was quicker (Araujo 2012)."""
RIVALS = {PLAIN: TIMING_2013, CHECKED: ROSSERIAL}
"""The control of each of our modes: the sketch that sends the same with the same safety against damage."""
PUBLISHED = {
    PLAIN: f"{PUBLISHED_MS * (1 - LESS):.0f} ms (frames)",
    ROSSERIAL: f"{PUBLISHED_MS:g} ms",
    ROSSERIAL_DEFAULT: f"{PUBLISHED_MS:g} ms",
}
REMARK = (
    "A message is a request for both counters, which the board reads from the motor board, and the reply, from the "
    "first bit of the request to the last byte that the PC needs; the control of frames is 2013's timing, that of "
    "frames with checksum is rosserial at 115200 baud. The sketches are ours (firmware/comparison). How the published "
    "times were measured is not known."
)
NOT_BUILT = (
    "Sketches to compare with are not built (make comparison in a checkout), so that their rows are missing: "
)
Runs = Dict[Subject, List[List[Message]]]  # the messages of each seed


def run(setting: Setting) -> Result:
    """Sends messages at random phases, and draws their total time."""
    built = [subject for subject in SUBJECTS if subject.path is None or os.path.isfile(subject.path)]
    runs = {subject: _runs(setting, subject) for subject in built}
    rows = [_row(subject, runs) for subject in runs] + _link_rows(setting, runs[PLAIN])
    missing = "; ".join(subject.text for subject in SUBJECTS if subject not in runs)
    remark = f"{REMARK} {NOT_BUILT}{missing}." if missing else REMARK
    title = "Time of messages between PC and motor board"
    return Result("turnaround", title, rows, [_draw(setting, runs)], remark)


def _runs(setting: Setting, subject: Subject, **others: Any) -> List[List[Message]]:
    return over_seeds(lambda seeded: measure(seeded, subject, **others), setting)


def _total(key: str, text: str = "", published: str = "") -> Measure:
    """The total time of `COUNT` messages [ms]."""

    def total_ms(messages: Sequence[Message]) -> float:
        return 1000 * sum(message.total_s for message in messages[:COUNT])

    return Measure(f"{key}_{COUNT}_ms", f"{COUNT} messages {text}", "ms", total_ms, published=published)


def _row(subject: Subject, runs: Runs) -> Figure:
    control = runs.get(RIVALS[subject], []) if subject in RIVALS else []
    text = f"to the motor board and back, {subject.text}"
    return _total(subject.key, text, PUBLISHED.get(subject, "")).figure(runs[subject], control)


def _link_rows(setting: Setting, plain: Sequence[Sequence[Message]]) -> List[Figure]:
    """What the serial link alone needs for the plain messages, and messages with shorter numbers."""
    link_ms = 1000 * sum(message.link_s for message in plain[0][:COUNT])
    text = f"of {COUNT} messages by frames, the bytes on the serial link"
    short = _total("short", "by frames, both counters at 0", PUBLISHED[PLAIN])
    runs = _runs(setting, PLAIN, counts=SHORT)
    return [Figure(f"link_{COUNT}_ms", text, link_ms, "ms"), short.figure(runs)]


def _draw(setting: Setting, runs: Runs) -> str:
    made, (axes,) = plot_style.figure(1, 7.5, 5.2)
    looks = (
        (PLAIN, plot_style.BLUE, "-"),
        (TIMING_2013, plot_style.BLUE, ":"),
        (CHECKED, plot_style.ORANGE, "-"),
        (ROSSERIAL, plot_style.ORANGE, ":"),
        (ROSSERIAL_DEFAULT, plot_style.GREY, "-."),
    )
    for subject, colour, line in looks:
        if subject in runs:
            plot_style.path(axes, _points(runs[subject]), colour, subject.text, line)
    for name, mark, each_ms in (("rosserial", "s", PUBLISHED_MS), ("frames", "^", PUBLISHED_MS * (1 - LESS))):
        axes.plot(COUNT, each_ms, mark, color=plot_style.GREEN, label=f"published: {name}")
    axes.set(xlabel="messages", ylabel="total time [ms]", xlim=(0, None), ylim=(0, None))
    axes.legend(loc="upper left", fontsize="small")
    return plot_style.save(made, setting.folder, "turnaround")


def _points(runs: Sequence[Sequence[Message]]) -> List[Any]:
    """Total time over the number of messages, the median of all seeds [ms]."""
    totals = zip(*(accumulate(1000 * message.total_s for message in messages) for messages in runs))
    return [(0, 0.0), *((number + 1, median(total)) for number, total in enumerate(totals))]
