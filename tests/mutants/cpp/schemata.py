"""All mutants of a C++ source in one text, from clang's syntax tree.

Each mutated expression becomes a call of `mutant.h` with the mutant's number, and MRL_MUTANT chooses one at run time.
Code that the compiler evaluates (constexpr, static_assert, case labels, array sizes) is left alone; a named constant is
mutated where it is used.
"""

import json
import subprocess
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Dict, Iterator, List, Optional, Sequence, Set, Tuple

Node = Dict[str, Any]

COMPARISONS = {
    "<": ("less", "<=", ">="),
    "<=": ("less_or_equal", "<", ">"),
    ">": ("greater", ">=", "<="),
    ">=": ("greater_or_equal", ">", "<"),
    "==": ("equal", "!="),
    "!=": ("unequal", "=="),
}
NEW_LIMIT = {
    ("<", 1): "-", ("<=", 1): "+", (">", 1): "+", (">=", 1): "-",
    ("<", 0): "+", ("<=", 0): "-", (">", 0): "-", (">=", 0): "+",
}  # fmt: skip
"""The change of a limit that the other comparison is not already: `a < 5` to `a <= 5` is the same as to `a < 6`."""
ARITHMETIC = {
    "+": ("add", "-"),
    "-": ("subtract", "+"),
    "*": ("multiply", "/"),
    "/": ("divide", "*"),
    "%": ("remainder", "/"),
    "<<": ("shift_left", ">>"),
    ">>": ("shift_right", "<<"),
    "&": ("both", "|"),
    "|": ("either", "&"),
    "^": ("differing", "&"),
}
ASSIGNMENTS = {
    "+=": ("add_to", "-="),
    "-=": ("subtract_from", "+="),
    "*=": ("multiply_by", "/="),
    "/=": ("divide_by", "*="),
    "&=": ("keep", "|="),
    "|=": ("set", "&="),
}
STEPS = {
    ("++", False): ("increment", "--"),
    ("--", False): ("decrement", "++"),
    ("++", True): ("post_increment", "--"),
    ("--", True): ("post_decrement", "++"),
}
COMPILED_AWAY = {
    "ConstantExpr",
    "StaticAssertDecl",
    "EnumDecl",
    "UnaryExprOrTypeTraitExpr",
    "TemplateArgument",
}
SEE_THROUGH = {
    "ImplicitCastExpr",
    "ExprWithCleanups",
    "MaterializeTemporaryExpr",
    "CXXBindTemporaryExpr",
    "ParenExpr",
}
NAMED = {"FunctionDecl", "CXXMethodDecl", "CXXConstructorDecl", "CXXRecordDecl"}
EFFECTS = {"CallExpr", "CXXMemberCallExpr", "CXXOperatorCallExpr", "CompoundAssignOperator"}
ALREADY_TRUTH = {"<", "<=", ">", ">=", "==", "!="}


@dataclass
class Mutant:
    """One change of one source: what stood there and what stands there instead."""

    file: str
    function: str
    offset: int
    line: int
    kind: str
    before: str
    after: str
    numbers: Tuple[int, ...] = ()
    occurrence: int = 1

    @property
    def key(self) -> str:
        """Stays the same while other lines move."""
        nth = f" #{self.occurrence}" if self.occurrence > 1 else ""
        return f"{self.function}: {self.before} -> {self.after}{nth}"


@dataclass
class Edit:
    """Puts `prefix` and `suffix` around a range; tokens in it are replaced."""

    begin: int
    end: int
    prefix: str  # with {0} for the first mutant's number
    suffix: str
    tokens: Tuple[Tuple[int, int, str], ...]
    mutants: List[Mutant] = field(default_factory=list)


def syntax_tree(source: Path, defines: Sequence[str]) -> Node:
    """Clang's tree of a source or header.

    Raises:
        RuntimeError: clang does not accept it.
    """
    command = ["clang++", "-std=gnu++11", "-fsyntax-only", "-w", *defines, f"-I{source.parent}"]
    command += ["-x", "c++", "-Xclang", "-ast-dump=json", str(source)]
    done = subprocess.run(command, capture_output=True)
    if done.returncode:
        raise RuntimeError(f"clang++ does not accept {source}: {done.stderr.decode()}")
    tree: Node = json.loads(done.stdout)
    _add_files(tree, [""])
    return tree


def _add_files(node: Any, current: List[str]) -> None:
    """Clang names the file of a place only if it differs from that of the place before."""
    if isinstance(node, list):
        for each in node:
            _add_files(each, current)
    elif isinstance(node, dict):
        if "offset" in node:
            current[0] = node["file"] = node.get("file", current[0])
        for each in list(node.values()):
            if isinstance(each, (list, dict)):
                _add_files(each, current)


class Finder:
    """Finds what can be mutated in one source."""

    def __init__(self, name: str, path: Path) -> None:
        self.name, self.path, self.text = name, path, path.read_bytes()
        self.edits: Dict[Tuple[int, int, str], Edit] = {}
        self._constants: Dict[str, int] = {}
        self._news: Dict[Tuple[int, int], str] = {}
        self._enums: Set[str] = set()
        self._function = ""

    def look(self, tree: Node) -> None:
        """Adds what a tree of this source shows; trees of several builds may show different parts."""
        self._constants = {node["id"]: _unit(node) for node in _walk(tree) if _is_named_number(node)}
        self._enums = {node.get("name", "") for node in _walk(tree) if node.get("kind") == "EnumDecl"} - {""}
        self._visit(tree, None)

    def source(self, first_number: int) -> Tuple[str, List[Mutant]]:
        """The text with all mutants, numbered from `first_number` on."""
        inserts: List[Tuple[int, int, int, int, bytes]] = []  # place, 0 end or 1 begin, nesting, order
        replaced: Dict[int, Tuple[int, bytes]] = {}
        mutants: List[Mutant] = []
        shared: Dict[Tuple[str, str], Mutant] = {}
        number = first_number
        for order, edit in enumerate(sorted(self.edits.values(), key=_nesting)):
            numbers = []
            for mutant in edit.mutants:
                same = shared.get((mutant.before, mutant.after)) if mutant.kind == "named constant" else None
                if same is None:
                    mutant.numbers = (number,)
                    number += 1
                    mutants.append(mutant)
                    if mutant.kind == "named constant":
                        shared[mutant.before, mutant.after] = mutant
                    same = mutant
                numbers.append(same.numbers[0])
            size = edit.end - edit.begin
            inserts.append((edit.begin, 1, -size, order, edit.prefix.format(numbers[0]).encode()))
            inserts.append((edit.end, 0, size, -order, edit.suffix.format(numbers[0]).encode()))
            for place, length, text in edit.tokens:
                replaced[place] = (length, text.format(numbers[0]).encode())
        _count_occurrences(mutants)
        return self._compose(inserts, replaced).decode(), mutants

    def _compose(
        self, inserts: List[Tuple[int, int, int, int, bytes]], replaced: Dict[int, Tuple[int, bytes]]
    ) -> bytes:
        out, at = [], 0
        events = [(place, which, nesting, order, 0, text) for place, which, nesting, order, text in inserts]
        events += [(place, 2, 0, 0, length, text) for place, (length, text) in replaced.items()]
        for place, _, _, _, length, text in sorted(events):
            out += [self.text[at:place], text]
            at = place + length
        return b"".join(out) + self.text[at:]

    # ---- the walk

    def _visit(self, node: Node, parent: Optional[Node]) -> None:
        kind = node.get("kind")
        if (
            kind in COMPILED_AWAY
            or node.get("isImplicit")
            or node.get("constexpr")
            or _begins_with_zero(node)
        ):
            return
        function = self._function
        if kind in NAMED:
            self._function = node.get("name", "")
        method = getattr(self, f"_on_{kind}", None)
        if method is not None:
            method(node, parent)
        if kind == "CXXForRangeStmt":
            self._visit(node["inner"][-1], node)
        else:
            for each in node.get("inner", []):
                if each:
                    self._visit(each, node)
        self._function = function

    def _on_BinaryOperator(self, node: Node, parent: Optional[Node]) -> None:
        opcode = node["opcode"]
        place = self._operator(node)
        if place is None:
            return
        if opcode in COMPARISONS:
            for side, each in enumerate(node["inner"]):
                new = NEW_LIMIT.get((opcode, side))
                span = self._span(_core(each))
                if new and span is not None:
                    self._news[span] = new
            name, *others = COMPARISONS[opcode]
            self._call(node, "comparison", name, place, others)
        elif opcode in ARITHMETIC and not (_is_pointer(node["inner"][1]) or _is_pointer(node)):
            name, *others = ARITHMETIC[opcode]
            self._call(node, "arithmetic", name, place, others)
        elif opcode == "&&":
            token = (place, 2, ") == mutant::on({0}) ? mutant::on({0}) : bool(")
            self._logical(node, token, "||")
        elif opcode == "||":
            token = (place, 2, ") != mutant::on({0}) ? !mutant::on({0}) : bool(")
            self._logical(node, token, "&&")

    def _logical(self, node: Node, token: Tuple[int, int, str], other: str) -> None:
        self._add(node, "boolean", "(bool(", "))", [self._with(node, token, other)], (token,))

    def _on_CompoundAssignOperator(self, node: Node, parent: Optional[Node]) -> None:
        place = self._operator(node)
        if place is not None and node["opcode"] in ASSIGNMENTS:
            name, *others = ASSIGNMENTS[node["opcode"]]
            self._call(node, "arithmetic", name, place, others)

    def _on_UnaryOperator(self, node: Node, parent: Optional[Node]) -> None:
        opcode, postfix = node["opcode"], node.get("isPostfix", False)
        span = self._span(node)
        if span is None:
            return
        text = self.text[slice(*span)].decode()
        place = span[1] - len(opcode) if postfix else span[0]
        if self.text[place : place + len(opcode)].decode() != opcode:
            return
        if opcode == "!":
            self._add(node, "boolean", "(bool(", ") == mutant::on({0}))", [text[1:]], ((place, 1, ""),))
        elif opcode == "-" and node["inner"][0].get("kind") != "IntegerLiteral":
            self._add(node, "arithmetic", "mutant::negative({0}, ", ")", [text[1:]], ((place, 1, ""),))
        elif (opcode, postfix) in STEPS and not _is_pointer(node):
            name, other = STEPS[opcode, postfix]
            after = text[: -len(opcode)] + other if postfix else other + text[len(opcode) :]
            self._add(
                node, "arithmetic", f"mutant::{name}({{0}}, ", ")", [after], ((place, len(opcode), ""),)
            )

    def _on_IntegerLiteral(self, node: Node, parent: Optional[Node]) -> None:
        text = self._text(node)
        if not text or not text[0].isdigit():
            return
        new = self._news.get(self._span(node) or (0, 0))
        if new is None:
            self._add(node, "constant", "(", " + mutant::step({0}))", [f"{text} + 1", f"{text} - 1"])
        else:
            self._add(node, "constant", "(", f" {new} mutant::one({{0}}))", [f"{text} {new} 1"])

    def _on_CXXBoolLiteralExpr(self, node: Node, parent: Optional[Node]) -> None:
        text = self._text(node)
        if text in ("true", "false"):
            other = "false" if text == "true" else "true"
            self._add(node, "constant", "mutant::negated({0}, ", ")", [other])

    def _on_DeclRefExpr(self, node: Node, parent: Optional[Node]) -> None:
        declared = node.get("referencedDecl", {})
        text = self._text(node)
        if text is None or text.split("::")[-1] != declared.get("name"):
            return  # a macro has written it
        if declared.get("kind") == "EnumConstantDecl":
            self._add(node, "constant", "mutant::next({0}, ", ")", [f"next after {text}"])
        elif declared.get("id") in self._constants:
            unit = self._constants[declared["id"]]
            step = "mutant::step({0})" if unit == 1 else f"{unit} * mutant::step({{0}})"
            more = f"{unit} ticks" if unit > 1 else "1"
            self._add(node, "named constant", "(", f" + {step})", [f"{text} + {more}", f"{text} - {more}"])

    def _on_IfStmt(self, node: Node, parent: Optional[Node]) -> None:
        self._condition(node["inner"][0])
        for each in node["inner"][1:]:
            self._statement(each)

    def _on_WhileStmt(self, node: Node, parent: Optional[Node]) -> None:
        self._condition(node["inner"][0])
        self._statement(node["inner"][-1])

    def _on_ForStmt(self, node: Node, parent: Optional[Node]) -> None:
        condition = node["inner"][2]
        if condition:
            self._condition(condition)
        self._statement(node["inner"][-1])

    def _on_CXXForRangeStmt(self, node: Node, parent: Optional[Node]) -> None:
        self._statement(node["inner"][-1])

    def _on_ConditionalOperator(self, node: Node, parent: Optional[Node]) -> None:
        self._condition(node["inner"][0])

    def _on_CompoundStmt(self, node: Node, parent: Optional[Node]) -> None:
        for each in node.get("inner", []):
            self._statement(each)

    def _on_CaseStmt(self, node: Node, parent: Optional[Node]) -> None:
        self._statement(node["inner"][-1])

    def _on_DefaultStmt(self, node: Node, parent: Optional[Node]) -> None:
        self._statement(node["inner"][-1])

    def _on_ReturnStmt(self, node: Node, parent: Optional[Node]) -> None:
        if not node.get("inner"):
            return
        value = node["inner"][0]
        core = _core(value)
        if (
            core.get("kind") in ("IntegerLiteral", "CXXBoolLiteralExpr")
            or value.get("valueCategory") == "lvalue"
        ):
            return
        returned = _type(value)
        if returned == "bool":
            if core.get("opcode") not in ALREADY_TRUTH | {"!"}:
                self._add(value, "return", "mutant::negated({0}, ", ")", [f"!({self._text(value)})"])
        elif returned in NUMBERS or returned.rsplit("::")[-1] in self._enums:
            self._add(value, "return", "mutant::other({0}, ", ")", [f"!({self._text(value)})"])

    # ---- parts

    def _condition(self, node: Node) -> None:
        if _core(node).get("opcode") in ALREADY_TRUTH | {"!"}:
            return
        self._add(node, "boolean", "mutant::negated({0}, bool(", "))", [f"!({self._text(node)})"])

    def _statement(self, node: Node) -> None:
        kind, core = node.get("kind"), _core(node)
        steps = core.get("kind") == "UnaryOperator" and core.get("opcode") in ("++", "--")
        assigns = core.get("kind") == "BinaryOperator" and core.get("opcode") == "="
        if core.get("kind") in EFFECTS or steps or assigns:
            self._add(node, "statement", "(mutant::on({0}) ? void() : void(", "))", ["nothing"])
        elif kind in ("BreakStmt", "ContinueStmt") or (kind == "ReturnStmt" and self._returns_nothing(node)):
            span = self._span(node)
            if span is not None:
                end = self.text.index(b";", span[1] - 1) + 1
                self._add_span((span[0], end), "statement", "{{ if (!mutant::on({0})) ", " }}", ["nothing"])

    def _returns_nothing(self, node: Node) -> bool:
        return not node.get("inner") or _type(node["inner"][0]) == "void"

    def _call(self, node: Node, kind: str, name: str, place: int, others: List[str]) -> None:
        token = (place, len(node["opcode"]), ",")
        afters = [self._with(node, token, other) for other in others]
        self._add(node, kind, f"mutant::{name}({{0}}, ", ")", afters, (token,))

    def _with(self, node: Node, token: Tuple[int, int, str], other: str) -> str:
        begin, end = self._span(node) or (0, 0)
        return (self.text[begin : token[0]] + other.encode() + self.text[token[0] + token[1] : end]).decode()

    def _add(
        self,
        node: Node,
        kind: str,
        prefix: str,
        suffix: str,
        afters: List[str],
        tokens: Tuple[Tuple[int, int, str], ...] = (),
    ) -> None:
        span = self._span(node)
        if span is not None:
            self._add_span(span, kind, prefix, suffix, afters, tokens)

    def _add_span(
        self,
        span: Tuple[int, int],
        kind: str,
        prefix: str,
        suffix: str,
        afters: List[str],
        tokens: Tuple[Tuple[int, int, str], ...] = (),
    ) -> None:
        begin, end = span
        key = (begin, end, prefix)
        if key in self.edits:
            return
        before = _one_line(self.text[begin:end])
        function = "constant" if kind == "named constant" else self._function
        line = self.text.count(b"\n", 0, begin) + 1
        mutants = [
            Mutant(self.name, function, begin, line, kind, before, _one_line(after.encode()))
            for after in afters
        ]
        self.edits[key] = Edit(begin, end, prefix, suffix, tokens, mutants)

    def _operator(self, node: Node) -> Optional[int]:
        """Where the operator stands; None if a macro made it."""
        left, right = (self._span(each) for each in node["inner"])
        if self._span(node) is None or left is None or right is None:
            return None
        between = self.text[left[1] : right[0]]
        if between.strip().decode() != node["opcode"]:
            return None
        return left[1] + between.index(node["opcode"].encode())

    def _text(self, node: Node) -> Optional[str]:
        span = self._span(node)
        return self.text[slice(*span)].decode() if span is not None else None

    def _span(self, node: Node) -> Optional[Tuple[int, int]]:
        """First byte and the one behind the last; None if it is not written in this source."""
        found = node.get("range", {})
        begin, end = (_written(found.get(which, {})) for which in ("begin", "end"))
        if begin is None or end is None or not self._is_here(begin) or not self._is_here(end):
            return None
        first, last = begin["offset"], end["offset"] + end["tokLen"]
        return (first, last) if first < last else None

    def _is_here(self, place: Node) -> bool:
        return bool(place["file"]) and Path(place["file"]).resolve() == self.path.resolve()


def _nesting(edit: Edit) -> Tuple[int, int, bool, str]:
    """Outer edits first; of those of one range, the one that replaces a token is the innermost."""
    return edit.begin, -edit.end, bool(edit.tokens), edit.prefix


def _one_line(text: bytes) -> str:
    return " ".join(text.decode().split())


def _count_occurrences(mutants: List[Mutant]) -> None:
    seen: Dict[str, int] = {}
    for mutant in sorted(mutants, key=lambda each: each.offset):
        key = mutant.key
        seen[key] = seen.get(key, 0) + 1
        mutant.occurrence = seen[key]


def _walk(node: Node) -> Iterator[Node]:
    yield node
    for each in node.get("inner", []):
        yield from _walk(each)


def _written(place: Node) -> Optional[Node]:
    """The place in the text; a name that stands for a number, as INT16_MAX, is its own place."""
    if "expansionLoc" in place:
        expansion: Node = place["expansionLoc"]
        return (
            None
            if expansion.get("isMacroArgExpansion") or place["spellingLoc"].get("isMacroArgExpansion")
            else expansion
        )
    return place if "offset" in place else None


def _core(node: Node) -> Node:
    while node.get("kind") in SEE_THROUGH and node.get("inner"):
        node = node["inner"][0]
    return node


def _type(node: Node) -> str:
    found = node.get("type", {})
    return str(found.get("desugaredQualType", found.get("qualType", ""))).replace("const ", "")


NUMBERS: Set[str] = {
    "int",
    "unsigned int",
    "short",
    "unsigned short",
    "char",
    "signed char",
    "unsigned char",
    "long",
}


def _is_pointer(node: Node) -> bool:
    return _type(node).endswith(("*", "]"))


def _begins_with_zero(node: Node) -> bool:
    """A member that begins with zero: the firmware's objects are static, and static memory is zero without code."""
    if node.get("kind") != "FieldDecl" or not node.get("inner"):
        return False
    value = _core(node["inner"][-1]).get("value")
    return value is False or value == "0"


TICKS_A_MS = 15


def _unit(node: Node) -> int:
    """What a change of 1 in the text changes: a time is written in ms and counted in ticks of 64 us."""
    return (
        TICKS_A_MS
        if any(each.get("referencedDecl", {}).get("name") == "of_ms" for each in _walk(node))
        else 1
    )


def _is_named_number(node: Node) -> bool:
    return node.get("kind") == "VarDecl" and bool(node.get("constexpr")) and _type(node) in NUMBERS
