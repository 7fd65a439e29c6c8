"""The URDF files: current, valid, and at one with the geometry."""

import math
import re
import subprocess
import xml.etree.ElementTree as ElementTree

import pytest

from mrl_driver.robot.models import ImuMount, LaserMount, ServoMount, driven_models, load
from ros1_bridge.description import urdf
from ros1_bridge.node.tf_names import imu_frame, joints_of, sonar_frame
from tests.models import four_wheels

from .rig import ROOT

NAMES = [model.name for model in driven_models()]
FILES = [path for path, _ in urdf.files()]


def tree(name, **options):
    return ElementTree.fromstring(urdf.render(load(name), **options))


def joint(robot, name):
    return next(each for each in robot.iter("joint") if each.get("name") == name)


def numbers(element, key):
    return [float(part) for part in element.get(key).split()]


@pytest.mark.parametrize("path, text", urdf.files(), ids=lambda each: getattr(each, "stem", ""))
def test_committed_file_is_current(path, text):
    assert path.read_text(encoding="utf-8") == text


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_check_urdf_accepts(path):
    done = subprocess.run(["check_urdf", str(path)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "root Link: base_link" in done.stdout


@pytest.mark.parametrize("name", NAMES)
def test_masses_and_inertias_are_those_of_a_body(name):
    model, inertias = load(name), list(tree(name, laser=True).iter("inertia"))
    mass = sum(float(each.get("value")) for each in tree(name).iter("mass"))
    assert mass == pytest.approx(model.body.mass_kg + 0.005 * len(model.sonars), rel=1e-3) and inertias
    for each in inertias:
        moments = sorted(float(each.get(key)) for key in ("ixx", "iyy", "izz"))
        assert moments[0] > 0
        assert moments[0] + moments[1] >= moments[2] * 0.999


@pytest.mark.parametrize("name, radius_m", [("traxbot", 0.0390), ("stingbot", 0.0327)])
def test_wheels_have_their_true_radius(name, radius_m):
    assert urdf.wheel_radius_m(load(name)) == pytest.approx(radius_m, abs=1e-4)


def test_servos_turn_joints_one_on_the_other():
    pan = ServoMount(1, -0.8, 0.8, 1000.0, 2000.0, 2.0, x_m=0.06, z_m=0.08)
    tilt = ServoMount(2, -0.4, 0.7, 1000.0, 2000.0, tilts=True, parent="pan", z_m=0.03)
    model = load("duo")._replace(servos={"pan": pan, "tilt": tilt})
    robot = ElementTree.fromstring(urdf.render(model, "r1/"))
    for name, parent, axis in (("pan", "r1/base_link", "0 0 1"), ("tilt", "r1/pan", "0 1 0")):
        found, mount = joint(robot, f"{name}_joint"), model.servos[name]
        assert (found.get("type"), found.find("parent").get("link")) == ("revolute", parent)
        assert (found.find("child").get("link"), found.find("axis").get("xyz")) == (f"r1/{name}", axis)
        assert numbers(found.find("origin"), "xyz") == [mount.x_m, mount.y_m, mount.z_m]
        limits = [float(found.find("limit").get(key)) for key in ("lower", "upper", "velocity")]
        assert limits == [mount.low_rad, mount.high_rad, mount.speed_rad_s]


@pytest.mark.parametrize("name", ["stingbot", "traxbot"])
def test_wheels_stand_as_far_apart_as_odometry_believes(name):
    robot = tree(name)
    right, left = (
        numbers(joint(robot, each).find("origin"), "xyz")[1] for each in joints_of(load(name).base)
    )
    assert left - right == pytest.approx(load(name).drive.wheel_separation_m)


@pytest.mark.parametrize("kind", ["skid", "mecanum"])
def test_four_wheels_stand_at_the_corners(kind):
    model = four_wheels(kind)
    robot = ElementTree.fromstring(urdf.render(model))
    places = [numbers(joint(robot, each).find("origin"), "xyz")[:2] for each in joints_of(model.base)]
    (x_m, _), y_m = places[0], 0.075
    assert x_m == pytest.approx(0.06 if kind == "mecanum" else model.body.length_m / 2 - 0.0325, abs=1e-4)
    wanted = [(x_m, -y_m), (x_m, y_m), (-x_m, y_m), (-x_m, -y_m)]
    assert [place == pytest.approx(want, abs=1e-6) for place, want in zip(places, wanted)] == [True] * 4


def test_three_wheels_roll_across():
    """Each at its radius from the middle, rolling at a right angle to it, counter-clockwise."""
    robot = tree("omni")
    for each in joints_of(load("omni").base):
        origin = joint(robot, each).find("origin")
        (x_m, y_m, _), yaw_rad = numbers(origin, "xyz"), numbers(origin, "rpy")[2]
        assert math.hypot(x_m, y_m) == pytest.approx(load("omni").drive.radius_m, rel=1e-4)
        assert math.remainder(yaw_rad - math.atan2(y_m, x_m), math.tau) == pytest.approx(
            math.pi / 2, abs=1e-4
        )


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("sonar", ["front", "left", "right"])
def test_sonar_sits_where_the_node_publishes_it(name, sonar):
    mount, origin = load(name).sonars[sonar], joint(tree(name), f"sonar_{sonar}_joint").find("origin")
    assert numbers(origin, "xyz")[:2] == [mount.x_m, mount.y_m]
    assert numbers(origin, "rpy")[2] == pytest.approx(math.radians(mount.yaw_deg), abs=1e-5)


def test_prefix_goes_before_each_link_and_laser_and_imu_are_optional():
    with_both, bare = (
        tree("traxbot", prefix="robot1/", laser=True, imu=True),
        tree("traxbot", prefix="robot1/"),
    )
    links, own = ([each.get("name") for each in robot.findall("link")] for robot in (with_both, bare))
    assert set(links) - set(own) == {"robot1/laser", "robot1/imu_link"}
    assert all(link.startswith("robot1/") for link in links)
    assert sonar_frame("robot1/base_link", "left") in links


def test_laser_is_where_the_model_says():
    model = load("traxbot")._replace(laser=LaserMount(x_m=0.02, y_m=-0.01, z_m=0.1, yaw_deg=90.0))
    found = joint(ElementTree.fromstring(urdf.render(model, laser=True)), "laser_joint").find("origin")
    assert found.get("xyz") == "0.02 -0.01 0.1" and found.get("rpy") == "0 0 1.5708"


def test_imu_is_where_the_model_says_with_the_axes_of_the_robot():
    """Readings are in the axes of base_link; a frame with the rotation of the chip would rotate them twice."""
    mount = ImuMount(x_m=0.03, y_m=-0.01, z_m=0.05, roll_deg=180.0, yaw_deg=90.0)
    model = load("traxbot")._replace(imu=mount)
    robot = ElementTree.fromstring(urdf.render(model, prefix="robot1/", imu=True))
    found = joint(robot, "imu_joint")
    assert found.find("child").get("link") == imu_frame("robot1/base_link") == "robot1/imu_link"
    origin = found.find("origin")
    assert (numbers(origin, "xyz"), numbers(origin, "rpy")) == ([0.03, -0.01, 0.05], [0.0, 0.0, 0.0])


@pytest.mark.parametrize(
    "model, words",
    [
        ("tank", "robot 'tank' is unknown"),
        ("pioneer", "pioneer is a board without motors .* description:=false"),
    ],
)
def test_model_without_a_description_costs_one_line(model, words):
    node = ROOT / "ros1_bridge" / "nodes" / "robot_description"
    done = subprocess.run([str(node), model], capture_output=True, text=True)
    assert done.returncode != 0 and done.stderr.count("\n") == 1
    assert re.match(f"robot_description: .*{words}", done.stderr)
