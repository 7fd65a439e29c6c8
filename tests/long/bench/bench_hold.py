"""`make bench-hold`: time from a holder's host to the motors of the robot that it holds; build/bench/hold.json.

Two radio images run in simulated time.  The host of the first writes a hold text while the second drives and streams at
50 Hz; the phase between both is random.  The same with parameter 26 off is the control: the robot must drive on.
"""

import random
import statistics
import sys
from typing import Dict, List, Optional

from mrl_driver.protocol.hold_text import HoldText
from mrl_driver.protocol.table import PARAMETER_BY_NAME
from mrl_driver.robot import models
from sim_arduino.board import parameter_store
from sim_arduino.hardware.motor import Mode
from tests.long.bench import report
from tests.long.bench.radio_pair import Pair, radio_image

HOLDS, CONTROLS = report.either((1000, 20), (3, 1))
SILENCE = 20  # Parameter 26 [100 ms]
START_S, STEP_S, PATIENCE_S, SETTLE_S = 2.5, 0.001, 0.5, 0.08
"""Until the image has listened; resolution; longest wait; time for a command to take effect."""
STREAM_MS = 20


def holder_and_held(radio_hold: int) -> Pair:
    """A holder, and a robot that streams and lets it hold it, or not."""
    pair, model = Pair(radio_image, STEP_S), models.load("traxbot")
    values = parameter_store.first(model.ids[0], model)
    values[PARAMETER_BY_NAME["radio_hold"].number] = radio_hold
    pair.boards[1].machine.write_eeprom(0, parameter_store.image(values))
    pair.run_until(START_S)
    pair.tell(1, "start_stream", STREAM_MS)
    return pair


def is_driven(pair: Pair) -> bool:
    """Whether the motor board of the held robot drives."""
    motors = pair.plants[1].robot.motors
    return any(motors[n].mode is not Mode.BRAKE for n in (0, 2))


def hold(pair: Pair, number: int) -> Optional[float]:
    """The driving robot is held once: the time from the write to its stop [s], None if it drives on."""
    begun_s = pair.now_s
    pair.say(pair.address, HoldText("hold", number).data)
    while pair.now_s < begun_s + PATIENCE_S:
        pair.step()
        if not is_driven(pair):
            return pair.now_s - begun_s
    return None


def measure(radio_hold: int, count: int) -> List[Optional[float]]:
    """Holds the robot many times, each time while it drives; when it stopped [s]."""
    pair, phase, out = holder_and_held(radio_hold), random.Random(1), []
    for number in range(1, count + 1):
        pair.tell(1, "move_differential", 200, 0)
        pair.run_until(pair.now_s + SETTLE_S + phase.uniform(0.0, STREAM_MS / 1000.0))
        assert is_driven(pair)
        out.append(hold(pair, number))
        pair.say(pair.address, HoldText("free", number).data)
        pair.run_until(pair.now_s + SETTLE_S)
    pair.close()
    return out


def figures() -> Dict[str, report.Measured]:
    print("hold", file=sys.stderr, flush=True)
    holds, controls = measure(SILENCE, HOLDS), measure(0, CONTROLS)
    stopped_ms = [1000.0 * stopped_s for stopped_s in holds if stopped_s is not None]
    return {
        "holds": len(holds),
        "stopped": len(stopped_ms),
        "stopped_ms_median": statistics.median(stopped_ms),
        "stopped_ms_worst": max(stopped_ms),
        "controls": len(controls),
        "controls_stopped": sum(stopped_s is not None for stopped_s in controls),
    }
