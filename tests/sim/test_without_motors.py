"""Emulated boards without motors: no motor board on the bus, no body in the world; and options that do not fit."""

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
    assert plant.footprint is None
    factory.make(factory.Options(pose="0.5,0.5,0"), plant.world).close()


def test_world_with_one_that_stands_there_is_refused(tmp_path):
    path = tmp_path / "hall.yaml"
    path.write_text("walls: [[0, 0, 1, 0]]\nrobots: {cart: [1, 1, 0, pioneer]}\n")
    with pytest.raises(ConfigError, match="hall.yaml: robots.cart: robot pioneer is a board without motors"):
        world_file.load(str(path))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"robot": "pioneer", "omni": True}, "--omni is given for robot pioneer, which has no motors"),
        (
            {"robot": "pioneer", "error": "axle=1.01"},
            "--error is given for robot pioneer, which has no motors",
        ),
        ({"robot": "traxbot", "wiring": 1}, "robot traxbot, which has an OMNI-3MD; expected .* duo"),
        ({"robot": "duo", "wiring": 4096}, "wiring is 4096, expected 0 to 4095"),
        ({"robot": "duo", "environment": True}, "--environment is given for robot duo"),
        ({"robot": "duo", "profile": "2013-august"}, "boards of 2013 have no H-bridge"),
        *(
            ({"robot": "pioneer", "sonar": f"{key}=0.9"}, f"--sonar {key} is given for robot pioneer")
            for key in ("crosstalk", "gain", "exponent")
        ),
        ({"environment": True, "sonar": "offset=0.01"}, "--sonar offset is given for robot traxbot"),
    ],
)
def test_options_that_do_not_fit_the_robot_are_refused_in_one_line(options, message):
    with pytest.raises(ConfigError, match=message) as error:
        factory.make(factory.Options(**options))
    assert "\n" not in str(error.value)
