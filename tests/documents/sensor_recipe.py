"""What a tree with the recipe's sensor does: run in that tree, prints one JSON object."""

import json
import sys

from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.protocol import REPLIES, Frame, FrameDecoder
from mrl_driver.protocol.table import SENSOR_BY_NAME
from mrl_driver.session.events import SensorRead
from mrl_driver.view.shown_state import line
from ros1_bridge.topics import sensor_topics
from sim_arduino.serve import factory

RUN_S = 1.6
WORLD, NAME = sys.argv[1:]


class Heard:
    """An engine that keeps what the board sends, as a recording does."""

    def __init__(self, engine):
        self.engine, self.data = engine, b""

    def __getattr__(self, name):
        return getattr(self.engine, name)

    def advance(self, to_s):
        sent = self.engine.advance(to_s)
        self.data += sent
        return sent


class Publisher:
    published = {}

    def __init__(self, topic):
        self.topic = topic

    def publish(self, message):
        Publisher.published[self.topic] = message


def seen(engine, pose):
    emulated = factory.make(factory.Options(engine=engine, world=WORLD, pose=pose))
    heard = Heard(emulated.engine)
    with SteppedDriver(heard) as robot:
        topics = sensor_topics.SensorTopics(
            None, "one/base_link", robot.board.capabilities, robot.board.version, lambda: 7
        )
        robot.on(SensorRead, topics.on_sensor)
        robot.wait(RUN_S)
        result = {
            "values": robot.sensors[NAME].values,
            "line": line(robot),
            "faults": robot.status.faults,
            "lost": robot.link.statistics.lost,
        }
    frames = [
        each for each in FrameDecoder(REPLIES, checked=True).feed(heard.data) if isinstance(each, Frame)
    ]
    code = SENSOR_BY_NAME[NAME].code
    result["recorded"] = [list(frame.args) for frame in frames if frame.code == code][-1]
    message = Publisher.published[NAME]
    result["topic"] = [message.header.frame_id, message.temperature, message.variance]
    emulated.close()
    return result


def absent():
    """The faults of a board whose sensor was never there, and what it reads."""
    emulated = factory.make(factory.Options(engine="avr"))
    emulated.plant.i2c[SENSOR_BY_NAME[NAME].i2c.address].present = False
    with SteppedDriver(emulated.engine) as robot:
        robot.wait(RUN_S)
        found = {"faults": robot.status.faults, "read": NAME in robot.sensors}
    emulated.close()
    return found


sensor_topics.direct_publisher = lambda _, topic, *__: Publisher(topic)
print(json.dumps({"far": seen("python", "-1,0,0"), "near": seen("avr", "1,0,0"), "absent": absent()}))
