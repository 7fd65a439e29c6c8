"""A weakness for each judge of the soak, which it must report."""

import os
import subprocess
import sys

import pytest

from mrl_driver.robot.odometry import Baseline
from sim_arduino.board.board_status import BoardStatus
from tests.long.programs import MARK, left_behind
from tests.long.soak import truth
from tests.long.soak.simulated import Simulation
from tests.long.soak.tally import Tally


def struck(fault, *details, seed=1, kind=Simulation, times=1):
    tally = Tally()
    simulation = kind(seed, tally)
    for _ in range(times):
        simulation.fault = fault
        getattr(simulation, fault)(*details)
    simulation.engine.close()
    return tally


class Unwatched(Simulation):
    """The board has no watchdog."""

    watchdog_ms = 0


def test_a_robot_without_a_watchdog_is_reported():
    assert struck("host_dies").kinds["time_to_stop"] == 0
    assert struck("host_dies", kind=Unwatched).kinds["time_to_stop"] > 0


def test_a_board_that_moves_again_after_its_own_stop_is_reported(monkeypatch):
    assert struck("outage", "stall:", times=3).kinds["forbidden_motion"] == 0
    monkeypatch.setattr(BoardStatus, "refuses_move", lambda self: False)
    assert struck("outage", "stall:", times=3).kinds["forbidden_motion"] > 0


@pytest.mark.parametrize("pulse_s, again, pulses", [(truth.PULSE_S, 0, 1), (0.0, 1, 0)])
def test_a_move_that_the_line_delivers_together_with_its_stop_moves_no_wheel(
    monkeypatch, pulse_s, again, pulses
):
    monkeypatch.setattr(truth, "PULSE_S", pulse_s)
    simulation = Simulation(1, Tally())
    simulation.stop()
    begun_s = simulation.now_s
    simulation.engine.stall(0.9)
    simulation.command(0.2, 0.0)
    simulation.wait(1.2)
    window = truth.judge(simulation.truth, begun_s, simulation.now_s)
    simulation.engine.close()
    assert (window.again, window.pulses) == (again, pulses)


@pytest.mark.parametrize("on_the_way_s, again", [(truth.ON_THE_WAY_S, 1), (0.15, 0)])
def test_a_move_after_the_end_is_reported_unless_the_computer_held_it_up(on_the_way_s, again):
    simulation = Simulation(1, Tally())
    simulation.stop()
    begun_s = simulation.now_s
    simulation.wait(0.1)
    simulation.command(0.2, 0.0)
    simulation.wait(1.0)
    window = truth.judge(simulation.truth, begun_s, simulation.now_s, on_the_way_s)
    simulation.engine.close()
    assert window.again == again and window.stopped_s < 1.0


def test_an_odometry_that_believes_all_counters_is_reported(monkeypatch):
    def believe(self, *reading):
        base, self._base = self._base, reading
        if base is None:
            return None
        moved = (((new - old + 0x8000) & 0xFFFF) - 0x8000 for new, old in zip(reading[:-1], base))
        return (*moved, reading[-1] - base[-1])

    assert struck("counter_wraps").kinds["pose_jump"] == 0
    monkeypatch.setattr(Baseline, "update", believe)
    assert struck("counter_wraps").kinds["pose_jump"] > 0


def test_a_process_that_is_left_is_reported():
    assert left_behind() == []
    command = [sys.executable, "-c", "print(flush=True); input()"]
    env = {**os.environ, MARK: str(os.getpid())}
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=env) as process:
        process.stdout.readline()
        assert [line.split()[0] for line in left_behind()] == [str(process.pid)]
        process.communicate(b"\n")
