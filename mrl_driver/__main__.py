"""`python -m mrl_driver` is the command `mrl`."""

import signal
import sys


def main() -> None:
    """Runs `mrl`; Ctrl-C while it still loads ends it without a word, a package that is missing costs a line."""
    before = signal.getsignal(signal.SIGINT)
    if before is signal.default_int_handler:  # else a shell has it ignored, for a program in the background
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        from .cli.main import main as run
    except ModuleNotFoundError as error:
        sys.exit(
            f"mrl: the Python package {error.name} is missing; install it with: sudo apt install python3-{error.name}, "
            f"or: pip install {error.name}"
        )

    signal.signal(signal.SIGINT, before)
    run()


if __name__ == "__main__":
    main()
