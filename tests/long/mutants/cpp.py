"""Mutants of the firmware's C++: all of them in one PC build, each tried in a fork of collected tests.

Each expression that can be changed, by clang's syntax tree, becomes a call of `mutant.h` with a number.  Left alone are
what the compiler computes (constexpr, static_assert, case labels, sizes) and members that begin with zero.
"""

import json
import multiprocessing
import multiprocessing.pool
import os
import pathlib
import re
import shutil
import signal
import subprocess
import time
from collections import Counter
from itertools import accumulate
from typing import Any, Callable, Dict, Iterator, List, NamedTuple, Optional, Sequence, Set, Tuple, Union

import pytest

from tests import tiers
from tests.long.bench.report import ROOT, either
from tests.long.mutants import Draw, Results

FIRMWARE, WORK = ROOT / "firmware/mrl_firmware", ROOT / "build/mutants/firmware"
BUILDS = either(
    {
        "": "",
        "_environment": "-DMRL_ENVIRONMENT=1",
        "_xbee": "-DMRL_XBEE=1",
        "_hbridge": "-DMRL_BRIDGE=1",
        "_hbridge_mega": "-DMRL_BRIDGE=1 -DMRL_MEGA=1",
        "_virtual": "-DMRL_BRIDGE=1 -DMRL_VIRTUAL=1",
    },
    {"_xbee": "-DMRL_XBEE=1"},
)
"""What is behind the name of the library, and its define."""
COMPILE = f"g++ -std=gnu++11 {either('-O1', '-O0')} -w -fPIC -shared"
TREE = "clang++ -std=gnu++11 -fsyntax-only -w -x c++ -Xclang -ast-dump=json"
WITHOUT = ("cacheprovider", "randomly", "rerunfailures", "xdist", "timeout", "faulthandler")
MOST_MUTANTS = 1 << 16
LEAST_S, FACTOR, MOST_S, HUNG_S = 2.0, 10.0, 30.0, 900.0
"""CPU time of a test: FACTOR times its usual one, at least LEAST_S; of all tests usually MOST_S; of a fork HUNG_S."""

Node = Dict[str, Any]
Span = Tuple[int, int]

OPERATORS = {
    "<": "less <= >=", "<=": "less_or_equal < >", ">": "greater >= <=", ">=": "greater_or_equal > <",
    "==": "equal !=", "!=": "unequal ==", "+": "add -", "-": "subtract +", "*": "multiply /", "/": "divide *",
    "%": "remainder /", "<<": "left >>", ">>": "right <<", "&": "both |", "|": "either &", "^": "differing &",
}  # fmt: skip
"""By operator, the function of `mutant.h` and the operators that stand there instead."""
COMPARISONS = ("<", "<=", ">", ">=", "==", "!=")
NEW_LIMIT = {"<": "+-", "<=": "-+", ">": "-+", ">=": "+-"}
"""The change of a limit on the left and on the right that the other comparison does not already make."""
STEPS = {"++": "increment --", "--": "decrement ++"}
COMPUTED = ("ConstantExpr", "StaticAssertDecl", "EnumDecl", "UnaryExprOrTypeTraitExpr", "TemplateArgument")
SEE_THROUGH = re.compile("ImplicitCast|ExprWithCleanups|Materialize|CXXBindTemporary|ParenExpr")
BODY = re.compile("(While|For|CXXForRange|Case|Default)Stmt")
EFFECTS = ("CallExpr", "CXXMemberCallExpr", "CXXOperatorCallExpr", "CompoundAssignOperator")
NAMED = ("FunctionDecl", "CXXMethodDecl", "CXXConstructorDecl", "CXXRecordDecl")
NUMBER = re.compile("(unsigned |signed )?(int|short|char|long)$")
OPTION = re.compile("!?MRL_[A-Z]+( && .*)?$")  # an option of the build, whose other branch need not exist


class Mutant(NamedTuple):
    file: str
    line: int
    text: str
    number: int


class Source:
    """A source or header with all its mutants, numbered from `number` on; `#` in a prefix stands for the number."""

    def __init__(self, path: pathlib.Path, number: int) -> None:
        self.path, self.text, self.number = path, path.read_bytes(), number
        self.mutants: List[Mutant] = []
        self._events: List[Tuple[Any, ...]] = []
        self._seen: Dict[Any, int] = {}
        self._limits: Dict[Optional[Span], str] = {}
        self._function = ""
        for define in BUILDS.values():
            command = [*TREE.split(), *define.split(), f"-I{path.parent}", str(path)]
            tree = json.loads(subprocess.check_output(command))
            self._constants = {node["id"]: _unit(node) for node in _walk(tree) if _is_named_number(node)}
            self._visit(tree)

    def changed(self) -> str:
        out, at = [], 0
        for place, _, _, _, length, text in sorted(self._events):
            out += [self.text[at:place], text.encode()]
            at = place + length
        return (b"".join(out) + self.text[at:]).decode()

    def _visit(self, node: Node) -> None:
        kind, inner, function = node.get("kind", ""), node.get("inner", []), self._function
        if kind in COMPUTED or node.get("isImplicit") or node.get("constexpr") or _begins_with_zero(node):
            return
        if kind in NAMED:
            self._function = node.get("name", "")
        if kind in ("IfStmt", "WhileStmt", "ConditionalOperator") or kind == "ForStmt" and inner[2]:
            self._condition(inner[2 if kind == "ForStmt" else 0])
        bodies = {"CompoundStmt": inner, "IfStmt": inner[1:]}
        for each in bodies.get(kind, inner[-1:] if BODY.match(kind) else []):
            self._statement(each)
        getattr(self, f"_on_{kind}", lambda node: None)(node)
        for each in inner[-1:] if kind == "CXXForRangeStmt" else inner:
            if each:
                self._visit(each)
        self._function = function

    def _condition(self, node: Node) -> None:
        if _core(node).get("opcode") not in (*COMPARISONS, "!") and not self._is_option(node):
            self._add(node, "mutant::negated(#, ", ")", f"!({self._written(node)})")

    def _statement(self, node: Node) -> None:
        kind, core = node.get("kind"), _core(node)
        returns = kind == "ReturnStmt" and (not node.get("inner") or _type(node["inner"][0]) == "void")
        if core.get("kind") in EFFECTS or core.get("opcode") in (*STEPS, "="):
            self._add(node, "(mutant::on(#) ? void() : void(", "))", "nothing")
        elif kind in ("BreakStmt", "ContinueStmt") or returns:
            begin, end = self._span(node) or (0, 0)
            self._add((begin, self.text.index(b";", end - 1) + 1), "{ if (!mutant::on(#)) ", " }", "nothing")

    def _on_BinaryOperator(self, node: Node) -> None:
        opcode, place = node["opcode"], self._operator(node)
        if place is None or self._is_option(node["inner"][0]):
            return
        for each, limit in zip(node["inner"], NEW_LIMIT.get(opcode, "")):
            self._limits[self._span(_core(each))] = limit
        if opcode in ("&&", "||"):
            same, no, other = ("==", "", "||") if opcode == "&&" else ("!=", "!", "&&")
            token = f") {same} mutant::on(#) ? {no}mutant::on(#) : bool("
            self._add(node, "(bool(", "))", self._with(node, place, other), token=(place, 2, token))
        elif opcode in COMPARISONS or opcode in OPERATORS and not _is_pointer(node, node["inner"][1]):
            self._call(node, place, *OPERATORS[opcode].split())

    def _on_CompoundAssignOperator(self, node: Node) -> None:
        place, (name, other) = self._operator(node), OPERATORS[node["opcode"][:-1]].split()
        if place is not None:
            self._call(node, place, f"{name}_assign", f"{other}=")

    def _call(self, node: Node, place: int, name: str, *others: str) -> None:
        afters = [self._with(node, place, other) for other in others]
        self._add(node, f"mutant::{name}(#, ", ")", *afters, token=(place, len(node["opcode"]), ","))

    def _on_UnaryOperator(self, node: Node) -> None:
        opcode, text, (begin, end) = node["opcode"], self._written(node), self._span(node) or (0, 0)
        post = "post_" if node.get("isPostfix") else ""
        place = end - len(opcode) if post else begin
        if text is None or self.text[place : place + len(opcode)].decode() != opcode or OPTION.match(text):
            return
        token = (place, len(opcode), "")
        if opcode == "!":
            self._add(node, "(bool(", ") == mutant::on(#))", text[1:], token=token)
        elif opcode == "-" and node["inner"][0].get("kind") != "IntegerLiteral":
            self._add(node, "mutant::negative(#, ", ")", text[1:], token=token)
        elif opcode in STEPS and not _is_pointer(node):
            name, other = STEPS[opcode].split()
            self._add(node, f"mutant::{post}{name}(#, ", ")", text.replace(opcode, other), token=token)

    def _on_IntegerLiteral(self, node: Node) -> None:
        text, limit = self._written(node) or "", self._limits.get(self._span(node))
        if text[:1].isdigit() and limit:
            self._add(node, "(", f" {limit} mutant::on(#))", f"{text} {limit} 1")
        elif text[:1].isdigit():
            self._add(node, "(", " + mutant::step(#))", f"{text} + 1", f"{text} - 1")

    def _on_CXXBoolLiteralExpr(self, node: Node) -> None:
        if self._written(node) in ("true", "false"):
            self._add(node, "mutant::negated(#, ", ")", "false" if node["value"] else "true")

    def _on_DeclRefExpr(self, node: Node) -> None:
        declared, text = node.get("referencedDecl", {}), self._written(node)
        if text is None or text.split("::")[-1] != declared.get("name"):
            return  # a macro has written it
        unit = self._constants.get(declared.get("id"))
        if declared.get("kind") == "EnumConstantDecl":
            self._add(node, "mutant::next(#, ", ")", f"next after {text}")
        elif unit:
            afters = f"{text} + {unit}", f"{text} - {unit}"
            self._add(node, "(", f" + {unit} * mutant::step(#))", *afters, shared=text)

    def _on_ReturnStmt(self, node: Node) -> None:
        value = (node.get("inner") or [{}])[0]
        if "Literal" in _core(value).get("kind", "") or value.get("valueCategory") == "lvalue":
            return
        if _type(value) == "bool":
            self._condition(value)
        elif NUMBER.match(_type(value)):
            self._add(value, "mutant::other(#, ", ")", f"!({self._written(value)})")

    def _add(self, where: Union[Node, Span], prefix: str, suffix: str, *afters: str, **more: Any) -> None:
        """Puts texts around a place, and replaces a `token`; uses of a `shared` name change together."""
        span = where if isinstance(where, tuple) else self._span(where)
        if span is None or (span, prefix) in self._seen:
            return
        begin, end = span
        number = self._seen.setdefault(more.get("shared", (span, prefix)), self.number)
        self._seen[span, prefix] = number
        if number == self.number:
            file, line = str(self.path.relative_to(ROOT)), self.text.count(b"\n", 0, begin) + 1
            before = self.text[begin:end].decode()
            texts = [" ".join(f"{self._function}: {before} -> {after}".split()) for after in afters]
            self.mutants += [Mutant(file, line, text, number + place) for place, text in enumerate(texts)]
            self.number += len(afters)
        order = len(self._events)  # of those of one range, the outer ones come first
        found = [(begin, 1, begin - end, order, 0, prefix), (end, 0, end - begin, -order, 0, suffix)]
        found += [(more["token"][0], 2, 0, 0, *more["token"][1:])] if "token" in more else []
        self._events += [(*each[:5], each[5].replace("#", str(number))) for each in found]

    def _with(self, node: Node, place: int, other: str) -> str:
        begin, end = self._span(node) or (0, 0)
        rest = self.text[place + len(node["opcode"]) : end]
        return (self.text[begin:place] + other.encode() + rest).decode()

    def _operator(self, node: Node) -> Optional[int]:
        """Where the operator stands; None if a macro made it."""
        left, right = (self._span(each) for each in node["inner"])
        between = self.text[left[1] : right[0]] if self._span(node) and left and right else b""
        same = left is not None and between.strip().decode() == node["opcode"]
        return left[1] + between.index(node["opcode"].encode()) if left and same else None

    def _is_option(self, node: Node) -> bool:
        return bool(OPTION.match(self._written(_core(node)) or ""))

    def _written(self, node: Node) -> Optional[str]:
        span = self._span(node)
        return self.text[slice(*span)].decode() if span is not None else None

    def _span(self, node: Node) -> Optional[Span]:
        """First byte and the one behind the last; None if it is not written in this source."""
        first, last = (_place(node.get("range", {}).get(which, {})) for which in ("begin", "end"))
        if any("offset" not in each or "includedFrom" in each for each in (first, last)):
            return None
        end = last["offset"] + last["tokLen"]
        is_call_of_macro = "expansionLoc" in node["range"]["end"] and self.text[end : end + 1] == b"("
        return (first["offset"], end) if first["offset"] < end and not is_call_of_macro else None


def _walk(node: Node) -> Iterator[Node]:
    yield node
    for each in node.get("inner", []):
        yield from _walk(each)


def _place(place: Node) -> Node:
    """The place in the text; a name that stands for a number, as INT16_MAX, is its own place."""
    if any(place.get(which, {}).get("isMacroArgExpansion") for which in ("expansionLoc", "spellingLoc")):
        return {}
    return place.get("expansionLoc", place)


def _core(node: Node) -> Node:
    while SEE_THROUGH.match(node.get("kind", "")) and node.get("inner"):
        node = node["inner"][0]
    return node


def _type(node: Node) -> str:
    found = node.get("type", {})
    return str(found.get("desugaredQualType", found.get("qualType", ""))).replace("const ", "")


def _is_pointer(*nodes: Node) -> bool:
    return any(_type(node).endswith(("*", "]")) for node in nodes)


def _begins_with_zero(node: Node) -> bool:
    """A member that begins with zero: the firmware's objects are static, and static memory is zero without code."""
    return node.get("kind") == "FieldDecl" and _core(node.get("inner", [{}])[-1]).get("value") in (False, "0")


def _is_named_number(node: Node) -> bool:
    return node.get("kind") == "VarDecl" and bool(node.get("constexpr")) and bool(NUMBER.match(_type(node)))


def _unit(node: Node) -> int:
    """The change of a constant: a time is written in ms and counted in ticks of 64 us."""
    named = (each.get("referencedDecl", {}).get("name") for each in _walk(node))
    return 15 if "of_ms" in named else 1


def build(sources: Sequence[str]) -> List[Mutant]:
    shutil.rmtree(str(WORK), ignore_errors=True)
    shutil.copytree(str(FIRMWARE), str(WORK / "source"), ignore=shutil.ignore_patterns("*_avr.cpp", "*.ino"))
    shutil.copy(str(ROOT / "tests/long/mutants/mutant.h"), str(WORK / "source"))
    mutants: List[Mutant] = []
    for name in sources:
        found = Source(ROOT / name, len(mutants))
        mutants += found.mutants
        target = WORK / "source" / found.path.relative_to(FIRMWARE)
        target.write_text('#include "mutant.h"\n' + found.changed())
    (WORK / "begin.cpp").write_text(f'#define MUTANT_BEGIN {MOST_MUTANTS}\n#include "mutant.h"\n')
    parts = *(WORK / "source").rglob("*.cpp"), *(ROOT / "tests/firmware").glob("*_pc.cpp"), WORK / "begin.cpp"
    for suffix, define in BUILDS.items():
        command = [*COMPILE.split(), *define.split(), f"-I{WORK / 'source'}", *map(str, parts)]
        subprocess.check_call([*command, "-o", str(WORK / f"libmrl_firmware{suffix}.so")])
    return mutants


class Trial:
    """The plugin that tries the mutants with the collected tests, instead of running these."""

    def __init__(self, mutants: Sequence[Mutant], workers: int) -> None:
        self.mutants, self.workers = mutants, workers
        self.alive: List[Mutant] = []
        self._items: Dict[str, Any] = {}
        self._reach: Dict[str, Tuple[float, Set[int]]] = {}
        self._good: Dict[str, Counter] = {}
        """How many mutants of a file each test has noticed: such tests come first."""

    def pytest_runtestloop(self, session: Any) -> bool:
        for item in session.items:
            if getattr(item, "callspec", None) is None or item.callspec.params.get("engine", "pc") == "pc":
                self._items[item.nodeid] = item
        with multiprocessing.pool.ThreadPool(self.workers) as pool:
            pool.map(self._measure, range(self.workers), 1)
            for path in WORK.glob("reach*"):
                for name, seconds, reached in map(json.loads, path.read_text().splitlines()):
                    self._reach[name] = seconds, set(reached)
            lacking = sorted(set(self._items) - set(self._reach))
            if lacking:
                raise pytest.UsageError(f"{len(lacking)} tests fail unchanged: {', '.join(lacking[:5])}")
            killed = pool.map(self._is_noticed, self.mutants, 1)
        self.alive = [mutant for mutant, noticed in zip(self.mutants, killed) if not noticed]
        return True

    def _measure(self, worker: int) -> None:
        """Note of each test that passes its CPU time [s] and the mutants that it reaches."""
        marks = WORK / f"marks{worker}"
        marks.write_bytes(bytes(MOST_MUTANTS))

        def work() -> None:
            with open(marks, "r+b", buffering=0) as file, open(WORK / f"reach{worker}", "w") as out:
                for name in list(self._items)[worker :: self.workers]:
                    file.seek(0)
                    file.write(bytes(MOST_MUTANTS))
                    begun_s = time.process_time()
                    if not self._fails(name):
                        file.seek(0)
                        reached = [number for number, mark in enumerate(file.read()) if mark]
                        out.write(json.dumps([name, time.process_time() - begun_s, reached]) + "\n")

        _forked(work, MRL_MUTANTS_REACHED=str(marks))

    def _is_noticed(self, mutant: Mutant) -> bool:
        good, last = self._good.setdefault(mutant.file, Counter()), WORK / f"last{mutant.number}"
        reached = [name for name, (_, numbers) in self._reach.items() if mutant.number in numbers]
        reached.sort(key=lambda name: (-good[name], self._reach[name][0]))
        sums_s = accumulate(self._reach[name][0] for name in reached)
        tests = [name for name, sum_s in zip(reached, sums_s) if sum_s < MOST_S]

        def work() -> None:
            for name in tests:
                last.write_text(name)
                signal.setitimer(signal.ITIMER_PROF, max(LEAST_S, FACTOR * self._reach[name][0]))
                if self._fails(name):
                    os._exit(1)

        code = _forked(work, MRL_MUTANT=str(mutant.number)) if tests else 0
        if code == 1:
            good[last.read_text()] += 1
        return bool(code)

    def _fails(self, name: str) -> bool:
        from _pytest.runner import runtestprotocol

        return any(each.failed for each in runtestprotocol(self._items[name], log=False, nextitem=None))


def _forked(work: Callable[[], None], **environment: str) -> int:
    """The exit code of a fork that does this; minus the signal that ended it."""

    def begin() -> None:
        os.environ.update(environment)
        for descriptor in (1, 2):
            os.dup2(os.open(os.devnull, os.O_WRONLY), descriptor)
        work()
        os._exit(0)

    process = multiprocessing.get_context("fork").Process(target=begin)
    process.start()
    process.join(HUNG_S)
    process.kill()
    process.join()
    return process.exitcode or 0


def run(sources: Sequence[str], tests: Sequence[str], workers: int, draw: Draw) -> Results:
    """Try the mutants of a group that are drawn."""
    from tests.firmware import pc_board

    usual, trial = pc_board.load, Trial(draw(build(sources)), workers)
    pc_board.load = lambda library: usual(WORK / library.name)
    os.chdir(str(ROOT))
    tiers.FOLDERS["firmware"] = tiers.QUICK  # by what they import
    options = ["--tier=quick", "-q", "--no-header", "--no-summary", *(f"-pno:{name}" for name in WITHOUT)]
    if pytest.main([*options, *tests], plugins=[trial]):
        raise SystemExit("the tests of the firmware cannot be collected")
    for source in sources:
        alive = [f"line {each.line}: {each.text}" for each in trial.alive if each.file == source]
        yield source, sum(each.file == source for each in trial.mutants), alive
