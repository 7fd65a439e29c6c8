"""Measures the time of messages between the PC and the motor board, of ours and of sketches in the same mode."""

from itertools import accumulate
from statistics import median
from typing import Any, Dict, List, NamedTuple, Optional, Sequence

from . import message_times, plot_style, trials
from .experiment_report import Figure, Result
from .experiment_robot import Setting, require_emulated
from .message_times import (
    CHECKED,
    LONG,
    PLAIN,
    RATE_HZ,
    ROSSERIAL,
    ROSSERIAL_DEFAULT,
    SHORT,
    SUBJECTS,
    TIMING_2013,
    Counts,
    Message,
    Subject,
)

COUNT = 20
"""Number of messages in the figures."""
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
Runs = Dict[Subject, List[List[Message]]]
"""The messages of each seed."""


class Topics(NamedTuple):
    """Times of one message between the board and ROS [ms]: frame to Odometry in a subscriber, and cmd_vel to the end of
    the command on the serial link.
    """

    odometry_ms: float
    command_ms: float


def run(setting: Setting, topics: Optional[Topics] = None) -> Result:
    """Sends messages at random phases, and draws their total time; with the times of ROS, if given."""
    require_emulated(setting, "turnaround")
    runs = {subject: _runs(setting, subject) for subject in SUBJECTS if subject.built}
    rows = [_row(subject, runs) for subject in runs] + _link_rows(setting, runs[PLAIN])
    if topics:
        rows += _ros_rows(topics, _totals_ms(runs[CHECKED]))
    missing = [subject.text for subject in SUBJECTS if subject not in runs]
    remarks = [REMARK, NOT_BUILT + "; ".join(missing) + "." if missing else "", TO_TOPICS if topics else ""]
    return Result(
        "turnaround",
        "Time of messages between PC and motor board",
        rows,
        [_draw(setting, runs, topics)],
        " ".join(filter(None, remarks)),
    )


def _runs(setting: Setting, subject: Subject, counts: Counts = LONG) -> List[List[Message]]:
    return trials.over_seeds(
        lambda seeded: message_times.measure(seeded, subject, RATE_HZ, counts), setting, trials.SEEDS
    )


def _totals_ms(runs: Sequence[Sequence[Message]]) -> List[float]:
    """The total time of `COUNT` messages, of each seed [ms]."""
    return [1000 * sum(message.total_s for message in messages[:COUNT]) for messages in runs]


def _row(subject: Subject, runs: Runs) -> Figure:
    control = runs.get(RIVALS[subject], []) if subject in RIVALS else []
    return trials.figure(
        f"{subject.key}_{COUNT}_ms",
        f"{COUNT} messages to the motor board and back, {subject.text}",
        _totals_ms(runs[subject]),
        "ms",
        _totals_ms(control),
        published=PUBLISHED.get(subject, ""),
    )


def _link_rows(setting: Setting, plain: Sequence[Sequence[Message]]) -> List[Figure]:
    """What the serial link alone needs for the plain messages, and messages with shorter numbers."""
    link_ms = 1000 * sum(message.link_s for message in plain[0][:COUNT])
    return [
        Figure(
            f"link_{COUNT}_ms", f"of {COUNT} messages by frames, the bytes on the serial link", link_ms, "ms"
        ),
        trials.figure(
            f"short_{COUNT}_ms",
            f"{COUNT} messages by frames, both counters at 0",
            _totals_ms(_runs(setting, PLAIN, SHORT)),
            "ms",
            published=PUBLISHED[PLAIN],
        ),
    ]


def _ros_rows(topics: Topics, checked_ms: Sequence[float]) -> List[Figure]:
    """Figures of the messages through ROS, in the default mode."""
    odometry_ms, commands_ms = COUNT * topics.odometry_ms, COUNT * topics.command_ms
    return [
        Figure(
            f"ros_odometry_{COUNT}_ms",
            f"{COUNT} frames from the board to Odometry in a subscriber, with checksum",
            odometry_ms,
            "ms",
        ),
        Figure(
            f"ros_commands_{COUNT}_ms",
            f"{COUNT} commands from cmd_vel to the end of the serial link, with checksum",
            commands_ms,
            "ms",
        ),
        Figure(
            f"ros_{COUNT}_ms",
            f"{COUNT} messages to the motor board, back and on to a topic, with checksum",
            median(checked_ms) + odometry_ms,
            "ms",
        ),
    ]


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
    _draw_published(axes)
    axes.set(xlabel="messages", ylabel="total time [ms]", xlim=(0, None), ylim=(0, None))
    axes.legend(loc="upper left", fontsize="small")
    return plot_style.save(made, setting.folder, "turnaround")


def _points(runs: Sequence[Sequence[Message]]) -> List[Any]:
    """Total time over the number of messages, the median of all seeds [ms]."""
    totals = zip(*(accumulate(1000 * message.total_s for message in messages) for messages in runs))
    return [(0, 0.0), *((number + 1, median(total)) for number, total in enumerate(totals))]


def _draw_published(axes: Any) -> None:
    for name, mark, milliseconds in (
        ("rosserial", "s", PUBLISHED_MS),
        ("frames", "^", PUBLISHED_MS * (1 - LESS)),
    ):
        axes.plot(COUNT, milliseconds, mark, color=plot_style.GREEN, label=f"published: {name}")
