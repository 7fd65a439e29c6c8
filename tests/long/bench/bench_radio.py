"""`make bench-radio`: texts between two emulated robots at several losses of the radio; build/bench/radio.json.

Numbered texts go from host to host through two boards and their modules, in simulated time: unicast with
acknowledgements, and broadcast.  Without loss it is the control.  The loss is the share of the packets that each radio
does not receive.
"""

import statistics
import sys
from typing import Any, Callable, Dict, List

from mrl_driver.robot.radio import BROADCAST
from sim_arduino.board import PythonBoard
from sim_arduino.hardware.wiring import Plant
from tests.long.bench import report
from tests.long.bench.radio_pair import Pair, radio_image

TEXTS, SEEDS, IMAGE_TEXTS = report.either((1000, 10, 200), (20, 1, 5))
LOSSES = (0.0, 0.1)
PERIOD_S, STEP_S = 0.1, 0.002
START_S = 0.5  # Until the image has started
LAST_S = report.either(6.0, 1.0)  # After the last text, for its third attempt
WAYS = ("unicast", "broadcast")


def exchange(
    way: str, loss: float, seed: int, board: Callable[[Plant], Any] = PythonBoard, texts: int = TEXTS
) -> float:
    """Sends numbered texts from one robot to another; how many of 1000 arrive."""
    pair = Pair(board, STEP_S, loss, seed)
    for number in range(texts):
        pair.run_until(START_S + number * PERIOD_S)
        pair.say(pair.address if way == "unicast" else BROADCAST, b"text %d" % number)
    pair.run_until(pair.now_s + LAST_S)
    pair.close()
    return 1000.0 * len(pair.arrived) / texts


def summary(name: str, delivered: List[float]) -> Dict[str, float]:
    return {
        f"{name}_delivered_per_1000_median": statistics.median(delivered),
        f"{name}_delivered_per_1000_worst": min(delivered),
    }


def figures() -> Dict[str, report.Measured]:
    found: Dict[str, float] = {}
    for loss in LOSSES:
        for way in WAYS:
            name = f"{way}_loss_{round(100 * loss)}"
            print(name, file=sys.stderr, flush=True)
            found.update(summary(name, [exchange(way, loss, seed) for seed in range(SEEDS)]))
    found.update(summary("image_unicast_loss_10", [exchange("unicast", 0.1, 0, radio_image, IMAGE_TEXTS)]))
    return found
