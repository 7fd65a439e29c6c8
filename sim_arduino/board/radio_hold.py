"""Robots that hold this one by radio: the firmware's `hold.cpp` in Python.  Nothing here turns a motor."""

import math
from typing import Callable, Dict, List, Tuple

from mrl_driver.protocol.frames import to_int16
from mrl_driver.protocol.hold_text import HoldText, is_newer
from mrl_driver.protocol.table import HOLD_STATES, INT16_MAX, MOST_HOLDERS, TICK_S

from .parameter_store import Config

UNIT_S = 1563 * TICK_S  # one count of parameter 26 [s]: 100 ms in whole ticks
_STATE = {name: row for row, (name, _) in enumerate(HOLD_STATES)}
_ANSWER = {"hold": "held", "free": "freed"}


class Holder:
    """A radio that has sent a hold text.  It stays known after its hold, so that an old text cannot hold the robot.

    Attributes:
        answer: What the board answers: the last text with an effect.
        heard_s: Time of that text [s].
        holds: It holds the robot.
        silent: It holds the robot, and was not heard for the time of parameter 26.
    """

    def __init__(self, answer: HoldText) -> None:
        self.answer = answer
        self.heard_s = 0.0
        self.holds = self.silent = False

    def is_good(self, text: HoldText) -> bool:
        """Whether a text has an effect: it is newer, or repeats the last one or its end."""
        if text.number != self.answer.number:
            return is_newer(text.number, self.answer.number)
        return self.holds or text.kind == "free"


class RadioHold:
    """The holds of one board since its last start.

    Args:
        config: The board's parameters.
        stop: Stops the motors.
        started_s: Time of the start [s].

    Attributes:
        undelivered: Number of texts that reached no radio.
    """

    def __init__(self, config: Config, stop: Callable[[], None], started_s: float) -> None:
        self._config, self._stop, self._started_s = config, stop, started_s
        self._listening = self.on
        self._holders: Dict[int, Holder] = {}
        self._waiting: Dict[int, bytes] = {}
        self._ignored = self.undelivered = 0
        self._told = self._changed = False

    @property
    def on(self) -> bool:
        """Whether other robots may hold this one."""
        return self._config["radio_hold"] > 0

    @property
    def _silence_s(self) -> float:
        return self._config["radio_hold"] * UNIT_S

    @property
    def held(self) -> bool:
        """Whether moves are refused."""
        return self._listening or any(holder.holds for holder in self._holders.values())

    @property
    def next_s(self) -> float:
        """Time of the next call of `run` [s]."""
        if not self.on:
            return -math.inf if self._holders or self._listening else math.inf
        times = [each.heard_s for each in self._holders.values() if each.holds and not each.silent]
        times += [self._started_s] * self._listening
        return min(times, default=math.inf) + self._silence_s

    def run(self, now_s: float) -> None:
        """Notes which holders are silent."""
        if not self.on:
            changed = self.held
            self._holders.clear()
            self._listening = False
        else:
            changed = self._listening
            self._listening = self._listening and now_s < self._started_s + self._silence_s
            changed = changed and not self._listening
            for holder in self._holders.values():
                if holder.holds and not holder.silent and now_s >= holder.heard_s + self._silence_s:
                    holder.silent = changed = True
        self._changed = self._changed or changed

    def take_news(self) -> bool:
        """Whether the state has changed since the last call, and the host has asked for it before."""
        news = self._told and self._changed
        if news:
            self._changed = False
        return news

    def receive(self, address: int, data: bytes, now_s: float) -> bool:
        """Takes a received text; False if it is not a hold text or holds are off, so that it is for the host."""
        text = HoldText.parse(data)
        if not self.on or text is None or text.kind not in _ANSWER:
            return False
        answer = HoldText(_ANSWER[text.kind], text.number)
        known = address in self._holders
        if not known and not self._make_room():
            self._count_ignored()
            return True
        holder = self._holders.setdefault(address, Holder(answer))
        if holder.is_good(text) if known else text.kind == "hold":
            holder.answer = answer
            self._apply(holder, text.kind == "hold", now_s)
        else:
            self._count_ignored()
        self._waiting[address] = holder.answer.data
        return True

    def answers(self) -> List[Tuple[int, bytes]]:
        """The texts to send and the addresses of their radios; each is returned once."""
        waiting, self._waiting = self._waiting, {}
        return list(waiting.items())

    def keep(self, address: int, data: bytes) -> None:
        """Keeps a text for which there was no room, unless there is a newer one."""
        self._waiting.setdefault(address, data)

    def release(self) -> int:
        """Drops the silent holders; 1 if another robot still holds this one, otherwise 0."""
        self._holders = {address: each for address, each in self._holders.items() if not each.silent}
        self._changed = True
        return int(self.held)

    def count_undelivered(self) -> None:
        """Counts a text that reached no radio."""
        self.undelivered = min(INT16_MAX, self.undelivered + 1)
        self._changed = True

    def report(self) -> Tuple[int, ...]:
        """The fields of the reply to `read_radio`."""
        self._told, self._changed = True, False
        holding = {address: each for address, each in self._holders.items() if each.holds}
        silent = [address for address, each in holding.items() if each.silent]
        state = "free" if self.on else "off"
        if holding:
            state = "silent" if silent else "held"
        elif self._listening:
            state = "listening"
        address = silent[0] if silent else next(reversed(list(holding)), 0)
        words = (to_int16(address >> shift & 0xFFFF) for shift in (48, 32, 16, 0))
        return (_STATE[state], len(holding), self._ignored, self.undelivered, *words)

    def _make_room(self) -> bool:
        """Whether a new radio finds a place; one whose hold has ended gives way."""
        if len(self._holders) + self._listening < MOST_HOLDERS:
            return True
        ended = next((address for address, each in self._holders.items() if not each.holds), None)
        if ended is not None:
            del self._holders[ended]
        return ended is not None

    def _apply(self, holder: Holder, holds: bool, now_s: float) -> None:
        self._changed = self._changed or holder.silent or holder.holds != holds
        holder.holds, holder.silent, holder.heard_s = holds, False, now_s
        if holds:
            self._stop()

    def _count_ignored(self) -> None:
        self._ignored = min(INT16_MAX, self._ignored + 1)
