"""One set-up for pip and for catkin.  The version stands in package.xml alone."""

import os
import pathlib
import re
import shutil
import subprocess
import xml.etree.ElementTree

from setuptools import find_packages, setup
from setuptools.command.build_py import build_py
from setuptools.command.sdist import sdist

_HERE = pathlib.Path(os.path.dirname(os.path.abspath(__file__)))
_VERSION = xml.etree.ElementTree.parse(str(_HERE / "package.xml")).findtext("version")
_EXTRAS = {
    "mutants": ["mutmut>=3.8,<4; python_version >= '3.10'"],
    "docs": ["mkdocs>=1.6,<2", "mkdocs-material>=9.7", "mkdocstrings[python]>=1"],
    "test": ["pytest>=7"],
    "plot": ["matplotlib>=3.5"],
    "web": ["aiohttp>=3.8", "cryptography>=2.8", "segno>=1.5"],
    "export": ["mcap>=1.6", "mcap-ros1-support>=0.9", "rosbags>=0.9.23"],
}
_IMAGES = os.path.join("mrl_driver", "images")


def _add_images(tree):
    """Copies what `make firmware` has built into the tree of a package; one that comes with images keeps them."""
    for image in sorted((_HERE / "build" / "firmware").glob("*.hex")):
        folder = pathlib.Path(tree, _IMAGES)
        folder.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(str(image), str(folder / image.name))


def _build_images():
    """Builds the images of a checkout that has none; without a cross compiler the package comes without them."""
    built = (_HERE / "build" / "firmware").glob("*.hex"), (_HERE / _IMAGES).glob("*.hex")
    if not any(any(images) for images in built) and shutil.which("make") and shutil.which("avr-g++"):
        subprocess.call(["make", "-s", f"-j{os.cpu_count() or 1}", "firmware", "MISSING="], cwd=str(_HERE))


def _long_description():
    """README.md as an index of packages shows it: without pictures, and links within the repository as words."""
    text = (_HERE / "README.md").read_text(encoding="utf-8")
    text = re.sub(r"^\|.*\n\| *---.*\n\| *!\[.*\n", "", text, flags=re.M)
    return re.sub(r"\[([^]]*)\]\((?!http)[^)]*\)", r"\1", text)


class BuildWithImages(build_py):
    """Packages with the firmware's images among the driver's data."""

    def run(self):
        """Builds, then adds the images; an editable install finds them in the checkout."""
        super().run()
        if not getattr(self, "editable_mode", False):
            _build_images()
            _add_images(self.build_lib)


class SdistWithImages(sdist):
    """Sources with the images, so that a wheel built from them has them without a cross compiler."""

    def make_release_tree(self, base_dir, files):
        """Fills the tree, then adds the images."""
        super().make_release_tree(base_dir, files)
        _add_images(base_dir)


setup(
    name="mrl-driver",
    version=_VERSION,
    description="Driver, firmware and emulator for TraxBot, StingBot and other Arduino robots, with a ROS 1 bridge",
    long_description=_long_description(),
    long_description_content_type="text/markdown",
    author="mrl-driver maintainers",
    license="BSD-3-Clause",
    keywords="arduino robot ros odometry sonar serial emulator",
    classifiers=[
        "Development Status :: 4 - Beta",
        "Environment :: Console",
        "Framework :: Pytest",
        "Intended Audience :: Education",
        "Intended Audience :: Science/Research",
        "Operating System :: POSIX :: Linux",
        "Programming Language :: C++",
        "Programming Language :: Python :: 3",
        "Programming Language :: Python :: 3.8",
        "Programming Language :: Python :: 3.9",
        "Programming Language :: Python :: 3.10",
        "Programming Language :: Python :: 3.11",
        "Programming Language :: Python :: 3.12",
        "Programming Language :: Python :: 3.13",
        "Topic :: Scientific/Engineering",
        "Topic :: System :: Hardware :: Hardware Drivers",
        "Typing :: Typed",
    ],
    python_requires=">=3.8",
    packages=find_packages(str(_HERE), include=["mrl_driver*", "sim_arduino*", "ros1_bridge*"]),
    package_data={
        "mrl_driver": ["py.typed", "images/*.hex"],
        "mrl_driver.apps.measure": ["*.json", "*.html", "*.css"],
        "mrl_driver.apps.tip_over": ["vehicles/*.yaml"],
        "mrl_driver.robot.models": ["*.yaml", "*.json"],
        "mrl_driver.robot.wirings": ["*.yaml"],
        "mrl_driver.apps.review": ["page/*"],
        "mrl_driver.apps.web": ["page/*", "page/vendor/*/*"],
        "sim_arduino": ["py.typed"],
        "sim_arduino.world": ["worlds/*.yaml", "*.json"],
        "sim_arduino.avr": ["*.c", "*.h"],
        "ros1_bridge.topics": ["*.yaml"],
    },
    install_requires=["pyserial>=3.5", "numpy>=1.17.3", "PyYAML>=5.4", "click>=8.1.4", "rich>=12.0"],
    extras_require={
        "dev": [
            "setuptools",
            "wheel",
            "pytest>=7",
            "pytest-xdist>=3",
            "pytest-timeout>=2",
            "pytest-randomly>=3.12",
            "hypothesis>=6",
            "jsonschema>=4",
            "selenium>=4.6",
            "ruff==0.17.6",
            "import-linter>=2; python_version >= '3.9'",
            "mypy>=1.8",
            *(package for extra in ("plot", "web", "export") for package in _EXTRAS[extra]),
            "codespell[toml]==2.3.0",
            "types-PyYAML",
            "types-pyserial",
        ],
        **_EXTRAS,
    },
    entry_points={
        "console_scripts": ["mrl=mrl_driver.__main__:main", "mrl-sim=sim_arduino.__main__:main"],
        "pytest11": ["mrl_sim=sim_arduino.testing.pytest_plugin"],
        "mrl.commands": [
            "calibrate=mrl_driver.apps.calibration.commands.calibrate:calibrate",
            "measure=mrl_driver.apps.measure.command:measure",
            "plot=mrl_driver.apps.review.plot_command:plot",
            "review=mrl_driver.apps.review.command:review",
            "tip-over=mrl_driver.apps.tip_over.command:tip_over",
            "web=mrl_driver.apps.web.command:web",
            "export=ros1_bridge.export.command:main",
            "demo=sim_arduino.demo:demo",
            "replay=sim_arduino.replay.replay:main",
            "mirror=sim_arduino.replay.mirror:main",
            "experiment=sim_arduino.experiments.cli:main",
        ],
        "mrl.experiments": ["ros=ros1_bridge.experiments.legs"],
    },
    cmdclass={"build_py": BuildWithImages, "sdist": SdistWithImages},
)
