"""Packages of others that launch files start, and how to get them.  Needs no master."""

import sys
from typing import Dict, List, NamedTuple, Sequence

from mrl_driver.errors import ConfigError


class Origin(NamedTuple):
    """Where a package comes from."""

    repository: str
    released: bool = True  # Noetic has it as a Debian package
    one: bool = True  # ROS One has it too, if it is released
    program: str = ""
    """The program that a launch file starts, if Debian has it in another package than the rest."""
    debian: str = ""  # Debian's packages with that program


_NAVIGATION = "https://github.com/ros-planning/navigation"
_MULTIMASTER = "https://github.com/fkie/multimaster_fkie"
_JOYSTICKS = "https://github.com/ros-drivers/joystick_drivers"
PACKAGES: Dict[str, Origin] = {
    "amcl": Origin(_NAVIGATION),
    "diagnostic_aggregator": Origin(
        "https://github.com/ros/diagnostics",
        program="aggregator_node",
        debian="libdiagnostic-aggregator-tools libdiagnostic-aggregator-dev",
    ),
    "fkie_master_discovery": Origin(_MULTIMASTER, one=False),
    "fkie_master_sync": Origin(_MULTIMASTER, one=False),
    "gmapping": Origin("https://github.com/ros-perception/slam_gmapping"),
    "hector_mapping": Origin("https://github.com/tu-darmstadt-ros-pkg/hector_slam"),
    "joy": Origin(_JOYSTICKS),
    "map_server": Origin(_NAVIGATION),
    "move_base": Origin(_NAVIGATION),
    "range_sensor_layer": Origin("https://github.com/DLu/navigation_layers", released=False),
    "robot_localization": Origin("https://github.com/cra-ros-pkg/robot_localization"),
    "rplidar_ros": Origin("https://github.com/Slamtec/rplidar_ros"),
    "tf2_ros": Origin(
        "https://github.com/ros/geometry2", program="static_transform_publisher", debian="tf2-tools"
    ),
    "twist_mux": Origin("https://github.com/ros-teleop/twist_mux"),
    "urg_node": Origin("https://github.com/ros-drivers/urg_node"),
    "wiimote": Origin(_JOYSTICKS),
}
"""Packages that Debian lacks, or has apart from what a robot needs; rviz is left out, because all know it."""


def missing(needed: Sequence[str]) -> List[str]:
    """Those of the packages that are not on ROS_PACKAGE_PATH, or lack their program."""
    import rospkg
    from roslib.packages import find_node

    found = set(rospkg.RosPack().list())
    programs = {package: PACKAGES[package].program for package in needed}
    return [
        package
        for package, program in programs.items()
        if package not in found or (program and not find_node(package, program))
    ]


def advice(packages: Sequence[str]) -> str:
    """One line that names missing packages and how to get them."""
    released = [package for package in packages if PACKAGES[package].released]
    debian = [PACKAGES[package].debian for package in packages if PACKAGES[package].debian]
    ways = [f"apt install {' '.join(debian)} (Debian)"] if debian else []
    if released:
        one = (("one", "ROS One"),) if all(PACKAGES[package].one for package in released) else ()
        for distro, name in (("noetic", "Noetic"), *one):
            names = (f"ros-{distro}-{package.replace('_', '-')}" for package in released)
            ways.append(f"apt install {' '.join(names)} ({name})")
    repositories = sorted({PACKAGES[package].repository for package in packages})
    ways.append(f"build {' '.join(repositories)} in your workspace")
    noun = "package" if len(packages) == 1 else "packages"
    only = [package for package in packages if package not in released]
    source = f" ({', '.join(only)}: from source only)" if released and only else ""
    return f"{noun} {', '.join(packages)} missing: {', or '.join(ways)}{source}"


def main() -> int:
    """The program `need_packages PACKAGE ...`, which launch files run before nodes of other packages.

    Prints the packages if all are there; otherwise the line that says how to get the missing ones, and returns 1.
    """
    needed = sys.argv[1:]
    if {"-h", "--help"}.intersection(needed):
        sys.stdout.write(
            f"usage: need_packages PACKAGE ...\n\nSays how to get those that are missing, of: {', '.join(PACKAGES)}\n"
        )
        return 0
    unknown = [package for package in needed if package not in PACKAGES]
    if unknown or not needed:
        raise ConfigError(f"got {' '.join(unknown) or 'nothing'}, expected packages of {', '.join(PACKAGES)}")
    lacking = missing(needed)
    if lacking:
        sys.stderr.write(f"{advice(lacking)}\n")
        return 1
    sys.stdout.write(" ".join(needed))
    return 0
