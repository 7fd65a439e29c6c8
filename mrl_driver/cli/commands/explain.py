"""`mrl explain`: what a code at the end of a message means, and what to do."""

import difflib

import click

from mrl_driver.errors import ConfigError
from mrl_driver.problems import GROUPS, PROBLEMS, Problem

from .shared import completion_of


@click.command()
@click.argument("code", required=False, shell_complete=completion_of(lambda: list(PROBLEMS)))
def explain(code: str) -> None:
    """Explain the code of a message: cause and remedy.

    Codes stand in brackets at the end of messages, such as [port_busy].  Stop reasons work too.  Without a code, lists
    all of them.  docs/troubleshooting.md has the same texts.

    \b
    Examples:
      mrl explain port_busy
      mrl explain "command timeout"             a stop reason
      mrl explain
    """
    if code:
        found = _find(code)
        click.echo(f"{found.code}: {found.message}")
        for text in found.also:
            click.echo(f"  also: {text}")
        click.echo(f"cause:  {found.cause}")
        click.echo(f"remedy: {found.advice or 'none is needed; the next command drives the robot again'}")
        return
    for group, rows in GROUPS.items():
        click.echo(f"{group}:")
        for row in rows:
            click.echo(f"  {row.code:<18} {row.message}")


def _find(text: str) -> Problem:
    from mrl_driver.protocol.stop_reason import StopReason
    from mrl_driver.view.words import STOPS

    code = text.strip("[] ").replace(" ", "_").replace("-", "_").lower()
    row = PROBLEMS.get(code) or PROBLEMS.get(STOPS[StopReason(code)].code)
    if row is None:
        near = difflib.get_close_matches(code, PROBLEMS, 3, 0.4)
        expected = ", ".join(near) or "one of those that mrl explain lists"
        raise ConfigError(f"there is no code {text!r}, expected {expected}")
    return row
