"""What is measured on the H-bridge image alone, one function per figure; times are simulated.

"Load" means: turning wheels, a stream as fast as the serial link allows, and 400 commands a second.
"""

from pathlib import Path
from typing import Callable, Dict, Iterator, List, Tuple

from mrl_driver.protocol.table import BY_NAME
from mrl_driver.robot import models
from sim_arduino.avr.records import PinChange
from sim_arduino.serve import factory
from tests.long.bench.bridge_board import BridgeRig, FullMega
from tests.long.bench.firmware_board import Rig, request
from tests.long.bench.firmware_measures import EXACT, MakeRig, end_refusal
from tests.long.bench.report import either

COMMANDS_HZ = 400
CONTROLLED = (b"@9,100,100e", b"@9,99,99e")
"""Commands of the load: with speed control, which costs the board most."""
UNCONTROLLED = b"@10,100,100e"  # All outputs keep their levels, so that the cycle of a change is exact
LOAD_EDGES_HZ, FOUR_WHEELS_HZ = 40000, 60000
LEAST_EDGES_HZ, MOST_EDGES_HZ = 5000.0, 400000.0
RATE_STEP, LOAD_S = either((1.01, 1.0), (10.0, 0.1))  # Exactness of the highest rate of edges
STOPS, WATCHDOG_STOPS, SAMPLES = either((1000, 30, 2000), (4, 2, 20))
HELD_US, MOVE_US_S, SERVO_PERIOD_S = 1500, 300, 20e-3
SERVO_S = either(2.0, 0.2)
RANGES_S, READINGS = 0.4, either(20, 1)  # More than a round of six HC-SR04
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


MakeTurning = Callable[[float], BridgeRig]  # Makes a rig whose wheels turn at a rate [edge/s, all together]


def loses_nothing(make: MakeTurning, edges_hz: float, seconds: float = LOAD_S) -> bool:
    """Are all edges counted, all commands accepted and no byte lost under load?"""
    rig = make(edges_hz).settle()
    load(rig, seconds)
    wheels = rig.machine.wheels
    rig.machine.turn(*[0.0] * len(wheels))
    rig.machine.send(request("stop_stream"))
    rig.run(20e-3)
    counts = answer(rig, "read_wheels")
    status = dict(zip((field.name for field in BY_NAME["read_status"].reply), answer(rig, "read_status")))
    refused = sum(answer(rig, "read_counters"))
    missed = [(wheel.edges - count) % 65536 for wheel, count in zip(wheels, counts)]
    lost = rig.machine.bytes_lost
    rig.close()
    return not any((*missed, status["impossible"], status["stop_reason"], refused, lost))


def edge_figures(make: MakeTurning) -> Dict[str, float]:
    """The highest rate of edges, all wheels together, at which nothing is lost."""
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
        cycles.append(machine.cycle)
        machine.run_until(machine.cycle + LOOK_STEP)  # the second byte follows the first one
        seen = machine.peek(at, 2)
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


def outputs_settled(rig: BridgeRig, after: int) -> int:
    """Cycle of the last change of an output after a cycle.

    Raises:
        TimeoutError: no output changed.
    """
    outputs, found = rig.outputs, rig.machine.pin_changes()
    changes: List[PinChange] = [one for one in found if one.cycle > after and one.pin in outputs]
    if not changes:
        raise TimeoutError("no output of the bridge changed within the simulated time")
    return max(one.cycle for one in changes)


def watch_outputs(rig: BridgeRig) -> None:
    rig.watch(rig.outputs)


def stop_figures(make: MakeTurning, edges_hz: float = LOAD_EDGES_HZ) -> Dict[str, float]:
    """From the last byte of `@13e` to the last change of an output, under load, at random phases."""
    rig = make(edges_hz).settle()
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


def servo_figures(make: MakeTurning, edges_hz: float = LOAD_EDGES_HZ) -> Dict[str, float]:
    """Largest deviation of the pulses of a servo that is held, and of the time from pulse to pulse, also of one that
    moves, under load."""
    rig = make(edges_hz).settle()
    frequency, pins = rig.machine.frequency_hz, [rig.pins[f"pin_servo_{number}"] for number in (1, 2)]
    for number, pulse_us in ((1, HELD_US), (2, 1000)):
        rig.ask(request("set_servo", number, pulse_us, 0))
    rig.ask(request("set_servo", 2, 2000, MOVE_US_S))
    rig.watch(pins)
    rig.run(2 * SERVO_PERIOD_S)
    rig.machine.pin_changes()
    load(rig, SERVO_S)
    changes = [[each for each in rig.machine.pin_changes() if each.pin == pin] for pin in pins]
    wrong = []
    for edges in changes:
        rises = [each.cycle for each in edges if each.level]
        wrong += [b - a - SERVO_PERIOD_S * frequency for a, b in zip(rises, rises[1:])]
    held = [
        b.cycle - a.cycle - HELD_US * 1e-6 * frequency for a, b in zip(changes[0], changes[0][1:]) if a.level
    ]
    rig.close()
    return {"servo_jitter_us": rig.microseconds(max(map(abs, wrong + held)))}


def input_figures(make: MakeTurning, edges_hz: float = LOAD_EDGES_HZ) -> Dict[str, float]:
    """From the edge of an input to the last change of an output, under load, at random phases."""
    rig = make(edges_hz)
    inputs = (
        ("bumper", rig.pins["pin_bumper_left"], 0),
        ("emergency_input", rig.pins["pin_emergency_stop"], 1),
    )
    for _, pin, active in inputs:
        rig.machine.set_pin(pin, 1 - active)
    rig.settle()
    watch_outputs(rig)
    return {f"{name}_ms_max": max(_delays_ms(rig, pin, active)) for name, pin, active in inputs}


def _delays_ms(rig: BridgeRig, pin: int, active: int) -> Iterator[float]:
    for _ in range(STOPS):
        at = rig.machine.cycle + int(rig.random.uniform(8e-3, 13e-3) * rig.machine.frequency_hz)
        rig.machine.set_pin(pin, active, at)
        load(rig, 22e-3, (UNCONTROLLED,))
        yield 1e-3 * rig.microseconds(outputs_settled(rig, at) - at)
        rig.machine.set_pin(pin, 1 - active)
        rig.run(5e-3)
        rig.machine.send(request("release_emergency"))
        rig.run(5e-3)
        rig.replies()


def range_figures(make: Callable[[float], FullMega], edges_hz: float) -> Dict[str, float]:
    """Largest error of the time of an echo, all sensors, under load."""
    rig = make(edges_hz).settle()
    load(rig, RANGES_S)
    errors_us: List[float] = []
    for _ in range(READINGS):
        load(rig, RANGES_S)
        rig.machine.send(request("stop_stream"))
        rig.run(20e-3)
        errors_us += rig.echoes.errors_us(answer(rig, "read_ranges"))
    rig.close()
    return {"echo_error_us_max": max(errors_us)}


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

SETTLE_S, STEP_S, SLOW_S = either((2.0, 1.0, 2.0), (1.0, 0.8, 0.5))
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
