"""The master on one machine, the robot on another: two network namespaces with a cable between them."""

import json
import math
import subprocess
import sys

import pytest

from tests.network import own_network
from tests.waiting import PATIENCE

from .rig import ROOT

LONGEST_S = 110 * PATIENCE


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    """What the trial of `two_machines` has seen."""
    folder = tmp_path_factory.mktemp("network")
    command = [*own_network(), sys.executable, "-m", "tests.ros.two_machines", str(folder)]
    done = subprocess.run(command, cwd=str(ROOT), capture_output=True, text=True, timeout=LONGEST_S)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def test_odometry_and_commands_pass_between_the_machines(seen):
    assert seen["moved"]


def test_robot_stops_when_the_cable_is_pulled(seen):
    assert seen["stop_s"] < math.inf


def test_robot_drives_on_when_the_cable_is_back(seen):
    assert seen["again_s"] < math.inf and seen["odom_again"]
