"""The sketch as the Arduino IDE builds it, builds that must fail, and what `make` says and leaves alone."""

import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.conftest import EXPLORE

ROOT = Path(__file__).resolve().parent.parent.parent
SKETCH = ROOT / "firmware" / "mrl_firmware"
OBJECTS = ROOT / "build" / "firmware" / "mrl_firmware.o"
CORE_OBJECTS = ROOT / "build" / "firmware" / "core_uno"
ARDUINO = Path("/usr/share/arduino/hardware/arduino/avr")


def run(*command, **options):
    return subprocess.run(
        [str(part) for part in command], capture_output=True, text=True, cwd=ROOT, check=False, **options
    )


class Ide:
    """The Arduino IDE's steps, as `platform.txt` and `boards.txt` of the core say."""

    def __init__(self, folder: Path, board: str = "uno") -> None:
        text = "".join((ARDUINO / name).read_text() for name in ("platform.txt", "boards.txt"))
        self.values = dict(line.split("=", 1) for line in text.splitlines() if re.match(r"[\w.]+=", line))
        for prefix in (f"{board}.", f"{board}.menu.cpu.atmega2560."):
            own = {key[len(prefix) :]: value for key, value in self.values.items() if key.startswith(prefix)}
            self.values.update(own)
        self.values.update({
            "compiler.path": "", "build.arch": "AVR", "runtime.ide.version": "10819", "build.path": str(folder),
            "build.project_name": "mrl_firmware.ino", "archive_file": "core.a", "archive_file_path": f"{folder}/core.a",
            "build.extra_flags": "-DDECIMAL_DIG=__DECIMAL_DIG__",  # WString.cpp of core 1.8.7 needs it with gcc 5.4
            "includes": f"-I{ARDUINO}/cores/arduino -I{ARDUINO}/variants/{self.values['build.variant']}",
        })  # fmt: skip
        self.folder = folder

    def step(self, recipe: str, **values: str) -> None:
        command, before = self.values[recipe], ""
        while command != before:
            before = command
            command = re.sub(r"\{([\w.]+)\}", lambda name: {**self.values, **values}[name[1]], command)
        done = run(*shlex.split(command))
        assert done.returncode == 0, done.stderr

    def compiled(self, source: Path, number: int) -> str:
        target = self.folder / f"{number}{source.name}.o"
        self.step(f"recipe.{source.suffix[1:]}.o.pattern", source_file=str(source), object_file=str(target))
        return str(target)

    def built(self, sketch: Path) -> str:
        """Compile the sketch, the files of its src folder and the core; return the hex file's text."""
        main = self.folder / "mrl_firmware.ino.cpp"
        main.write_text("#include <Arduino.h>\n" + (sketch / "mrl_firmware.ino").read_text())
        shutil.copytree(sketch / "src", self.folder / "src")
        for header in ("build.h", "pins.h"):
            shutil.copy(sketch / header, self.folder)
        sources = [main, *sorted((self.folder / "src").rglob("*.cpp"))]
        objects = [self.compiled(source, 0) for source in sources]
        core = ARDUINO / "cores/arduino"
        for number, source in enumerate(sorted([*core.glob("*.c"), *core.glob("*.cpp")])):
            self.step("recipe.ar.pattern", object_file=self.compiled(source, number))
        self.step("recipe.c.combine.pattern", object_files=shlex.join(objects))
        self.step("recipe.objcopy.hex.pattern")
        return (self.folder / "mrl_firmware.ino.hex").read_text()


IDE_BUILDS = [("_hbridge_mega", "MRL_BRIDGE", "mega"), ("", "", "uno")]
"""Each takes 4 s; the second one has the same steps, and nothing to set."""


@pytest.mark.parametrize("suffix, option, board", IDE_BUILDS if EXPLORE else IDE_BUILDS[:1])
def test_the_binary_of_the_arduino_ide_is_the_measured_one(tmp_path, suffix, option, board):
    """Without this checkout, Python or make: a folder, and the options that a user sets in build.h."""
    sketch, build = tmp_path / "sketch", tmp_path / "build"
    shutil.copytree(SKETCH, sketch)
    build.mkdir()
    options = (sketch / "build.h").read_text()
    (sketch / "build.h").write_text(options.replace(f"#define {option} 0", f"#define {option} 1", 1))
    measured = ROOT / "build" / "firmware" / f"mrl_firmware{suffix}.hex"
    assert Ide(build, board).built(sketch) == measured.read_text()


def test_forgotten_handler_fails_to_link(tmp_path):
    """Without motion.cpp nobody carries out command 11."""
    objects = [path for path in OBJECTS.rglob("*.o") if path.name != "motion.cpp.o"]
    built = run(
        "avr-gcc",
        "-mmcu=atmega328p",
        "-flto",
        "-O1",
        *objects,
        *CORE_OBJECTS.rglob("*.o"),
        "-o",
        tmp_path / "x",
    )
    assert built.returncode != 0 and "move_differential" in built.stderr


WRONG_PINS = [
    ("-DMRL_ENVIRONMENT=0", "SONAR_TRIGGER = 12", "SONAR_TRIGGER = 13", "two functions share a pin"),
    ("-DMRL_ENVIRONMENT=1", "FAN = 7", "FAN = 8", "two functions share a pin"),
]
"""Build, what pins.h says, what it says instead, the compiler's message."""


@pytest.mark.parametrize("define, right, wrong, message", WRONG_PINS)
def test_impossible_pins_fail_to_compile(tmp_path, define, right, wrong, message):
    """The conflict of 2013 is one: two functions on one pin."""
    text = (SKETCH / "pins.h").read_text()
    assert right in text
    (tmp_path / "pins.h").write_text(text.replace(right, wrong))
    command = ["g++", "-std=gnu++11", "-fsyntax-only", define, f"-I{SKETCH}", "-x", "c++"]
    assert run(*command, SKETCH / "pins.h").returncode == 0
    failed = run(*command, tmp_path / "pins.h")
    assert failed.returncode != 0 and message in failed.stderr


@pytest.mark.parametrize(
    "defines, words",
    [
        ("-DMRL_BRIDGE=1 -DMRL_XBEE=1", "set only one of the three to 1"),
        ("-DMRL_BRIDGE=1 -DMRL_ENVIRONMENT=1", "set only one of the three to 1"),
        ("-DMRL_MEGA=1", "an Arduino Mega has motors on an H-bridge"),
    ],
)
def test_builds_that_exclude_each_other_fail_with_one_error(defines, words):
    """An H-bridge needs the pins of the radio and of the dust sensor."""
    failed = run("g++", "-std=gnu++11", "-fsyntax-only", *defines.split(), "-x", "c++", SKETCH / "pins.h")
    errors = [line for line in failed.stderr.splitlines() if "error:" in line]
    assert len(errors) == 1 and words in errors[0]


def without_last_line(done):
    """What make says on stderr, without its own word that it failed."""
    return [line for line in done.stderr.splitlines() if not re.match(r"make(\[\d+\])?: \*\*\*", line)]


@pytest.mark.parametrize("port", ["", "/dev/nothing", "/dev/null/x"])
def test_flash_without_a_board_says_so_in_one_line(port):
    done = run("make", "-s", "flash", f"PORT={port}")
    assert done.returncode != 0
    lines = without_last_line(done)
    assert len(lines) == 1 and lines[0].startswith("make flash:")


def test_nothing_is_built_twice():
    binaries = "build/pc/libmrl_firmware.so", "build/pc/libmrl_firmware_hbridge.so"
    done = run("make", "-q", "MISSING=", "firmware", *binaries)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("binary", ["firmware/mrl_firmware.elf", "pc/libmrl_firmware.so"])
def test_removed_source_is_noticed(binary):
    """Its folder is newer then."""
    asked = ("make", "-q", "MISSING=", f"build/{binary}")
    removed = run(*asked, "-W", "firmware/mrl_firmware/src/motors")
    assert (run(*asked).returncode, removed.returncode) == (0, 1)


APT_GET = """#!/bin/sh
case "$*" in
  update) echo {update} ;;
  *--print-uris*) printf '{sizes}' | grep . ;;
  install*) exit 1 ;;
esac
"""


def apt_in(folder, *variables):
    """What `make apt` says on stderr in a folder with the Makefile alone, without make's own last line."""
    (folder / "firmware").mkdir(parents=True)
    for name in ("Makefile", "firmware/firmware.mk", "firmware/comparison.mk"):
        shutil.copy(ROOT / name, folder / name)
    done = run(
        "make", "-C", folder, "apt", "MISSING=of-nobody", "SUDO=env", *variables, start_new_session=True
    )
    assert done.returncode != 0
    return without_last_line(done)


def test_a_path_that_no_virtual_environment_can_have_is_refused_before_anything_is_installed(tmp_path):
    said = apt_in(tmp_path / "a:b")
    assert len(said) == 1 and said[0].startswith("make: got a path with a colon")


@pytest.mark.parametrize(
    "update, sizes, words",
    [
        ("Err:1", "", "make: apt reached no server"),
        ("Hit:1", "", "make: apt cannot install these packages"),
        (
            "Hit:1",
            "Need to get 2 MB of archives\nAfter this operation, 900000 GB of",
            "expected room for both sizes",
        ),
        ("Hit:1", "Need to get 2 MB/3 MB of archives", "make: apt could not install all packages"),
    ],
)
def test_what_keeps_packages_from_being_installed_is_said_in_one_line(tmp_path, update, sizes, words):
    apt_get = tmp_path / "apt-get"
    apt_get.write_text(APT_GET.format(update=update, sizes=sizes))
    apt_get.chmod(0o755)
    said = apt_in(tmp_path / "clone", f"APT_GET={apt_get}")
    assert len(said) == 1 and words in said[0]


def test_log_has_what_apt_says_without_its_progress(tmp_path):
    apt_get = tmp_path / "apt-get"
    said = "install*) printf 'Setting up a: b\\npmstatus:a:50.0:half\\nDone\\n';"
    apt_get.write_text(APT_GET.format(update="Hit:1", sizes="After this").replace("install*)", said))
    apt_get.chmod(0o755)
    apt_in(tmp_path / "clone", f"APT_GET={apt_get}")
    log = (tmp_path / "clone" / "build" / "apt.log").read_text()
    assert log.splitlines()[-2:] == ["Setting up a: b", "Done"]


def test_ctrl_c_says_that_apt_completes_what_it_has_begun(tmp_path):
    apt_get = tmp_path / "apt-get"
    ignores = "install*) trap '' INT; echo Begun; until grep -q Begun build/apt.log; do :; done; kill -INT 0; echo Done"
    apt_get.write_text(
        APT_GET.format(update="Hit:1", sizes="After this").replace("install*) exit 1", ignores)
    )
    apt_get.chmod(0o755)
    said = apt_in(tmp_path / "clone", f"APT_GET={apt_get}")
    assert len(said) == 1 and "apt first completes" in said[0]
    assert (tmp_path / "clone" / "build" / "apt.log").read_text().splitlines()[-2:] == ["Begun", "Done"]


def test_make_test_installs_what_it_needs_and_no_more():
    """The makes that it starts do not ask for the packages of `make test-all`."""
    said = run("make", "-n", "test", "MISSING=$(NEEDED)", "RUN=:").stdout
    wanted = re.findall(r"packages that are missing: (.*)", said)
    assert "avrdude" in wanted[0] and "clang" not in " ".join(wanted).split()


PACKAGE_APPEARS = f"""\
include firmware/firmware.mk
.PHONY: apt
apt:
	@cp -rL {ARDUINO} $(ARDUINO_AVR)
	@echo core installed
"""
"""The rules of the firmware, with `apt` as the Makefile has it on a machine without the Arduino core."""


def make(*words, **options):
    return subprocess.run(
        ["make", *map(str, words)], capture_output=True, text=True, cwd=ROOT, check=False, **options
    )


def files(tree):
    assert tree.is_dir()
    return {path.relative_to(tree): path.read_bytes() for path in tree.rglob("*") if path.is_file()}


def built(folder, how, *goals):
    """Builds against a core that appears while make runs; the core is in `avr` of the folder then."""
    (folder / "rules.mk").write_text(PACKAGE_APPEARS)
    folders = f"FW_BUILD={folder}", f"ARDUINO_AVR={folder / 'avr'}"
    done = make("-f", folder / "rules.mk", *folders, how, *(folder / goal for goal in goals))
    assert done.returncode == 0 and done.stdout.count("core installed") == 1, done.stderr


@pytest.mark.parametrize("how", ["apt", "-j2"], ids=["set-up first", "both at once"])
def test_core_installed_by_the_same_make_stays_whole(tmp_path, how):
    built(tmp_path, how, *(f"core_uno/{name}.o" for name in ("main.cpp", "hooks.c", "wiring.c")))
    assert files(tmp_path / "avr") == files(ARDUINO)


def test_two_builds_give_the_same_image(tmp_path):
    """Of one commit by one compiler, whatever the folder and the order of the jobs: here one after another."""
    built(tmp_path, "apt", "mrl_firmware.elf")
    image = ROOT / "build" / "firmware" / "mrl_firmware.hex"
    assert (tmp_path / "mrl_firmware.hex").read_bytes() == image.read_bytes()
    assert files(tmp_path / "avr") == files(ARDUINO)


def test_missing_core_is_named(tmp_path):
    goal = tmp_path / "firmware" / "core_uno" / "wiring.c.o"
    done = make(f"FW_BUILD={tmp_path / 'firmware'}", f"ARDUINO_AVR={tmp_path / 'avr'}", goal)
    assert done.returncode != 0
    assert f"no Arduino core in {tmp_path / 'avr'}: " in done.stderr


def test_no_rule_makes_a_file_outside_the_checkout():
    """`make -p` prints every rule; only names of files that no rule makes stand below "Not a target"."""
    printed = make("-pnq", "firmware", "pc-firmware").stdout
    rules = printed.replace("# Not a target:\n/", "").splitlines()
    assert "firmware: " in printed
    assert [rule for rule in rules if rule.startswith("/")] == []


@pytest.mark.parametrize("words, installed", [((), set()), (("ENGINE=avr",), {"gcc", "gcc-avr"})])
def test_make_run_installs_compilers_only_for_the_firmwares_binary(words, installed):
    done = run("make", "-s", "--eval", "show:; @echo $(PACKAGES_run)", "show", *words)
    assert set(done.stdout.split()) & {"gcc", "g++", "gcc-avr"} == installed
