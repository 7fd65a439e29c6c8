"""Measures the time of messages from the PC to the motor board and back, with the real firmware image."""

from typing import Any, List, NamedTuple, Optional, Sequence, Tuple

from mrl_driver.errors import BoardTimeout
from mrl_driver.protocol import REPLIES, Frame, FrameDecoder, encode_request
from mrl_driver.protocol.table import BY_NAME
from sim_arduino.board.engine import Engine
from sim_arduino.serve import factory

from . import plot_style
from .experiment_report import Figure, Result
from .experiment_robot import Setting, require_emulated

COUNTS = (1, 2, 5, 10, 20, 30, 40, 50)
"""Numbers of messages per second."""
STEP_S = 1e-4
"""Replies are checked after each such interval of simulated time [s]."""
PUBLISHED_MS, PUBLISHED_COUNT, LESS = 36.0, 20, 0.35
"""Time of 20 messages with rosserial, and share by which the 2012 frame driver was quicker (thesis)."""
MEASURED_MS = {"2013 firmware": 2.445, "rosserial": 2.896}
"""Time of one request for the encoders on the same simulated chip, for the 2013 firmware and for an equal rosserial
sketch; medians of 300.
"""
TO_TOPICS = (
    "The times to and from topics are medians of 200 messages in real time: that of a frame begins when it has left "
    "the board, that of a command ends with its last byte on the serial link."
)
BOOT_S, PAUSE_S, PATIENCE_S = 2.5, 0.1, 1.0
"""Time for the start of the board, pause after a request without a reply, and longest wait for a reply [s]."""
REQUEST = "read_encoders"
COUNTERS = ((1, -567), (3, 1234))
"""Counter values in the reply, which has 15 bytes without a checksum."""
Point = Tuple[int, float]
"""Number of messages in a second, and their total time [ms]."""


class Topics(NamedTuple):
    """Times of one message between the board and ROS [ms]: frame to Odometry in a subscriber, and cmd_vel to the motor
    board.
    """

    odometry_ms: float
    command_ms: float


class Host:
    """A PC that sends requests to `engine`, and looks for replies after every `STEP_S`."""

    def __init__(self, engine: Engine) -> None:
        self._engine, self._now_s = engine, 0.0
        self._checked = False

    def request(self, name: str, *args: int) -> int:
        """Sends a request; returns its code."""
        code = BY_NAME[name].code
        self._engine.receive(encode_request(code, *args, checked=self._checked))
        return code

    def check(self) -> None:
        """Has all frames from here on carry a checksum."""
        self.request("set_check", 1)
        self.wait(PAUSE_S)
        self._checked = True

    def wait(self, seconds: float) -> None:
        """Lets time pass; what the board sends is lost."""
        self._now_s += seconds
        self._engine.advance(self._now_s)

    def time_s(self, name: str) -> float:
        """Time from a request to the end of its reply [s]."""
        begin_s, decoder = self._now_s, FrameDecoder(REPLIES, checked=self._checked)
        code = self.request(name)
        while self._now_s < begin_s + PATIENCE_S:
            self._now_s += STEP_S
            for event in decoder.feed(self._engine.advance(self._now_s)):
                if isinstance(event, Frame) and event.code == code:
                    return self._now_s - begin_s
        raise BoardTimeout(f"the image does not answer {name} within {PATIENCE_S:g} s; build it again")


def run(setting: Setting, topics: Optional[Topics] = None) -> Result:
    """Sends messages, evenly spread over a second, and draws their total time; with the times of ROS, if given."""
    require_emulated(setting, "turnaround")
    checked = [(count, _total_ms(setting, count, True)) for count in COUNTS]
    plain = [(count, _total_ms(setting, count, False)) for count in COUNTS]
    published = f"{PUBLISHED_MS:g} ms (rosserial), 35 % less (frames)"
    rows = [
        Figure("plain_20_ms", "20 messages", dict(plain)[20], "ms", published),
        Figure(
            "checked_20_ms", "20 messages with checksum, sequence and board time", dict(checked)[20], "ms"
        ),
        Figure(
            "rosserial_20_ms",
            "20 messages of rosserial on the same chip",
            20 * MEASURED_MS["rosserial"],
            "ms",
        ),
        Figure(
            "firmware_2013_20_ms", "20 messages of the 2013 firmware", 20 * MEASURED_MS["2013 firmware"], "ms"
        ),
    ]
    if topics:
        rows += _rows(topics, dict(plain)[20], published)
    remark = (
        "A message is a request for the encoders, which the board reads from the motor board, and the reply. The "
        "serial link alone takes 1.6 ms of it without a checksum. How the published time was measured is not known."
    ) + (f" {TO_TOPICS}" if topics else "")
    title = "Time of messages between PC and motor board"
    return Result("turnaround", title, rows, [_draw(setting, plain, checked, topics)], remark)


def _rows(topics: Topics, plain_ms: float, published: str) -> List[Figure]:
    """Figures of 20 messages through ROS."""
    odometry, commands = 20 * topics.odometry_ms, 20 * topics.command_ms
    return [
        Figure("ros_odometry_20_ms", "20 frames from the board to Odometry in a subscriber", odometry, "ms"),
        Figure("ros_commands_20_ms", "20 commands from cmd_vel to the motor board", commands, "ms"),
        Figure(
            "ros_20_ms", "20 messages, including their time to a topic", plain_ms + odometry, "ms", published
        ),
    ]


def _total_ms(setting: Setting, count: int, check: bool) -> float:
    """Total time of `count` messages [ms]."""
    made, total_s = factory.make(factory.Options(robot=setting.robot, engine="avr", seed=setting.seed)), 0.0
    try:
        host = Host(made.engine)
        host.wait(BOOT_S)
        if check:
            host.check()
        for wheel, counts in COUNTERS:
            host.request("preset_encoder", wheel, counts)
            host.wait(PAUSE_S)
        for _ in range(count):
            total_s += host.time_s(REQUEST)
            host.wait(max(0.0, 1.0 / count - total_s / count))
    finally:
        made.close()
    return 1000 * total_s


def _draw(
    setting: Setting, plain: Sequence[Point], checked: Sequence[Point], topics: Optional[Topics]
) -> str:
    made, (axes,) = plot_style.figure()
    lines: List[Tuple[str, Any, str, str]] = [
        ("rosserial, measured", [(n, n * MEASURED_MS["rosserial"]) for n in COUNTS], plot_style.GREY, ":"),
        (
            "2013 firmware, measured",
            [(n, n * MEASURED_MS["2013 firmware"]) for n in COUNTS],
            plot_style.GREY,
            "-.",
        ),
        ("with checksum", checked, plot_style.ORANGE, "--"),
        ("plain", plain, plot_style.BLUE, "-"),
    ]
    if topics:
        lines += [
            (
                "ROS: cmd_vel to motor board",
                [(n, n * topics.command_ms) for n in COUNTS],
                plot_style.PINK,
                "--",
            ),
            ("ROS: frame to odom", [(n, n * topics.odometry_ms) for n in COUNTS], plot_style.SKY, "-"),
        ]
    for label, points, colour, line in lines:
        plot_style.path(axes, points, colour, label, line)
    axes.plot(PUBLISHED_COUNT, PUBLISHED_MS, "s", color=plot_style.GREEN, label="published: rosserial")
    axes.plot(
        PUBLISHED_COUNT, PUBLISHED_MS * (1 - LESS), "^", color=plot_style.GREEN, label="published: frames"
    )
    axes.set(xlabel="messages in a second", ylabel="total time [ms]", xlim=(0, None), ylim=(0, None))
    axes.legend(loc="upper left")
    return plot_style.save(made, setting.folder, "turnaround")
