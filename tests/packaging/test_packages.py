"""sdist and wheel hold what they need, and work outside the repository."""

import json
import os
import pathlib
import shutil
import subprocess
import sys
import tarfile
import xml.etree.ElementTree
import zipfile

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
VERSION = xml.etree.ElementTree.parse(ROOT / "package.xml").findtext("version")
FOLDERS = ("firmware", "mrl_driver", "ros1_bridge", "sim_arduino", "tests", ".ci")
IMAGES = {
    f"mrl_driver/images/mrl_firmware{build}.hex": f"build/firmware/mrl_firmware{build}.hex"
    for build in ("", "_environment", "_xbee")
}


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


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """An sdist of a copy of the tree, and a wheel of that sdist."""
    tree, out = tmp_path_factory.mktemp("tree"), tmp_path_factory.mktemp("dist")
    for path in ROOT.iterdir():
        if path.is_file():
            shutil.copy2(path, tree)
    for name in FOLDERS:
        shutil.copytree(ROOT / name, tree / name, ignore=shutil.ignore_patterns("__pycache__"))
    for image in IMAGES.values():
        (tree / image).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / image, tree / image)
    run(sys.executable, "setup.py", "-q", "sdist", "-d", out, cwd=tree)
    pip = (sys.executable, "-m", "pip", "--disable-pip-version-check")
    source = next(out.glob("*.tar.gz"))
    run(*pip, "wheel", "-q", "--no-deps", "--no-build-isolation", "-w", out, source, cwd=out)
    return out


@pytest.fixture(scope="module")
def wheel(built):
    return next(built.glob("*.whl"))


@pytest.fixture(scope="module")
def place(wheel, tmp_path_factory):
    """A virtual environment with the wheel, and with what it needs out of this one; a folder beside it."""
    place = tmp_path_factory.mktemp("elsewhere")
    run(sys.executable, "-m", "venv", "--without-pip", "--system-site-packages", "venv", cwd=place)
    python = place / "venv" / "bin" / "python"
    library = run(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", cwd=place).strip()
    ours = [path for path in sys.path if path.endswith("-packages")]
    pathlib.Path(library, "needs.pth").write_text("\n".join(ours))
    pip = (sys.executable, "-m", "pip", "--disable-pip-version-check", "--python", python)
    run(*pip, "install", "-q", "--no-deps", "--no-index", wheel, cwd=place)
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
    data = {str(p.relative_to(ROOT)) for p in (ROOT / "mrl_driver" / "robots").glob("*.yaml")}
    data |= {str(p.relative_to(ROOT)) for p in (ROOT / "sim_arduino").rglob("worlds/*")}
    data |= {"ros1_bridge/sensors.yaml", "sim_arduino/avr/board.h", "mrl_driver/py.typed", *IMAGES}
    assert modules | data <= set(zipfile.ZipFile(wheel).namelist())


@pytest.mark.parametrize("packaged, built_at", IMAGES.items(), ids=lambda path: pathlib.Path(path).name)
def test_packaged_image_is_the_one_that_was_built(wheel, packaged, built_at):
    assert zipfile.ZipFile(wheel).read(packaged) == (ROOT / built_at).read_bytes()


def test_version_is_that_of_package_xml(place):
    assert tried(place, "mrl", "--version").split()[-1] == VERSION


def test_modules_and_image_come_from_the_wheel(place):
    code = (
        "import sim_arduino, mrl_driver.images as i; from sim_arduino.avr.elf import read_image; "
        "print(sim_arduino.__file__, i.image_path(), sum(len(d) for _, d in read_image(i.image_path()).flash))"
    )
    module, image, size = tried(place, "python", "-c", code).split()
    assert str(place) in module and str(place) in image and 15000 < int(size) < 32256


def test_emulator_explains_itself(place):
    assert "--world" in tried(place, "mrl-sim", "--help")


def test_driver_talks_to_a_board(place, emulated_board):
    facts = json.loads(tried(place, "mrl", "info", "--port", emulated_board.port, "--json"))
    assert facts["robot"] == "traxbot"


def test_images_are_asked_for_by_build():
    from mrl_driver.errors import ConfigError
    from mrl_driver.images import image_path

    assert image_path("xbee").endswith("mrl_firmware_xbee.hex")
    with pytest.raises(ConfigError, match="build is 'zigbee', expected sonar, environment, xbee"):
        image_path("zigbee")
