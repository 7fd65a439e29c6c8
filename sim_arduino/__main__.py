"""`python -m sim_arduino` is the command `mrl-sim`."""

from mrl_driver.program import start


def main() -> None:
    """Run `mrl-sim`."""
    start("mrl-sim", "sim_arduino.serve.main")


if __name__ == "__main__":
    main()
