"""Renders the table of problems and the error classes into `docs/troubleshooting.md`."""

from typing import Iterator, List, Type

from mrl_driver import errors
from mrl_driver.problems import GROUPS, Problem

_HEAD = """\
<!-- Rendered from mrl_driver/problems.py and mrl_driver/errors.py by `make generate`. -->
# Troubleshooting

Look for the message that you see, or for its code, which stands in brackets at the end of a message: `[port_busy]`.
`mrl explain CODE` prints the same words in a terminal. Words in capitals, such as PORT, stand for something that
varies.

If you do not know where to start, run `mrl doctor --port PORT`. It checks computer, port, board and robot, and does not
move the robot. If a drive went wrong, record it (`mrl drive --record drive.mrl --port PORT`, or [from a
program](data.md#recordings)) and run `mrl review drive.mrl`. To report a problem, add the output of
`mrl doctor --report --port PORT` and the recording.

**If a robot does something that you do not expect, switch off its motor power first, then look for the reason.**
"""


def troubleshooting() -> str:
    """Return the page."""
    anchors = {group: group.lower().replace(",", "").replace(" ", "-") for group in (*GROUPS, "Exit codes")}
    contents = [f"- [{group}](#{anchor})" for group, anchor in anchors.items()]
    return "\n".join([_HEAD, *contents, "", *_sections(), *_exit_codes()]) + "\n"


def _sections() -> Iterator[str]:
    for group, rows in GROUPS.items():
        yield f"## {group}\n"
        for row in rows:
            yield from _section(row)


def _section(row: Problem) -> Iterator[str]:
    yield f'<a id="{row.code}"></a>\n'
    yield f"### {row.code}: {row.message}\n"
    if row.also:
        yield "Other messages with this code:\n"
        yield from (f"- {text}" for text in row.also)
        yield ""
    yield f"**Cause.** {row.cause}\n"
    yield f"**Remedy.** {row.advice or 'None is needed: the next command drives the robot again.'}\n"


def _classes(base: Type[errors.MrlError]) -> List[Type[errors.MrlError]]:
    """Return an error class of `errors` and all below it, in their order there."""
    below = [each for each in base.__subclasses__() if each.__module__ == errors.__name__]
    return [base, *(found for each in below for found in _classes(each))]


def _exit_codes() -> Iterator[str]:
    yield "## Exit codes\n"
    yield "`mrl` ends with the exit code of its error; 0 means that all went well, 130 that you pressed Ctrl-C.\n"
    yield "| exit code | error class in Python | meaning | more |"
    yield "|---|---|---|---|"
    for kind in _classes(errors.MrlError):
        meaning = (kind.__doc__ or "").splitlines()[0] if kind is not errors.MrlError else "Any other error."
        more = f"[`{kind.code}`](#{kind.code})" if kind.code else "the message says what was expected"
        yield f"| {kind.exit_code} | `{kind.__name__}` | {meaning} | {more} |"
