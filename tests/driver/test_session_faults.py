"""The session under any order of commands and faults."""

import math

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from mrl_driver.robot.models import load
from mrl_driver.robot.odometry import fastest_wheel_m_s
from mrl_driver.robot.robot_state import RobotState
from mrl_driver.session.session import Counts, Ready
from tests.fake_board import FakeBoard

from .talk import STEP_S, Talk

MODEL = load("traxbot")
STEP_M = fastest_wheel_m_s(0.65, 5.0, MODEL.drive.wheel_separation_m)  # No pose moves faster than this [m/s]


class LinkUnderFaults(RuleBasedStateMachine):
    @initialize(version=st.sampled_from([1, 2]))
    def connect(self, version):
        self.talk = Talk(FakeBoard(version=version)).until_ready()
        self.state = RobotState(MODEL)
        self.taken = 0
        self.dropped = False
        self.at = (0.0, 0.0)
        self.at_s = 0.0

    def _go(self, seconds):
        for _ in range(round(seconds / STEP_S)):
            self.talk.step()
            for event in self.talk.events[self.taken :]:
                self._watch(event)
            self.taken = len(self.talk.events)

    def _watch(self, event):
        self.state.digest(event, self.talk.now)
        if isinstance(event, Counts) and self.state.telemetry:
            x_m, y_m, _ = self.state.telemetry.pose
            reach = STEP_M * (event.arrival_s - self.at_s + 0.15)
            assert math.dist((x_m, y_m), self.at) <= reach
            self.at, self.at_s = (x_m, y_m), event.arrival_s

    @rule(linear=st.integers(-300, 300), angular=st.integers(-1000, 1000))
    def drive(self, linear, angular):
        self.talk.session.drive((linear, angular), self.talk.now)
        self._go(0.05)

    @rule()
    def stop(self):
        self.talk.session.stop(self.talk.now)
        self._go(0.05)

    @rule(seconds=st.sampled_from([0.02, 0.2, 1.0]))
    def wait(self, seconds):
        self._go(seconds)

    @rule()
    def reset_board(self):
        self.talk.board.reset(self.talk.now)
        self._go(1.5)
        assert self.talk.session.motion.target is None or not self.talk.session.ready

    @rule(seconds=st.sampled_from([0.05, 0.4, 2.0]))
    def hold_board(self, seconds):
        self.talk.board.mute = True
        self._go(seconds)
        self.talk.board.mute = False
        self._go(0.02)

    @rule(junk=st.binary(max_size=80))
    def noise(self, junk):
        self.talk.board.out += junk.replace(b"@", b"#")
        self._go(0.05)

    @rule(position=st.integers(0, 40), bit=st.integers(0, 7))
    def flip(self, position, bit):
        def damage(data):
            self.talk.to_host = lambda rest: rest
            at = position % len(data) if data else 0
            return data[:at] + bytes([data[at] ^ 1 << bit]) + data[at + 1 :] if data else data

        if self.talk.session.checked:
            self.talk.to_host = damage
        self._go(0.05)

    @rule()
    def drop_to_board(self):
        self.talk.to_board = lambda data: b""
        self._go(0.2)
        self.talk.to_board = lambda data: data

    @invariant()
    def no_busy_loop(self):
        if hasattr(self, "talk"):
            assert self.talk.session.deadline(self.talk.now) > self.talk.now - 2 * STEP_S

    def teardown(self):
        """Whatever happened: once the line is good, the board is greeted and obeys."""
        if not hasattr(self, "talk"):
            return
        self._go(1.5)
        self.talk.until(lambda: self.talk.session.ready, 5)
        assert self.talk.session.drive((100, 0), self.talk.now)
        self._go(0.3)
        assert self.talk.board.speeds == (100, 0)
        self.talk.session.stop(self.talk.now)
        self._go(0.6)
        assert self.talk.board.speeds == (0, 0) and not self.talk.session.motion.stopping
        assert self.talk.seen(Ready)


TestLinkUnderFaults = LinkUnderFaults.TestCase
TestLinkUnderFaults.settings = settings(max_examples=25, stateful_step_count=15, deadline=None)
