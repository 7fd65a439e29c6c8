"""A few mutants of Python in each run of the tests, so that tests which no longer notice are noticed."""

import ast
import sys

import pytest

from .python.mutations import compiled, mutants_of
from .python.run import run, sample, targets
from .results import KILLED, equivalents, errors, score, survivors

SEED, COUNT, MOST_MISSED = 23, 50, 4
SOURCES = (
    "mrl_driver/session/motion_command.py",
    "mrl_driver/session/session.py",
    "mrl_driver/session/handshake.py",
    "mrl_driver/safety/wheel_monitor.py",
)
"""Safety sources that cost 1 to 1.4 s of CPU each with the first of their files of tests; each mutant costs 0.06 s."""

pytestmark = pytest.mark.skipif(
    sys.version_info < (3, 9), reason="names of mutants need ast.unparse of Python 3.9"
)


def keys_of(code):
    return [each.key for each in mutants_of(ast.parse(code))]


@pytest.mark.timeout(300)  # 9 s of CPU, in a process for each source and 50 forks
def test_the_nearest_tests_notice_a_sample_of_mutants():
    kept, listed, missed, count = targets(), equivalents(), [], 0
    for source, keys in sample(COUNT, SOURCES, SEED).items():
        result = run(source, kept[source]["tests"][:1], 2, keys=keys, keep=False)
        count += len(result["mutants"])
        missed += [
            f"{source}: {each['key']}"
            for each in survivors(result)
            if each["key"] not in listed.get(source, {})
        ]
    assert count == COUNT
    assert len(missed) <= MOST_MISSED, missed


def test_a_comparison_is_moved_by_its_boundary():
    assert keys_of("def f(x):\n    x < y") == ["f: x < y -> x <= y #1"]


def test_docstrings_and_errors_are_not_changed():
    assert keys_of('def f():\n    """Text."""\n    raise ValueError("x")') == [
        "f: raise ValueError('x') -> pass #1"
    ]


def test_the_same_change_twice_in_a_function_is_counted():
    assert keys_of("x = 1, 1") == ["<module>: 1 -> 2 #1", "<module>: 1 -> 2 #2"]


def test_a_mutant_leaves_the_source_as_it_was():
    tree = ast.parse("def f(a):\n    return a + 1")
    mutant = mutants_of(tree)[0]
    found = {}
    exec(compiled(tree, mutant, "f.py"), found)
    assert (mutant.key, found["f"](1), ast.dump(tree)) == (
        "f: a + 1 -> None #1" if mutant.kind == "return" else "f: a + 1 -> a - 1 #1",
        None if mutant.kind == "return" else 0,
        ast.dump(ast.parse("def f(a):\n    return a + 1")),
    )


def test_an_equivalent_does_not_lower_the_score():
    rows = [{"key": "a", "state": KILLED[0]}, {"key": "b", "state": "survived"}]
    counts = score({"file": "f.py", "mutants": rows}, {"f.py": {"b": "no difference"}})
    assert (counts.killed, counts.all, counts.equivalent, counts.share) == (1, 2, 1, 1.0)


def test_a_run_that_was_broken_off_is_an_error():
    result = {"file": "f.py", "mutants": [{"key": "a", "state": KILLED[0]}], "left": 3}
    assert errors(result, False, {}) == ["f.py: the run was broken off, 3 mutants are left; run it again"]
