"""The files of a calibration: the robot's YAML, and the runs so far, so that a calibration can be resumed.

Files are replaced atomically, and the old YAML file is kept next to the new one.
"""

import datetime
import json
import os
import re
from typing import Any, Dict, List, Mapping, Optional, Tuple

from mrl_driver import yaml_file
from mrl_driver.errors import ConfigError
from mrl_driver.files import read_plain, replace_file
from mrl_driver.protocol.table import NOT_CONNECTED
from mrl_driver.robot import models
from mrl_driver.yaml_form import with_schema_line

from .trial import Trial, as_json, from_json

VERSION = 1
_LONGEST = 1 << 22  # longest file read [byte]; one with hundreds of runs has some hundred thousand
Key = Tuple[str, str]  # section and key of a number in a robot's YAML, such as ("drive", "turn_slip")


class Progress:
    """The measured runs of a procedure, in a JSON file with those of others.

    The `settings` describe how the runs were driven.  ConfigError if the file is damaged, or belongs to another robot.
    """

    def __init__(self, path: str, robot: str, procedure: str, settings: Mapping[str, Any]) -> None:
        self.path, self._procedure, self._settings = path, procedure, dict(settings)
        self._data: Dict[str, Any] = {"version": VERSION, "robot": robot, "procedures": {}}
        if os.path.exists(path):
            self._data = _read_state(path, robot)

    @property
    def _found(self) -> Optional[Dict[str, Any]]:
        """What the file has of this procedure, and is not evaluated yet."""
        found: Optional[Dict[str, Any]] = self._data["procedures"].get(self._procedure)
        return None if found is None or found.get("done") else found

    def runs(self) -> List[Trial]:
        """The runs that are not evaluated yet; raise ConfigError if they are damaged, or had other settings."""
        found = self._found
        if found is not None and found["settings"] != self._settings:
            raise ConfigError(
                f"{self.path} holds runs of {self._procedure} with {_listed(found['settings'])}, expected "
                f"{_listed(self._settings)}: give the options of its runs, or start again with --restart"
            )
        return [from_json(each) for each in found["runs"]] if found is not None else []

    def require_result(self, procedure: str) -> None:
        """Raise ConfigError if this other procedure has runs, and ended without a result."""
        found = self._data["procedures"].get(procedure)
        if found is not None and not found.get("done"):
            raise ConfigError(
                f"{self.path} holds runs of {procedure} without a result, expected its result first: repeat "
                f"mrl calibrate {procedure}"
            )

    def other_runs(self) -> List[Trial]:
        """The runs of all other procedures, evaluated or not."""
        others = (found for name, found in self._data["procedures"].items() if name != self._procedure)
        return [from_json(each) for found in others for each in found["runs"]]

    def put(self, run: Trial, number: Optional[int] = None) -> None:
        """Add a run, or replace run `number` (from 0), which was driven again; it is on the disk when this returns."""
        runs = list(self._found["runs"]) if self._found is not None else []
        if number is None:
            runs.append(as_json(run))
        else:
            runs[number] = as_json(run)
        self._write({"settings": self._settings, "runs": runs})

    def forget(self) -> None:
        """Delete the runs of this procedure."""
        if self._procedure in self._data["procedures"]:
            self._write(None)

    def finish(self) -> None:
        """Mark the runs as evaluated; the next run starts a new list."""
        if self._found is not None:
            self._write({**self._found, "done": True})

    def _write(self, found: Optional[Dict[str, Any]]) -> None:
        self._data["procedures"].pop(self._procedure, None)
        if found is not None:
            self._data["procedures"][self._procedure] = found
        replace_file(self.path, json.dumps(self._data, separators=(",", ":")) + "\n")


def _read_state(path: str, robot: str) -> Dict[str, Any]:
    try:
        data = json.loads(read_plain(path, _LONGEST))
        good = data["version"] == VERSION and all(
            isinstance(found["runs"], list) and isinstance(found["settings"], dict)
            for found in data["procedures"].values()
        )
    except OSError as error:
        raise ConfigError(f"{path} cannot be read: {error.strerror}") from None
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        good = False
    if not good:
        raise ConfigError(f"{path} is not the state of a calibration; move it away to start again")
    if data.get("robot") != robot:
        found = yaml_file.short(data.get("robot"))
        raise ConfigError(f"{path} belongs to {found}, expected {robot}; give another --output")
    return dict(data)


def _listed(settings: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} {yaml_file.short(value)}" for name, value in settings.items()) or "no settings"


def write_model(
    source: str, output: str, values: Mapping[Key, float], note: str, virtual: bool = False
) -> str:
    """Write the model file `source` with new numbers to `output`; comments stay, and `note` follows each new number.

    The file says so if the robot is `virtual`.  Return the path of the backup of `output`, or "" if it did not exist;
    errors are as of `edited`, and OutputError if a file cannot be written.
    """
    text = edited(source, values, note, virtual)
    kept = _keep(output)
    replace_file(output, text)
    return kept


def edited(source: str, values: Mapping[Key, float], note: str, virtual: bool = False) -> str:
    """Return the text of a model file with new numbers; ConfigError if it cannot be read, or would not be a model."""
    text = with_schema_line(_text_of(source), models.SCHEMA)
    comment = f"{note}, {datetime.date.today().isoformat()}"
    for key, value in values.items():
        text = _with_number(text, key, value, comment)
    if virtual:
        text = (
            re.sub(r"^virtual:.*\n?", "", text, flags=re.MULTILINE).rstrip()
            + f"\nvirtual: true  # {comment}\n"
        )
    _require_model(text, source, values)
    return text


def _text_of(path: str) -> str:
    try:
        return read_plain(path, _LONGEST).decode("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path} cannot be read: {getattr(error, 'strerror', error)}") from None


def _spelling(value: float) -> str:
    return str(value) if isinstance(value, int) else f"{value:.8g}" if abs(value) >= 1e-3 else f"{value:.12f}"


def _with_number(text: str, key: Key, value: float, comment: str) -> str:
    """The text with one number changed, or added at the end of its section, or added with a new section.

    The line of a pin that is not connected any more is left empty.
    """
    section, name = key
    line = f"  {name}: {_spelling(value)}"
    start = re.search(rf"^{section}:[ \t]*(#.*)?$", text, re.MULTILINE)
    if start is None:
        return f"{text.rstrip()}\n{section}:\n{line}  # {comment}\n"
    end = re.compile(r"^\S", re.MULTILINE).search(text, start.end())
    body = text[start.end() : end.start() if end else len(text)]
    rest = text[start.end() + len(body) :]
    old = re.search(rf"^[ \t]+{name}:.*$", body, re.MULTILINE)
    new = f"{line}  # {comment}" if section != "wiring" or value != NOT_CONNECTED else ""
    body = body[: old.start()] + new + body[old.end() :] if old else f"{body.rstrip()}\n{new}\n"
    return text[: start.end()] + body + rest


def _require_model(text: str, source: str, values: Mapping[Key, float]) -> None:
    """Refuse a text that is not a model, or does not hold the new numbers."""
    try:
        data = yaml_file.parse(text, source)
    except ConfigError:
        raise ConfigError(f"{source} cannot be edited automatically; nothing was changed") from None
    model = models.parse(data, source)
    for (section, name), value in values.items():
        part = model.board if section == "wiring" else getattr(model, section)
        key = f"pin_{name}" if section == "wiring" else name
        found = float(part[key] if isinstance(part, dict) else getattr(part, name))
        if abs(found - value) > 1e-6 * abs(value) + 1e-9:
            raise ConfigError(
                f"{source}: {section}.{name} cannot be edited, expected it on its own line; nothing was changed"
            )


def _keep(path: str) -> str:
    """Copy an existing file to a backup; returns the backup's name, or "" without a file."""
    if not os.path.exists(path):
        return ""
    number = 1
    while os.path.exists(f"{path}.{number}.bak"):
        number += 1
    kept = f"{path}.{number}.bak"
    replace_file(kept, _text_of(path))
    return kept
