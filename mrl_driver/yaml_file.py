"""YAML files that people write, with errors of one line.  Pure but for the reading."""

from typing import Any

from .errors import ConfigError


def read(path: str) -> Any:
    """What a YAML file holds.

    Raises:
        OSError: it cannot be opened.
        ConfigError: it is no YAML, or nested beyond all sense.
    """
    with open(path, encoding="utf-8") as file:
        import yaml  # late: most users have no such file, and it takes a tenth of a short command's time

        try:
            return yaml.safe_load(file)
        except (yaml.YAMLError, ValueError, RecursionError) as error:  # ValueError: no text, or no date
            raise ConfigError(f"{path}: no YAML: {' '.join(str(error).split())}") from None
