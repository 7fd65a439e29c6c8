"""`python -m mrl_driver` is the command `mrl`."""

import signal


def main() -> None:
    """Runs `mrl`; Ctrl-C while it still loads ends it without a word."""
    before = signal.getsignal(signal.SIGINT)
    if before is signal.default_int_handler:  # else a shell has it ignored, for a program in the background
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from .cli import main as run

    signal.signal(signal.SIGINT, before)
    run()


if __name__ == "__main__":
    main()
