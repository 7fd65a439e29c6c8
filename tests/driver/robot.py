"""A driver's core and a fake board, stepped together in simulated time."""

from mrl_driver.driver.options import DEFAULTS
from mrl_driver.driver.robot_core import Core
from tests.fake_board import FakeBoard

STEP_S = 0.01


class Robot:
    """`to_host` may be replaced to damage what passes; `events` is what the listeners would get."""

    def __init__(self, model, to_host=lambda data: data, board=None, options=DEFAULTS):
        self.core, self.board, self.now, self.to_host = (
            Core(model, options),
            board or FakeBoard(),
            0.0,
            to_host,
        )
        self.events = []
        self.core.begin(0.0)
        self.until(lambda: self.core.state.telemetry is not None)
        self.motion = self.core.session.motion

    def until(self, condition, seconds=20.0):
        end_s = self.now + seconds
        while not condition():
            assert self.now < end_s, "it did not happen in time"
            self.step()

    def run(self, seconds):
        end_s = self.now + seconds
        while self.now < end_s:
            self.step()

    def step(self):
        self.now += STEP_S
        self.events += self.core.turn(self.to_host(self.board.advance(self.now)), self.now)
        self.board.receive(self.core.session.take(), self.now)

    def seen(self, kind):
        return [event for event in self.events if isinstance(event, kind)]

    def drive(self, linear_m_s, angular_rad_s=0.0):
        return self.core.drive(linear_m_s, angular_rad_s, self.now)

    def until_empty(self, linear_m_s):
        """Drives until the battery is empty, which takes 5 s."""
        self.board.battery = 840
        self.until(lambda: not self.drive(linear_m_s))
