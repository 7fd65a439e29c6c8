"""What a recording says about its robot and session, as JSON text; see the remarks in `recording`.

Reading checks everything: the text may be damaged, or written by anybody.
"""

import json
import math
from typing import Any, Dict, NamedTuple, Optional

from mrl_driver.errors import ConfigError
from mrl_driver.protocol.table import INT16_MAX
from mrl_driver.robot import models
from mrl_driver.robot.models import Drive, RobotModel, kind_of
from mrl_driver.robot.models.drives import DIFFERENTIAL, NONE
from mrl_driver.session.handshake import Board


class Joined(NamedTuple):
    """A session whose greeting is not in the recording."""

    board: Board
    stream_code: int
    checked: bool


def model_text(model: RobotModel) -> str:
    """Return the model as JSON, with the keys of its YAML file."""
    return json.dumps(_document(model))


def _document(model: RobotModel) -> Dict[str, Any]:
    if not model.drives:
        return {"name": model.name, "ids": model.ids, "drive": NONE, "build": models.ENVIRONMENT}
    document: Dict[str, Any] = model._asdict()
    kind = DIFFERENTIAL if isinstance(model.drive, Drive) else kind_of(model.drive)
    document["drive"] = {"kind": kind, **model.drive._asdict()}
    document["sonars"] = {name: mount._asdict() for name, mount in model.sonars.items()}
    for name in ("limits", "body", "battery", "noise", "imu", "laser"):
        document[name] = document[name]._asdict()
    if not model.build:
        del document["build"]
    return document


def model_of(text: str) -> Optional[RobotModel]:
    """Return the model in this text; None if it holds none that a driver could use."""
    try:
        return models.parse(json.loads(text), "the recording")
    except (ConfigError, ValueError, RecursionError):
        return None


def session_text(board: Board, stream_code: int, checked: bool) -> str:
    """Return board, code of the stream, and whether frames carry a checksum, as JSON."""
    facts = {**board._asdict(), "capabilities": sorted(board.capabilities)}
    return json.dumps({"board": facts, "stream": stream_code, "checked": checked})


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
        return Joined(Board(**whole, **numbers, capabilities=frozenset(capabilities)), stream, checked)
    except (KeyError, TypeError, ValueError, RecursionError):
        return None
