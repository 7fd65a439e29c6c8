"""`python -m mrl_driver` is the command `mrl`."""

from mrl_driver.program import start


def main() -> None:
    """Run `mrl`."""
    start("mrl", "mrl_driver.cli.main")


if __name__ == "__main__":
    main()
