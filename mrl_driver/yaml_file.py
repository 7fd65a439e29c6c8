"""YAML files that users write: each fault is an error in one line, with the file and, if known, the line number."""

import re
from functools import lru_cache
from typing import Any, Container, Dict, List, Mapping, Optional, Sequence, Tuple

from .errors import ConfigError
from .files import read_plain

_DEEPEST = 10
_LONGEST = 1 << 19
"""Longest file accepted [byte]; those of users have a few thousand, and PyYAML without libyaml takes 10 s for this."""
_LONGEST_NUMBER = 500
"""Longest number, date and so on accepted [characters]: Python takes long to read very long ones, or refuses."""
_STRING = "tag:yaml.org,2002:str"
_NOT_DECIMAL = re.compile(r"[-+]?0[0-9_]+|.*:.*")
"""Numbers in base 8 and 60, such as 0700 (448) and 7:17 (437): nobody means them, and YAML 1.2 has neither."""
_MOST_VALUES = 1 << 20  # most values accepted, with those behind an alias counted each time it stands
_MOST_SHOWN = 80  # longest value or key in a message [characters]


def read_expected(path: str, expected: str) -> Any:
    """As `read`, for a file that must exist: ConfigError, with what is `expected`, if it cannot be opened."""
    try:
        return read(path)
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}, expected {expected}") from None


def read(path: str) -> Any:
    """Return the content of a YAML file.

    Raises:
        OSError: the file cannot be opened, is not a plain file, or is longer than 512 KiB.
        ConfigError: it is not YAML, a value does not fit its tag, a mapping has a key twice, the nesting is deeper
            than 10, a number has more than 500 characters, or its aliases stand for more than a million values.
    """
    try:
        return parse(read_plain(path, _LONGEST).decode("utf-8"), path)
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: no YAML: {error}") from None


def parse(text: str, path: str) -> Any:
    """Return the content of a text in YAML; raise ConfigError as `read`, in which `path` names it."""
    import yaml  # late: most users have no such file, and the import takes a tenth of a short command's time

    try:
        _check_size(path, text)
        return yaml.load(text, Loader=_loader())
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"line {mark.line + 1}: " if mark else ""
        if mark and "\t" in "".join(text.splitlines()[mark.line : mark.line + 1]):
            raise ConfigError(f"{path}: {where}no YAML: a tab, expected spaces") from None
        raise ConfigError(f"{path}: {where}no YAML: {_cut(str(error.problem or error.context))}") from None
    except yaml.YAMLError as error:
        raise ConfigError(f"{path}: no YAML: {_cut(' '.join(str(error).split()))}") from None


def _check_size(path: str, text: str) -> None:
    """Check depth and size first.

    Loaders recurse: thousands of brackets would crash them, or the whole program.  A few aliases of aliases stand for
    more values than any memory has.
    """
    import yaml

    anchors: Dict[Optional[str], Tuple[int, int]] = {}
    names: List[Optional[str]] = []  # the anchors of the collections that are read
    sizes = [[1, 0]]  # how many values are in each of them, and how deep the deepest is
    events: Any = yaml.parse(text, Loader=_loader())
    for event in events:
        found = (0, 0)
        if isinstance(event, yaml.AliasEvent):
            found = anchors.get(event.anchor, (1, 0))
        elif isinstance(event, yaml.ScalarEvent):
            found = (1, 0)
        elif isinstance(event, yaml.CollectionStartEvent):
            names.append(event.anchor)
            sizes.append([1, 0])
        elif isinstance(event, yaml.CollectionEndEvent):
            values, height = sizes.pop()
            anchors[names.pop()] = found = values, height + 1
        sizes[-1] = [sizes[-1][0] + found[0], max(sizes[-1][1], found[1])]
        line = event.start_mark.line + 1
        if len(sizes) - 1 + sizes[-1][1] > _DEEPEST:
            raise ConfigError(f"{path}: line {line}: no YAML of this kind is nested deeper than {_DEEPEST}")
        if sizes[-1][0] > _MOST_VALUES:
            raise ConfigError(f"{path}: line {line}: aliases stand for more than {_MOST_VALUES} values")


@lru_cache(maxsize=None)
def _loader() -> Any:
    """Return a safe loader that names the line of each fault; uses libyaml if present, which is ten times as fast."""
    import yaml

    base: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

    class Loader(base):
        def construct_object(self, node: Any, deep: bool = False) -> Any:
            scalar = isinstance(node, yaml.ScalarNode) and node.tag != _STRING
            if scalar and len(node.value) > _LONGEST_NUMBER:
                raise _fault(node, f"{len(node.value)} characters are too many for {node.tag}")
            try:
                found = super().construct_object(node, deep=deep)
                if isinstance(found, (int, float)) and _NOT_DECIMAL.fullmatch(node.value):
                    raise _fault(
                        node, f"{node.value} means {found:g} in base 8 or 60, expected a decimal number"
                    )
                return found
            except yaml.YAMLError:
                raise
            except Exception:  # noqa: BLE001 - the constructors of tags raise whatever comes
                raise _fault(node, f"{short(node.value)} does not fit its tag {node.tag}") from None

        def construct_mapping(self, node: Any, deep: bool = False) -> Any:
            seen = set()
            for key, _ in node.value if isinstance(node, yaml.MappingNode) else ():
                if isinstance(key, yaml.ScalarNode) and key.value in seen:
                    raise _fault(key, f"the key {short(key.value)} stands twice")
                if isinstance(key, yaml.ScalarNode):
                    seen.add(key.value)
            return super().construct_mapping(node, deep=deep)

    def _fault(node: Any, text: str) -> Exception:
        return yaml.constructor.ConstructorError(None, None, text, node.start_mark)

    return Loader


def short(value: Any) -> str:
    """Return a value as text for a message, at most 80 characters."""
    return _cut(repr(value))


def _cut(text: str) -> str:
    return text if len(text) <= _MOST_SHOWN else f"{text[: _MOST_SHOWN - 3]}..."


class Reader:
    """Checks values from a parsed file.

    Each method returns the value, or raises ConfigError with the file, the key, the value and what was expected.  `key`
    is the place of the value, such as `drive.turn_slip`; "" is the whole file.
    """

    def __init__(self, path: str) -> None:
        self.path = path

    def fail(self, key: str, got: Any, expected: str) -> ConfigError:
        """Return the error for a value."""
        what = "empty" if got is None else short(got)
        return ConfigError(f"{self.path}: {_cut(key) or 'file'} is {what}, expected {expected}")

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
                raise ConfigError(
                    f"{self.path}: key {_cut(f'{prefix}{name}')} is unknown, expected {', '.join(known)}"
                )
        for name in known:
            if name not in found and name not in optional:
                raise ConfigError(f"{self.path}: key {prefix}{name} is missing")
        return found


def is_number(value: Any, low: float, high: float) -> bool:
    """Return whether the value is a number between two others, both included; true and false are not."""
    return isinstance(value, (int, float)) and not isinstance(value, bool) and low <= value <= high
