"""YAML files that users write: each fault is an error in one line, with the file and, if known, the line number."""

from functools import lru_cache
from typing import Any, Container, Mapping, Sequence

from .errors import ConfigError

_DEEPEST = 10
_LONGEST = 1 << 20
"""Longest file accepted [characters]; those of users have a few thousand."""
_LONGEST_BITS = 2048
"""Longest number accepted [bit]; Python refuses to print very long ones."""


def read_expected(path: str, expected: str) -> Any:
    """As `read`, for a file that must exist; `expected` describes it in the error.

    Raises:
        ConfigError: as `read`, or the file cannot be opened.
    """
    try:
        return read(path)
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}, expected {expected}") from None


def read(path: str) -> Any:
    """Return the content of a YAML file.

    Raises:
        OSError: the file cannot be opened.
        ConfigError: it is not YAML, a value does not fit its tag, a mapping has a key twice, the nesting is deeper
            than 10, or the file is longer than a million characters.
    """
    with open(path, encoding="utf-8") as file:
        try:
            text = file.read(_LONGEST + 1)
        except ValueError as error:
            raise ConfigError(f"{path}: no YAML: {error}") from None
    if len(text) > _LONGEST:
        raise ConfigError(f"{path}: longer than {_LONGEST} characters, expected a YAML file written by hand")
    return parse(text, path)


def parse(text: str, path: str) -> Any:
    """Return the content of a text in YAML; `path` names it in errors.

    Raises:
        ConfigError: as `read`.
    """
    import yaml  # late: most users have no such file, and the import takes a tenth of a short command's time

    try:
        _check_depth(path, text)
        return yaml.load(text, Loader=_loader())
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"line {mark.line + 1}: " if mark else ""
        raise ConfigError(f"{path}: {where}no YAML: {error.problem or error.context}") from None
    except yaml.YAMLError as error:
        raise ConfigError(f"{path}: no YAML: {' '.join(str(error).split())}") from None


def _check_depth(path: str, text: str) -> None:
    """Check the depth first, because loaders recurse: thousands of brackets would crash them, or the whole program."""
    import yaml

    depth = 0
    events: Any = yaml.parse(text, Loader=_loader())
    for event in events:
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > _DEEPEST:
            line = event.start_mark.line + 1
            raise ConfigError(f"{path}: line {line}: no YAML of this kind is nested deeper than {_DEEPEST}")


@lru_cache(maxsize=None)
def _loader() -> Any:
    """Return a safe loader that names the line of each fault; uses libyaml if present, which is ten times as fast."""
    import yaml

    base: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

    class Loader(base):
        def construct_object(self, node: Any, deep: bool = False) -> Any:
            try:
                value = super().construct_object(node, deep=deep)
            except yaml.YAMLError:
                raise
            except Exception:  # noqa: BLE001 - the constructors of tags raise whatever comes
                raise _fault(node, f"{short(node.value)} does not fit its tag {node.tag}") from None
            if isinstance(value, int) and value.bit_length() > _LONGEST_BITS:
                raise _fault(node, f"a number of {value.bit_length()} bits is too large")
            return value

        def construct_mapping(self, node: Any, deep: bool = False) -> Any:
            seen = set()
            for key, _ in node.value if isinstance(node, yaml.MappingNode) else ():
                if isinstance(key, yaml.ScalarNode) and key.value in seen:
                    raise _fault(key, f"the key {key.value!r} stands twice")
                if isinstance(key, yaml.ScalarNode):
                    seen.add(key.value)
            return super().construct_mapping(node, deep=deep)

    def _fault(node: Any, text: str) -> Exception:
        return yaml.constructor.ConstructorError(None, None, text, node.start_mark)

    return Loader


def short(value: Any) -> str:
    """Return a value as text for a message, at most 80 characters."""
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:77]}..."


class Reader:
    """Checks values from a parsed file.

    Each method returns the value, or raises ConfigError with the file, the key, the value and what was expected.  `key`
    is the place of the value, such as `drive.turn_slip`; "" is the whole file.
    """

    def __init__(self, path: str) -> None:
        self.path = path

    def fail(self, key: str, got: Any, expected: str) -> ConfigError:
        """Return the error for a value."""
        return ConfigError(f"{self.path}: {key or 'file'} is {short(got)}, expected {expected}")

    def mapping(
        self, key: str, value: Any, expected: str = "a mapping of keys to values"
    ) -> Mapping[str, Any]:
        """Check for a mapping."""
        if not isinstance(value, dict):
            raise self.fail(key, value, expected)
        return value

    def keys(
        self, key: str, value: Any, known: Sequence[str], optional: Container[str] = ()
    ) -> Mapping[str, Any]:
        """Check for a mapping that has only `known` keys, and all of them that are not `optional`."""
        found = self.mapping(key, value)
        prefix = f"{key}." if key else ""
        for name in found:
            if name not in known:
                raise ConfigError(f"{self.path}: key {prefix}{name} is unknown, expected {', '.join(known)}")
        for name in known:
            if name not in found and name not in optional:
                raise ConfigError(f"{self.path}: key {prefix}{name} is missing")
        return found

    def number(self, key: str, value: Any, low: float, high: float) -> float:
        """Check for a number between two others, both included."""
        if not is_number(value, low, high):
            raise self.fail(key, value, f"a number from {low:g} to {high:g}")
        return float(value)

    def whole(self, key: str, value: Any, low: int, high: int) -> int:
        """Check for a whole number between two others, both included."""
        if not isinstance(value, int) or not is_number(value, low, high):
            raise self.fail(key, value, f"a whole number from {low} to {high}")
        return value

    def flag(self, key: str, value: Any) -> bool:
        """Check for true or false."""
        if not isinstance(value, bool):
            raise self.fail(key, value, "true or false")
        return value

    def text(self, key: str, value: Any, expected: str = "a name") -> str:
        """Check for a text that is not empty."""
        if not isinstance(value, str) or not value:
            raise self.fail(key, value, expected)
        return value


def is_number(value: Any, low: float, high: float) -> bool:
    """Return whether the value is a number between two others, both included; true and false are not."""
    return isinstance(value, (int, float)) and not isinstance(value, bool) and low <= value <= high
