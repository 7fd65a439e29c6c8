"""Claims of the documents that were wrong once, and steps that were missing."""

import re

import pytest

from ros1_bridge.node.packages import PACKAGES

from .blocks import ROOT

README, ROS_README = (
    " ".join((ROOT / name).read_text().split()) for name in ("README.md", "ros1_bridge/README.md")
)
ONLY_NOETIC = ("rqt", "robot_localization", "move_base", "amcl")


@pytest.mark.parametrize("package", ONLY_NOETIC)
def test_debian_is_not_said_to_have_what_only_noetic_has(package):
    (debian,) = re.findall(r"Debian has [^.]*\.", ROS_README)
    (noetic,) = re.findall(r"Only Noetic has [^.]*\.", ROS_README)
    assert package not in debian and package in noetic


@pytest.mark.parametrize("text", [README, ROS_README], ids=["README", "ROS README"])
def test_set_up_begins_with_a_clone(text):
    assert "git clone URL" in text


def test_rosdep_is_initialised_before_it_is_used():
    assert 0 < ROS_README.find("rosdep init") < ROS_README.find("rosdep install")


def test_namespaces_are_said_to_need_a_prefix():
    assert "each robot also needs `prefix:=robot1/`" in ROS_README


def test_arguments_that_roslaunch_calls_required_are_said_to_be_optional():
    assert 'calls arguments without a fixed default "required", but you may omit them' in ROS_README


@pytest.mark.parametrize("name", ["README.md", "HARDWARE.md"])
def test_root_is_given_the_path_of_mrl(name):
    """sudo does not search a virtual environment."""
    text = (ROOT / name).read_text()
    assert "sudo $(which mrl) system install" in text and "sudo mrl" not in text


def test_launch_files_that_need_packages_which_debian_lacks_are_listed():
    """With every such package, next to a launch file that names it."""
    text = (
        (ROOT / "ros1_bridge" / "README.md")
        .read_text()
        .split("## Packages that Debian lacks")[1]
        .split("\n#")[0]
    )
    rows = re.findall(r"^\| `(\w+\.launch)` \| ([^|]*) \|", text, re.M)
    assert {package for _, packages in rows for package in packages.split(", ")} == set(PACKAGES)
    for file, packages in rows:
        launch = (ROOT / "ros1_bridge" / "launch" / file).read_text()
        assert all(package in launch for package in packages.split(", ")), file
