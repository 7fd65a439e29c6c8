"""Starts the programs in the folder `nodes`."""

import os
import signal
import sys
from pathlib import Path

from mrl_driver import program
from mrl_driver.errors import MrlError


def start(module: str, venv: bool = False) -> None:
    """Run the function `main` of a module, and exit with the code that it returns, or with that of its error.

    With `venv`, see `use_virtual_environment`.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # until the node takes over, Ctrl-C shows no traceback
    name = os.path.basename(sys.argv[0])
    if venv:
        use_virtual_environment()
    try:
        sys.exit(program.start(name, module))
    except MrlError as error:
        sys.stderr.write(f"{name}: {error.line}\n")
        sys.exit(error.exit_code)


def use_virtual_environment() -> None:
    """In a checkout, go on with the Python of its virtual environment, if there is one: it has numpy."""
    venv = Path(__file__).resolve().parents[2] / ".venv"
    python = str(venv / "bin" / "python")
    if os.access(python, os.X_OK) and Path(sys.prefix).resolve() != venv.resolve():
        os.execv(python, [python, *sys.argv])
