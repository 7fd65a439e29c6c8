"""The same seed gives the same bytes; time may run faster; pictures."""

import json
import math

import pytest

from mrl_driver.geometry import ORIGIN, Pose
from mrl_driver.robot import models
from sim_arduino.hardware.sonars import READING_S, SonarChain, SonarErrors, count_of
from sim_arduino.hardware.wiring import Plant
from sim_arduino.serve.factory import Options, make
from sim_arduino.view.world_view import PlantTrail
from sim_arduino.world.shapes import Footprint, Wall
from sim_arduino.world.world import World
from sim_arduino.world.world_file import load
from tests.sim.simulator import Client, Simulator
from tests.waiting import wait_until

NOISY = "noise=0.02,missed=0.1,crosstalk=0.1"


def bytes_of(**options):
    """Six seconds of a robot with an IMU that wanders in the L-course, on a bad line."""
    faults = ("loss:rate=0.001", "flip:rate=0.001")
    robot = make(Options(world="l-course", sonar=NOISY, faults=faults, imu=True, imu_seed=5, **options))
    out = b""
    for i in range(120):
        out += robot.engine.advance(i / 20)
        robot.engine.receive({12: b"@18,20e@47,20e", 20: b"@11,200,300e", 60: b"@11,300,-600e"}.get(i, b""))
    return out


def test_the_same_seed_gives_the_same_bytes():
    assert bytes_of(seed=7) == bytes_of(seed=7) != bytes_of(seed=8)


ROUND_S = 3 * READING_S


def counts(errors, rounds=300, channel=0, others=(), wall_x=1.1):
    """Readings of a sonar with a wall before the front one, and other robots."""
    world = World([Wall(wall_x, -0.2, wall_x, 0.2)])
    for number, pose in enumerate(others):
        world.place(f"r{number}", pose, Footprint(0.01, 0.01))
    chain = SonarChain(models.load("traxbot").sonars, world, lambda time_s: ORIGIN, errors=errors, seed=1)
    chain.power(True, 0.0)
    found = []
    for i in range(rounds):
        chain.trigger(1.0 + i * (ROUND_S + 0.02))
        found.append(int(chain.volts(channel, 1.0 + i * (ROUND_S + 0.02) + ROUND_S + 0.01) * 1024 / 5.0))
    return found


FACING, TURNED = Pose(5.0, 0.0, math.pi), Pose(5.0, 0.0, 0.0)


def test_a_robot_that_faces_this_one_is_heard_now_and_then():
    """Its ping comes at any moment of 0.3 s; one of the first 28 ms beats the echo from the other robot, 4.9 m away."""
    found = [each for each in counts(SonarErrors(crosstalk=1.0), 400, 0, [FACING], wall_x=9.0)]
    echo = count_of(4.9 - 0.005)
    assert max(found) == echo
    share = sum(each < echo for each in found) / len(found)
    assert share == pytest.approx(2 * 4.9 / 343.0 / 0.3, abs=0.04)


def test_the_time_of_a_fast_board_runs_ahead_of_the_hosts(tmp_path):
    truth = tmp_path / "truth.jsonl"

    def gone_s():
        rows = [json.loads(line) for line in truth.read_text().splitlines() if line.endswith("}")]
        return [rows[-1][clock] - rows[0][clock] for clock in ("t", "host_monotonic")] if rows else (0.0, 0.0)

    with Simulator("--speed", "20", "--truth", str(truth)):
        wait_until(lambda: gone_s()[0] > 1.0)
    board_s, host_s = gone_s()
    assert board_s > 2 * host_s > 0


def moved():
    plant = Plant(models.load("traxbot"), load("hazards"))
    trail = PlantTrail(plant)
    plant.motor_board.move_differential(0.0, 300, 200)
    for i in range(100):
        plant.advance(i / 20)
        trail.look(i / 20)
    return trail


def test_mrl_sim_draws_at_its_end(tmp_path):
    path = tmp_path / "run.png"
    with Simulator("--plot", str(path), "--view") as simulator, Client(simulator.path) as client:
        client.ask(b"@15e")
        assert simulator.end() == 0
    assert path.read_bytes().startswith(b"\x89PNG")
