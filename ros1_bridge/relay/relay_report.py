"""The state of a relay as diagnostics: level, message, keys and values.  No ROS."""

from typing import Dict, Tuple

from .topic_receiver import TopicReceiver
from .topic_sender import TopicSender

OK, WARN, ERROR = 0, 1, 2
"""Levels of diagnostic_msgs/DiagnosticStatus."""


def receiver_health(receiver: TopicReceiver) -> Tuple[int, str]:
    """Level and message about the connection to a peer."""
    if not receiver.is_connected:
        return ERROR, f"not connected: {receiver.reason}"
    if receiver.missing:
        return WARN, f"does not send {', '.join(receiver.missing)}"
    return OK, "connected"


def receiver_values(receiver: TopicReceiver) -> Dict[str, str]:
    """What has become of each topic of a peer; ages are those since the last call."""
    values = {"Address": str(receiver.address)}
    for topic, counts in receiver.counts.items():
        values[f"{topic} Received"] = str(counts.taken)
        values[f"{topic} Lost"] = str(counts.lost)
        values[f"{topic} Late"] = str(counts.late)
        values[f"{topic} Age [ms]"] = f"{1e3 * counts.age_s:.1f}"
        values[f"{topic} Oldest [ms]"] = f"{1e3 * counts.reset_oldest():.1f}"
    return values


def sender_values(sender: TopicSender) -> Dict[str, str]:
    """Which topics are sent, and which relays get them."""
    return {
        "Address": str(sender.address),
        "Topics": ", ".join(sorted(sender.topics)),
        "Receivers": ", ".join(sender.receivers()),
        "Too Long": str(sender.too_long),
    }
