"""Motors on H-bridges and encoders on the Arduino's pins: what an H-bridge board has in place of the OMNI-3MD.

The pins are those of the model's wiring.  The board writes its outputs as shares of time for which they are high; the
edges of the encoders' pins come out at their true times.
"""

import math
from typing import Dict, List, Sequence

from mrl_driver.geometry import Pose
from mrl_driver.protocol.table import BRIDGES as BRIDGE_NAMES
from mrl_driver.protocol.table import NOT_CONNECTED, WHEELS, WIRING
from mrl_driver.robot import wiring as board_wiring
from mrl_driver.robot.chips import CHIPS
from mrl_driver.robot.models import COMMON_BOARD, RobotModel

from .bridge import BRIDGES, Bridge, Shares
from .dc_motor import DcMotor, DcMotorParams
from .encoders import PinEdge, Quadrature
from .robot_physics import AS_MODELLED, Errors, RobotPhysics, params_for
from .stop_inputs import StopInputs

ENABLE = 3  # index of a motor's enable, behind PWM_A, PWM_B and LOGIC
MOTORS = (0, 2, 1, 3)
"""Motors of the body by the wheels of the table: the middle one of three is at the rear left."""
TOGGLES, TOGGLE_S = 6, 62.5e-3
"""After a reset by the host, the bootloader toggles the LED's pin this often, each time after this pause [s].  Source:
Optiboot 4.4, `flash_led` with LED_START_FLASHES 3."""
TICK_HZ = 200.0  # rate at which the battery's voltage follows the motors' current [Hz]
IDLE_A, BATTERY_OHM = 0.1, 0.1
"""Current of board, bridge and encoders, and resistance of pack and leads; assumed."""
LARGE_V, SMALL_V = 12.0, 6.0  # nominal voltages of gearmotors, for batteries above and below 9 V when full
STALL_W, NO_LOAD_W, STALL_NM_RAD_S = 14.4, 0.6, 8.9
"""Power at stall (1.2 A at 12 V) and at no load (0.05 A), and stall torque times no-load speed (0.5 Nm at 170/min);
assumed for a gearmotor of 25 mm."""
ROTOR_KGM2_RAD2_S2 = 0.37
"""Inertia of the rotor times the square of its speed at the output shaft (1e-6 kg m2, 34:1, 170/min); assumed."""
ROLLING = 0.03  # rolling friction of a wheel, as a share of the weight; assumed
STICTION = 1.5  # static friction over moving friction; assumed
GRAVITY_M_S2 = 9.81
_BITS = {name: 1 << bit for bit, (name, _) in enumerate(WIRING)}


def has_bridge(model: RobotModel) -> bool:
    """Whether a robot of this model has its motors on H-bridges."""
    return bool(model.board.get("bridge"))


def wheel_count(model: RobotModel) -> int:
    """Driven wheels of a robot with H-bridges, two or four."""
    return board_wiring.motors(board_wiring.of_board(model.board))


def counts_per_turn(model: RobotModel) -> float:
    """Encoder counts per turn of a wheel."""
    return model.board["gearbox"] * model.board["encoder_counts"] / 100.0


def motor_params(model: RobotModel, errors: Errors = AS_MODELLED) -> DcMotorParams:
    """Parameters of one gearmotor of a model, with its bridge and its wheel's share of the robot's mass.

    `full_speed` is its speed without load, where the current overcomes the gearbox's friction alone; at stall no
    back-EMF is left.
    """
    turn, bridge = counts_per_turn(model), BRIDGES[model.board["bridge"]]
    no_load_rad_s = model.board.get("full_speed", COMMON_BOARD["full_speed"]) * 2.0 * math.pi / 60.0
    nominal_v = LARGE_V if model.battery.full_v > 9.0 else SMALL_V
    no_load_a, stall_a = NO_LOAD_W / nominal_v, STALL_W / nominal_v
    winding_ohm = nominal_v / stall_a
    volts_per_rad_s = (nominal_v - no_load_a * winding_ohm) / no_load_rad_s
    nm_per_a = STALL_NM_RAD_S / no_load_rad_s / (stall_a - no_load_a)
    mass_kg, radius_m = (
        model.body.mass_kg * errors.load / wheel_count(model),
        turn * model.base.metres_per_count / (2.0 * math.pi),
    )
    inertia_kgm2 = ROTOR_KGM2_RAD2_S2 / no_load_rad_s**2 + mass_kg * radius_m**2
    rolling_nm = ROLLING * mass_kg * GRAVITY_M_S2 * radius_m
    per_rad = turn / (2.0 * math.pi)
    friction = (nm_per_a * no_load_a + rolling_nm) / inertia_kgm2 * per_rad
    return DcMotorParams(
        winding_ohm + bridge.resistance_ohm,
        volts_per_rad_s / per_rad,
        nm_per_a / inertia_kgm2 * per_rad,
        friction,
        STICTION * friction,
        bridge.drop_v,
    )


def robot_for(model: RobotModel, errors: Errors, pose: Pose, seed: int) -> RobotPhysics:
    """The body of a robot with H-bridges."""
    motor = motor_params(model, errors)
    params = params_for(model, errors)._replace(control_hz=TICK_HZ, idle_a=IDLE_A, resistance_ohm=BATTERY_OHM)
    return RobotPhysics(params, pose, seed, [DcMotor(motor) for _ in range(max(3, wheel_count(model)))])


class BridgePlant:
    """Bridges, motors and encoders of one robot, and their cables.

    `wiring` is a sum of rows of the wiring table, as in parameter 20; `phase_error` delays the edges of all encoders'
    channel B by a share of a count.

    Attributes:
        outputs: Pins PWM_A, PWM_B and LOGIC of each motor, and an enable, which is that of all (Arduino numbers); -1
            where nothing is connected.
        encoder_pins: Pins of the channels A and B of each encoder.
        inputs: Bumpers, cliff sensors and the emergency stop.
        battery_channel: Channel of the converter with the battery's divider; -1 without one.
    """

    def __init__(
        self, robot: RobotPhysics, model: RobotModel, wiring: int = 1, phase_error: float = 0.0
    ) -> None:
        self.robot = robot
        self.bridge: Bridge = BRIDGES[model.board["bridge"]]
        tied = board_wiring.BRIDGE_WIRES[BRIDGE_NAMES[model.board["bridge"]]].tied
        self._tied = [float(wire in (tied, ENABLE)) for wire in range(ENABLE + 1)]
        table = board_wiring.of_board(model.board)
        self.outputs, self.encoder_pins = board_wiring.output_pins(table), board_wiring.encoder_pins(table)
        self._levels = [[0.0 for _ in pins] for pins in self.outputs]
        battery = table["pin_battery"]
        self.battery_channel = CHIPS[model.chip].pins[battery].channel if battery != NOT_CONNECTED else -1
        self._led = CHIPS[model.chip].led
        self._toggles_s: List[float] = []  # times at which the bootloader will toggle the LED's pin [s]
        self.time_s = 0.0
        self._divider = model.board.get("battery_divider", 0) / 1000.0
        self._set = {name for name, bit in _BITS.items() if wiring & bit}
        self._swapped = {parts: int(f"{parts}_swapped" in self._set) for parts in ("motors", "encoders")}
        self.encoders = tuple(
            Quadrature(
                pins,
                phase_error,
                "single_channel" in self._set or pins[1] == NOT_CONNECTED,
                reversed_=self._is_reversed("encoder", self._wheel("encoders", each)),
            )
            for each, pins in enumerate(self.encoder_pins)
        )
        wheels = [self._wheel("motors", each) for each in range(len(self.outputs))]
        self._driven = [(self.motor(wheel), self._is_reversed("motor", wheel)) for wheel in wheels]
        followed = [self.motor(self._wheel("encoders", each)) for each in range(len(self.encoders))]
        self._followed = list(zip(self.encoders, followed))
        self.inputs = StopInputs(model)
        self.levels: Dict[int, int] = {}  # levels of the board's inputs after the last `advance`
        self._edges: List[PinEdge] = []
        for encoder in self.encoders:
            self.levels.update({wire.pin: wire.level for wire in encoder.wires if wire.pin != NOT_CONNECTED})
        self.levels.update(self.inputs.levels())

    # ---- cables

    def _wheel(self, parts: str, index: int) -> int:
        """Wheel, a place in `WHEELS`, to which the board's motor or encoder of this index is connected."""
        return index ^ self._swapped[parts] if index < board_wiring.FRONT else index

    def _is_reversed(self, part: str, wheel: int) -> bool:
        return f"{WHEELS[wheel]}_{part}_reversed" in self._set

    # ---- the board's outputs

    def write(
        self, time_s: float, motor: int, pwm_a: float, pwm_b: float, logic: float, enable: float = 0.0
    ) -> None:
        """Sets the shares of time, 0 to 1, for which the outputs of a motor are high, until the next call.

        A wire without a pin has the level to which the module ties it.  All motors coast while an enable is low.  A
        board may have more outputs than motors.
        """
        self.advance(time_s)
        if not self.is_booting and motor < len(self.outputs):
            self._drive(motor, (pwm_a, pwm_b, logic, enable))

    def _drive(self, motor: int, high: Sequence[float]) -> None:
        levels = [
            share if pin != NOT_CONNECTED else tied
            for share, pin, tied in zip(high, self.outputs[motor], self._tied)
        ]
        if levels == self._levels[motor]:
            return
        enable_changes, self._levels[motor] = levels[ENABLE] != self._levels[motor][ENABLE], levels
        enabled = all([levels[ENABLE] == 1.0 for levels in self._levels])
        for each in range(len(self._levels)) if enable_changes else (motor,):
            shares = self.bridge.shares(*self._levels[each][:ENABLE]) if enabled else Shares()
            driven, backward = self._driven[each]
            driven.shares = shares.reversed() if backward else shares

    def off(self, time_s: float) -> None:
        """All wires are low: the pins are inputs, and pull-downs hold the bridges."""
        for motor in range(len(self.outputs)):
            self.write(time_s, motor, 0.0, 0.0, 0.0)

    # ---- the bootloader

    def boot(self, time_s: float) -> float:
        """The bootloader starts after a reset by the host; it drives no pin but the LED's.

        Returns the time that it needs [s] if a motor has a wire on that pin, else 0.
        """
        self._toggles_s = []
        self.off(time_s)
        if any(self._led in pins for pins in self.outputs):
            self._toggles_s = [time_s + TOGGLE_S * number for number in range(1, TOGGLES + 1)]
        return len(self._toggles_s) * TOGGLE_S

    @property
    def is_booting(self) -> bool:
        """The bootloader moves a motor's wire, so that the program has not started."""
        return bool(self._toggles_s)

    def _toggle(self) -> None:
        self._run(self._toggles_s.pop(0))
        high = float(len(self._toggles_s) & 1)
        for motor, pins in enumerate(self.outputs):
            self._drive(motor, [high if pin == self._led else 0.0 for pin in pins])

    # ---- time, and the board's inputs

    def advance(self, time_s: float) -> None:
        """Runs the robot to `time_s` [s]."""
        while self._toggles_s and self._toggles_s[0] <= time_s:
            self._toggle()
        if time_s > self.time_s:
            self._run(time_s)

    def _run(self, time_s: float) -> None:
        start_s = self.time_s
        self.robot.step(time_s - start_s)
        self.time_s = time_s
        edges: List[PinEdge] = []
        for encoder, motor in self._followed:
            edges += encoder.follow(start_s, time_s, motor.take_motions())
        switched = self.inputs.levels()
        edges += [PinEdge(time_s, pin, level) for pin, level in switched.items() if self.levels[pin] != level]
        if edges:
            edges.sort()
            self._edges += edges
            self.levels.update([(edge.pin, edge.level) for edge in edges])

    def take_edges(self) -> List[PinEdge]:
        """Edges of the inputs since the last call, in order of time."""
        edges, self._edges = self._edges, []
        return edges

    def encoder(self, wheel: int) -> Quadrature:
        """The encoder of a wheel, a place in `WHEELS`."""
        return self.encoders[self._wheel("encoders", wheel)]

    @property
    def battery_v(self) -> float:
        """Voltage at the bridges [V]."""
        return self.robot.state.battery_v

    def divided_v(self) -> float:
        """Voltage behind the battery's divider [V]; 0 without a divider."""
        return min(5.0, self.battery_v / self._divider) if self._divider else 0.0

    def motor(self, wheel: int) -> DcMotor:
        """The motor that turns a wheel, a place in `WHEELS`."""
        motor: DcMotor = self.robot.motors[MOTORS[wheel]]
        return motor
