"""`mrl radio` on a fake board with a radio."""

import json

import pytest

from mrl_driver.cli.commands.radio import print_nodes, print_texts
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import ConfigError
from mrl_driver.robot.radio import BROADCAST, text_request
from tests.fake_board import FakeBoard
from tests.models import model
from tests.radio_board import PEER, Engine, RadioBoard
from tests.waiting import wait_until

from .run import mrl


@pytest.fixture
def robot():
    engine = Engine(RadioBoard())
    with SteppedDriver(engine, model("traxbot")) as driver:
        driver.engine = engine
        yield driver


def test_discover_as_json(serve):
    board = serve(RadioBoard())
    nodes = json.loads(mrl("radio", "discover", "--port", board.path, "--seconds", "1", "--json").stdout)
    assert nodes[0] == {"address": "0013a20040a1b2c3", "network": "0001"} and len(nodes) == 2


def test_texts_of_strangers_give_no_orders_to_the_terminal(robot, capsys):
    board = robot.engine.board
    robot.on_telemetry(lambda _: None if board.told else board.hear(PEER, "a\x1b[2J\r\nb"))
    print_texts(robot, 0.3, False)
    assert capsys.readouterr().out == "0013a20040a1b2c3  a\\x1b[2J\\r\\nb\n"


@pytest.mark.parametrize("use", [print_nodes, print_texts])
def test_board_without_a_radio_is_named(use):
    robot = SteppedDriver(Engine(FakeBoard()), model("traxbot"))
    with robot, pytest.raises(ConfigError, match="no radio"):
        use(robot, 0.1, False)


def test_send_sends_the_text_to_all(serve):
    board = serve(RadioBoard())
    assert mrl("radio", "send", "all", "hello", "--port", board.path).returncode == 0
    wait_until(lambda: board.board.sent)
    assert board.board.sent[0][1] == text_request(BROADCAST, "hello")[1:]
