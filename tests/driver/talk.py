"""A session and a board that talk in injected time, without a port."""

from mrl_driver.session.handshake import DEFAULT_PLAN
from mrl_driver.session.session import Counts, Ready, Session
from tests.fake_board import FakeBoard

STEP_S = 0.002


class Talk:
    """Steps both; `to_board` and `to_host` may be replaced to damage what passes."""

    def __init__(self, board=None, admit=lambda board: None, plan=DEFAULT_PLAN, **options):
        self.board = board or FakeBoard()
        self.now = 0.0
        self.session = Session(admit, self.now, plan, **options)
        self.events = []
        self.sent = []
        self.to_board = self.to_host = lambda data: data

    def run(self, seconds):
        end = self.now + seconds
        while self.now < end:
            self.step()
        return self

    def until(self, condition, seconds=10.0):
        end = self.now + seconds
        while not condition():
            assert self.now < end, "it did not happen in time"
            self.step()
        return self

    def until_ready(self):
        return self.until(lambda: self.seen(Ready) and self.session.ready)

    def step(self):
        self.now += STEP_S
        data = self.to_host(self.board.advance(self.now))
        if data:
            self.events += self.session.receive(data, self.now)
        if data or self.now >= self.session.deadline(self.now):
            self.events += self.session.tick(self.now)
        out = self.session.take()
        if out:
            self.sent.append((self.now, out))
            self.board.receive(self.to_board(out), self.now)

    def seen(self, kind):
        return [event for event in self.events if isinstance(event, kind)]

    def sent_since(self, time_s):
        return b"".join(data for sent_s, data in self.sent if sent_s >= time_s)

    @property
    def counts(self):
        return self.seen(Counts)
