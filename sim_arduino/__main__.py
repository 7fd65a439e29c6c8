"""`python -m sim_arduino` is the command `mrl-sim`."""

from typing import Callable

from mrl_driver.program import start


def _load() -> Callable[[], None]:
    from sim_arduino.serve.main import main as run

    return run


def main() -> None:
    """Run `mrl-sim`."""
    start("mrl-sim", _load)


if __name__ == "__main__":
    main()
