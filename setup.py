"""One set-up for pip and for catkin.  The version stands in package.xml alone."""

import os
import pathlib
import xml.etree.ElementTree

from setuptools import setup

_HERE = os.path.dirname(os.path.abspath(__file__))
_VERSION = xml.etree.ElementTree.parse(os.path.join(_HERE, "package.xml")).findtext("version")

setup(
    name="mrl-driver",
    version=_VERSION,
    description="Driver, firmware and emulator for TraxBot, StingBot and other Arduino robots, with a ROS 1 bridge",
    long_description=pathlib.Path(_HERE, "README.md").read_text(encoding="utf-8"),
    long_description_content_type="text/markdown",
    license="BSD-3-Clause",
    python_requires=">=3.8",
    packages=[
        "mrl_driver",
        "mrl_driver.commands",
        "mrl_driver.doctor",
        "mrl_driver.robots",
        "sim_arduino",
        "sim_arduino.avr",
        "ros1_bridge",
    ],
    package_data={
        "mrl_driver": ["py.typed"],
        "mrl_driver.robots": ["*.yaml"],
        "sim_arduino": ["py.typed", "worlds/*.yaml"],
        "ros1_bridge": ["*.yaml"],
        "sim_arduino.avr": ["*.c", "*.h"],
    },
    install_requires=[
        "pyserial>=3.5",
        "numpy>=1.17",
        "PyYAML>=5.3",
        "click>=8.0",
        "rich>=10.0",
        "platformdirs>=2.0",
    ],
    extras_require={
        "dev": [
            "pytest>=7",
            "pytest-xdist>=3",
            "pytest-timeout>=2",
            "hypothesis>=6",
            "ruff==0.17.6",
            "mypy>=1.8",
            "matplotlib>=3.5",
            "types-PyYAML",
            "types-pyserial",
        ],
        "test": ["pytest>=7"],
        "plot": ["matplotlib>=3.5"],
    },
    entry_points={
        "console_scripts": ["mrl=mrl_driver.cli:main", "mrl-sim=sim_arduino.cli:main"],
        "pytest11": ["mrl_sim=sim_arduino.pytest_plugin"],
        "mrl.commands": ["replay=sim_arduino.replay:main", "mirror=sim_arduino.mirror:main"],
    },
)
