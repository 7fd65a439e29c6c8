"""Findings of `mrl doctor` on a terminal, and as plain text to paste into a bug report."""

import datetime
import platform
import textwrap
from typing import Any, Iterator, List, Mapping, Sequence

from rich.console import Console
from rich.text import Text

from mrl_driver.cli.doctor.findings import FAULT, NOTE, OK, WARNING, Finding, verdict
from mrl_driver.host.named_robots import Target
from mrl_driver.program import version

_MARKS = {OK: ("✓", "ok"), NOTE: ("·", "--"), WARNING: ("!", "!!"), FAULT: ("✗", "XX")}
_STYLES = {OK: "green", NOTE: "dim", WARNING: "bold yellow", FAULT: "bold red"}
_SUBJECT, _INDENT = 16, 20
_WIDEST = 100


def _console() -> Console:
    return Console(highlight=False, soft_wrap=True)


def show(finding: Finding) -> None:
    """Print one finding, with its advice below."""
    console = _console()
    signs = console.encoding.lower().startswith("utf")
    style = _STYLES[finding.level]
    subject = Text(f"{finding.subject:<{_SUBJECT}} ", style="" if finding.level in (OK, NOTE) else style)
    first, *rest = _wrapped(finding.text + (f"  [{finding.code}]" if finding.code else ""), console)
    console.print(
        Text(f"{_MARKS[finding.level][0 if signs else 1]:<2} ", style=style) + subject + Text(first)
    )
    arrow = "→" if signs else "->"
    advice = _wrapped(f"{arrow} {finding.advice}", console) if finding.advice else []
    for line in rest:
        console.print(" " * _INDENT + line)
    for line in advice:
        console.print(Text(" " * _INDENT + line, style="cyan"))


def _wrapped(text: str, console: Console) -> List[str]:
    """Return the lines of the third column; a single line if the output is not a terminal."""
    width = min(console.width, _WIDEST) - _INDENT if console.is_terminal else 10**6
    return textwrap.wrap(text, max(20, width), break_long_words=False, break_on_hyphens=False) or [""]


def conclude(findings: Sequence[Finding]) -> None:
    """Print the verdict."""
    levels = [finding.level for finding in findings]
    style = _STYLES[FAULT if FAULT in levels else WARNING if WARNING in levels else OK]
    _console().print(Text(f"\n   {verdict(findings)}", style=style))


def report(findings: Sequence[Finding], facts: Mapping[str, Any], target: Target) -> Iterator[str]:
    """Yield the lines of the whole report, with the versions of the software."""
    yield f"mrl doctor, {datetime.datetime.now().astimezone().isoformat(timespec='seconds')}"
    yield f"mrl-driver {version()}, pyserial {version('pyserial')}, Python {platform.python_version()}"
    yield f"{platform.platform()}"
    yield f"port {target.port}, model {target.model}, {target.baud} Bd"
    yield ""
    for finding in findings:
        code = f"  [{finding.code}]" if finding.code else ""
        yield f"{finding.level:<8} {finding.subject:<18} {finding.text}{code}"
        if finding.advice:
            yield f"{'':27} -> {finding.advice}"
    yield ""
    yield f"verdict: {verdict(findings)}"
    yield ""
    yield from (f"{key}: {value}" for key, value in facts.items())
