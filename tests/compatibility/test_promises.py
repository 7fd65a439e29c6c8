"""Each release keeps what earlier ones promised: a file of lines for each, and what it had stored or recorded.

A promise that a test misses here is kept, and deprecated; it ends in a new major version, which removes its line
(docs/compatibility.md).
"""

import re
from functools import lru_cache
from pathlib import Path

import pytest

from mrl_driver.driver.recorded import RecordedDriver
from mrl_driver.protocol import REPLIES, REQUESTS, Frame, FrameDecoder
from mrl_driver.protocol.table import BY_NAME

from . import present

FOLDER = Path(__file__).parent
REMEDY = "keep it and deprecate it, or raise the major version and remove its line: docs/compatibility.md"
END_ERROR = 1e-9  # [s], [m], [rad]


def promised(*kinds):
    """Release, kind, name and words of all lines of these kinds; of all kinds without one."""
    for path in sorted(FOLDER.glob("*.txt")):
        for line in path.read_text(encoding="ascii").splitlines():
            kind, name, *words = line.split()
            if kind in kinds or not kinds:
                yield path.stem, kind, name, words


@lru_cache(maxsize=None)
def now():
    return {(kind, name): words for kind, name, words in present.lines()}


def fields_of(words):
    return [word for word in words if word[0] != "@"]


def accepts(arguments, words):
    """Whether a call with these arguments still works: none is gone or moved, and new ones may be left out."""
    same = all(new in (old, f"{old}=") for old, new in zip(arguments, words))
    return same and len(words) >= len(arguments) and all(new[-1] == "=" for new in words[len(arguments) :])


KEPT = {
    "python": accepts,
    "request": lambda old, new: fields_of(new)[: len(fields_of(old))] == fields_of(old),
    "reply": lambda old, new: fields_of(new) == fields_of(old),
    "table": lambda old, new: new[: len(old)] == old,
}
"""Whether a promise is kept, by kind; of the others each word must still be there."""
STORED = ("eeprom", "recording")
KINDS = sorted({kind for _, kind, _, _ in promised()} - set(STORED))


def test_a_name_of_a_new_list_that_is_not_there_is_an_error(monkeypatch):
    monkeypatch.setitem(present.PUBLIC, "mrl_driver.geometry", "Pose Poses")
    with pytest.raises(AttributeError, match="Poses"):
        list(present.python_names())


@pytest.mark.parametrize("kind", KINDS)
def test_what_was_promised_is_there(kind):
    kept = KEPT.get(kind, lambda old, new: set(old) <= set(new))
    broken = []
    for release, _, name, words in promised(kind):
        found = now().get((kind, name))
        if found is None or not kept(words, found):
            gone = [word for word in words if word not in (found or ())]
            broken.append(f"{release} promised: {kind} {name}: {' '.join(gone)}; now: {found}; {REMEDY}")
    assert not broken, "\n".join(broken)


@pytest.mark.parametrize("kind, direction", [("request", REQUESTS), ("reply", REPLIES)])
def test_bytes_mean_what_they_meant(kind, direction):
    for release, _, name, words in promised(kind):
        for wire in (word for word in words if word[0] == "@"):
            code, *numbers = map(int, re.findall(r"-?\d+", wire))
            found = FrameDecoder(direction).feed(wire.encode("ascii"))
            meant = Frame(code, tuple(numbers[: len(fields_of(words))]))
            assert code == BY_NAME[name].code and found == [meant], f"{release} promised: {wire}; {REMEDY}"


@pytest.mark.parametrize("release, name, words", [(r, n, w) for r, _, n, w in promised("recording")])
def test_a_recording_ends_where_it_ended(release, name, words):
    robot = RecordedDriver(str(FOLDER / name))
    heard = []
    robot.on_telemetry(heard.append)
    robot.play()
    found = len(heard), heard[-1].stamp_s, *robot.pose
    assert found == pytest.approx(tuple(map(float, words)), rel=0, abs=END_ERROR), REMEDY
