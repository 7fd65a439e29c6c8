"""sdist and wheel hold what they need, and work outside the repository."""

import os
import pathlib
import shlex
import shutil
import subprocess
import sys
import tarfile
import zipfile

import pytest

from mrl_driver.host import firmware_images
from sim_arduino.avr import intel_hex

from . import first_motion

ROOT = pathlib.Path(__file__).resolve().parents[2]
FOLDERS = ("firmware", "mrl_driver", "ros1_bridge", "sim_arduino", "tests", ".ci")
IMAGES = {f"mrl_driver/images/{image}": f"build/firmware/{image}" for image in firmware_images.IMAGES}


def run(*command, cwd, **environment):
    done = subprocess.run(
        [str(word) for word in command],
        cwd=cwd,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def copy_sources(tree):
    """The sources alone, nothing that was built."""
    for path in ROOT.iterdir():
        if path.is_file():
            shutil.copy2(path, tree)
    for name in FOLDERS:
        shutil.copytree(ROOT / name, tree / name, ignore=shutil.ignore_patterns("__pycache__"))


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """An sdist of a copy of the tree, and a wheel of that sdist."""
    tree, out = tmp_path_factory.mktemp("tree"), tmp_path_factory.mktemp("dist")
    copy_sources(tree)
    for image in IMAGES.values():
        (tree / image).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / image, tree / image)
    run(sys.executable, "setup.py", "-q", "sdist", "-d", out, cwd=tree)
    with tarfile.open(next(out.glob("*.tar.gz"))) as archive:
        archive.extractall(out / "unpacked")
    (source,) = (out / "unpacked").iterdir()
    code = "import sys; from setuptools.build_meta import build_wheel; build_wheel(sys.argv[1])"
    run(sys.executable, "-c", code, out, cwd=source)
    return out


@pytest.fixture(scope="module")
def wheel(built):
    return next(built.glob("*.whl"))


def environment(place):
    """A virtual environment in a folder: of this one it has what mrl-driver needs, of ROS nothing."""
    run(sys.executable, "-m", "venv", "--without-pip", "--system-site-packages", "venv", cwd=place)
    python = place / "venv" / "bin" / "python"
    library = run(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", cwd=place).strip()
    ours = [path for path in sys.path if path.endswith("-packages")]
    no_ros = "import sys; sys.modules.update(rospy=None, rosgraph=None)"
    pathlib.Path(library, "needs.pth").write_text("\n".join([*ours, no_ros]))
    return python


def pip_for(python):
    """Its own pip is that of this environment, too."""
    return python, "-m", "pip", "--disable-pip-version-check"


@pytest.fixture(scope="module")
def place(wheel, tmp_path_factory):
    """An environment with the wheel, and a folder beside it."""
    place = tmp_path_factory.mktemp("elsewhere")
    python = environment(place)
    run(*pip_for(python), "install", "-q", "--no-compile", "--no-deps", "--no-index", wheel, cwd=place)
    return place


@pytest.fixture(scope="module")
def from_clone(tmp_path_factory):
    """An environment after `pip install .` in a fresh clone, on a computer without a cross compiler."""
    place, tree = tmp_path_factory.mktemp("bare"), tmp_path_factory.mktemp("clone")
    copy_sources(tree)
    python = environment(place)
    options = ("--no-compile", "--no-deps", "--no-index", "--no-build-isolation")
    run(*pip_for(python), "install", "-q", *options, tree, cwd=tree, PATH="")
    return place


def tried(place, *words):
    return run(place / "venv" / "bin" / words[0], *words[1:], cwd=place, PYTHONPATH="")


def test_sdist_holds_sources_tests_and_images(built):
    with tarfile.open(next(built.glob("*.tar.gz"))) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    wanted = {
        "Makefile",
        "package.xml",
        "firmware/mrl_firmware/pins.h",
        "firmware/PROTOCOL.md",
        "tests/vectors.yaml",
    }
    assert wanted | set(IMAGES) | {"ros1_bridge/launch/robot.launch", "pyproject.toml"} <= names


def test_wheel_holds_every_module_and_all_data(wheel):
    folders = ("mrl_driver", "sim_arduino", "ros1_bridge")
    modules = {str(p.relative_to(ROOT)) for folder in folders for p in (ROOT / folder).rglob("*.py")}
    data = {str(p.relative_to(ROOT)) for p in (ROOT / "mrl_driver" / "robot" / "models").glob("*.yaml")}
    data |= {str(p.relative_to(ROOT)) for p in (ROOT / "sim_arduino").rglob("worlds/*")}
    data |= {str(p.relative_to(ROOT)) for p in (ROOT / "mrl_driver").glob("apps/*/page/**/*") if p.is_file()}
    data |= {f"mrl_driver/apps/measure/{name}" for name in ("emulated.json", "measure.html", "measure.css")}
    data |= {"mrl_driver/robot/models/robot.schema.json", "sim_arduino/world/world.schema.json"}
    data |= {"ros1_bridge/topics/sensors.yaml", "sim_arduino/avr/board.h", "mrl_driver/py.typed", *IMAGES}
    assert modules | data <= set(zipfile.ZipFile(wheel).namelist())


COMPILER = f"""#!/bin/sh
built={shlex.quote(str(ROOT))}
eval "option=\\${{$(($# - 3))}} source=\\${{$(($# - 2))}} output=\\${{$#}}"
case $option$source in -c[!/]*) cmp "$source" "$built/$source" || exit 1 ;; esac
exec cp "$built/${{output%.new}}" "$output"
"""
"""Takes what `make firmware` has built of the same sources, which spares half a minute of computing.

Its arguments end with `-c SOURCE -o OBJECT`, or with `OBJECT... -o IMAGE.new`.
"""


def test_pip_builds_the_images_of_a_fresh_clone(tmp_path, monkeypatch):
    """Nothing was built in it; the computer has make and a cross compiler."""
    tree, out, programs = tmp_path / "clone", tmp_path / "dist", tmp_path / "programs"
    for folder in (tree, out, programs):
        folder.mkdir()
    for name in ("avr-gcc", "avr-g++"):
        (programs / name).write_text(COMPILER)
        (programs / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{programs}:{os.environ['PATH']}")
    copy_sources(tree)
    options = ("-q", "--no-deps", "--no-build-isolation", "-w", out)
    run(*pip_for(sys.executable), "wheel", *options, tree, cwd=out)
    wheel = zipfile.ZipFile(next(out.glob("*.whl")))
    images = {name: wheel.read(name) for name in wheel.namelist() if name.endswith(".hex")}
    assert images == {name: (ROOT / built).read_bytes() for name, built in IMAGES.items()}


def test_modules_and_image_come_from_the_wheel(place):
    code = (
        "import sim_arduino, mrl_driver.host.firmware_images as i; from sim_arduino.avr.elf import read_image; "
        "print(sim_arduino.__file__, i.image_path(), sum(len(d) for _, d in read_image(i.image_path()).flash))"
    )
    module, image, size = tried(place, "python", "-c", code).split()
    assert str(place) in module and str(place) in image and 15000 < int(size) < 32256


@pytest.fixture
def programs(place, monkeypatch):
    """The folder of the programs of the wheel, away from the checkout."""
    monkeypatch.chdir(place)
    monkeypatch.delenv("PYTHONPATH", raising=False)
    return place / "venv" / "bin"


def test_the_wheel_drives_with_the_keys(programs):
    first_motion.drive(programs)


def test_the_wheel_serves_the_page(programs):
    assert b"</html>" in first_motion.page(programs)


def test_the_wheel_uploads_the_build_of_a_bare_board(programs):
    (wanted,) = (text.read_text() for text in programs.parent.rglob("mrl_firmware_virtual.hex"))
    got = first_motion.flash(programs)
    assert all(got[at : at + len(data)] == data for at, data in intel_hex.read(wanted))


def test_fresh_clone_drives_an_emulated_robot_without_ros(from_clone):
    """As in the first tutorial: mrl-sim serves, mrl drive drives."""
    command = [from_clone / "venv" / "bin" / "mrl-sim", "--robot", "traxbot", "--link", "ttyTRAX0"]
    with subprocess.Popen(command, cwd=from_clone, stdout=subprocess.PIPE, text=True) as emulator:
        try:
            assert emulator.stdout.readline().startswith("/dev/")
            said = tried(from_clone, "mrl", "drive", "--port", "ttyTRAX0", "--linear", "0.2", "--for", "1")
        finally:
            emulator.terminate()
    assert float(said.split()[1]) > 0.05  # x [m]
