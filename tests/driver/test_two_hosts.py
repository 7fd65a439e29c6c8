"""A board reached over TCP and UDP from another host: two network namespaces with a cable between them."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.network import own_network
from tests.waiting import PATIENCE

ROOT = Path(__file__).resolve().parents[2]
LONGEST_S = 110 * PATIENCE
POSE_ERROR_M = 1e-3


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    """What the trials of `two_hosts` have seen."""
    command = [*own_network(), sys.executable, "-m", "tests.driver.two_hosts"]
    folder = tmp_path_factory.mktemp("hosts")
    done = subprocess.run(
        [*command, str(folder)], cwd=str(ROOT), capture_output=True, text=True, timeout=LONGEST_S
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


@pytest.mark.parametrize("scheme", ["tcp", "udp"])
def test_the_pose_is_the_true_one(seen, scheme):
    assert seen[scheme]["error_m"] < POSE_ERROR_M


@pytest.mark.parametrize("scheme", ["tcp", "udp"])
def test_the_robot_stands_when_the_cable_is_pulled_and_drives_when_it_is_back(seen, scheme):
    assert seen[scheme]["rolled_m"] == 0.0
    assert seen[scheme]["again_m"] > 0.0
