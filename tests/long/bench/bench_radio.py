"""`make bench-radio`: texts between two emulated robots at several losses of the radio; build/bench/radio.json.

Numbered texts go from host to host through two boards and their modules, in simulated time: unicast with
acknowledgements, and broadcast.  Without loss it is the control.  The loss is the share of the packets that each radio
does not receive.
"""

import statistics
import sys
from typing import Dict, List, NamedTuple, Union

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
LOSSES = (0.0, 0.1, 0.3)
PERIOD_S, STEP_S = 0.1, 0.002
START_S, LAST_S = 0.5, 6.0
"""Until the image has started; after the last text, for its third attempt."""
WAYS = ("unicast", "broadcast")


class Run(NamedTuple):
    """One run: texts of 1000 that arrived, texts that arrived again, and delays of the first arrivals [s]."""

    delivered: float
    again: float
    delays_s: List[float]


def exchange(way: str, loss: float, seed: int, engine: str = "python", texts: int = TEXTS) -> Run:
    """Sends numbered texts from one robot to another."""
    world, model, fit = World(), models.load("traxbot"), RadioFit(loss=loss)
    plants = [Plant(model, world, (n, 0, 0), name=f"robot{n}", seed=seed, radio=fit) for n in (0, 1)]
    image = image_path("xbee")
    boards = [PythonBoard(each) if engine == "python" else AvrEngine(each, image) for each in plants]
    to = plants[1].xbee.station.address if way == "unicast" else BROADCAST
    sent_s: Dict[bytes, float] = {}
    arrived_s: Dict[bytes, List[float]] = {}
    decoder, now_s = FrameDecoder(REPLIES), 0.0
    for number in range(texts):
        while now_s < START_S + number * PERIOD_S:
            now_s = _step(boards, decoder, now_s, arrived_s)
        text = b"text %d" % number
        sent_s[text] = now_s
        code, *fields = text_request(to, text)
        boards[0].receive(encode_request(code, *fields))
    end_s = now_s + LAST_S
    while now_s < end_s:
        now_s = _step(boards, decoder, now_s, arrived_s)
    for board in boards:
        board.close()
    again = sum(len(each) - 1 for each in arrived_s.values())
    delays_s = [times[0] - sent_s[text] for text, times in arrived_s.items()]
    return Run(1000.0 * len(arrived_s) / texts, 1000.0 * again / texts, delays_s)


def _step(
    boards: List[Union[PythonBoard, AvrEngine]],
    decoder: FrameDecoder,
    now_s: float,
    arrived_s: Dict[bytes, List[float]],
) -> float:
    """Runs both boards one step further, notes what arrived, and returns the new time [s]."""
    now_s += STEP_S
    boards[0].advance(now_s)
    for event in decoder.feed(boards[1].advance(now_s)):
        received = text_of(event) if isinstance(event, Frame) else None
        if received:
            arrived_s.setdefault(received.data, []).append(now_s)
    return now_s


def summary(name: str, runs: List[Run]) -> Dict[str, float]:
    """The figures of several runs."""
    delays_ms = sorted(1000.0 * each for run in runs for each in run.delays_s)
    return {
        f"{name}_delivered_per_1000_median": statistics.median(run.delivered for run in runs),
        f"{name}_delivered_per_1000_worst": min(run.delivered for run in runs),
        f"{name}_again_per_1000_worst": max(run.again for run in runs),
        f"{name}_delay_ms_median": statistics.median(delays_ms),
        f"{name}_delay_ms_p99": delays_ms[int(0.99 * (len(delays_ms) - 1))],
        f"{name}_delay_ms_worst": delays_ms[-1],
    }


def main() -> int:
    """Measures, prints, writes."""
    figures: Dict[str, float] = {"seeds": SEEDS, "texts_per_seed": TEXTS, "image_texts": IMAGE_TEXTS}
    for loss in LOSSES:
        for way in WAYS:
            name = f"{way}_loss_{round(100 * loss)}"
            print(name, file=sys.stderr, flush=True)
            figures.update(summary(name, [exchange(way, loss, seed) for seed in range(SEEDS)]))
    figures.update(summary("image_unicast_loss_10", [exchange("unicast", 0.1, 0, "avr", IMAGE_TEXTS)]))
    return report.conclude("radio", figures)


if __name__ == "__main__":
    sys.exit(main())
