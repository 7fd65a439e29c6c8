"""`python -m mrl_driver` is the command `mrl`."""

from typing import Callable

from mrl_driver.program import start


def _load() -> Callable[[], None]:
    from mrl_driver.cli.main import main as run

    return run


def main() -> None:
    """Run `mrl`."""
    start("mrl", _load)


if __name__ == "__main__":
    main()
