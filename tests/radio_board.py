"""A fake board with a radio that finds two nodes."""

from mrl_driver.robot.radio import SEARCH, TEXT_IN, TEXT_OUT, RadioNode, text_request
from tests.fake_board import FakeBoard

PEER, WORDS = 0x0013A20040A1B2C3, (0x0013, 0xA200 - 0x10000, 0x40A1, 0xB2C3 - 0x10000)
NODES = [RadioNode(PEER, 1), RadioNode(PEER - 0xB2C3 + 7, 2)]


class RadioBoard(FakeBoard):
    """A board with a radio.

    `nodes` answer a search.  Frames 38 are in `sent` with their times, texts that it receives in `told`.
    """

    nodes = ((*WORDS, 1), (*WORDS[:3], 7, 2))

    def __init__(self):
        super().__init__()
        self.capabilities.add("xbee")
        self.sent, self.told = [], []

    def _do(self, event, now):
        if event.code == TEXT_OUT:
            self.sent.append((now, event.args))
        elif event.code == SEARCH:
            for node in self.nodes:
                self._say(SEARCH, *node)
        else:
            super()._do(event, now)

    def hear(self, address, text):
        self.told.append(text)
        self._say(TEXT_IN, *text_request(address, text)[1:])


class Engine:
    """The fake board as an engine of the emulator."""

    next_event_s = 0.0

    def __init__(self, board):
        self.board = board
        self.now_s = 0.0

    def receive(self, data):
        self.board.receive(data, self.now_s)

    def advance(self, to_s):
        self.now_s = self.next_event_s = to_s
        self.next_event_s += 1e-3
        return self.board.advance(to_s)
