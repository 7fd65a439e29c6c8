"""Commands that report an error as one line on stderr, and end with its exit code."""

import sys
from typing import Any

import click

from mrl_driver.errors import MrlError, SimulatorError, shortages
from mrl_driver.program import in_plain_words


class OneLine(click.Command):
    """A click command without tracebacks."""

    def main(self, *args: Any, **kwargs: Any) -> Any:
        """Like click's method, but an error prints one line."""
        try:
            with shortages("the emulator cannot go on", SimulatorError):
                super().main(*args, **{**kwargs, "standalone_mode": False})
        except (MrlError, click.ClickException) as error:
            text = error.format_message() if isinstance(error, click.ClickException) else str(error)
            click.echo(f"{self.name}: {in_plain_words(' '.join(text.split()))}", err=True)
            sys.exit(error.exit_code)
        except OSError as error:
            click.echo(f"{self.name}: {error}; the last lines of the log are lost", err=True)
            sys.exit(SimulatorError.exit_code)
        except (click.Abort, KeyboardInterrupt):
            sys.exit(130)
