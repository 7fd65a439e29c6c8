"""Installs mrl-driver in an empty environment and drives an emulated robot with it, as a newcomer does.

    python3 -m tests.packaging.first_motion build/dist/mrl_driver-0.4.0-py3-none-any.whl
    python3 -m tests.packaging.first_motion .

It needs no compiler.  It prints the time from the start of pip to the first motion; what pip downloads was
there before.  Then it serves the page, and uploads the build of a bare board where avrdude is.
"""

import contextlib
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
import urllib.request
from pathlib import Path

from tests.cli.bootloader import Bootloader
from tests.cli.terminal import Terminal

START_S = 300.0  # pip and Python start slowly where other programs run


def installed(source, folder):
    """The folder of the programs after an installation with the extra `web`, when that began, and its CPU time [s]."""
    subprocess.run([sys.executable, "-m", "venv", str(folder / "venv")], check=True)
    pip, packages = (
        [str(folder / "venv/bin/pip"), "--disable-pip-version-check", "-q"],
        str(folder / "packages"),
    )
    wanted = f"{source}[web]"
    subprocess.run([*pip, "download", "-d", packages, "setuptools", "wheel", wanted], check=True)
    began_s, before_s = time.monotonic(), cpu_s()
    subprocess.run([*pip, "install", "--no-index", "--find-links", packages, wanted], check=True)
    return folder / "venv/bin", began_s, cpu_s() - before_s


def cpu_s():
    """CPU time of all programs that have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def demo(programs, *options):
    """The demonstration of the installed programs."""
    return Terminal("demo", *options, mrl=[programs / "mrl"])


def end(terminal):
    """Press q, and wait for the end; an error if its exit code is not 0."""
    terminal.press(b"q")
    terminal.wait_for("mrl new", timeout_s=START_S)
    assert terminal.end() == 0


def drive(programs):
    """Drive with the keys, until the wheels have measured a motion; returns when that was [s]."""
    terminal = demo(programs)
    terminal.wait_for("asked", timeout_s=START_S)
    terminal.wait_for(r"path +0\.(?!00)\d\d m", b"w", START_S)
    moved_s = time.monotonic()
    end(terminal)
    return moved_s


def page(programs):
    """The page, as a browser gets it."""
    terminal = demo(programs, "--web")
    address = terminal.wait_for(r"http://[\w.:]+/?\S*", timeout_s=START_S)[0]
    with urllib.request.urlopen(address) as answer:
        got = answer.read()
    end(terminal)
    return got


def flash(programs):
    """What `mrl flash --build virtual` writes to a bootloader, which is no board afterwards."""
    with contextlib.closing(Bootloader()) as board:
        command = [str(programs / "mrl"), "flash", "--build", "virtual", "--port", board.path, "--yes"]
        said = subprocess.run(command, capture_output=True, text=True).stderr
        assert "was written and read back" in said, said
        return bytes(board.flash)


def main():
    source = Path(sys.argv[1]).resolve()
    compilers = [name for name in ("gcc", "cc", "g++", "avr-gcc", "avr-g++") if shutil.which(name)]
    print(f"{source.name}, Python {sys.version.split()[0]}, compilers: {', '.join(compilers) or 'none'}")
    with tempfile.TemporaryDirectory() as name:
        programs, began_s, pip_s = installed(source, Path(name))
        installed_s = time.monotonic() - began_s
        os.chdir(name)
        moved_s = drive(programs) - began_s
        print(f"pip install: {installed_s:.1f} s (CPU {pip_s:.1f} s); first motion after {moved_s:.1f} s")
        print(f"mrl web: {len(page(programs))} bytes")
        if shutil.which("avrdude") and source.suffix == ".whl":  # a clone has no images without a compiler
            print(f"mrl flash: {len(flash(programs).rstrip(bytes([0xFF])))} bytes of the virtual build")


if __name__ == "__main__":
    main()
