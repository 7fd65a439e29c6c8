"""Emulated boards without motors: no motor board on the bus, no body in the world."""

import pytest

from mrl_driver.errors import ConfigError
from sim_arduino.serve import factory
from sim_arduino.world import world_file


@pytest.fixture
def plant():
    emulated = factory.make(factory.Options(robot="pioneer", pose="0.5,0.5,0"))
    yield emulated.plant
    emulated.close()


def test_bus_has_no_motor_board_and_the_robot_stands(plant):
    plant.advance(2.0)
    assert not plant.motor_board.present
    assert plant.true_pose[:2] == (0.5, 0.5)


def test_other_robots_pass_where_it_stands(plant):
    """The robot that carries it is not emulated."""
    assert plant.footprint is None
    factory.make(factory.Options(pose="0.5,0.5,0"), plant.world).close()


@pytest.mark.parametrize(
    "option, value", [("omni", True), ("slip", True), ("error", "axle=1.01"), ("battery", 9.0)]
)
def test_options_for_motors_are_refused(option, value):
    with pytest.raises(ConfigError, match=f"--{option} is given for robot pioneer, which has no motors"):
        factory.make(factory.Options(robot="pioneer", **{option: value}))


def test_world_with_one_that_stands_there_is_refused(tmp_path):
    path = tmp_path / "hall.yaml"
    path.write_text("walls: [[0, 0, 1, 0]]\nrobots: {cart: [1, 1, 0, pioneer]}\n")
    with pytest.raises(ConfigError, match="hall.yaml: robots.cart: robot pioneer is a board without motors"):
        world_file.load(str(path))
