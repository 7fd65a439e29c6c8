"""The shipped parameters of move_base, amcl, the sonar layer and the EKF: they have reasons, and fit the robots."""

import math

import pytest
import roslib.packages
import rospy
import yaml
from sensor_msgs.msg import Range

from mrl_driver.geometry import wrap_angle
from mrl_driver.robot import models
from mrl_driver.robot.models import OmniDrive
from tests.consistency import error_squared
from tests.driver.test_covariance import PERIOD_S, Drawn
from tests.waiting import wait_until

from .planar_ekf import IN_3D, VYAW, YAW, PlanarEkf, X, Y
from .rig import ROOT, START_S
from .test_launch import CLEARING

FOLDER = ROOT / "ros1_bridge" / "navigation"
ROBOTS = ("traxbot", "stingbot", "omni", "duo")
LAYERS = ("layers_laser.yaml", "layers_sonars.yaml", "layers_both.yaml")
INSCRIBED_COST = 253
"""costmap_2d gives this cost to a place where the robot just touches nothing; lethal ones are above it."""
HALF_DOOR_M = 0.35  # The doors of the world `house` are 0.7 m wide
SONAR_PERIOD_S = 0.3
LATE_S = 0.3
"""Of the planner's period, odometry and the motor board, a command takes effect at the latest after this time [s]."""


def parameters(name):
    return yaml.safe_load((FOLDER / name).read_text())


def planner_of(robot):
    common, own = (parameters(f"{name}.yaml")["TrajectoryPlannerROS"] for name in ("move_base", robot))
    return {**common, **own}


@pytest.fixture(params=ROBOTS)
def robot(request):
    return request.param


def test_a_narrow_door_costs_less_than_the_way_through_it_gains(robot):
    """The planner adds both.  If the walls beside a door outweigh one trajectory, the robot stands before it."""
    planner = planner_of(robot)
    gain = planner["goal_distance_bias"] * planner["max_vel_x"] * planner["sim_time"]
    assert planner["occdist_scale"] * INSCRIBED_COST < gain


def test_a_door_whose_posts_the_sonars_mark_costs_less_than_the_slowest_way_ahead_gains(robot):
    """The marks leave no room for a longer trajectory; a robot that gains nothing turns on the spot for ever."""
    planner = {**planner_of(robot), **parameters("layers_sonars.yaml")["TrajectoryPlannerROS"]}
    gain = planner["goal_distance_bias"] * planner["min_vel_x"] * planner["sim_time"]
    assert planner["occdist_scale"] * INSCRIBED_COST < gain


def test_speeds_and_accelerations_are_the_models(robot):
    planner, limits = planner_of(robot), models.load_packaged(robot).limits
    assert planner["max_vel_x"] == limits.linear_m_s
    assert (planner["max_vel_theta"], -planner["min_vel_theta"]) == (limits.angular_rad_s,) * 2
    assert planner["acc_lim_x"] == limits.linear_acceleration_m_s2
    assert planner["acc_lim_theta"] == limits.angular_acceleration_rad_s2
    assert planner["min_vel_x"] < planner["max_vel_x"]


def test_a_turn_at_the_goal_ends_within_the_tolerance_although_commands_are_late(robot):
    planner = planner_of(robot)
    assert planner["min_in_place_vel_theta"] * LATE_S < planner["yaw_goal_tolerance"]


def test_only_a_base_that_can_is_driven_sideways(robot):
    planner, model = planner_of(robot), models.load_packaged(robot)
    assert planner["holonomic_robot"] == isinstance(model.drive, OmniDrive)
    if planner["holonomic_robot"]:
        speeds = [float(part) for part in planner["y_vels"].split(",")]
        assert sorted(speeds) == speeds and {-speed for speed in speeds} == set(speeds)
        assert max(speeds) <= model.limits.lateral_m_s
        assert planner["acc_lim_y"] == model.limits.linear_acceleration_m_s2
    else:
        assert "y_vels" not in planner


def test_radius_holds_the_body_and_fits_through_a_door(robot):
    body = models.load_packaged(robot).body
    for costmap in ("global_costmap", "local_costmap"):
        given = parameters(f"{robot}.yaml")[costmap]
        assert math.hypot(body.length_m, body.width_m) / 2 < given["robot_radius"] < HALF_DOOR_M
        assert given["inflation"]["inflation_radius"] > given["robot_radius"]


def test_local_costmap_holds_what_the_planner_looks_at(robot):
    planner, window = planner_of(robot), parameters("move_base.yaml")["local_costmap"]
    assert planner["max_vel_x"] * planner["sim_time"] < min(window["width"], window["height"]) / 2


@pytest.mark.parametrize("name", LAYERS)
@pytest.mark.parametrize("costmap", ["global_costmap", "local_costmap"])
def test_inflation_is_the_last_layer(name, costmap):
    """It works on what the layers before it have marked."""
    assert parameters(name)[costmap]["plugins"][-1]["name"] == "inflation"


@pytest.mark.parametrize("name", LAYERS)
def test_recovery_clears_the_lasers_layer_alone(name):
    """Cells of the sonar layer that are cleared become unknown; the layer takes that for certainly occupied."""
    given = parameters(name)
    behaviours = given.get(
        "recovery_behaviors", [{"name": "conservative_reset"}, {"name": "aggressive_reset"}]
    )
    cleared = {layer for each in behaviours for layer in given.get(each["name"], {}).get("layer_names", [])}
    layers = {plugin["name"] for plugin in given["global_costmap"]["plugins"]}
    assert cleared == layers & {"obstacles"}


def test_without_a_laser_the_walls_come_from_the_map():
    plugins = parameters("layers_sonars.yaml")["local_costmap"]["plugins"]
    assert "costmap_2d::StaticLayer" in {plugin["type"] for plugin in plugins}


def test_silent_sonars_stop_move_base_and_one_lost_reading_does_not():
    sonars = parameters("sonar_layer.yaml")["sonars"]
    assert 2 * SONAR_PERIOD_S < sonars["no_readings_timeout"] <= 2.0
    assert sonars["clear_on_max_reading"]


def test_obstacles_are_cleared_farther_than_they_are_marked():
    scan = parameters("laser_layer.yaml")["obstacles"]["scan"]
    assert scan["obstacle_range"] < scan["raytrace_range"]


def test_running_node_reports_the_longest_range_when_it_is_requested(rig, tmp_path):
    """On a floor without end."""
    world = tmp_path / "far.yaml"
    world.write_text("walls: [[99, -9, 99, 9]]\n")
    rig.node(rig.board("--robot", "traxbot", "--world", str(world)).port)
    sonar = rig.topic("sonar/front", Range)
    assert sonar.wait()[-1].range == math.inf
    (program,) = roslib.packages.find_node("dynamic_reconfigure", "dynparam")
    child = rig.start(
        "dynparam", "/usr/bin/python3", program, *CLEARING.split(), f"__ns:={rig.ns}", "__name:=once"
    )
    wait_until(lambda: sonar.messages[-1].max_range < 0.71, START_S)
    wait_until(lambda: child.exit_code == 0)
    assert rospy.get_param(f"{rig.ns}/robot_node/clear_range") == 0.7, "a respawned node forgets it"


YAW_NOISE = {"traxbot": 0.0015, "stingbot": 0.002}  # Of ekf.launch, with a gyro and without
VALUES = {
    robot: yaml.safe_load((FOLDER / "ekf.yaml").read_text().replace("$(arg yaw_noise)", str(noise)))
    for robot, noise in YAW_NOISE.items()
}
SQUARE = ((0.2, 0.0, 3.0), (0.0, 0.8, math.pi / 2 / 0.8)) * 4  # Speeds [m/s, rad/s], each for this long [s]
DRAWN = 5
LEAST, MOST = 0.1, 7.53
"""99.9 % of the means of 5 normalised errors squared are below the second: chi squared of 15, over 5.  Below the first,
the standard deviations are more than five times the errors."""
NEAR_M, NEAR_RAD = 0.005, 0.005


def test_filter_takes_the_twist_of_the_odometry_alone_with_a_diagonal_noise():
    """The pose would count the same errors again, and no other sensor could correct it."""
    values = VALUES["traxbot"]
    used = [at for at, taken in enumerate(values["odom0_config"]) if taken]
    assert (values["odom0"], used) == ("odom", [6, 7, 11]), "vx, vy, vyaw"
    noise = values["process_noise_covariance"]
    assert len(noise) == 15 * 15 and all((value > 0) == (at % 16 == 0) for at, value in enumerate(noise))


class Filtered(Drawn):
    """A robot whose odometry goes to a filter with our parameters."""

    def __init__(self, *robot):
        super().__init__(*robot)
        values = VALUES[robot[0]]
        ours = values["process_noise_covariance"][::16]
        self.filter = PlanarEkf([ours[at] for at in IN_3D], values["dynamic_process_noise_covariance"])

    def step(self):
        super().step()
        linear, angular = self.odometry.twist
        of_linear, of_angular, of_lateral = self.odometry.uncertainty.variances
        self.filter.update(PERIOD_S, (linear, 0.0, angular), (of_linear, of_lateral, of_angular))


@pytest.mark.parametrize("robot", [("traxbot", True, 0.1), ("stingbot", False, None)], ids=["gyro", "wheels"])
def test_filter_is_where_the_odometry_is_and_as_sure_as_its_errors_allow(robot):
    """After a square.  Nothing that the odometry measures is lost, at the beginning and the end of a turn either."""
    errors = []
    for seed in range(DRAWN):
        made = Filtered(robot[0], seed, *robot[1:])
        made.drive(SQUARE)
        pose, true, (x, y, yaw) = made.odometry.pose, made.body.state, made.filter.state[[X, Y, YAW]]
        assert math.hypot(x - pose.x_m, y - pose.y_m) < NEAR_M and abs(made.filter.state[VYAW]) < NEAR_RAD
        assert abs(wrap_angle(yaw - pose.yaw_rad)) < NEAR_RAD
        away = true.x_m - x, true.y_m - y, wrap_angle(true.yaw_rad - yaw)
        errors.append(error_squared(made.filter.spread, *away))
    assert LEAST < sum(errors) / DRAWN < MOST, errors
