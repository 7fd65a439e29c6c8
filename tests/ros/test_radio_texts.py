"""A text from topic to topic: two nodes, their boards and radios."""

from diagnostic_msgs.msg import KeyValue

from sim_arduino.hardware.xbee import address_for
from sim_arduino.testing import EmulatedBoard
from sim_arduino.world.world import World

from .rig import NODE


def test_text_goes_from_one_robot_to_the_other_and_back(rig):
    world = World()
    with EmulatedBoard(world, name="one", radio="auto") as one, EmulatedBoard(
        world, name="two", radio="auto", pose="1,0,0"
    ) as two:
        for board, name in ((one, "one"), (two, "two")):
            rig.start(name, str(NODE), f"__ns:={rig.ns}/{name}", f"_port:={board.port}")
        received = {name: rig.topic(f"{name}/xbee/received", KeyValue) for name in ("one", "two")}
        send = {name: rig.publisher(f"{name}/xbee/send", KeyValue) for name in ("one", "two")}
        for topic in received.values():
            topic.wait_for_publisher()
        there, back = (
            KeyValue(f"{address_for('two'):016x}", "go"),
            KeyValue(f"{address_for('one'):016x}", "went"),
        )
        send["one"].publish(there)
        got_there = received["two"].wait()
        send["two"].publish(back)
        got_back = received["one"].wait()
    assert got_there == [KeyValue(back.key, "go")] and got_back == [KeyValue(there.key, "went")]
