"""What is measured on the H-bridge image alone, one function per figure; times are simulated.

"Load" means: turning wheels, a stream as fast as the serial link allows, and 400 commands a second.
"""

from pathlib import Path
from typing import Callable, Dict, List, Tuple

from mrl_driver.protocol.table import BY_NAME
from mrl_driver.robot import models
from sim_arduino.avr.records import PinChange
from sim_arduino.serve import factory
from tests.long.bench.bridge_board import BridgeRig
from tests.long.bench.firmware_board import Rig, request
from tests.long.bench.firmware_measures import EXACT, MakeRig, end_refusal
from tests.long.bench.report import either

COMMANDS_HZ = 400
CONTROLLED = (b"@9,100,100e", b"@9,99,99e")
"""Commands of the load: with speed control, which costs the board most."""
UNCONTROLLED = b"@10,100,100e"  # All outputs keep their levels, so that the cycle of a change is exact
LOAD_EDGES_HZ = 40000
LEAST_EDGES_HZ, MOST_EDGES_HZ = 5000.0, 400000.0
RATE_STEP, LOAD_S = either((1.01, 1.0), (1.5, 0.1))  # Exactness of the highest rate of edges
STOPS, WATCHDOG_STOPS, SAMPLES = either((1000, 30, 2000), (10, 2, 20))
SAMPLE_DUE = "_ZN3hal10sample_dueE"  # the interrupt of the sample moves it on
SAMPLE_CYCLES = 78 * 1024
LOOK_CYCLES, LOOK_STEP = 2000, 8
"""The sample is looked for from this long before it is due on, in steps of half a microsecond."""


def answer(rig: Rig, name: str, *args: int) -> Tuple[int, ...]:
    line = rig.ask(request(name, *args)).line
    return tuple(int(value) for value in line[1 : line.index(b"e")].split(b",")[1:])


def load(rig: Rig, seconds: float, commands: Tuple[bytes, ...] = CONTROLLED) -> None:
    """Runs under load, without the end of the stream."""
    period = rig.machine.frequency_hz // COMMANDS_HZ
    start = rig.machine.cycle
    rig.machine.send(request("start_stream"))
    for number in range(int(seconds * COMMANDS_HZ)):
        rig.machine.send(commands[number % len(commands)], start + number * period)
    rig.run(seconds)


MakeTurning = Callable[[float], BridgeRig]  # Makes a rig whose wheels turn at a rate [edge/s, both together]


def loses_nothing(make: MakeTurning, edges_hz: float, seconds: float = LOAD_S) -> bool:
    """Are all edges counted, all commands accepted and no byte lost under load?"""
    rig = make(edges_hz).settle()
    load(rig, seconds)
    rig.machine.turn(0.0, 0.0)
    rig.machine.send(request("stop_stream"))
    rig.run(20e-3)
    right, left = answer(rig, "read_encoders")
    status = dict(zip((field.name for field in BY_NAME["read_status"].reply), answer(rig, "read_status")))
    refused = sum(answer(rig, "read_counters"))
    missed = [(wheel.edges - count) % 65536 for wheel, count in zip(rig.machine.wheels, (left, right))]
    lost = rig.machine.bytes_lost
    rig.close()
    return not any((*missed, status["impossible"], status["stop_reason"], refused, lost))


def edge_figures(make: MakeTurning) -> Dict[str, float]:
    """The highest rate of edges, both wheels together, at which nothing is lost."""
    good, bad = LEAST_EDGES_HZ, MOST_EDGES_HZ
    if not loses_nothing(make, good):
        return {"edges_hz": 0.0}
    while bad / good > RATE_STEP:
        middle = (good * bad) ** 0.5
        good, bad = (middle, bad) if loses_nothing(make, middle) else (good, middle)
    return {"edges_hz": good}


def sample_cycles(rig: Rig, count: int) -> List[int]:
    """Cycles at which the interrupt of the sample runs, each at most `LOOK_STEP` late."""
    machine, cycles = rig.machine, []
    at = machine.symbol(SAMPLE_DUE).address
    seen, due = machine.peek(at, 2), machine.cycle + LOOK_CYCLES
    for _ in range(count + 1):
        machine.run_until(due - LOOK_CYCLES)
        while machine.peek(at, 2) == seen:
            machine.run_until(machine.cycle + LOOK_STEP)
        seen = machine.peek(at, 2)
        cycles.append(machine.cycle)
        due = machine.cycle + SAMPLE_CYCLES
    return cycles


def sample_figures(make: MakeTurning) -> Dict[str, float]:
    """Spread of the intervals between count samples under load, and their mean rate."""
    rig = make(LOAD_EDGES_HZ).settle()
    seconds = SAMPLES * SAMPLE_CYCLES / rig.machine.frequency_hz
    period = rig.machine.frequency_hz // COMMANDS_HZ
    rig.machine.send(request("start_stream"))
    for number in range(int(seconds * COMMANDS_HZ)):
        rig.machine.send(CONTROLLED[number % 2], rig.machine.cycle + number * period)
    cycles = sample_cycles(rig, SAMPLES)
    gaps = [later - earlier for earlier, later in zip(cycles, cycles[1:])]
    hertz = rig.machine.frequency_hz * len(gaps) / (cycles[-1] - cycles[0])
    rig.close()
    return {"sample_spread_us": rig.microseconds(max(gaps) - min(gaps)), "sample_hz": hertz}


# -- stops


def outputs_settled(rig: Rig, after: int) -> int:
    """Cycle of the last change of an output after a cycle.

    Raises:
        TimeoutError: no output changed.
    """
    changes: List[PinChange] = [one for one in rig.machine.pin_changes() if one.cycle > after]
    if not changes:
        raise TimeoutError("no output of the bridge changed within the simulated time")
    return max(one.cycle for one in changes)


def watch_outputs(rig: BridgeRig) -> None:
    rig.machine.watch_pins(rig.outputs)


def stop_figures(make: MakeTurning) -> Dict[str, float]:
    """From the last byte of `@13e` to the last change of an output, under load, at random phases."""
    rig = make(LOAD_EDGES_HZ).settle()
    watch_outputs(rig)
    delays = []
    for _ in range(STOPS):
        load(rig, 8e-3, (UNCONTROLLED,))
        end = rig.send_somewhen(b"@13e", 5e-3)
        rig.machine.run_until(end - 10)
        rig.machine.pin_changes()
        rig.machine.run_until(end + int(3e-3 * rig.machine.frequency_hz))
        delays.append(rig.microseconds(outputs_settled(rig, end) - end))
        rig.replies()
    rig.close()
    return {"stop_us_max": max(delays)}


def watchdog_figures(make: Callable[[], BridgeRig]) -> Dict[str, float]:
    """From the last byte of the host to the last change of an output, watchdog 250 ms, at random phases."""
    rig = make().settle()
    rig.ask(request("set_watchdog", 250))
    watch_outputs(rig)
    delays = []
    for _ in range(WATCHDOG_STOPS):
        end_refusal(rig)
        end = rig.send_somewhen(UNCONTROLLED, 0.1)
        rig.machine.run_until(end + int(20e-3 * rig.machine.frequency_hz))
        rig.machine.pin_changes()
        rig.machine.run_until(end + int(0.4 * rig.machine.frequency_hz))
        delays.append(1e-3 * rig.microseconds(outputs_settled(rig, end) - end))
    rig.close()
    return {"watchdog_stop_ms_max": max(delays)}


def exact_figures(make: MakeRig) -> Dict[str, float]:
    """How many of all counts come back as they were set by command 4."""
    rig = make().settle()
    rig.machine.turn(0.0, 0.0)
    rig.run(10e-3)
    exact = 0
    for value in EXACT:
        rig.machine.send(request("preset_encoder", 1, value))
        exact += answer(rig, "read_encoders")[1] == value
    rig.close()
    return {"int16_exact": exact * EXACT.step}


# -- motion: the image, the emulated duo, and the true speed of its wheels

SETTLE_S, STEP_S, SLOW_S = 2.0, 1.0, 2.0
TARGET_MM_S, SLOW_MM_S = 300, 20
SLICE_S = 1e-3
WITHIN = 0.05


class Duo:
    """An emulated duo with the real image, without a host's limits."""

    def __init__(self, elf: Path) -> None:
        self._made = factory.make(
            factory.Options(robot="duo", engine="avr", elf=str(elf), footprint="none", error="phase=0.2")
        )
        self._now_s = 0.0
        self._metres_per_count = models.load("duo").differential.metres_per_count
        self.run(SETTLE_S)
        self.send(request("write_config", 8, 0))

    def send(self, data: bytes) -> None:
        self._made.engine.receive(data)
        self.run(0.02)

    def run(self, seconds: float) -> List[Tuple[float, float]]:
        """True speeds (left, right) of the wheels [m/s] after each slice."""
        speeds = []
        for _ in range(round(seconds / SLICE_S)):
            self._now_s += SLICE_S
            self._made.engine.advance(self._now_s)
            bridge = self._made.plant.bridge
            speeds.append(tuple(bridge.motor(wheel).speed * self._metres_per_count for wheel in (0, 1)))
        return speeds

    def step(self, linear_mm_s: int, seconds: float) -> List[Tuple[float, float]]:
        """Speeds after a step of the target, from now on."""
        self._made.engine.receive(request("move_differential", linear_mm_s, 0))
        return self.run(seconds)

    def close(self) -> None:
        self._made.close()


def motion_figures(elf: Path) -> Dict[str, float]:
    """A step to 0.3 m/s without a ramp, and the ripple at 0.02 m/s; the worse wheel."""
    duo = Duo(elf)
    target = TARGET_MM_S / 1000
    step = [[speed / target for speed in wheel] for wheel in zip(*duo.step(TARGET_MM_S, STEP_S))]
    duo.step(0, 1.0)
    duo.step(SLOW_MM_S, 1.0)
    slow = list(zip(*duo.run(SLOW_S)))
    duo.close()
    steady = [wheel[len(wheel) // 2 :] for wheel in step]
    late = [
        max((i + 1 for i, each in enumerate(wheel) if abs(each - 1) > WITHIN), default=0) for wheel in step
    ]
    return {
        "step_overshoot": max(0.0, *(max(wheel) - 1 for wheel in step)),
        "step_mean_error": max(abs(sum(wheel) / len(wheel) - 1) for wheel in steady),
        "step_within_ms": 1e3 * SLICE_S * max(late),
        "slow_ripple": max((max(wheel) - min(wheel)) * len(wheel) / sum(wheel) for wheel in slow),
    }
