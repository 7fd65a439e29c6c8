"""The command `mrl`.

Sub-commands are imported when they are used.  The apps and other packages add theirs through the entry point group
`mrl.commands`.  An error is one line on stderr and an exit code from `errors`.
"""

import difflib
import importlib
import io
import os
import signal
import sys
from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple

import click

from mrl_driver.errors import MrlError, OutputError, shortages
from mrl_driver.program import handle_end_signals, in_plain_words, version

INTERRUPTED = 130  # exit code after Ctrl-C, as in shells
TERMINATED = 143
_GROUP_ALONE: Any = getattr(click.exceptions, "NoArgsIsHelpError", ())
"""Error of click 8.2 and later for a group without a sub-command; older versions print the help themselves."""

OWN = (
    *("completion", "config", "doctor", "drive", "explain", "flash", "goto", "info", "monitor", "names"),
    *("new", "ports", "radio", "record", "serve", "set-id", "system"),
)
"""The sub-commands of this folder: each is a function in a module of its name; `record` is in `monitor`."""


class Commands(click.Group):
    """The sub-commands of this folder, and those that the apps and other packages register."""

    def list_commands(self, ctx: click.Context) -> List[str]:
        """Return the names of all sub-commands, sorted."""
        return sorted(set(OWN) | set(registered("mrl.commands")))

    def get_command(self, ctx: click.Context, cmd_name: str) -> Optional[click.Command]:
        """Import and return the sub-command with this name."""
        if cmd_name in OWN:
            name = cmd_name.replace("-", "_")
            module = "monitor" if name == "record" else name
            own: click.Command = getattr(importlib.import_module(f"mrl_driver.cli.commands.{module}"), name)
            return own
        point = registered("mrl.commands").get(cmd_name)
        return point.load() if point else None

    def resolve_command(
        self, ctx: click.Context, args: List[str]
    ) -> Tuple[Optional[str], Optional[click.Command], List[str]]:
        """Return the sub-command for the arguments; for an unknown name suggest similar ones."""
        if self.get_command(ctx, args[0]) is None and not args[0].startswith("-"):
            near = difflib.get_close_matches(args[0], self.list_commands(ctx), 3, 0.5)
            expected = ", ".join(near or self.list_commands(ctx))
            raise click.UsageError(f"there is no command {args[0]!r}, expected {expected}", ctx)
        return super().resolve_command(ctx, args)


def registered(group: str) -> Dict[str, Any]:
    """Return the entry points of all packages in a group, by name."""
    from importlib import metadata

    # Not `entry_points`: there, an old `mrl_driver.egg-info` in the working folder hides the newer one.
    points = (point for each in metadata.distributions() for point in each.entry_points)
    return {point.name: point for point in points if point.group == group}


def _print_version(ctx: click.Context, _: click.Parameter, wanted: bool) -> None:
    if wanted:
        click.echo(f"mrl, version {version()}")
        ctx.exit()


def _completion_of(function: str) -> Callable[[click.Context, click.Parameter, str], List[str]]:
    """Return a completion that calls this function of `shared`, which is imported only when the shell needs it."""

    def complete(ctx: click.Context, param: click.Parameter, incomplete: str) -> List[str]:
        found: List[str] = getattr(importlib.import_module("mrl_driver.cli.commands.shared"), function)(
            ctx, param, incomplete
        )
        return found

    return complete


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.option(
    "--port",
    metavar="PORT",
    help="Serial port, for every command that needs one.",
    shell_complete=_completion_of("complete_port"),
)
@click.option(
    "--robot",
    metavar="ROBOT",
    help="Named robot, robot model or .yaml file, for every command that needs one.",
    shell_complete=_completion_of("complete_robot"),
)
@click.option(
    "--version",
    is_flag=True,
    expose_value=False,
    is_eager=True,
    callback=_print_version,
    help="Show the version.",
)
def cli(port: Optional[str], robot: Optional[str]) -> None:
    """Drive and watch TraxBot, StingBot and other Arduino robots.

    \b
    Where to begin:
      mrl ports                            list the serial ports
      mrl doctor --port /dev/ttyACM0       check computer, cable and robot
      mrl monitor --port /dev/ttyACM0      watch the robot, and drive it with the keyboard
      mrl web --port /dev/ttyACM0          the same on a web page, also for a phone
      mrl names add lab3 --port /dev/ttyACM0    give the robot a name; then: mrl --robot lab3 info
      mrl new                              make a robot of your own, with motors on an H-bridge
      mrl demo                             no board? drives an emulated robot; mrl demo --web on a page
      mrl-sim --link ttySIM0               serves one; in another terminal: mrl doctor --port ttySIM0
    \b
    Exit codes:
      0 success                  1 a fault found, or another error   2 a wrong option or file
      3 no such port             4 no permission for the port        5 the port is in use
      6 the port was unplugged   7 not a robot                       8 a different robot
      9 the battery is empty    10 the board does not answer        11 the board refused
     12 an invalid command      13 an error of the emulator         14 a wheel or its wires
     15 a file or the output cannot be written                     16 a goal not reached
    130 Ctrl-C, or you answered no
    """


def _terminate(*_: Any) -> None:
    raise SystemExit(TERMINATED)


def main(args: Optional[Sequence[str]] = None) -> None:
    """Run `mrl`; always raises SystemExit.  After a signal the robot is stopped first."""
    handle_end_signals(_terminate, (signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT))
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal without such characters shows `?`
    words = list(sys.argv[1:] if args is None else args)
    asked_by_shell = "_MRL_COMPLETE" in os.environ
    if words[:1] in ([], ["help"]) and not asked_by_shell:
        words = [*words[1:], "--help"]
    try:
        with shortages("this command cannot go on", MrlError):
            sys.exit(cli.main(words, prog_name="mrl", standalone_mode=False) or 0)
    except click.ClickException as error:
        if isinstance(error, _GROUP_ALONE):
            click.echo(error.format_message())
            sys.exit(0)
        _print_error(_one_line(error))
        sys.exit(error.exit_code)
    except (click.Abort, KeyboardInterrupt) as error:
        _print_error(str(error) or str(error.__context__ or "") or "interrupted")  # click's Abort has no text
        sys.exit(INTERRUPTED)
    except MrlError as error:
        _print_error(error.line)
        sys.exit(error.exit_code)
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(1)
    except OSError as error:
        what = f"{error.filename} cannot be used" if error.filename else "the output cannot be written"
        text = f"{what}: {error.strerror or error}; free disk space, or choose another folder"
        _print_error(OutputError(text).line)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # otherwise Python reports the error again at exit
        sys.exit(OutputError.exit_code)


def _one_line(error: click.ClickException) -> str:
    text = in_plain_words(" ".join(error.format_message().split()))
    ctx = getattr(error, "ctx", None)
    return f"{text[:1].lower()}{text[1:].rstrip('.')}; see: {ctx.command_path if ctx else 'mrl'} --help"


def _print_error(text: str) -> None:
    click.echo(f"mrl: {text}", err=True)
