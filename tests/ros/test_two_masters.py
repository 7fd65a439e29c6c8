"""Two masters with a relay each, in two network namespaces with a cable between them; a robot drives over it."""

import json
import math
import subprocess
import sys

import pytest

from tests.network import own_network
from tests.waiting import PATIENCE

from .rig import ROOT


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    """What the trial of `two_masters` has seen."""
    folder = tmp_path_factory.mktemp("masters")
    command = [*own_network(), sys.executable, "-m", "tests.ros.two_masters", str(folder)]
    done = subprocess.run(command, cwd=str(ROOT), capture_output=True, text=True, timeout=110 * PATIENCE)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def test_topics_and_commands_cross_before_and_after_the_cut_and_none_comes_back(seen):
    """Latched state comes again; a message of a shared topic does not come back."""
    assert seen["moved"] and seen["restored_s"] < math.inf and seen["drives_again"]
    assert seen["mode"] and not seen["came_back"]


def test_robot_stops_when_the_cable_is_pulled_and_the_desk_is_told(seen):
    assert seen["stop_s"] < math.inf and seen["noticed_s"] < math.inf


def test_no_command_from_before_the_restore_moves_the_robot(seen):
    assert not seen["replayed"]
