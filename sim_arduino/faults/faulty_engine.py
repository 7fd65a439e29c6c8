"""Injects faults of link and board: `FaultyEngine` wraps any engine.

    engine = FaultyEngine(PythonBoard(plant), ["loss:rate=0.001", "unplug:at=5,lasts=2"], seed=1)

Every fault is one of `fault_table.FAULTS`, which `mrl-sim --fault` uses and its help lists.
"""

import math
import random
from functools import partial
from typing import Any, Callable, Iterable, List, Mapping, Tuple, Union

from mrl_driver.errors import ConfigError
from sim_arduino.board.engine import Engine

from .fault_kind import FOREVER_S, FaultKind
from .fault_table import BOTH, TO_BOARD, TO_HOST, Fault, parse
from .hardware_faults import NEEDS, places
from .line_faults import LineFault


class Window:
    """The time for which a fault is on: from `at` for `lasts` seconds, and again every `every` seconds (0: once)."""

    def __init__(self, at: float = 0.0, lasts: float = math.inf, every: float = 0.0) -> None:
        self._start_s, self._lasts_s, self._every_s = at, lasts, every

    def on(self, now_s: float) -> bool:
        """Whether the fault is on; successive times must not decrease."""
        while self._every_s and now_s >= self._start_s + min(self._lasts_s, self._every_s):
            self._start_s += self._every_s
        return self._start_s <= now_s < self._start_s + self._lasts_s

    def over(self, now_s: float) -> bool:
        """Whether the fault has been on, and will not be again."""
        return not self._every_s and now_s >= self._start_s + self._lasts_s

    def next_s(self, now_s: float) -> float:
        """Time of the next switch [s], later than `now_s`; may be infinite."""
        if self.on(now_s):
            return self._start_s + min(self._lasts_s, self._every_s or math.inf)
        return self._start_s if now_s < self._start_s else math.inf


class Chain:
    """The faults of one direction, one after the other, each in its window."""

    def __init__(self) -> None:
        self._links: List[Tuple[LineFault, Window]] = []

    def add(self, fault: LineFault, window: Window) -> None:
        """Adds a fault at the receiver's end."""
        self._links.append((fault, window))

    def clear(self) -> None:
        """Removes all faults; the bytes they hold are lost."""
        self._links.clear()

    def run(self, data: bytes, now_s: float) -> bytes:
        """The bytes that come out of the last fault at `now_s`."""
        for fault, window in self._links:
            data = fault.run(data, now_s) if window.on(now_s) else fault.empty() + data
        self._links = [link for link in self._links if not link[1].over(now_s)]
        return data

    def empty(self) -> None:
        """Drops the bytes that the faults hold."""
        for fault, _ in self._links:
            fault.empty()

    def next_s(self, now_s: float) -> float:
        """Time of the next event after `now_s` [s]."""
        times = [math.inf]
        for fault, window in self._links:
            times.append(window.next_s(now_s))
            if window.on(now_s) and fault.next_s > now_s:
                times.append(fault.next_s)
        return min(times)


class _Switch:
    """A fault that is on during its windows; `act` is called when that changes."""

    def __init__(self, act: Callable[[bool], None], *windows: Window) -> None:
        self.act, self.windows = act, [*windows]
        self.is_on = False

    def update(self, now_s: float) -> bool:
        """Switches the fault if it is due; returns whether it has ended."""
        on = any([window.on(now_s) for window in self.windows])
        self.windows = [window for window in self.windows if not window.over(now_s)]
        changed, self.is_on = on != self.is_on, on
        if changed:
            self.act(on)
        return changed and not on

    def next_s(self, now_s: float) -> float:
        return min([window.next_s(now_s) for window in self.windows], default=math.inf)


class FaultyEngine:
    """An engine with a bad link: the same interface, and methods that inject faults.

    It begins with `faults`, as `Fault` or as text for `parse`, which raises ConfigError; `seed` is that of all random
    ones.
    """

    def __init__(self, engine: Engine, faults: Iterable[Union[Fault, str]] = (), seed: int = 0) -> None:
        self.engine = engine
        self.now_s = 0.0
        self._seed, self._count = seed, 0
        self._chains = {TO_BOARD: Chain(), TO_HOST: Chain()}
        self.unplugs = 0  # number of times that the cable was unplugged
        self._frozen, self._unplugged = _Switch(self._freeze), _Switch(self._pull)
        self._of_board = {
            "freeze": self._frozen,
            "unplug": self._unplugged,
            "reset": _Switch(lambda on: self.engine.reset() if on else None),
            "brown_out": _Switch(lambda on: getattr(engine, "brown_out", engine.reset)() if on else None),
        }
        self._switches = [*self._of_board.values()]
        """All switches; those of hardware faults come behind those of the board."""
        self._waiting = b""
        for fault in faults:
            self.add(fault)

    # ---- faults on request

    def add(self, fault: Union[Fault, str]) -> None:
        """Adds a fault; its times count from the engine's start.

        ConfigError if the text is not a fault, or the robot lacks the hardware that it needs.
        """
        kind, values, direction, times = parse(fault) if isinstance(fault, str) else fault
        self._count += 1
        if kind.switch is not None:
            if kind.needs:
                self._require_hardware(kind, values)
            self._switches.append(_Switch(partial(kind.switch, self.plant, **values), Window(*times)))
            self._switches[-1].update(self.now_s)
        elif kind.make is None:
            self._of_board[kind.name].windows.append(Window(*times))
        else:
            for name, chain in self._chains.items():
                if direction in (BOTH, name):
                    rng = random.Random(f"{self._seed} {self._count} {name}")
                    chain.add(kind.make(rng, **values), Window(*times))

    def _require_hardware(self, kind: FaultKind, values: Mapping[str, Any]) -> None:
        what, expected, there = NEEDS[kind.needs]
        if not there(self.plant):
            raise ConfigError(
                f"fault {kind.name!r} needs {what}, robot {self.plant.model.name} has none; expected {expected}"
            )
        for key, value in values.items():
            known = places(self.plant, key)
            if known and value not in known:
                raise ConfigError(
                    f"fault {kind.name!r} is of {key} {value}, robot {self.plant.model.name} has {', '.join(known)}"
                )

    @property
    def plant(self) -> Any:
        """The hardware of the engine."""
        return self.engine.plant  # type: ignore[attr-defined]

    def inject(self, fault: Union[Fault, str]) -> None:
        """Adds a fault, whose times count from now; ConfigError if the text is none."""
        found = parse(fault) if isinstance(fault, str) else fault
        at_s, lasts_s, every_s = found.window
        self.add(found._replace(window=(at_s + self.now_s, lasts_s, every_s)))
        self._switch()  # one that begins now may be over at the board's next event

    def clear(self) -> None:
        """Removes all faults; bytes that they held back are lost."""
        for chain in self._chains.values():
            chain.clear()
        for switch in self._switches:
            switch.windows.clear()
        self._switch()

    def unplug(self, seconds: float = FOREVER_S) -> None:
        """Unplugs the cable, and plugs it in after `seconds`."""
        self.inject(f"unplug:at=0,lasts={seconds}")

    def plug(self) -> None:
        """Plugs the cable in."""
        self._unplugged.windows.clear()
        self._switch()

    def stall(self, seconds: float) -> None:
        """Makes the line hold back all bytes for `seconds`."""
        self.inject(f"stall:at=0,lasts={seconds}")

    def freeze(self, seconds: float) -> None:
        """Freezes the board for `seconds`."""
        self.inject(f"freeze:at=0,lasts={seconds}")

    # ---- the Engine interface

    @property
    def plugged(self) -> bool:
        """Whether the host has a port."""
        return not self._unplugged.is_on

    def receive(self, data: bytes) -> None:
        """Bytes from the host, at the time of the last `advance`."""
        if self.plugged:
            self._arrive(self._chains[TO_BOARD].run(data, self.now_s))

    def advance(self, to_s: float) -> bytes:
        """Runs to `to_s` [s]; returns the bytes that reached the host until then."""
        out = bytearray()
        while self._own_s() < to_s:
            out += self._step(self._own_s())
        return bytes(out + self._step(to_s))

    @property
    def next_event_s(self) -> float:
        """Time of the next call of `advance` if no bytes come [s]."""
        return self._own_s() if self._frozen.is_on else min(self._own_s(), self.engine.next_event_s)

    def set_host_baud(self, baud: float) -> None:
        """Sets the host's baud rate, if the engine supports baud rates."""
        getattr(self.engine, "set_host_baud", lambda _: None)(baud)

    def gap(self, to_s: float, waiting: bytes) -> None:
        """The board did not run until `to_s`; `waiting` holds the bytes sent meanwhile."""
        self.now_s = max(self.now_s, to_s)
        waiting = self._chains[TO_BOARD].run(waiting, self.now_s) if self.plugged else b""
        if self._frozen.is_on:
            self._waiting += waiting
        else:
            self.engine.gap(to_s, waiting)

    def reset(self) -> None:
        """Presses the reset button."""
        self.engine.reset()

    def close(self) -> None:
        """Frees the engine's resources."""
        self.engine.close()

    # ---- in time

    def _own_s(self) -> float:
        """Time of the next event of a fault, after now [s]."""
        own_s = [chain.next_s(self.now_s) for chain in self._chains.values()]
        return min(own_s + [switch.next_s(self.now_s) for switch in self._switches])

    def _step(self, to_s: float) -> bytes:
        """Runs to `to_s`, then switches the faults that are due; no fault may switch before `to_s`."""
        sent = b"" if self._frozen.is_on else self.engine.advance(to_s)
        self.now_s = to_s
        out = self._chains[TO_HOST].run(sent if self.plugged else b"", to_s)
        self._switch()
        self._arrive(self._chains[TO_BOARD].run(b"", to_s))
        return out

    def _switch(self) -> None:
        """Switches the faults that are due; a part that is mended keeps its other faults."""
        ended = [switch for switch in self._switches if switch.update(self.now_s)]
        board = len(self._of_board)
        hardware = [switch for switch in self._switches[board:] if switch.windows]
        self._switches[board:] = hardware
        for switch in hardware if ended else ():
            if switch.is_on:
                switch.act(True)
        if not self.plugged:
            for chain in self._chains.values():
                chain.empty()

    def _freeze(self, frozen: bool) -> None:
        if not frozen:
            self.engine.gap(self.now_s, self._waiting)
            self._waiting = b""

    def _pull(self, unplugged: bool) -> None:
        self.unplugs += unplugged

    def _arrive(self, data: bytes) -> None:
        """Passes on bytes that reach the board's end of the line."""
        if self._frozen.is_on:
            self._waiting += data
        elif data:
            self.engine.receive(data)
