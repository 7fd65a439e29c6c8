"""Several processes in one world."""

import inspect
import json
import os
import subprocess
import sys
import tempfile
import uuid
from contextlib import closing

import pytest

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose
from sim_arduino.hardware.mirror import Mirror
from sim_arduino.replay.mirror import follow
from sim_arduino.world import shared_robots
from sim_arduino.world.shapes import Footprint
from sim_arduino.world.shared_robots import SharedRegistry
from sim_arduino.world.world import World
from tests.shortage import descriptors_left, errors_of_each_step
from tests.sim.simulator import Client, Simulator
from tests.waiting import wait_until

BOX = Footprint(0.2, 0.1)


@pytest.fixture
def lab(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setattr(shared_robots, "LOOK_S", 0.0)
    return f"lab-{uuid.uuid4().hex[:8]}"


@pytest.fixture
def registries(lab):
    """Two processes' views of one world, as far as locks and files go."""
    made = [SharedRegistry(lab), SharedRegistry(lab)]
    yield made
    for registry in made:
        registry.close()


def test_a_symbolic_link_of_another_user_is_not_followed(tmp_path, monkeypatch):
    monkeypatch.delenv("XDG_RUNTIME_DIR", raising=False)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    (tmp_path / "own").mkdir()
    (tmp_path / f"mrl-sim-{os.getuid()}").symlink_to(tmp_path / "own")
    with pytest.raises(ConfigError, match="is a symbolic link or belongs to another user"):
        SharedRegistry("lab")
    assert not list((tmp_path / "own").iterdir())


def test_a_robot_is_seen_by_all_but_by_itself(registries):
    """A process that scans for a robot of another one leaves it out: a laser must not see the robot that carries it."""
    registries[0].place("one", Pose(1.0, 2.0, 3.0), BOX)
    for registry in registries:
        assert registry.others("two") == [("one", Pose(1.0, 2.0, 3.0), BOX)]
        assert registry.others("one") == []


def test_a_name_is_taken_once(registries):
    registries[0].place("one", Pose(1.0, 2.0, 3.0), BOX)
    with pytest.raises(ConfigError, match="robot 'one' is in world .* already"):
        registries[1].place("one", Pose(1.0, 2.0, 3.0), BOX)


def test_a_robot_whose_process_was_killed_is_gone(registries, lab):
    code = (
        f"from sim_arduino.world.shared_robots import *; c = SharedRegistry({lab!r}); "
        "c.place('dead', Pose(0, 0, 0), Footprint(1, 1)); print(flush=True); input()"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    process.stdout.readline()
    before = [mover.name for mover in registries[0].others("")]
    process.kill()
    process.communicate()
    assert (before, registries[0].others("")) == (["dead"], [])


@pytest.mark.parametrize("name", ["", "a b", "../x", "x" * 41])
def test_bad_world_names(name):
    with pytest.raises(ConfigError, match="expected 1 to 40 letters, digits, - or _"):
        SharedRegistry(name)


def shared(registry):
    world = World()
    world.registry = registry
    return world


@pytest.mark.parametrize("line", ["POSE", '{"pose": POSE, "battery_v": 12.1}'])
def test_a_mirror_stands_where_the_odometry_says(registries, line):
    """Odometry that began at (1, 0), looking along y."""
    with closing(Mirror(shared(registries[1]), "real", BOX, Pose(1.0, 0.0, 1.5707963267948966))) as mirror:
        pose = '{"x_m": 0.5, "y_m": 0.0, "yaw_rad": 0.0}'
        follow(mirror, [line.replace("POSE", pose), "\n"])
        assert registries[0].others("")[0].pose == pytest.approx((1.0, 0.5, 1.5707963))
    assert registries[0].others("") == []


@pytest.mark.parametrize(
    "line",
    [
        "junk",
        '{"x_m": 1, "y_m": NaN, "yaw_rad": 0}',
        '{"pose": 7}',
        pytest.param("[" * 100000, id="deep"),
    ],
)
def test_a_bad_line_is_named_by_its_number(line):
    with closing(Mirror(World(), "real", BOX)) as mirror, pytest.raises(ConfigError, match="line 2 is"):
        follow(mirror, ["\n", line])


def test_boards_of_two_processes_bump_into_each_other(lab, tmp_path):
    """One drives 1 m towards the other, which stands; bow to bow they are 0.225 m apart."""
    truth = tmp_path / "truth"
    shared = ("--world-name", lab, "--world", "square")
    moving = ("--name", "one", "--truth", str(truth), "--speed", "4")
    other = Simulator(*shared, "--name", "two", "--pose", "0.6,0,180")
    with other, Simulator(*shared, *moving) as one, Client(one.path) as client:
        client.ask(b"@15e")
        client.send(b"@11,400,0e")
        wait_until(lambda: last(truth) > 0.37)
        rows = truth.read_text().count("\n")
        wait_until(lambda: truth.read_text().count("\n") > rows + 10)
    assert last(truth) == pytest.approx(0.6 - 0.225, abs=1e-3)


def last(truth):
    rows = truth.read_text().splitlines()
    return json.loads(rows[-1])["x"] if rows and rows[-1].endswith("}") else 0.0


def at_each_step(action, look):
    """Does `action`, and calls `look` before each of its Python instructions."""

    looks = []

    def trace(frame, event, _):
        frame.f_trace_opcodes = True
        if event == "opcode":
            looks.append(look())
        return trace

    before = sys.gettrace()
    inspect.currentframe().f_trace_opcodes = True  # Python 3.12 counts only those that ask before `settrace`
    sys.settrace(trace)
    try:
        action()
    finally:
        sys.settrace(before)
    assert looks


def test_reader_in_the_middle_of_a_move_sees_the_place_before_or_after(registries):
    before, after = Pose(1.0, 2.0, 3.0), Pose(4.0, 5.0, 6.0)
    registries[0].place("one", before, BOX)
    seen = [registries[1].others("")[0].pose]
    at_each_step(
        lambda: registries[0].place("one", after, BOX), lambda: seen.append(registries[1].others("")[0].pose)
    )
    assert set(seen) <= {before, after} and (seen[0], registries[1].others("")[0].pose) == (before, after)


def test_a_process_that_runs_out_of_descriptors_leaves_none_open(lab):
    def join():
        registry = SharedRegistry(lab)
        registry.place("one", Pose(0.0, 0.0, 0.0), Footprint(0.2, 0.1))
        return registry

    assert errors_of_each_step(join, descriptors_left, OSError)
