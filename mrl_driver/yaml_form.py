"""The form of a YAML file, as rows: one row checks a value, and gives the JSON Schema by which editors check it.

`read` returns the value, or raises ConfigError with the file, the key, the value and what was expected.  `schema` is of
draft 7, the newest that the YAML plug-in of most editors knows.  A schema refuses nothing that `read` accepts; what
only `read` refuses is in the docstring of the form.
"""

import json
import math
from typing import Any, Callable, Container, Dict, Mapping, NamedTuple, Optional, Tuple

from .yaml_file import Reader, is_number

Schema = Dict[str, Any]
DRAFT = "http://json-schema.org/draft-07/schema#"


class Form:
    """What one value of a file may be."""

    def read(self, reader: Reader, key: str, value: Any) -> Any:
        """Return the value at `key`; raise ConfigError if it does not have this form."""
        raise NotImplementedError

    def schema(self) -> Schema:
        """Return the JSON Schema of the form."""
        raise NotImplementedError


class _Value(Form):
    """A value that is `accepted`; `expected` describes it in the error."""

    def __init__(self, schema: Schema, expected: str, accepted: Callable[[Any], bool]) -> None:
        self._schema, self._expected, self._accepted = schema, expected, accepted

    def read(self, reader: Reader, key: str, value: Any) -> Any:
        if not self._accepted(value):
            raise reader.fail(key, value, self._expected)
        return value

    def schema(self) -> Schema:
        return self._schema


class Number(_Value):
    """A number between two others, both included.  Only `read` refuses NaN."""

    def __init__(self, low: float, high: float) -> None:
        self.low, self.high = low, high
        schema = {"type": "number", "minimum": low, "maximum": high}
        super().__init__(
            schema, f"a number from {low:g} to {high:g}", lambda each: is_number(each, low, high)
        )

    def read(self, reader: Reader, key: str, value: Any) -> float:
        if not self._accepted(value):
            raise reader.fail(key, value, self._expected + _spelling(value))
        return float(value)


class Whole(_Value):
    """A whole number between two others, both included.  Only `read` refuses a spelling with a point, such as 5.0."""

    def __init__(self, low: int, high: int) -> None:
        def accepted(value: Any) -> bool:
            return isinstance(value, int) and is_number(value, low, high)

        schema = {"type": "integer", "minimum": low, "maximum": high}
        super().__init__(schema, f"a whole number from {low} to {high}", accepted)


class Flag(_Value):
    """True or false."""

    def __init__(self) -> None:
        super().__init__({"type": "boolean"}, "true or false", lambda value: isinstance(value, bool))


class Text(_Value):
    """A text that is not empty."""

    def __init__(self, expected: str = "a name") -> None:
        schema = {"type": "string", "minLength": 1}
        super().__init__(schema, expected, lambda value: isinstance(value, str) and value != "")


class Choice(_Value):
    """One of these words; `expected` describes them in the error."""

    def __init__(self, words: Tuple[str, ...], expected: str = "") -> None:
        super().__init__({"enum": list(words)}, expected or " or ".join(words), words.__contains__)


class Numbers(Form):
    """A list with one number for each part, such as [x, y, yaw]; each part has its range."""

    def __init__(self, **parts: Tuple[float, float]) -> None:
        self._parts = parts
        self.meaning = ", ".join(parts)

    def read(self, reader: Reader, key: str, value: Any) -> Tuple[float, ...]:
        if not isinstance(value, list) or len(value) != len(self._parts):
            raise reader.fail(key, value, f"[{self.meaning}], {len(self._parts)} numbers")
        for each, (part, (low, high)) in zip(value, self._parts.items()):
            if not is_number(each, low, high):
                raise reader.fail(
                    key, value, f"[{self.meaning}] with {part} a number from {low:g} to {high:g}"
                )
        return tuple(float(each) for each in value)

    def schema(self) -> Schema:
        items = [{**Number(*limits).schema(), "description": part} for part, limits in self._parts.items()]
        return {"type": "array", "items": items, "minItems": len(items), "maxItems": len(items)}


class Rows(Form):
    """A list of any number of `Numbers`."""

    def __init__(self, row: Numbers) -> None:
        self._row = row

    def read(self, reader: Reader, key: str, value: Any) -> Tuple[Tuple[float, ...], ...]:
        if not isinstance(value, list):
            raise reader.fail(key, value, f"a list of [{self._row.meaning}]")
        return tuple(self._row.read(reader, f"{key}[{i}]", row) for i, row in enumerate(value))

    def schema(self) -> Schema:
        return {"type": "array", "items": self._row.schema()}


class Keys(Form):
    """A mapping with these keys, and all of them that are not `optional`; `read` returns those that are there.

    `texts` describe the keys to editors, `expected` the mapping in the error.  With `or_null`, a key without a value
    counts as left out.
    """

    def __init__(
        self,
        forms: Mapping[str, Form],
        optional: Container[str] = (),
        texts: Optional[Mapping[str, str]] = None,
        expected: str = "a mapping of keys to values",
        or_null: bool = False,
    ) -> None:
        self.forms, self._optional, self._texts = forms, optional, texts or {}
        self._expected, self._or_null = expected, or_null

    def read(self, reader: Reader, key: str, value: Any) -> Dict[str, Any]:
        found = reader.keys(
            key, reader.mapping(key, value, self._expected), tuple(self.forms), self._optional
        )
        prefix = f"{key}." if key else ""
        return {
            name: form.read(reader, f"{prefix}{name}", found[name])
            for name, form in self.forms.items()
            if name in found and not (self._or_null and found[name] is None)
        }

    def schema(self) -> Schema:
        return {
            "type": "object",
            "properties": {name: self._described(name, form) for name, form in self.forms.items()},
            "required": [name for name in self.forms if name not in self._optional],
            "additionalProperties": False,
        }

    def _described(self, name: str, form: Form) -> Schema:
        found = form.schema()
        if self._or_null:
            found = {**found, "type": [found["type"], "null"]}
        return {**found, "description": self._texts[name]} if name in self._texts else found


class Section(Keys):
    """A mapping with the fields of a named tuple, which `read` returns; fields with a default are optional.

    The docstrings of the fields describe them to the reader of the file.
    """

    def __init__(self, kind: Callable[..., Any], forms: Mapping[str, Form]) -> None:
        super().__init__(forms, kind._field_defaults)  # type: ignore[attr-defined]
        self._kind = kind

    def read(self, reader: Reader, key: str, value: Any) -> Any:
        return self._kind(**super().read(reader, key, value))

    def schema(self) -> Schema:
        text = " ".join((self._kind.__doc__ or "").split("\n\n")[0].split())
        self._texts = field_texts(self._kind)
        return {"description": text, **super().schema()}


class Condition(NamedTuple):
    """The value at the place of these keys is one of `values`; with `or_absent` it may also be left out.

    Without `values`, any value that is there meets the condition.
    """

    place: Tuple[str, ...]
    values: Tuple[Any, ...] = ()
    or_absent: bool = False

    def value(self, data: Any) -> Any:
        """Return the value at the place, or None if a key is left out."""
        for name in self.place:
            data = data.get(name) if isinstance(data, dict) else None
        return data

    def is_met(self, data: Any) -> bool:
        """Return whether a file's content meets the condition."""
        found = self.value(data)
        if found is None:
            return self.or_absent
        return not self.values or found in self.values

    def schema(self) -> Schema:
        """Return the JSON Schema of all files that meet the condition."""
        found: Schema = {"enum": list(self.values)} if self.values else {}
        optional = self.or_absent
        for name in reversed(self.place):
            found = {"properties": {name: found}, **({} if optional else {"required": [name]})}
        return found


class Rule(NamedTuple):
    """Where a file meets `when`, it must meet `then`; `expected` describes that in the error."""

    when: Condition
    then: Condition
    expected: str

    def check(self, reader: Reader, data: Any) -> None:
        """Raise ConfigError if a file's content breaks the rule."""
        if self.when.is_met(data) and not self.then.is_met(data):
            raise reader.fail(".".join(self.then.place), self.then.value(data), self.expected)

    def schema(self) -> Schema:
        """Return the JSON Schema of all files that keep the rule."""
        return {"if": self.when.schema(), "then": self.then.schema()}


def _spelling(value: Any) -> str:
    """Return how YAML takes a text such as `0,15` or `1e-1` as a number; empty if it is not meant as one."""
    try:
        number = float(value.replace(",", ".")) if isinstance(value, str) else math.nan
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        return ""
    digits = repr(number)
    if "e" in digits and "." not in digits:
        digits = digits.replace("e", ".0e")
    return f"; write {digits}"


def field_texts(kind: Any) -> Dict[str, str]:
    """Return the docstrings of a class's fields, by name, in one line each."""
    import ast  # late: only the generator of the schemas is here
    import inspect
    import textwrap

    (tree,) = ast.parse(textwrap.dedent(inspect.getsource(kind))).body
    assert isinstance(tree, ast.ClassDef)
    texts = {}
    for field, after in zip(tree.body, tree.body[1:]):
        if isinstance(field, ast.AnnAssign) and isinstance(after, ast.Expr):
            assert isinstance(field.target, ast.Name)
            texts[field.target.id] = " ".join(ast.literal_eval(after.value).split())
    return texts


def schema_text(title: str, schema: Schema) -> str:
    """Return a JSON Schema as the text of a file."""
    return json.dumps({"$schema": DRAFT, "title": title, **schema}, indent=1) + "\n"


def schema_line(schema_path: str) -> str:
    """Return the first line of a YAML file; by it, editors find the file's schema."""
    return f"# yaml-language-server: $schema={schema_path}"


def with_schema_line(text: str, schema_path: str) -> str:
    """Return the text of a YAML file with another path in its `schema_line`; a text without that line as it is."""
    first, end, rest = text.partition("\n")
    is_line = first.startswith(schema_line(""))
    return schema_line(schema_path) + end + rest if is_line else text
