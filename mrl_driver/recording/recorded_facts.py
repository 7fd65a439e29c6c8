"""What a recording says about its robot and session, as JSON text; see the remarks in `recording`.

Reading checks everything: the text may be damaged, or written by anybody.
"""

import json
import math
from typing import Any, Dict, List, NamedTuple, Optional, Tuple

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import FARTHEST_M, Pose
from mrl_driver.json_text import exact_json
from mrl_driver.protocol import REPLIES, Frame, FrameDecoder, encode_reply
from mrl_driver.protocol.table import INT16_MAX
from mrl_driver.robot import models, wiring
from mrl_driver.robot.chips import CHIPS
from mrl_driver.robot.covariance import Spread, is_covariance
from mrl_driver.robot.heading import KnownBias
from mrl_driver.robot.models import RobotModel, kind_of
from mrl_driver.robot.models.drives import DIFFERENTIAL, NONE, TRACKED
from mrl_driver.session.handshake import Board
from mrl_driver.session.session import Session

LARGEST_BIAS = 1.0
"""Largest bias of a gyro, and largest number of its variances, that a recording may hold [rad/s]."""


class Joined(NamedTuple):
    """A session whose greeting is not in the recording."""

    board: Board
    stream_code: int
    checked: bool
    stamp_s: float
    """Time of the last telemetry, on the driver's clock: the two clocks are matched from there on [s]."""
    last: Optional[Frame]  # its frame
    bias: Optional[KnownBias]  # bias of the gyro; None without a gyro, or before it is known


def model_text(model: RobotModel) -> str:
    """Return the model as JSON, with the keys of its YAML file."""
    if not model.drives:
        return exact_json({"name": model.name, "ids": model.ids, "drive": NONE, "build": models.ENVIRONMENT})
    document: Dict[str, Any] = model._asdict()
    usual = models.SonarMount._field_defaults
    kind = kind_of(model.drive)
    kind = DIFFERENTIAL if kind == TRACKED else kind
    document["drive"] = {"kind": kind, **model.drive._asdict()}
    document["sonars"] = {
        name: {key: value for key, value in mount._asdict().items() if value != usual.get(key)}
        for name, mount in model.sonars.items()
    }
    for name in ("limits", "body", "battery", "noise", "imu", "laser"):
        document[name] = document[name]._asdict()
    for name in ("build", "virtual"):
        if not document[name]:
            del document[name]
    chip = document.pop("chip")
    if pins := {name: value for name, value in model.board.items() if name in wiring.EMPTY}:
        document["board"] = {name: value for name, value in model.board.items() if name not in pins}
        document["wiring"] = {"chip": chip, **wiring.section(pins, CHIPS[chip])}
    return exact_json(document)


def model_of(text: str) -> Optional[RobotModel]:
    """Return the model in this text; None if it holds none that a driver could use."""
    try:
        return models.parse(json.loads(text), "the recording")
    except (ConfigError, ValueError, OverflowError, RecursionError):
        return None


def session_text(session: Session, board: Board, stamp_s: float, bias: Optional[KnownBias] = None) -> str:
    """Return what a reader must know about a session whose greeting it does not see, as JSON.

    `stamp_s` is the time of the last telemetry [s].
    """
    facts = {**board._asdict(), "capabilities": sorted(board.capabilities)}
    checked, last, frame = session.checked, session.last_frame, b""
    if last is not None:
        frame = encode_reply(
            last.code, *last.args, stamp=last.stamp, checked=checked and last.stamp is not None
        )
    found = {"board": facts, "stream": session.stream_code, "checked": checked}
    return exact_json({**found, "stamp_s": stamp_s, "frame": frame.decode(), "bias": bias})


def _bias_of(found: Any) -> Optional[KnownBias]:
    """The bias in this list; None if it is damaged, or there is none."""
    if not isinstance(found, list) or len(found) != len(KnownBias._fields):
        return None
    if not all(type(each) in (int, float) and abs(each) <= LARGEST_BIAS for each in found):
        return None
    bias = KnownBias(*map(float, found))
    return bias if bias.variance >= 0.0 and bias.noise_rad2_s >= 0.0 else None


def session_of(text: str) -> Optional[Joined]:
    """Return the session in this text; None if it is damaged."""
    try:
        found = json.loads(text)
        facts = dict(found["board"])
        whole = {name: facts[name] for name in ("robot_id", "version", "protocol")}
        numbers = {name: facts[name] for name in ("motor_board_version", "battery_v", "temperature_c")}
        capabilities, stream, checked = facts["capabilities"], found["stream"], found["checked"]
        if not all(type(each) is int and 0 <= each <= INT16_MAX for each in (*whole.values(), stream)):
            return None
        if not all(type(each) in (int, float) and not math.isinf(each) for each in numbers.values()):
            return None
        if not all(isinstance(each, str) for each in capabilities) or type(checked) is not bool:
            return None
        board = Board(**whole, **numbers, capabilities=frozenset(capabilities))
        stamp_s, frame = float(found["stamp_s"]), str(found["frame"]).encode()
        frames = FrameDecoder(REPLIES, checked).feed(frame)
        last = next((event for event in frames if isinstance(event, Frame) and event.code == stream), None)
        last = last if math.isfinite(stamp_s) else None
        return Joined(board, stream, checked, stamp_s, last, _bias_of(found.get("bias")))
    except (KeyError, TypeError, ValueError, OverflowError, RecursionError):
        return None


def numbers_of(data: bytes) -> List[float]:
    """Return the finite numbers in this text, separated by spaces; none if it holds anything else."""
    try:
        numbers = [float(word) for word in data.split()]
    except ValueError:
        return []
    return numbers if all(map(math.isfinite, numbers)) else []


class Gap(NamedTuple):
    """Lines that could not be written."""

    begin_s: float
    end_s: float
    """Times of the lines before and behind them [s since the recording began]."""
    lines: int
    reason: str


def gap_of(data: bytes, end_s: float) -> Optional[Gap]:
    """Return the gap that ends at this time, with the facts in this text; None if it is damaged."""
    try:
        found = json.loads(data)
        lines, begin_s, reason = found["lines"], float(found["since_s"]), str(found["reason"])
    except (KeyError, TypeError, ValueError, OverflowError, RecursionError):
        return None
    fits = type(lines) is int and 0 < lines < 1 << 60 and 0.0 <= begin_s <= end_s
    return Gap(begin_s, end_s, lines, reason) if fits else None


def pose_of(data: bytes) -> Optional[Tuple[Pose, Spread]]:
    """Return the pose in this text and its covariance; None if it is damaged."""
    numbers = numbers_of(data)
    if len(numbers) != 9:
        return None
    x_m, y_m, yaw_rad, xx, xy, x_yaw, yy, y_yaw, yaw_yaw = numbers
    if max(abs(x_m), abs(y_m)) > FARTHEST_M or abs(yaw_rad) > math.pi:  # no driver sets such a pose
        return None
    spread = xx, xy, x_yaw, yy, y_yaw, yaw_yaw
    return (Pose(x_m, y_m, yaw_rad), spread) if is_covariance(spread) else None
