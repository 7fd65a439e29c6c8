"""Reading YAML that somebody else wrote: whatever is wrong with it is one line."""

from typing import Any

import yaml

from mrl_driver.errors import ConfigError

_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""Ten times as fast where libyaml is there; it counts in worlds of thousands of walls."""
_DEEPEST = 10


def read(path: str, expected: str) -> Any:
    """What a YAML file says.

    Raises:
        ConfigError: it cannot be read, or is no YAML, or lists are nested more than 10 deep.
    """
    try:
        with open(path, encoding="utf-8") as file:
            text = file.read()
        _demand_flat(path, text)
        return yaml.load(text, Loader=_LOADER)
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}, expected {expected}") from None
    except (yaml.YAMLError, ValueError) as error:
        raise ConfigError(f"{path}: no YAML: {' '.join(str(error).split())}") from None


def _demand_flat(path: str, text: str) -> None:
    """Loaders recurse: thousands of brackets would end them, and libyaml's with the whole program."""
    depth = 0
    events: Any = yaml.parse(text, Loader=_LOADER)
    for event in events:
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > _DEEPEST:
            line = event.start_mark.line + 1
            raise ConfigError(
                f"{path}: line {line} is nested deeper than {_DEEPEST}, expected lists of numbers"
            )


def short(value: Any) -> str:
    """A value for a message, not longer than 80 characters."""
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:77]}..."
