"""Measures the time of messages between the PC and the motor board, of ours and of sketches in the same mode."""

import os
from itertools import accumulate
from statistics import median
from typing import Any, Dict, List, NamedTuple, Optional, Sequence

from . import message_times, plot_style
from .experiment_report import Figure, Measure, Result, over_seeds
from .experiment_robot import Setting
from .message_times import (
    CHECKED,
    PLAIN,
    RATE_HZ,
    ROSSERIAL,
    ROSSERIAL_DEFAULT,
    SUBJECTS,
    TIMING_2013,
    Message,
    Subject,
)

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
TO_TOPICS = (
    "Through ROS: medians of 200 messages in real time, in the default mode, with checksum. The time of a frame begins "
    "when it has left the board, that of a command ends with its last byte on the serial link."
)
Runs = Dict[Subject, List[List[Message]]]  # the messages of each seed


class Topics(NamedTuple):
    """Times of one message between the board and ROS [ms]: frame to Odometry in a subscriber, and cmd_vel to the end of
    the command on the serial link.
    """

    odometry_ms: float
    command_ms: float


def run(setting: Setting, topics: Optional[Topics] = None) -> Result:
    """Sends messages at random phases, and draws their total time; with the times of ROS, if given."""
    built = [subject for subject in SUBJECTS if subject.path is None or os.path.isfile(subject.path)]
    runs = {subject: _runs(setting, subject) for subject in built}
    rows = [_row(subject, runs) for subject in runs] + _link_rows(setting, runs[PLAIN])
    if topics:
        rows += _ros_rows(topics, _total(CHECKED.key).figure(runs[CHECKED]))
    missing = "; ".join(subject.text for subject in SUBJECTS if subject not in runs)
    remarks = [REMARK, f"{NOT_BUILT}{missing}." if missing else "", TO_TOPICS if topics else ""]
    picture, title = _draw(setting, runs, topics), "Time of messages between PC and motor board"
    return Result("turnaround", title, rows, [picture], " ".join(filter(None, remarks)))


def _runs(setting: Setting, subject: Subject, **others: Any) -> List[List[Message]]:
    return over_seeds(lambda seeded: message_times.measure(seeded, subject, **others), setting)


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
    runs = _runs(setting, PLAIN, counts=message_times.SHORT)
    return [Figure(f"link_{COUNT}_ms", text, link_ms, "ms"), short.figure(runs)]


def _ros_rows(topics: Topics, checked: Figure) -> List[Figure]:
    """Figures of the messages through ROS, in the default mode."""
    odometry_ms, commands_ms = COUNT * topics.odometry_ms, COUNT * topics.command_ms
    whole_ms = float(checked.ours) + odometry_ms
    rows = (
        ("ros_odometry", "frames from the board to Odometry in a subscriber", odometry_ms),
        ("ros_commands", "commands from cmd_vel to the end of the serial link", commands_ms),
        ("ros", "messages to the motor board, back and on to a topic", whole_ms),
    )
    return [Figure(f"{key}_{COUNT}_ms", f"{COUNT} {text}, with checksum", ms, "ms") for key, text, ms in rows]


def _draw(setting: Setting, runs: Runs, topics: Optional[Topics]) -> str:
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
    if topics:
        for label, each_ms, colour in (
            ("ROS: cmd_vel to the serial link", topics.command_ms, plot_style.PINK),
            ("ROS: frame to odom", topics.odometry_ms, plot_style.SKY),
        ):
            plot_style.path(axes, [(0, 0), (RATE_HZ, RATE_HZ * each_ms)], colour, label, "--")
    for name, mark, each_ms in (("rosserial", "s", PUBLISHED_MS), ("frames", "^", PUBLISHED_MS * (1 - LESS))):
        axes.plot(COUNT, each_ms, mark, color=plot_style.GREEN, label=f"published: {name}")
    axes.set(xlabel="messages", ylabel="total time [ms]", xlim=(0, None), ylim=(0, None))
    axes.legend(loc="upper left", fontsize="small")
    return plot_style.save(made, setting.folder, "turnaround")


def _points(runs: Sequence[Sequence[Message]]) -> List[Any]:
    """Total time over the number of messages, the median of all seeds [ms]."""
    totals = zip(*(accumulate(1000 * message.total_s for message in messages) for messages in runs))
    return [(0, 0.0), *((number + 1, median(total)) for number, total in enumerate(totals))]
