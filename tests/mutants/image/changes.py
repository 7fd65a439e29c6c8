"""Single changes of a hal_*_avr.cpp, found in its text.

Clang's tree does not help here: registers and bits are macros, and the interrupts of the encoders are assembly.
The text has clang-format's spaces around each binary operator.
"""

import re
from collections import Counter
from typing import Dict, Iterator, List, NamedTuple, Tuple

from tests.mutants.cpp.schemata import ARITHMETIC, ASSIGNMENTS, COMPARISONS, Mutant

HEAD = re.compile(
    r"ISR\((\w+)|#define (COUNT_EDGE)|struct (\w+) \{|(?:inline |static |constexpr )*[\w:]+ (\w+)\("
)
NOT_CODE = re.compile(
    r"//[^\n]*|/\*.*?\*/|^#(?!define COUNT_EDGE)[^\n]*|static_assert\(.*?\);|"
    r"__attribute__\(\(.*?\)\)(?=[; ])|Ring<\w+>",
    re.M | re.S,
)
ARRAY = re.compile(r"^(?:constexpr |volatile )*\w+ \w+\[.*$", re.M)
ASSEMBLY = re.compile(r'"((?:\d: *)?)(\w[^"\\]*?) *((?:\\n\\t)?)"')
OPERATOR = re.compile(r"(?<= )(?:<=|>=|==|!=|<<|>>|&&|\|\||[-+|&^*/%]=|[-+*/%<>&|^])(?= )")
DECLARES = re.compile(
    r"(?:const|constexpr|static|extern|using|struct|volatile|return|do|while|for|if|else|bool|u?int\d+_t|Mark|Moment|"
    r"EncoderSample|ResetTrace|Transfer|BusState|mrl::\w+<\w+>|Ring<\w+>)\b(?! *\()"
)
CONTROL = re.compile(r"(?:\} )?(?:else )?(?:if|while|for|else)\b")
CONDITION = re.compile(r"\b(?:if|while) \(")
NEGATION = re.compile(r"!(?=[\w(])")
COMPLEMENT = re.compile(r"~(?=[\w(])")
STEP = re.compile(r"\+\+|--")
BIT = re.compile(r"_BV\(\w+\)")
NUMBER = re.compile(r"(?<![\w.])(?:0x[0-9A-Fa-f]+|\d+)\b")
TRUTH = re.compile(r"\b(?:true|false)\b")
RETURN = re.compile(r"\breturn ([^;{}]+);")
NAMES: Dict[str, str] = {
    "BusState::idle": "BusState::busy",
    "BusState::busy": "BusState::nack",
    "BusState::nack": "BusState::lost",
    "BusState::lost": "BusState::idle",
    "PwmRate::medium": "PwmRate::fast",
    "PwmRate::fast": "PwmRate::slow",
    "BridgePin::pwm_a": "BridgePin::pwm_b",
    "BridgePin::pwm_b": "BridgePin::logic",
    "OUTPUT_A": "OUTPUT_B",
    "OUTPUT_B": "OUTPUT_A",
    "PORTB": "PORTD",
    "PORTD": "PORTB",
}
"""Values of enumerations, and names of registers' parts that are easily mistaken for each other."""
NAMED = re.compile("|".join(rf"(?<![\w:]){name}\b" for name in NAMES))
INSTRUCTIONS: Dict[str, str] = {
    "adc": "add",
    "add": "adc",
    "asr": "lsr",
    "breq": "brne",
    "dec": "inc",
    "or": "mov",
    "ori": "andi",
    "sbrs": "sbrc",
    "sbi": "cbi",
    "sei": "cli",
}


class Change(NamedTuple):
    """Text that takes the place of a range."""

    kind: str
    begin: int
    end: int
    after: str


def mutants_of(name: str, text: str) -> List[Tuple[Mutant, str]]:
    """All mutants of a source, each with its whole text."""
    masked = _masked(text)
    found: List[Tuple[Mutant, str]] = []
    seen: Counter = Counter()
    for change in sorted(set(_changes(text, masked)), key=lambda each: (each.begin, each.end, each.after)):
        begin, end = _line(text, change.begin, change.end)
        before = _one_line(text[begin:end])
        after = _one_line(text[begin : change.begin] + change.after + text[change.end : end])
        mutant = Mutant(name, _function(masked, change.begin), change.begin, text.count("\n", 0, change.begin) + 1,
                        change.kind, before, after)  # fmt: skip
        seen[mutant.key] += 1
        mutant.occurrence = seen[mutant.key]
        found.append((mutant, text[: change.begin] + change.after + text[change.end :]))
    return found


def _masked(text: str) -> str:
    """The text with blanks, at the same places, where nothing is to be changed."""
    text = NOT_CODE.sub(lambda match: re.sub(r"[^\n]", " ", match.group()), text)
    return ARRAY.sub(
        lambda match: re.sub(r"\[\w+\]|\[[\w:]+\]", lambda m: " " * len(m.group()), match.group()), text
    )


def _changes(text: str, masked: str) -> Iterator[Change]:
    assembly = [match.span() for match in ASSEMBLY.finditer(masked)]
    yield from _assembly(masked)
    for change in _of_cpp(text, masked):
        if not any(begin <= change.begin < end for begin, end in assembly):
            yield change


def _assembly(masked: str) -> Iterator[Change]:
    for match in ASSEMBLY.finditer(masked):
        for part in re.finditer(r"(?:(?!\\n\\t).)+", match.group(2)):
            begin, end = match.start(2) + part.start(), match.start(2) + part.end()
            if re.fullmatch(r"[A-Z_a-z]+", part.group()) and part.group() not in (
                "sei",
                "sleep",
                "cli",
                "reti",
            ):
                continue  # a name of an operand, not an instruction
            yield Change("instruction", begin, end, "")
            word = part.group().split()[0]
            if word in INSTRUCTIONS:
                yield Change("instruction", begin, begin + len(word), INSTRUCTIONS[word])


def _of_cpp(text: str, masked: str) -> Iterator[Change]:
    for match in OPERATOR.finditer(masked):
        operator = match.group()
        others = {
            **COMPARISONS,
            **ARITHMETIC,
            **ASSIGNMENTS,
            "&&": ("", "||"),
            "||": ("", "&&"),
            "^=": ("", "|="),
        }
        kind = (
            "comparison"
            if operator in COMPARISONS
            else "boolean"
            if operator in ("&&", "||")
            else "arithmetic"
        )
        for other in others.get(operator, ("",))[1:]:
            yield Change(kind, *match.span(), other)
    for kind, pattern, after in (
        ("boolean", NEGATION, ""),
        ("arithmetic", COMPLEMENT, ""),
        ("bit", BIT, "0"),
    ):
        for match in pattern.finditer(masked):
            yield Change(kind, *match.span(), after)
    for match in STEP.finditer(masked):
        yield Change("arithmetic", *match.span(), "--" if match.group() == "++" else "++")
    for match in NUMBER.finditer(masked):
        value = int(match.group(), 0)
        for other in (value + 1, value - 1):
            yield Change("constant", *match.span(), f"{other:#x}" if "x" in match.group() else str(other))
    for match in TRUTH.finditer(masked):
        yield Change("constant", *match.span(), "false" if match.group() == "true" else "true")
    for match in NAMED.finditer(masked):
        yield Change("name", *match.span(), NAMES[match.group()])
    yield from _conditions(masked)
    yield from _statements(masked)
    for match in RETURN.finditer(masked):
        if not NUMBER.fullmatch(match.group(1)) and not TRUTH.fullmatch(match.group(1)):
            yield Change("return", *match.span(1), f"!({text[slice(*match.span(1))]})")


def _conditions(masked: str) -> Iterator[Change]:
    for match in CONDITION.finditer(masked):
        begin = match.end()
        end = _closing(masked, begin)
        condition = masked[begin:end]
        if not condition.startswith("!") or "&&" in condition:
            yield Change("boolean", begin, end, f"!({condition})")


def _closing(masked: str, begin: int) -> int:
    """The place of the parenthesis that closes what has been opened before `begin`."""
    depth = 1
    for place in range(begin, len(masked)):
        depth += {"(": 1, ")": -1}.get(masked[place], 0)
        if not depth:
            return place
    raise ValueError("a parenthesis is not closed")


def _statements(masked: str) -> Iterator[Change]:
    """Statements that are left out: assignments, calls, steps, and returns of nothing."""
    for match in re.finditer(r"[^;{}]*;", masked):
        text = match.group()
        begin = match.start() + len(text) - len(text.lstrip())
        while True:
            control = CONTROL.match(masked, begin, match.end())
            if not control:
                break
            begin = control.end()
            opened = re.compile(r" *\(").match(masked, begin, match.end())
            if opened:
                begin = _closing(masked, opened.end()) + 1
            begin += len(masked[begin : match.end()]) - len(masked[begin : match.end()].lstrip())
        statement = masked[begin : match.end()]
        if begin >= match.end() or statement.count("(") != statement.count(")") or '"' in statement[:1]:
            continue
        in_function = masked[masked.rfind("\n", 0, begin) + 1 : begin + 1].startswith(
            (" ", "ISR", "static inline")
        )
        if in_function and (statement == "return;" or (len(statement) > 1 and not DECLARES.match(statement))):
            yield Change("statement", begin, match.end(), ";")


def _function(masked: str, place: int) -> str:
    """The function around a place."""
    lines = masked[: masked.find("\n", place)].split("\n")
    for line in reversed(lines):
        match = HEAD.match(line)
        if match:
            return next(each for each in match.groups() if each)
        if line.startswith(("constexpr", "}  // namespace", "volatile")):
            return "constant"
    return "constant"


def _line(text: str, begin: int, end: int) -> Tuple[int, int]:
    return text.rfind("\n", 0, begin) + 1, text.find("\n", end)


def _one_line(text: str) -> str:
    return " ".join(re.sub(r" //.*|\\$", "", text).split())
