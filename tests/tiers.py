"""The tier of a test, decided by what its file and its fixtures' files import.

`quick` is pure: no process, no port, no ROS, no compiler but g++ for the PC build that conformance drives.  `test` adds
processes, ports, documents, the firmware's parts, whole calibrations and the statistics of drawn robots; of ROS, the
firmware's image and the browser it has the files named `test_one_drive.py`.  `all` is everything.
"""

import functools
import inspect
import pathlib
import re

QUICK, TEST, ALL = range(3)
NAMES = {"quick": QUICK, "test": TEST, "all": ALL}
ROOT = pathlib.Path(__file__).parent.parent
OURS = ("tests", "mrl_driver", "sim_arduino", "ros1_bridge")

FOREIGN = re.compile(
    r"(ros(?!1_bridge)\w+|actionlib|tf2_\w+|genpy|catkin_pkg|dynamic_reconfigure|diagnostic_updater"
    r"|(?!mrl)\w+_msgs|std_srvs|selenium)(\.|$)"
)
"""What pip does not install for the quick tier; a file that imports one of these is not even imported there."""
CHIP = re.compile(r"sim_arduino\.(avr|board\.avr_board)")
OUTSIDE = re.compile(
    r"(subprocess|matplotlib|pty|socket|multiprocessing|sim_arduino\.(serve|testing)|tests\.consistency)(\.|$)"
)
FOLDERS = {
    "cli": TEST,
    "firmware": TEST,
    "calibration": TEST,
    "documents": TEST,
    "experiments": ALL,
    "packaging": ALL,
    "long": ALL,
}
ENGINES = {"python": QUICK, "pc": QUICK, "avr": ALL}
"""Parameters named `engine` decide with the folder: files of the conformance tests import every engine."""
IMPORT = re.compile(
    r"^([ \t]*)(?:from[ \t]+([\w.]+)[ \t]+import[ \t]+(\([^)]*\)|[^\n#]*)|import[ \t]+([\w. ,]+))", re.M
)


@functools.lru_cache(maxsize=None)
def _file_of(module):
    path = ROOT.joinpath(*module.split("."))
    found = (each for each in (path.with_suffix(".py"), path / "__init__.py") if each.is_file())
    return next(found, None) if module.split(".")[0] in OURS else None


@functools.lru_cache(maxsize=None)
def _imports(path):
    """Absolute names of what a file imports; of the product what it imports when it is imported itself."""
    names, package = set(), path.relative_to(ROOT).parent.parts
    for indent, base, listed, plain in IMPORT.findall(path.read_text(encoding="utf-8")):
        if indent and package[0] != "tests":
            continue
        names.update(name.split(" as ")[0].strip() for name in plain.split(",") if name)
        if base.startswith("."):
            up = len(base) - len(base.lstrip("."))
            base = ".".join((*package[: len(package) - up + 1], *filter(None, [base.lstrip(".")])))
        inner = (f"{base}.{name}" for name in re.findall(r"\w+", listed)) if base else ()
        names.update(filter(None, [base, *filter(_file_of, inner)]))
    return names


@functools.lru_cache(maxsize=None)
def _files_of(path, within):
    """The files of the packages `within` that a file imports."""
    return {_file_of(name) for name in _imports(path) if name.split(".")[0] in within} - {None}


@functools.lru_cache(maxsize=None)
def imported(path, within=OURS):
    """All that a file imports, through the modules of the packages `within`."""
    names, todo, seen = set(), {path}, set()
    while todo:
        file = todo.pop()
        seen.add(file)
        names |= _imports(file)
        todo |= _files_of(file, within) - seen
    return names


@functools.lru_cache(maxsize=None)
def is_foreign(path):
    """True if the file cannot be imported with what pip installs for the quick tier."""
    return any(map(FOREIGN.match, imported(path)))


@functools.lru_cache(maxsize=None)
def of_file(path):
    """The tier that a file's imports and its folder ask for."""
    direct = imported(path, ("tests",))
    if is_foreign(path) or any(map(CHIP.match, direct)):
        return ALL
    outside = any(map(OUTSIDE.match, direct)) or "openpty" in path.read_text(encoding="utf-8")
    return max(TEST if outside else QUICK, of_folder(path))


def of_folder(path):
    """The tier that a file's folder asks for."""
    return FOLDERS.get(path.relative_to(ROOT).parts[1], QUICK)


@functools.lru_cache(maxsize=None)
def _file_of_fixture(function):
    """The file of a fixture; None if it is none of ours."""
    file = pathlib.Path(inspect.getsourcefile(function))
    return file if ROOT / "tests" in file.parents else None


def _files(item):
    """The file of a test, and those of its fixtures."""
    definitions = (each for found in item._fixtureinfo.name2fixturedefs.values() for each in found)
    return {item.path, *(_file_of_fixture(each.func) for each in definitions)} - {None}


def _engine(item):
    callspec = getattr(item, "callspec", None)
    return callspec and callspec.params.get("engine")


def of_test(item):
    """The tier of a collected test: of engine and folder if it has an engine, else the highest of all its files."""
    if item.path.name == "test_one_drive.py":
        return TEST
    if item.get_closest_marker("realtime"):
        return ALL
    engine = _engine(item)
    if engine in ENGINES:
        return max(ENGINES[engine], of_folder(item.path))
    return max(map(of_file, _files(item)))


def needs_pc_build(item):
    """True if a test runs the firmware's C++ on the PC."""
    engine = _engine(item)
    if engine in ENGINES:
        return engine == "pc"
    return any("tests.firmware.pc_board" in imported(file, ("tests",)) for file in _files(item))
