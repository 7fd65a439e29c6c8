"""What `make` builds lies in the checkout; the Arduino core's files are read and left alone."""

import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent.parent
ARDUINO = Path("/usr/share/arduino/hardware/arduino/avr")
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
    built(tmp_path, how, "core/main.cpp.o", "core/hooks.c.o", "core/wiring.c.o")
    assert files(tmp_path / "avr") == files(ARDUINO)


def test_two_builds_give_the_same_image(tmp_path):
    """Of one commit by one compiler, whatever the folder and the order of the jobs: here one after another."""
    built(tmp_path, "apt", "mrl_firmware.elf")
    image = ROOT / "build" / "firmware" / "mrl_firmware.hex"
    assert (tmp_path / "mrl_firmware.hex").read_bytes() == image.read_bytes()
    assert files(tmp_path / "avr") == files(ARDUINO)


def test_missing_core_is_named(tmp_path):
    goal = tmp_path / "firmware" / "core" / "wiring.c.o"
    done = make(f"FW_BUILD={tmp_path / 'firmware'}", f"ARDUINO_AVR={tmp_path / 'avr'}", goal)
    assert done.returncode != 0
    assert f"no Arduino core in {tmp_path / 'avr'}: " in done.stderr


def test_no_rule_makes_a_file_outside_the_checkout():
    """`make -p` prints every rule; only names of files that no rule makes stand below "Not a target"."""
    printed = make("-pnq", "firmware", "pc-firmware").stdout
    rules = printed.replace("# Not a target:\n/", "").splitlines()
    assert "firmware: " in printed
    assert [rule for rule in rules if rule.startswith("/")] == []
