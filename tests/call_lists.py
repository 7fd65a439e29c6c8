"""Lists of the calls that one step of a thread makes, by `sys.setprofile`.

Only functions of this project's packages count, comprehensions included.  A step begins with a call of `first` and ends
before the next one, so everything that a thread does for one frame, or for one command, is in one list.
"""

import sys
import threading
from collections import Counter
from pathlib import Path
from types import FrameType
from typing import Any, Dict, List, NamedTuple, Set, Tuple

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = tuple(f"{ROOT / name}/" for name in ("mrl_driver", "ros1_bridge"))
DUE = (
    "mrl_driver/session/session.py:tick",
    "mrl_driver/driver/robot_core.py:limit_again",
    "mrl_driver/driver/robot_core.py:_check_wheels",
    "mrl_driver/session/motion_command.py:observe",
    "mrl_driver/session/board_clock.py:_collect",
)
"""Calls for what falls due with some frames: requests and repeats, a step of the ramp, a comparison of the wheels, the
confirmation of a stop, a point for the fit of the clocks, which a frame gives that comes faster than those before."""
PARTS = {"Pose", "Command"}
"""A field of the telemetry, and a row of the command table: neither is a value on its way."""


class Step(NamedTuple):
    """The calls of one step, as `file:function`, and the classes of our packages whose objects they returned."""

    calls: Tuple[str, ...]
    values: Tuple[str, ...]


class CallLists:
    """Collects the steps of each thread that starts while it is installed; `begin` adds the calling thread.

    Args:
        first: `file:function` of each call that begins a step.
    """

    def __init__(self, *first: str) -> None:
        self._first = first
        self._names: Dict[Any, str] = {}
        self._now: Dict[int, Tuple[List[str], Set[str]]] = {}
        self.steps: List[Step] = []

    def install(self) -> "CallLists":
        """Watch every thread that starts from now on."""
        threading.setprofile(self._on_event)
        return self

    def begin(self) -> None:
        """Watch the calling thread."""
        sys.setprofile(self._on_event)

    def remove(self) -> None:
        """Watch no further thread, and no longer the calling one."""
        threading.setprofile(None)  # type: ignore[arg-type]
        sys.setprofile(None)

    def _name_of(self, frame: FrameType) -> str:
        code = frame.f_code
        name = self._names.get(code)
        if name is None:
            path = code.co_filename
            ours = path.startswith(PACKAGES)
            name = f"{Path(path).relative_to(ROOT)}:{code.co_name}" if ours else ""
            self._names[code] = name
        return name

    def _on_event(self, frame: FrameType, event: str, value: Any) -> None:
        if event not in ("call", "return"):
            return
        name = self._name_of(frame)
        if not name:
            return
        thread = threading.get_ident()
        if event == "return":
            if thread in self._now:
                values = value if type(value) is list else [value]
                self._now[thread][1].update(
                    type(each).__name__ for each in values if type(each).__module__.startswith("mrl_driver")
                )
            return
        if name in self._first:
            self._end(thread)
            self._now[thread] = ([], set())
        if thread in self._now:
            self._now[thread][0].append(name)

    def _end(self, thread: int) -> None:
        calls, values = self._now.pop(thread, ([], set()))
        if calls:
            self.steps.append(Step(tuple(calls), tuple(sorted(values - PARTS))))

    def steady(self, *contains: str, without: str = "") -> Step:
        """The most frequent step that has all these calls, with nothing due, and not the call `without`."""
        steps = [
            step
            for step in self.steps
            if set(contains) <= set(step.calls) and not {*DUE, without} & set(step.calls)
        ]
        assert steps, (
            f"no step with {contains} in {Counter(step.calls for step in self.steps).most_common(3)}"
        )
        return Counter(steps).most_common(1)[0][0]


def listed(step: Step) -> str:
    """One line for each call."""
    lines = [f"{at:3d}  {call}" for at, call in enumerate(step.calls, 1)]
    return "\n".join([f"{len(lines)} calls; values: {', '.join(step.values)}", *lines])
