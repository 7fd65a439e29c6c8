"""`make bench-hold`: time from a holder's host to the motors of the robot that it holds; build/bench/hold.json.

Two radio images run in simulated time.  The host of the first writes a hold text while the second drives and streams at
50 Hz; the phase between both is random.  The same with parameter 26 off is the control: the robot must drive on.
"""

import random
import statistics
import sys
from typing import Dict, List, Optional

from mrl_driver.host.firmware_images import image_path
from mrl_driver.protocol import encode_request
from mrl_driver.protocol.hold_text import HoldText
from mrl_driver.protocol.table import BY_NAME, PARAMETER_BY_NAME
from mrl_driver.robot import models
from mrl_driver.robot.radio import text_request
from sim_arduino.board import parameter_store
from sim_arduino.board.avr_board import AvrEngine
from sim_arduino.hardware.motor import Mode
from sim_arduino.hardware.wiring import Plant
from sim_arduino.hardware.xbee import RadioFit
from sim_arduino.world.world import World
from tests.long.bench import report

HOLDS, CONTROLS = report.either((1000, 20), (5, 2))
SILENCE = 20
"""Parameter 26 [100 ms]."""
START_S, STEP_S, PATIENCE_S, SETTLE_S = 2.5, 0.001, 0.5, 0.08
"""Until the image has listened; resolution; longest wait; time for a command to take effect."""
STREAM_MS = 20


class Pair:
    """A holder, and a robot that lets it hold it, or not."""

    def __init__(self, radio_hold: int) -> None:
        world, model = World(), models.load("traxbot")
        plants = [Plant(model, world, (n, 0, 0), name=f"robot{n}", radio=RadioFit()) for n in (0, 1)]
        self.boards = [AvrEngine(each, image_path("xbee")) for each in plants]
        values = parameter_store.first(model.ids[0], model)
        values[PARAMETER_BY_NAME["radio_hold"].number] = radio_hold
        self.boards[1].machine.write_eeprom(0, parameter_store.image(values))
        self._held = plants[1]
        self._address = plants[1].xbee.station.address
        self.now_s = 0.0
        self.run(START_S)
        self.tell(1, "start_stream", STREAM_MS)

    def tell(self, board: int, name: str, *args: int) -> None:
        self.boards[board].receive(encode_request(BY_NAME[name].code, *args))

    def say(self, text: HoldText) -> None:
        code, *fields = text_request(self._address, text.data)
        self.boards[0].receive(encode_request(code, *fields))

    def run(self, seconds: float) -> None:
        end_s = self.now_s + seconds
        while self.now_s < end_s:
            self.step()

    def step(self) -> None:
        self.now_s += STEP_S
        for board in reversed(self.boards):
            board.advance(self.now_s)

    @property
    def driven(self) -> bool:
        motors = self._held.robot.motors
        return any(motors[n].mode is not Mode.BRAKE for n in (0, 2))

    def close(self) -> None:
        for board in self.boards:
            board.close()


def hold(pair: Pair, number: int) -> Optional[float]:
    """The driving robot is held once: the time from the write to its stop [s], None if it drives on."""
    begun_s = pair.now_s
    pair.say(HoldText("hold", number))
    while pair.now_s < begun_s + PATIENCE_S:
        pair.step()
        if not pair.driven:
            return pair.now_s - begun_s
    return None


def measure(radio_hold: int, count: int) -> List[Optional[float]]:
    """Holds the robot many times, each time while it drives; when it stopped [s]."""
    pair, phase, out = Pair(radio_hold), random.Random(1), []
    for number in range(1, count + 1):
        pair.tell(1, "move_differential", 200, 0)
        pair.run(SETTLE_S + phase.uniform(0.0, STREAM_MS / 1000.0))
        assert pair.driven
        out.append(hold(pair, number))
        pair.say(HoldText("free", number))
        pair.run(SETTLE_S)
    pair.close()
    return out


def main() -> int:
    """Measures, prints, writes."""
    print("hold", file=sys.stderr, flush=True)
    holds, controls = measure(SILENCE, HOLDS), measure(0, CONTROLS)
    stopped_ms = [1000.0 * stopped_s for stopped_s in holds if stopped_s is not None]
    figures: Dict[str, float] = {
        "holds": len(holds),
        "stopped": len(stopped_ms),
        "stopped_ms_median": statistics.median(stopped_ms),
        "stopped_ms_worst": max(stopped_ms),
        "controls": len(controls),
        "controls_stopped": sum(stopped_s is not None for stopped_s in controls),
    }
    return report.conclude("hold", figures)


if __name__ == "__main__":
    sys.exit(main())
