"""Small changes to Python source, one at a time: comparisons, arithmetic, constants, conditions, returns, statements.

`mutants_of` lists them, `compiled` makes the code of one.  Nothing here runs anything.

Not changed: docstrings, annotations, texts of errors and f-strings, names, and what only reads better
(`assert`, `__all__`, keys of type variables).
"""

import ast
from types import CodeType
from typing import Any, Callable, Dict, Iterator, List, NamedTuple, Optional, Tuple

_COMPARISONS = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
}  # fmt: skip
_ARITHMETIC = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult, ast.Pow: ast.Mult, ast.LShift: ast.RShift, ast.RShift: ast.LShift, ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd, ast.BitXor: ast.BitAnd,
}  # fmt: skip
_UNCHANGED_CALLS = ("TypeVar", "NewType")
_ERRORS = ("Error", "Timeout", "NotARobot", "WrongRobot")


class Mutant(NamedTuple):
    """One change: `set_new` and `set_old` put it into the tree and take it out again."""

    key: str
    """Names the change without line numbers: `<function>: <before> -> <after> #<n-th in that function>`."""
    line: int
    kind: str
    before: str
    after: str
    last_line: int
    """The statement that is changed runs from `first_line` to here, without the body of an `if` or a loop."""
    first_line: int
    in_function: bool
    """The change is in the body of a function, so that it is made by exchanging the function's code."""
    set_new: Callable[[], None]
    set_old: Callable[[], None]


class _Change(NamedTuple):
    kind: str
    node: ast.AST
    before: str
    after: str
    set_new: Callable[[], None]
    set_old: Callable[[], None]


def mutants_of(tree: ast.Module) -> List[Mutant]:
    """Return all mutants of a module, in the order of its source."""
    found: List[Mutant] = []
    seen: Dict[str, int] = {}
    for scope, in_function, (first, last), change in _walk(tree, "", False, (1, 1)):
        text = f"{scope or '<module>'}: {change.before} -> {change.after}"
        seen[text] = seen.get(text, 0) + 1
        found.append(
            Mutant(
                f"{text} #{seen[text]}",
                change.node.lineno,  # type: ignore[attr-defined]
                change.kind,
                change.before,
                change.after,
                last,
                first,
                in_function,
                change.set_new,
                change.set_old,
            )
        )
    return found


def compiled(tree: ast.Module, mutant: Mutant, filename: str) -> CodeType:
    """Return the code of the module with this mutant; the tree is as before afterwards."""
    mutant.set_new()
    try:
        return compile(tree, filename, "exec", dont_inherit=True)
    finally:
        mutant.set_old()


Lines = Tuple[int, int]


def _walk(
    node: ast.AST, scope: str, in_function: bool, lines: Lines
) -> Iterator[Tuple[str, bool, Lines, _Change]]:
    if isinstance(node, ast.stmt):
        lines = _lines(node)
    named = isinstance(node, (ast.FunctionDef, ast.ClassDef))
    inner = (f"{scope}.{node.name}" if scope else node.name) if named else scope  # type: ignore[attr-defined]
    for change in _changes(node):
        if isinstance(change.node, ast.stmt) and change.node is not node:  # a statement that is dropped
            inside = in_function or isinstance(node, ast.FunctionDef)
            yield inner, inside, _lines(change.node), change
        else:
            yield scope, in_function, lines, change
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "type_comment"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if not isinstance(child, ast.AST) or _left_out(child):
                continue
            inside = in_function or (isinstance(node, ast.FunctionDef) and name == "body")
            yield from _walk(child, inner, inside, lines)


def _lines(node: Any) -> Lines:
    """The first and the last line of a statement; without the body of a compound one."""
    body = getattr(node, "body", None)
    last = max(node.lineno, body[0].lineno - 1) if isinstance(body, list) else node.end_lineno
    return node.lineno, last


def _left_out(node: ast.AST) -> bool:
    """Whether nothing in this part of a tree is changed."""
    if isinstance(node, (ast.JoinedStr, ast.Assert, ast.Import, ast.ImportFrom)):
        return True
    if isinstance(node, ast.Expr):
        return isinstance(node.value, ast.Constant)  # docstrings
    if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
        return node.targets[0].id == "__all__" or _is_type(node.value)
    return isinstance(node, ast.Call) and _name(node.func).endswith((*_UNCHANGED_CALLS, *_ERRORS))


def _is_type(node: ast.AST) -> bool:
    """Whether the value of an assignment is a type, such as `Tuple[int, ...]`."""
    return isinstance(node, ast.Subscript) and _name(node.value) in (
        "Tuple", "List", "Dict", "Callable", "Union", "Optional", "Sequence", "Iterator",
    )  # fmt: skip


def _name(node: ast.AST) -> str:
    return node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""


def _changes(node: ast.AST) -> Iterator[_Change]:
    """Yield the changes of this node itself, and of those of its children that it decides about."""
    if isinstance(node, ast.Compare):
        yield from _compared(node)
    elif isinstance(node, (ast.BinOp, ast.AugAssign)) and type(node.op) in _ARITHMETIC:
        if not (isinstance(node, ast.BinOp) and _is_text(node.left)):
            yield _swap("arithmetic", node, "op", _ARITHMETIC[type(node.op)]())
    elif isinstance(node, ast.BoolOp):
        yield _swap("boolean", node, "op", ast.Or() if isinstance(node.op, ast.And) else ast.And())
    if isinstance(node, (ast.If, ast.While, ast.IfExp)) and not _is_negated(node.test):
        yield _negated(node)
    if isinstance(node, ast.Return) and node.value is not None and not _is_none(node.value):
        yield _swap("return", node, "value", ast.Constant(None))
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns"):
            continue
        for index, child in enumerate(value if isinstance(value, list) else [value]):
            if not isinstance(child, ast.AST):
                continue
            new = _replacement(child) if not _is_error(node) else None
            if new is not None:
                yield _put(new[0], node, name, index if isinstance(value, list) else None, child, new[1])


def _compared(node: ast.Compare) -> Iterator[_Change]:
    for index, op in enumerate(node.ops):
        yield _put("comparison", node, "ops", index, op, _COMPARISONS[type(op)]())


def _is_negated(test: ast.AST) -> bool:
    """Whether another change of the condition does the same as its negation."""
    if isinstance(test, ast.UnaryOp):
        return isinstance(test.op, ast.Not)
    return (
        isinstance(test, ast.Compare)
        and len(test.ops) == 1
        and isinstance(test.ops[0], (ast.Eq, ast.NotEq, ast.Is, ast.IsNot, ast.In, ast.NotIn))
    )


def _is_error(node: ast.AST) -> bool:
    """Whether a node makes an error, whose text is not changed."""
    return isinstance(node, ast.Call) and _name(node.func).endswith(_ERRORS)


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.JoinedStr) or (
        isinstance(node, ast.Constant) and isinstance(node.value, (str, bytes))
    )


def _is_none(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and node.value is None


def _replacement(node: ast.AST) -> Optional[Tuple[str, ast.AST]]:
    """Return the kind of change and what stands in place of a child; None for what stays."""
    if isinstance(node, ast.Constant):
        value = _other(node.value)
        return None if value is None else ("constant", ast.Constant(value))
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.Not, ast.USub)):
        return ("boolean" if isinstance(node.op, ast.Not) else "arithmetic"), node.operand
    if _may_be_dropped(node):
        return "statement", ast.Pass()
    return None


def _other(value: Any) -> Any:
    """Return another constant of the same type, near enough that a test of the figure is what notices."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return value + 1
    if isinstance(value, float):
        return value * 2 if value else 1.0
    if isinstance(value, str):
        return f"{value}?"
    return value + b"?" if isinstance(value, bytes) else None


def _may_be_dropped(node: ast.AST) -> bool:
    if isinstance(node, ast.Assign):
        return not isinstance(node.targets[0], (ast.Name, ast.Tuple)) or _has_attribute(node.targets[0])
    if isinstance(node, ast.Expr):
        return isinstance(node.value, ast.Call)
    if isinstance(node, ast.Return):
        return node.value is None
    return isinstance(node, (ast.AugAssign, ast.Raise, ast.Break, ast.Continue, ast.Delete))


def _has_attribute(node: ast.AST) -> bool:
    return isinstance(node, ast.Tuple) and all(isinstance(each, ast.Attribute) for each in node.elts)


def _negated(node: Any) -> _Change:
    new = ast.UnaryOp(ast.Not(), node.test)
    return _put("boolean", node, "test", None, node.test, new)


def _swap(kind: str, node: Any, field: str, new: ast.AST) -> _Change:
    """A change of a field, described by the whole node."""
    return _put(kind, node, field, None, getattr(node, field), new)


def _put(kind: str, node: Any, field: str, index: Optional[int], old: ast.AST, new: Any) -> _Change:
    """A change that puts `new` into the field of a node, or at the index of a list there, in place of `old`."""
    if hasattr(new, "lineno") or isinstance(new, (ast.expr, ast.stmt)):
        at = old if hasattr(old, "lineno") else node
        ast.copy_location(new, at)
        ast.fix_missing_locations(new)

    def put(what: ast.AST) -> None:
        if index is None:
            setattr(node, field, what)
        else:
            getattr(node, field)[index] = what

    whole = node if isinstance(node, ast.expr) and not isinstance(old, ast.expr) else old
    before = _short(whole) if isinstance(whole, (ast.expr, ast.stmt)) else _short(node)
    put(new)
    after = (
        _short(whole if whole is not old else new)
        if isinstance(whole, (ast.expr, ast.stmt))
        else _short(node)
    )
    put(old)
    return _Change(
        kind, old if hasattr(old, "lineno") else node, before, after, lambda: put(new), lambda: put(old)
    )


def _short(node: ast.AST) -> str:
    text = ast.unparse(node) if hasattr(ast, "unparse") else ast.dump(node)
    return text.splitlines()[0]
