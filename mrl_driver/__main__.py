"""`python -m mrl_driver` is the command `mrl`."""

from .cli import main

if __name__ == "__main__":
    main()
