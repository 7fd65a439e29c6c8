"""The result of a check."""

from functools import partial
from typing import Iterable, NamedTuple

from mrl_driver.problems import PROBLEMS

OK, NOTE, WARNING, FAULT = "ok", "note", "warning", "fault"


class Finding(NamedTuple):
    """The result of one check."""

    level: str  # `ok`, `note` (good to know), `warning` (works, with a drawback), or `fault` (does not work)
    subject: str  # subject of the check, in a word or two
    text: str  # text of the finding
    advice: str = ""  # what to do about it
    code: str = ""  # code of the row in `problems`; empty if all is well


def problem(level: str, code: str, subject: str, text: str, advice: str = "") -> Finding:
    """Return a finding with the code of a row in `problems`, and that row's remedy unless another one is given."""
    return Finding(level, subject, text, advice or PROBLEMS[code].remedy, code)


ok = partial(Finding, OK)
note, warning, fault = (partial(problem, level) for level in (NOTE, WARNING, FAULT))


def warning_if(bad: bool, code: str, subject: str, text: str, advice: str = "") -> Finding:
    """Return a warning, or the finding that all is well, with the same text."""
    return warning(code, subject, text, advice) if bad else ok(subject, text)


def verdict(findings: Iterable[Finding]) -> str:
    """Return a summary of all findings in one sentence."""
    levels = [finding.level for finding in findings]
    faults, warnings = levels.count(FAULT), levels.count(WARNING)
    if faults:
        return f"{_count(faults, 'fault')}, {_count(warnings, 'warning')}: see the advice above"
    if warnings:
        return f"{_count(warnings, 'warning')}; the robot can be used"
    return "no problem found"


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"
