"""The shipped parameters of move_base, by the sums that its planner makes of them."""

import pytest
import yaml

from .rig import ROOT

FOLDER = ROOT / "ros1_bridge" / "navigation"
INSCRIBED_COST = 253
"""costmap_2d gives this cost to a place where the robot just touches nothing; lethal ones are above it."""


def parameters(name):
    return yaml.safe_load((FOLDER / name).read_text())


@pytest.mark.parametrize("model", ["traxbot", "stingbot"])
def test_a_narrow_door_costs_less_than_the_way_through_it_gains(model):
    """The planner adds both.  If the walls beside a door outweigh one trajectory, the robot stands before it."""
    planner = {
        **parameters("move_base.yaml")["TrajectoryPlannerROS"],
        **parameters(f"{model}.yaml")["TrajectoryPlannerROS"],
    }
    gain = planner["gdist_scale"] * planner["max_vel_x"] * planner["sim_time"]
    assert planner["occdist_scale"] * INSCRIBED_COST < gain
