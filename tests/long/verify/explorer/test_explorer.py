"""The explorer of the real code, in a short form; `make explore` runs all of it."""

import pytest

from mrl_driver.driver.connection import Connection
from mrl_driver.driver.recorded import RecordedDriver
from mrl_driver.driver.recording_summary import summarise
from mrl_driver.recording.recording import Recording
from mrl_driver.session.session import Session
from ros1_bridge.control.commander import Commander
from ros1_bridge.control.velocity_sources import VelocitySources
from tests.long.verify.explorer.board import ExploredBoard, build
from tests.long.verify.explorer.events import happen
from tests.long.verify.explorer.recorded import record
from tests.long.verify.explorer.search import Explorer
from tests.long.verify.explorer.world import PORT, Ports

COAST_M = 0.01  # The robot drives farther than this [m]
STEPS_BACK = ("d", "dL", "dc", "dPr", "bdM")


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    return build(tmp_path_factory.mktemp("explorer") / "libboard.so", optimise="-O0")


@pytest.fixture
def explorer(library):
    made = Explorer(ExploredBoard(library))
    yield made
    made.world.end()


def test_a_board_that_loses_its_motor_board_while_a_move_is_under_way_to_it_tells_a_true_reason(explorer):
    assert explorer.play("Wasada") == ""


@pytest.mark.parametrize("event", ["c", "o", "r"])
def test_a_board_that_comes_back_is_greeted_and_obeys_again(explorer, event):
    explorer.play("d" + event + "WWd")
    assert explorer.world.driver.ready
    assert explorer.world.board.truth.turning


@pytest.mark.parametrize(
    "owner, guard, path",
    [
        (Commander, "latch", "id"),
        (Connection, "stop_for_good", "dxw"),
        (Ports, "same_board", "dWoWW"),
        (Session, "_stop_blind", "dhW"),
        (VelocitySources, "distrust", "giu"),
    ],
)
def test_without_a_guard_a_sequence_violates_a_property(library, monkeypatch, owner, guard, path):
    made = Explorer(ExploredBoard(library))
    held = made.play(path)
    if owner is Ports:
        monkeypatch.setattr(
            Ports, guard, property(lambda ports: True, lambda ports, value: None), raising=False
        )
        made.world.end()
        made = Explorer(ExploredBoard(library))
    else:
        monkeypatch.setattr(owner, guard, lambda self, *_: None)
    broken = made.play(path)
    made.world.end()
    assert held == "" and broken.startswith("P")


@pytest.mark.parametrize("path", STEPS_BACK)
def test_a_restored_state_goes_on_as_the_one_that_was_saved(explorer, path):
    explorer.play(path)
    saved = explorer.save()
    ends = []
    for _ in range(2):
        explorer.restore(saved)
        for letter in "dWs":
            happen(explorer.world, explorer.judge, letter)
        world = explorer.world
        ends.append((explorer.key(), world.board.key(), world.board_s, world.host_s, world.driver.pose))
        explorer.play("dMo")
    assert ends[0] == ends[1]


def test_a_sequence_becomes_a_recording(library, tmp_path):
    file = tmp_path / "path.mrl"
    record("dLWs", str(file), ExploredBoard(library))
    recording = Recording(str(file))
    assert recording.header["port"] == PORT
    assert summarise(RecordedDriver(recording))["pose"]["x_m"] > COAST_M
