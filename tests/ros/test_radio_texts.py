"""A text from topic to topic: two nodes, two boards that run the radio build's image, and their radios."""

from diagnostic_msgs.msg import KeyValue

from sim_arduino.hardware.xbee import address_for
from sim_arduino.testing import EmulatedBoard
from sim_arduino.world.world import World
from tests.waiting import wait_until

from .rig import NODE

AGAIN_S = 0.3
"""A text is sent again after this time, because a board whose process is held up drops what was sent to it."""


def test_text_goes_from_one_robot_to_the_other_and_back(rig):
    fitted = {"world": World(), "engine": "avr", "radio": "auto"}
    with EmulatedBoard(name="one", **fitted) as one, EmulatedBoard(name="two", pose="1,0,0", **fitted) as two:
        for board, name in ((one, "one"), (two, "two")):
            rig.start(name, str(NODE), f"__ns:={rig.ns}/{name}", f"_port:={board.port}")
        received = {name: rig.topic(f"{name}/xbee/received", KeyValue) for name in ("one", "two")}
        send = {name: rig.publisher(f"{name}/xbee/send", KeyValue) for name in ("one", "two")}
        for here, there, text in (("one", "two", "go"), ("two", "one", "went")):
            received[there].wait_for_publisher()
            message = KeyValue(f"{address_for(there):016x}", text)
            wait_until(lambda: send[here].publish(message) or received[there].messages, step_s=AGAIN_S)  # noqa: B023
            assert received[there].messages[0] == KeyValue(f"{address_for(here):016x}", text)
