"""Turns a sequence of events of the explorer into a script that the model of the stop follows."""

from typing import Dict, List, Tuple

from tests.long.verify.model.checker import Tick

ONE: Dict[str, Tuple[Tick, ...]] = {
    "w": (Tick(),),
    "W": 5 * (Tick(),),
    "L": 6 * (Tick(fault="LOST"),),
    "M": 6 * (Tick(fault="MUTE"),),
    "X": 6 * (Tick(fault="DAMAGE"),),
    "h": 3 * (Tick(other="HANGS"),),
    "P": (*6 * (Tick(other="STOPPED"),), Tick()),
    "S": (*6 * (Tick(other="SUSPENDED"),), Tick()),
    "r": (Tick(other="RESET"), Tick(other="UP")),
    "c": (Tick(other="UNPLUG"), Tick(), Tick(other="PLUG")),
    "o": (Tick(other="UNPLUG"), Tick(), Tick(other="PLUG_OTHER")),
    "a": (*2 * (Tick(other="BUS_DEAD"),), Tick()),
}
"""What happens in the ticks of one event.  The model's board needs a tick to start, the explorer's none."""
ACTS = {"d": "DRIVE", "s": "STOP", "i": "EMERGENCY", "u": "RELEASE", "x": "CLOSE"}
HUNG_TICKS = 10  # The callback of an event `h` hangs for this long, also during the events that follow
AWAY = ("STOPPED", "SUSPENDED")
OF_NEXT = {"l": "LOST", "m": "MUTE"}  # Faults of the next tick
KNOWN = "".join((*ACTS, *OF_NEXT, *ONE))


def script_of(path: str) -> List[Tick]:
    """Return the ticks of a sequence of events by letter.

    Raises:
        ValueError: an event has no counterpart in the model.
    """
    foreign = set(path) - set(KNOWN)
    if foreign:
        raise ValueError(f"the model has no events {''.join(sorted(foreign))}, expected some of {KNOWN}")
    script: List[Tick] = []
    latched = closed = False
    faults, hung_until = "", 0
    for letter in path:
        if letter in OF_NEXT:
            faults += letter
            continue
        if letter in ACTS:
            act = ACTS[letter]
            if closed or (letter == "u" and not latched):
                act = ""  # it has no effect
            elif letter == "i" and latched:
                act = "STOP"
            latched, closed = (latched or letter == "i") and letter != "u", closed or letter == "x"
            ticks: Tuple[Tick, ...] = (Tick(user=act),)
        else:
            ticks = ONE[letter]
        if faults:
            first = ticks[0]
            lost, mute = "l" in faults or first.fault == "LOST", "m" in faults or first.fault == "MUTE"
            fault = "CUT_BOTH" if lost and mute else "LOST" if lost else first.fault or "MUTE"
            ticks, faults = (first._replace(fault=fault), *ticks[1:]), ""
        script += ticks
        if letter == "h":
            hung_until = len(script) - len(ticks) + HUNG_TICKS
        for i in range(len(script) - len(ticks), min(len(script), hung_until)):
            if not script[i].other and script[i - 1].other not in AWAY:  # the driver goes on first
                script[i] = script[i]._replace(other="HANGS")
    return script
