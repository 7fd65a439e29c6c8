"""Saves and restores a graph of objects in place, and renders it as a key.

Objects keep their identity, so that bound methods and references from outside stay valid.  What is not an object of
this project, a list, a dictionary, a set, a deque or a bytearray is a constant.
"""

from collections import deque
from typing import Any, Callable, Dict, FrozenSet, List, Tuple

Saved = List[Tuple[Any, Any]]
_PACKAGES = ("mrl_driver.", "ros1_bridge.", "tests.long.verify.explorer.")
_TABLES = ("_shapes", "_forms", "_runs", "listeners", "_ignored", "_names")  # Attributes that never change
_CONSTANT, _OBJECT, _LIST, _DICT, _SET, _BYTES, _TUPLE, _DEQUE = range(8)
_KINDS: Dict[type, int] = {
    **dict.fromkeys((int, float, str, bytes, bool, type(None), frozenset), _CONSTANT),
    list: _LIST,
    dict: _DICT,
    set: _SET,
    bytearray: _BYTES,
    tuple: _TUPLE,
    deque: _DEQUE,
}


def _kind(kind: type) -> int:
    found = _CONSTANT
    own = getattr(kind, "__module__", "").startswith(_PACKAGES)
    if (
        own
        and not issubclass(kind, tuple)
        and not hasattr(kind, "CONSTANT")
        and not issubclass(kind, BaseException)
    ):
        found = _OBJECT
    _KINDS[kind] = found
    return found


def save(roots: Tuple[Any, ...]) -> Saved:
    """Return the contents of all objects that can be reached from these."""
    saved: Saved = []
    seen = set()
    waiting: List[Any] = list(roots)
    kinds = _KINDS
    while waiting:
        each = waiting.pop()
        kind = kinds.get(type(each))
        if kind is None:
            kind = _kind(type(each))
        if kind == _CONSTANT or id(each) in seen:
            continue
        if kind == _TUPLE:
            waiting.extend(each)
            continue
        seen.add(id(each))
        if kind == _OBJECT:
            content: Any = each.__dict__.copy()
            for name, value in content.items():
                inner = kinds.get(type(value))
                if (inner is None or inner) and name not in _TABLES:
                    waiting.append(value)
        elif kind == _DICT:
            content = each.copy()
            waiting.extend(content.values())
        elif kind == _LIST:
            content = each[:]
            waiting.extend(content)
        else:
            content = each.copy()
        saved.append((each, content))
    return saved


def restore(saved: Saved) -> None:
    for each, content in saved:
        kind = _KINDS[type(each)]
        if kind == _OBJECT:
            own = each.__dict__
            own.clear()
            own.update(content)
        elif kind in (_LIST, _BYTES):
            each[:] = content
        else:
            each.clear()
            if kind == _DEQUE:
                each.extend(content)
            else:
                each.update(content)


class Keys:
    """Renders graphs of objects as keys.

    Args:
        ignored: attributes that are not in the key: "Class.attribute" or "Class" for all of a class.
        age: rounds a time for the key.
    """

    def __init__(self, ignored: FrozenSet[str], age: Callable[[float], int]) -> None:
        self._ignored, self._age = ignored, age
        self._names: Dict[Tuple[type, int], Tuple[Tuple[str, bool], ...]] = {}

    def names_of(self, each: Any) -> Tuple[Tuple[str, bool], ...]:
        """Return the attributes in the key, and whether each is a time."""
        kind = type(each)
        found = self._names.get((kind, len(each.__dict__)))
        if found is None:
            name = kind.__name__
            own = [] if name in self._ignored else sorted(set(each.__dict__) - set(_TABLES))
            found = tuple(
                (attribute, attribute.endswith("_s") or attribute == "_fade")
                for attribute in own
                if f"{name}.{attribute}" not in self._ignored
            )
            self._names[kind, len(each.__dict__)] = found
        return found

    def key(self, root: Any, now: float) -> Tuple[Any, ...]:
        """Return the key of an object and of all that it refers to."""
        return self._object(root, now, set())

    def _object(self, each: Any, now: float, seen: Any) -> Tuple[Any, ...]:
        if id(each) in seen:
            return ()
        seen.add(id(each))
        values = each.__dict__
        kinds, age = _KINDS, self._age
        found: List[Any] = []
        for name, is_time in self.names_of(each):
            value = values[name]
            kind = kinds.get(type(value))
            if kind is None:
                kind = _kind(type(value))
            if kind == _CONSTANT:
                if is_time and type(value) is float:
                    value = age(now - value)
                elif callable(value) or isinstance(value, BaseException):
                    value = type(value)
                found.append(value)
            else:
                found.append(self._value(value, kind, is_time, now, seen))
        return tuple(found)

    def _value(self, value: Any, kind: int, is_time: bool, now: float, seen: Any) -> Any:
        if kind == _OBJECT:
            return self._object(value, now, seen)
        if kind == _TUPLE:
            return value
        if kind == _BYTES:
            return bytes(value)
        if kind == _SET:
            return tuple(sorted(value))
        if kind == _DICT:
            return tuple(sorted(value.items(), key=str))
        return tuple(
            self._value(each, _KINDS.get(type(each), _CONSTANT) or _kind(type(each)), is_time, now, seen)
            if _KINDS.get(type(each)) != _CONSTANT
            else each
            for each in value
        )
