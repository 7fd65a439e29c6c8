"""`make bench-radio`: texts between two emulated robots at several losses of the radio; build/bench/radio.json.

Numbered texts go from host to host through two boards and their modules, in simulated time: unicast with
acknowledgements, and broadcast.  Without loss it is the control.  The loss is the share of the packets that each radio
does not receive.
"""

import statistics
import sys
from typing import Dict, List, Set, Union

from mrl_driver.host.firmware_images import image_path
from mrl_driver.protocol import REPLIES, Frame, FrameDecoder, encode_request
from mrl_driver.robot import models
from mrl_driver.robot.radio import BROADCAST, text_of, text_request
from sim_arduino.board import PythonBoard
from sim_arduino.board.avr_board import AvrEngine
from sim_arduino.hardware.wiring import Plant
from sim_arduino.hardware.xbee import RadioFit
from sim_arduino.world.world import World
from tests.long.bench import report

TEXTS, SEEDS, IMAGE_TEXTS = report.either((1000, 10, 200), (30, 1, 10))
LOSSES = (0.0, 0.1)
PERIOD_S, STEP_S = 0.1, 0.002
START_S, LAST_S = 0.5, 6.0
"""Until the image has started; after the last text, for its third attempt."""
WAYS = ("unicast", "broadcast")


def exchange(way: str, loss: float, seed: int, engine: str = "python", texts: int = TEXTS) -> float:
    """Sends numbered texts from one robot to another; how many of 1000 arrive."""
    world, model, fit = World(), models.load("traxbot"), RadioFit(loss=loss)
    plants = [Plant(model, world, (n, 0, 0), name=f"robot{n}", seed=seed, radio=fit) for n in (0, 1)]
    image = image_path("xbee")
    boards = [PythonBoard(each) if engine == "python" else AvrEngine(each, image) for each in plants]
    to = plants[1].xbee.station.address if way == "unicast" else BROADCAST
    arrived: Set[bytes] = set()
    decoder, now_s = FrameDecoder(REPLIES), 0.0
    for number in range(texts):
        while now_s < START_S + number * PERIOD_S:
            now_s = _step(boards, decoder, now_s, arrived)
        code, *fields = text_request(to, b"text %d" % number)
        boards[0].receive(encode_request(code, *fields))
    end_s = now_s + LAST_S
    while now_s < end_s:
        now_s = _step(boards, decoder, now_s, arrived)
    for board in boards:
        board.close()
    return 1000.0 * len(arrived) / texts


def _step(
    boards: List[Union[PythonBoard, AvrEngine]],
    decoder: FrameDecoder,
    now_s: float,
    arrived: Set[bytes],
) -> float:
    """Runs both boards one step further, notes what arrived, and returns the new time [s]."""
    now_s += STEP_S
    boards[0].advance(now_s)
    for event in decoder.feed(boards[1].advance(now_s)):
        received = text_of(event) if isinstance(event, Frame) else None
        if received:
            arrived.add(received.data)
    return now_s


def summary(name: str, delivered: List[float]) -> Dict[str, float]:
    return {
        f"{name}_delivered_per_1000_median": statistics.median(delivered),
        f"{name}_delivered_per_1000_worst": min(delivered),
    }


def main() -> int:
    """Measures, prints, writes."""
    figures: Dict[str, float] = {}
    for loss in LOSSES:
        for way in WAYS:
            name = f"{way}_loss_{round(100 * loss)}"
            print(name, file=sys.stderr, flush=True)
            figures.update(summary(name, [exchange(way, loss, seed) for seed in range(SEEDS)]))
    figures.update(summary("image_unicast_loss_10", [exchange("unicast", 0.1, 0, "avr", IMAGE_TEXTS)]))
    return report.conclude("radio", figures)


if __name__ == "__main__":
    sys.exit(main())
