"""YAML files that users write: each fault is an error in one line, with the file and, if known, the line number."""

from functools import lru_cache
from typing import Any

from .errors import ConfigError

_DEEPEST = 10
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
        ConfigError: it is not YAML, a value does not fit its tag, a mapping has a key twice, or the nesting is deeper
            than 10.
    """
    with open(path, encoding="utf-8") as file:
        import yaml  # late: most users have no such file, and the import takes a tenth of a short command's time

        try:
            text = file.read()
            _check_depth(path, text)
            return yaml.load(text, Loader=_loader())
        except yaml.MarkedYAMLError as error:
            mark = error.problem_mark or error.context_mark
            where = f"line {mark.line + 1}: " if mark else ""
            raise ConfigError(f"{path}: {where}no YAML: {error.problem or error.context}") from None
        except (yaml.YAMLError, ValueError) as error:  # ValueError: not text
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
