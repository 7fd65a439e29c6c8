"""The hardware wired to a board: motor board, sonars, environment sensors, pins.  Every engine uses a `Plant`."""

import dataclasses
from typing import Any, Callable, Dict, List, Mapping, NamedTuple, Optional, Tuple

from mrl_driver.errors import SimulatorError
from mrl_driver.geometry import Pose, wrap_angle
from mrl_driver.protocol.table import NOT_CONNECTED
from mrl_driver.robot.chips import CHIPS
from mrl_driver.robot.models import ECHO_INPUTS, RobotModel, SonarMount, load_packaged
from mrl_driver.robot.wiring import RANGE_PINS, SERVOS, of_board
from sim_arduino.world.scene import OTHERS, Environment
from sim_arduino.world.world import World
from sim_arduino.world.world_file import load

from . import environment_sensors as sensors
from .analog_ranges import AnalogRange
from .bridge_plant import BridgePlant, has_bridge, robot_for
from .collision import Bumper, footprint_for, touched
from .echo_ranges import EchoRanges, Wires
from .imu import FLAWLESS_IMU, LONGEST_STEP_S, ImuErrors, InertialSensor, Mpu6050
from .omni3md import ADDRESS, Omni3MD
from .robot_physics import AS_MODELLED, Errors, RobotPhysics, params_for
from .servo import Servo
from .sonars import FLAWLESS, VOLTS_PER_COUNT, SonarChain, SonarErrors
from .xbee import RadioFit, XBee

FAN, DUST, SONAR_TRIGGER, SONAR_POWER, HEATER = 7, 8, 12, 13, 15  # pins of the board (Arduino numbers)
IMU_ADDRESS, IMU_BESIDE_THERMOPILE = 0x68, 0x69
"""Address of the IMU; the environment-sensor build has its thermopile at the first, so that the IMU's AD0 is high."""
STANDING = "traxbot"  # model of the body under a board without motors: it stands still
TRACK_SLIP = 0.1  # share of the yaw that a TraxBot's tracks lose in a turn if slip is on; wheels lose nothing


class SonarPins(NamedTuple):
    """Channels of the converter with the outputs of front, left and right, and pins of trigger and power; -1: none."""

    channels: Tuple[int, ...] = (0, 1, 2)
    trigger: int = SONAR_TRIGGER
    power: int = SONAR_POWER


def sonar_pins_of(model: RobotModel, board: Optional[Mapping[str, int]] = None) -> SonarPins:
    """The pins of the sonars of a robot, or of a board with these parameters; H-bridge boards have them in a table."""
    if not has_bridge(model):
        return SonarPins()
    pins = of_board(model.board if board is None else board)
    outputs = [pins[f"pin_sonar_{name}"] for name in ("front", "left", "right")]
    channels = tuple(CHIPS[model.chip].pins[pin].channel if pin != NOT_CONNECTED else -1 for pin in outputs)
    return SonarPins(channels, pins["pin_sonar_trigger"], pins["pin_sonar_power"])


def chain_of(model: RobotModel) -> Dict[str, SonarMount]:
    """The MB1300 sonars of a robot, by input."""
    mounts = {mount.input_of(each): mount for each, mount in model.sonars.items()}
    return {each: mount for each, mount in mounts.items() if each not in ECHO_INPUTS}


def range_wires_of(model: RobotModel) -> Dict[str, Wires]:
    """Pins of the HC-SR04 of a robot, by input."""
    pins = of_board(model.board)
    found = (Wires(pins[trigger], pins[echo]) for trigger, echo in RANGE_PINS)
    return {name: wires for name, wires in zip(ECHO_INPUTS, found) if wires.trigger != NOT_CONNECTED}


def analog_ranges_of(model: RobotModel, board: Optional[Mapping[str, int]] = None) -> Dict[int, str]:
    """Inputs of the analog range sensors of a robot, or of a board with these parameters, by their channels."""
    pins, chip = of_board(model.board if board is None else board), CHIPS[model.chip]
    found = ((name, pins[trigger], pins[echo]) for name, (trigger, echo) in zip(ECHO_INPUTS, RANGE_PINS))
    return {
        chip.pins[echo].channel: name for name, trigger, echo in found if trigger == NOT_CONNECTED != echo
    }


class Plant:
    """One robot in a world; without motors it stands still.

    Times are seconds since the plant's start; they never decrease.  `seed` draws all noise, and the errors of the
    environment sensors.

    Args:
        pose: Start pose, x y [m] and yaw [rad]; the world's start pose if absent.
        slip: Tracks lose a share of each turn.
        sonars: False for the environment-sensor build, which has other sensors on A0 and A2.
        footprint: Outline used for collisions, see `collision.footprint_for`.
        omni: The robot has three omni wheels instead of two wheels.
        wiring: How motors and encoders of a robot with H-bridges are connected, see `BridgePlant`.
        imu: An IMU is fitted where the model says.

    Attributes:
        bridge: Motors and encoders on the board's pins, if the model has a bridge; None with an OMNI-3MD.
        servos: Servos by their numbers; `servo_pins` has them by their pins.
        range_volts: Output voltage [V] of each analog range sensor at a time [s], by its input.
        i2c: All I2C slaves by 7-bit address.
        environment: Values that the sensors measure far from all sources; may be changed at any time.
    """

    bridge: Optional[BridgePlant] = None
    _omni3md: Optional[Omni3MD] = None
    _shown: Optional[Pose] = None

    def __init__(
        self,
        model: RobotModel,
        world: Optional[World] = None,
        pose: Optional[Tuple[float, ...]] = None,
        slip: bool = False,
        battery_v: Optional[float] = None,
        sonars: bool = True,
        errors: Errors = AS_MODELLED,
        sonar_errors: SonarErrors = FLAWLESS,
        seed: int = 0,
        footprint: str = "box",
        omni: bool = False,
        name: str = "robot",
        wiring: int = 1,
        imu: bool = False,
        imu_errors: ImuErrors = FLAWLESS_IMU,
        environment_errors: sensors.EnvironmentErrors = sensors.PERFECT,
        radio: Optional[RadioFit] = None,
    ) -> None:
        self.model, self.name = model, name
        self.world = load() if world is None else world
        if slip and model.body.tracks and not errors.turn_slip:
            errors = errors._replace(turn_slip=TRACK_SLIP)
        start = self.world.start_of(name) if pose is None else Pose(*pose)
        self.robot = self._with_motors(errors, start, omni, wiring, seed)
        if battery_v is not None:
            self.robot.set_battery(battery_v)
        self.footprint = footprint_for(model, footprint)
        if self.footprint:
            self.robot.allow = Bumper(self.world, self.footprint, name).share
        if self.footprint and self.bridge:
            body = self.footprint
            self.bridge.inputs.touched = lambda: touched(self.world, body, name, self._pose())
        self.environment = dataclasses.replace(self.world.scene.ambient)
        self._spoilt, self.sonars_fitted = sensors.SpoiltReadings(environment_errors, seed), sonars
        mounts = {mount.input_of(each): mount for each, mount in model.sonars.items()} if sonars else {}
        wires = range_wires_of(model)
        shared = self.world, self._pose_at, name, sonar_errors, seed
        self.sonars = SonarChain(chain_of(model) if sonars else {}, *shared)
        self.ranges = EchoRanges(wires, mounts, *shared)
        self._analog_ranges = analog_ranges_of(model)
        self.range_volts: Dict[str, Callable[[float], float]] = {
            each: AnalogRange(each, mounts.get(each), *shared, self.ranges.failed).volts
            for each in self._analog_ranges.values()
        }
        self.sonar_pins = sonar_pins_of(model)
        if self.sonar_pins.power == NOT_CONNECTED:
            self.sonars.power(True, 0.0)
        if self.sonar_pins.trigger == NOT_CONNECTED:
            self.sonars.hold(True, 0.0)
        table = of_board(model.board)
        pins = {number: table[name] for number, name in enumerate(SERVOS, 1) if table[name] != NOT_CONNECTED}
        self.servos = {number: Servo() for number in pins}
        self.servo_pins = {pin: self.servos[number] for number, pin in pins.items()}
        self.imu = self._imu(imu_errors, seed) if imu else None
        self.xbee = XBee(self.world.radio, name, radio, lambda: self._pose()[:2], seed) if radio else None
        self.i2c = self._slaves()
        self._dust = sensors.DustPulses(lambda time_s: self._sensed_now().dust_pcs_l)
        self._show()

    def _with_motors(self, errors: Errors, start: Pose, omni: bool, wiring: int, seed: int) -> RobotPhysics:
        """The body; notes what controls its motors."""
        if has_bridge(self.model):
            robot = robot_for(self.model, errors, start, seed)
            self.bridge = BridgePlant(robot, self.model, wiring, errors.encoder_phase)
        else:
            body = self.model if self.model.drives else load_packaged(STANDING)
            robot = RobotPhysics(params_for(body, errors, omni), start, seed)
            self._omni3md = Omni3MD(robot, body)
            self._omni3md.present = self.model.drives
        return robot

    @property
    def motor_board(self) -> Omni3MD:
        """The program of the OMNI-3MD; SimulatorError if the robot has H-bridges instead."""
        if self._omni3md is None:
            raise SimulatorError(
                f"robot {self.model.name} has H-bridges, expected an OMNI-3MD; use plant.bridge"
            )
        return self._omni3md

    def _move(self, time_s: float) -> None:
        """Runs the motors, and the body with them."""
        if self.bridge:
            self.bridge.advance(time_s)
        else:
            self.motor_board.advance(time_s)

    def _imu(self, errors: ImuErrors, seed: int) -> Mpu6050:
        imu = Mpu6050(InertialSensor(self.model.imu, errors, seed), self._move, seed=seed)
        self.robot.report_motion(imu.moved, LONGEST_STEP_S)
        return imu

    def _slaves(self) -> Dict[int, Any]:
        north_rad = self.world.scene.north_rad
        motors = {} if self.bridge else {ADDRESS: self.motor_board}
        at = IMU_ADDRESS if self.sonars_fitted else IMU_BESIDE_THERMOPILE
        return {
            **motors,
            sensors.THERMOPILE_ADDRESS: sensors.thermopile(self.sensed),
            sensors.COMPASS_ADDRESS: sensors.compass(lambda time_s: self._pose_at(time_s).yaw_rad, north_rad),
            **{row.i2c.address: sensors.plain_sensor(row, row.i2c, self.sensed) for row in OTHERS if row.i2c},
            **({at: self.imu} if self.imu else {}),
        }

    def advance(self, time_s: float) -> None:
        """Runs all parts to `time_s` [s]."""
        while self.sonars.next_s <= time_s:
            self.sonars.advance(self.sonars.next_s)
        self._move(time_s)
        if self.xbee:
            self.xbee.now_s = max(self.xbee.now_s, time_s)
        self._show()

    def _show(self) -> None:
        """Publishes the pose to the other robots of the world."""
        pose = self._pose()
        if self.footprint and pose != self._shown:
            self._shown = pose
            self.world.place(self.name, pose, self.footprint)

    def _pose(self) -> Pose:
        state = self.robot.state
        return Pose(state.x_m, state.y_m, state.yaw_rad)

    @property
    def true_pose(self) -> Pose:
        """True pose at the time of the last `advance`: metres, and radians in (-pi, pi]."""
        state = self.robot.state
        return Pose(state.x_m, state.y_m, wrap_angle(state.yaw_rad))

    def sensed(self, time_s: float) -> Environment:
        """Values that the environment sensors measure at the robot's pose."""
        self._pose_at(time_s)
        return self._sensed_now()

    def _sensed_now(self) -> Environment:
        return self._spoilt.reading(self.world.scene.sensed(self.environment, self._pose(), self.world.sees))

    def dust_edges(self, to_s: float) -> List[Tuple[float, int]]:
        """Edges at D8 of the dust pulses that begin until `to_s`: times [s] and levels."""
        return [] if self.sonars_fitted else self._dust.edges(to_s)

    def adc_volts(self, channel: int, time_s: float) -> float:
        """Voltage of an analog input [V]: a sonar's, alcohol on A0 and light on A2, or a battery's divider."""
        self.advance(time_s)
        if self.bridge and channel == self.bridge.battery_channel:
            return self.bridge.divided_v()
        if channel in self._analog_ranges:
            return self.range_volts[self._analog_ranges[channel]](time_s)
        if self.sonars_fitted:
            channels = self.sonar_pins.channels
            return self.sonars.volts(
                channels.index(channel) if channel in channels else len(channels), time_s
            )
        sensed = self.sensed(time_s)
        counts = {0: sensed.alcohol_count, 2: sensed.light_count}
        return (counts.get(channel, 0) + 0.5) * VOLTS_PER_COUNT

    def pin_changed(self, pin: int, level: int, time_s: float) -> None:
        """The board drives a pin (Arduino number)."""
        if pin in self.servo_pins:
            self.servo_pins[pin].changed(level, time_s)
            return
        self.advance(time_s)
        if pin == self.sonar_pins.power:
            self.sonars.power(bool(level), time_s)
        elif pin == self.sonar_pins.trigger:
            self.sonars.hold(bool(level), time_s)
        else:
            self.ranges.pin_changed(pin, level, time_s)

    def _pose_at(self, time_s: float) -> Pose:
        self._move(time_s)
        return self._pose()
