"""Figures of the faults table that time alone decides, exact in simulated time; `test_faults` has them on ptys."""

import pytest

from mrl_driver.events import Stale
from mrl_driver.options import Options
from mrl_driver.robots import load
from mrl_driver.stepped import SteppedDriver
from sim_arduino.board import PythonBoard
from sim_arduino.faults import FaultyEngine
from sim_arduino.plant import Plant

from .emulator import MOVE, STOP

HOST_DEAD_S, BEYOND_TIMEOUT_S = 0.3, 0.05
LATE_S, STALE_S = 0.1, 0.3
FROZEN_S, COMMAND_S = 5.0, 0.02
ON_THE_WAY_S = 0.005
"""A frame on the wire, and one in the making."""


class Bench:
    """A driver that drives, the line between, and when the motor board was told what."""

    def __init__(self, **options):
        self.plant = Plant(load("traxbot"))
        self.board = PythonBoard(self.plant)
        self.engine = FaultyEngine(self.board)
        self.robot = SteppedDriver(self.engine, options=Options(**options))
        self.robot.connect()
        self.heard = []
        self.robot.on_event(lambda event: self.heard.append((self.robot.now_s, event)))

    def drive(self, seconds):
        """Commands every 20 ms, as from a joystick; when the last one was given."""
        end_s = self.robot.now_s + seconds
        while self.robot.now_s < end_s - 1e-9:
            last_s = self.robot.now_s
            self.robot.drive(0.2, 0.0)
            self.robot.wait(COMMAND_S)
        return last_s

    def times(self, code, since_s):
        return [c.time_s for c in self.plant.motor_board.commands if c.code == code and c.time_s > since_s]

    def told(self, kind):
        return [time_s for time_s, event in self.heard if isinstance(event, kind)]


def test_a_dead_host_is_a_stop_within_300_ms():
    bench = Bench()
    bench.drive(0.5)
    died_s = bench.robot.now_s
    bench.engine.advance(died_s + 1.0)
    assert bench.times(STOP, died_s)[0] - died_s <= HOST_DEAD_S


@pytest.mark.parametrize("timeout_s", [0.1, 0.25, 0.6])
def test_a_dead_command_source_is_a_stop_50_ms_after_the_timeout(timeout_s):
    bench = Bench(command_timeout_s=timeout_s)
    last_s = bench.drive(0.5)
    bench.robot.wait(1.0)
    assert timeout_s <= bench.times(STOP, last_s)[0] - last_s <= timeout_s + BEYOND_TIMEOUT_S


def test_a_board_that_stood_still_for_5_s_carries_out_nothing_that_waited():
    """It is sent no motion once its telemetry is late; what came before that is stale when it goes on."""
    bench = Bench()
    bench.drive(0.5)
    frozen_s = bench.robot.now_s
    bench.engine.freeze(FROZEN_S)
    bench.drive(FROZEN_S)
    waited = bench.engine._waiting
    assert 1 <= waited.count(b"@11,") <= LATE_S / COMMAND_S + 1
    bench.robot.wait(1.0)
    assert bench.robot.ready and bench.robot.command is None
    assert bench.times(MOVE, frozen_s) == []
    assert bench.times(STOP, frozen_s)[0] >= frozen_s + FROZEN_S


@pytest.mark.parametrize("period_ms", [20, 50, 200, 1000])
def test_a_silent_board_is_stale_within_300_ms_whatever_the_period(period_ms):
    bench = Bench(period_ms=period_ms)
    bench.drive(2.0)
    silent_s = bench.robot.now_s
    bench.engine.freeze(1.0)
    bench.robot.wait(0.5)
    assert bench.told(Stale)[0] - silent_s <= STALE_S


@pytest.mark.parametrize("period_ms", [50, 200, 1000])
def test_a_late_board_is_sent_no_motion_whatever_the_period(period_ms):
    bench = Bench(period_ms=period_ms)
    bench.drive(2.0)
    silent_s = bench.robot.now_s
    bench.engine.freeze(1.0)
    sent = []
    receive = bench.engine.receive
    bench.engine.receive = lambda data: (sent.append((bench.robot.now_s, data)), receive(data))
    bench.drive(0.5)
    assert max(time_s for time_s, data in sent if b"@11," in data) - silent_s <= LATE_S + ON_THE_WAY_S


def test_a_slow_period_is_kept_though_the_board_streams_faster():
    """And a sonar that was new in a frame which nobody was told of is new in the next."""
    bench = Bench(period_ms=200)
    told = []
    bench.robot.on_telemetry(told.append)
    bench.robot.wait(3.0)
    gaps = [b.stamp_s - a.stamp_s for a, b in zip(told, told[1:])]
    assert gaps == pytest.approx([0.2] * 14, abs=ON_THE_WAY_S)
    assert {name for telemetry in told for name in telemetry.fresh} == {"front", "left", "right"}
    assert sum(len(telemetry.fresh) for telemetry in told) >= 3 * 9
