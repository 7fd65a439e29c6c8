"""Mutants of Python sources: mutmut changes functions and methods, `_numbers` finds the numbers outside them.

Both work on a copy of packages and tests in build/mutants.  mutmut runs the tests that call the changed function in
their own process.
"""

import ast
import json
import pathlib
import shutil
import subprocess
import sys
from typing import Any, Dict, Iterator, List, Sequence, Tuple

from tests import tiers
from tests.long.mutants import Draw, Results

ROOT = pathlib.Path(__file__).resolve().parents[3]
PACKAGES = ("mrl_driver", "ros1_bridge", "sim_arduino")
CONFIG = """[mutmut]
source_paths=
 {packages}
only_mutate=
 {sources}
do_not_mutate_patterns=
 ^\\s*raise\\b
 ^\\s*f?"
pytest_add_cli_args_test_selection=
 {tests}
pytest_add_cli_args=
 -p
 no:cacheprovider
 -p
 no:xdist
 -p
 no:timeout
 -m
 not realtime
 -k
 not (frames_are_taken_at_once or byte_by_byte or call_path or no_frame_passes or thread_and_lock)
"""
"""Texts of errors are left alone, and mutmut has its own time limit.  Tests are left out that count calls (mutmut makes
more) or read the sources."""
NOTICED = (1, 3, 24, 36, 152, 255, -9, -11, -24)
"""mutmut's codes of mutants with which a test failed, lasted too long or crashed."""
NAMES = """import pathlib, sys
from mutmut.mutation.file_mutation import mutate_file_contents
from mutmut.utils.format_utils import get_mutant_name
for path in map(pathlib.Path, sys.argv[1:]):
    for name in mutate_file_contents(str(path), path.read_text()).mutant_names:
        print(path, get_mutant_name(path, name))
"""
SHOW = """import sys
from mutmut.mutation.diff_apply import get_diff_for_mutant
path, name = sys.argv[1:]
lines = get_diff_for_mutant(name, path=path).splitlines()[2:]
print(name.rpartition(".")[2], *[each for each in lines if each[0] in "-+"], sep=" ")
"""


def run(sources: Sequence[str], tests: Sequence[str], workers: int, draw: Draw) -> Results:
    """Try the mutants of a group that are drawn; a folder of tests is its quick tier."""
    files = sorted({file for each in tests for file in _files(ROOT / each)})
    work = ROOT / "build" / "mutants" / sources[0].replace("/", ".")
    _lay_out(work)
    config = dict(packages="\n ".join(PACKAGES), sources="\n ".join(sources), tests="\n ".join(files))
    (work / "setup.cfg").write_text(CONFIG.format(**config))
    mutants = [each.split() for each in _printed(work, NAMES, *sources).splitlines()]
    numbers = [(each, one) for each in sources for one in _numbers(ast.parse((ROOT / each).read_text()))]
    chosen = draw([*mutants, *numbers])
    _run_mutmut(work, [name for _, name in chosen if isinstance(name, str)], workers)
    copy, codes = work / "mutants", {}
    for source in sources:
        codes.update(json.loads((copy / f"{source}.meta").read_text())["exit_code_by_key"])
    unnoticed: Dict[Any, Tuple[str, str]] = {}
    """What is changed, and the source with it if that is still to be tried: mutmut changes no such number."""
    for source, each in chosen:
        if isinstance(each, ast.Constant):
            unnoticed[each] = _with_other_number(source, each)
        elif codes[each] not in NOTICED:
            unnoticed[each] = _printed(work, SHOW, source, each), ""
    for source in sources:
        shutil.copy(str(ROOT / source), str(copy / source))  # programs of the tests have no mutmut
    to_try, unchanged = any(text for _, text in unnoticed.values()), (ROOT / sources[0]).read_text()
    if to_try and not _passes(unchanged, sources[0], files, copy):
        raise SystemExit(f"tests of {', '.join(sources)} fail unchanged in {copy}, expected that all pass")
    for source in sources:
        own = [each for path, each in chosen if path == source]
        trials = (unnoticed[each] for each in own if each in unnoticed)
        alive = [shown for shown, text in trials if not text or _passes(text, source, files, copy)]
        yield source, len(own), alive
    shutil.rmtree(str(work))  # roslaunch and rosrun would find the nodes of these copies


def _printed(work: pathlib.Path, script: str, *arguments: str) -> str:
    """What a script of mutmut's modules prints."""
    command = [sys.executable, "-c", script, *arguments]
    return subprocess.check_output(command, cwd=str(work)).decode().rstrip("\n")


def _run_mutmut(work: pathlib.Path, names: Sequence[str], workers: int) -> None:
    mutmut = str(pathlib.Path(sys.executable).with_name("mutmut"))
    with open(str(work / "log"), "w") as log:
        command = [mutmut, "run", "--max-children", str(workers), *names]
        code = subprocess.run(command, cwd=str(work), stdout=log, stderr=log).returncode
    if code:
        raise SystemExit(f"mutmut ended with {code}, expected 0; its last lines in {work / 'log'} say why")


def _files(path: pathlib.Path) -> List[str]:
    if not path.exists():
        raise SystemExit(f"sources.yaml names {path}, which is not there")
    found = (
        [path] if path.is_file() else [each for each in path.rglob("test_*.py") if not tiers.of_file(each)]
    )
    return [str(each.relative_to(ROOT)) for each in found]


def _lay_out(work: pathlib.Path) -> None:
    """Links to what mutmut copies, and in the folder of the copies to what the tests read besides."""
    shutil.rmtree(str(work), ignore_errors=True)
    (work / "mutants").mkdir(parents=True)
    listed = subprocess.check_output(["git", "ls-files"], cwd=str(ROOT)).decode().splitlines()
    for name in {path.split("/")[0] for path in listed} | {"build"}:
        (work if name in (*PACKAGES, "tests") else work / "mutants").joinpath(name).symlink_to(ROOT / name)


def _numbers(node: ast.AST) -> Iterator[ast.Constant]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Constant) and type(child.value) in (int, float):
            yield child
        elif not isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef)):
            yield from _numbers(child)


def _with_other_number(source: str, number: ast.Constant) -> Tuple[str, str]:
    """The change of a number, 1 more or twice as much, and the source with it."""
    text = (ROOT / source).read_text()
    value = number.value + 1 if isinstance(number.value, int) else number.value * 2 or 1.0
    lines = text.encode().splitlines(keepends=True)
    line = lines[number.lineno - 1]
    new = line[: number.col_offset] + repr(value).encode() + line[number.end_col_offset :]
    lines[number.lineno - 1] = new
    change = f"line {number.lineno} - {line.decode().strip()} + {new.decode().strip()}"
    return change, b"".join(lines).decode()


def _passes(text: str, source: str, files: Sequence[str], copy: pathlib.Path) -> bool:
    """Whether all tests pass with this text of a source; those that name the source run first."""
    name = pathlib.Path(source).stem
    near = sorted(files, key=lambda file: name not in (ROOT / file).read_text())
    options = ["-x", "-n0", "-p", "no:cacheprovider", "-m", "not realtime"]  # pytest refuses -xn0
    command = [sys.executable, "-m", "pytest", *options, *near]
    (copy / source).write_text(text)
    done = subprocess.run(command, cwd=str(copy), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    shutil.copy(str(ROOT / source), str(copy / source))
    return not done.returncode
