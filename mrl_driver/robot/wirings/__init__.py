"""Wirings of common shields and tutorials: one YAML file each, with its source."""

import os
from functools import lru_cache
from typing import Any, Dict, List, NamedTuple

from mrl_driver import yaml_file
from mrl_driver.protocol.table import BRIDGES
from mrl_driver.robot.chips import Chip
from mrl_driver.robot.models.robot_file import Wiring
from mrl_driver.yaml_form import Choice, Keys, Text

_FOLDER = os.path.dirname(os.path.abspath(__file__))


class Entry(NamedTuple):
    """A wiring of the catalogue."""

    title: str
    source: str
    bridge: str
    """A row of `BRIDGES`; empty if the wiring suits all."""
    chip: Chip
    pins: Dict[str, int]


def names() -> List[str]:
    """Return the names of all entries."""
    return sorted(name[: -len(".yaml")] for name in os.listdir(_FOLDER) if name.endswith(".yaml"))


@lru_cache(maxsize=None)
def load(name: str) -> Entry:
    """Return the entry with this name."""
    path = os.path.join(_FOLDER, f"{name}.yaml")
    forms = {"title": Text(), "source": Text(), "bridge": Choice(BRIDGES[1:]), "wiring": Wiring()}
    found: Dict[str, Any] = Keys(forms, ("bridge",)).read(yaml_file.Reader(path), "", yaml_file.read(path))
    return Entry(found["title"], found["source"], found.get("bridge", ""), *found["wiring"])
