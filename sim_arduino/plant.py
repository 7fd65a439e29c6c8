"""What is wired to a board: motor board, sonars, environment sensors, pins.  Every engine runs on one of these."""

import math
from typing import Any, Dict, Optional, Tuple

from mrl_driver.robots import RobotModel

from .omni3md import ADDRESS, Omni3MD
from .physics import Robot, params_for
from .sensors import COMPASS_ADDRESS, THERMOPILE_ADDRESS, Compass, Environment, Thermopile
from .sonars import VOLTS_PER_COUNT, SonarChain
from .world import Pose, World, load

SONAR_TRIGGER, SONAR_POWER = 12, 13
TRACK_SLIP = 0.1
"""Share of the yaw that a TraxBot's tracks lose in a turn when slip is on; wheels lose none."""


class Plant:
    """One robot in a world.  Times are seconds since the plant's start and never run backwards.

    Attributes:
        motor_board: The OMNI-3MD, as methods and as I2C slave.
        i2c: All I2C slaves by 7-bit address.
        environment: What the environment sensors sense; may be changed at any time.
        sonars_fitted: False for the environment-sensor build, whose A0 and A2 carry other sensors.
    """

    def __init__(
        self,
        model: RobotModel,
        world: Optional[World] = None,
        pose: Optional[Tuple[float, ...]] = None,
        slip: bool = False,
        battery_v: Optional[float] = None,
        sonars: bool = True,
        left_scale: float = 1.0,
        right_scale: float = 1.0,
        axle_scale: float = 1.0,
    ) -> None:
        self.model = model
        self.world = load() if world is None else world
        turn_slip = TRACK_SLIP if slip and model.body.tracks else 0.0
        start = self.world.start if pose is None else Pose(*pose)
        self.robot = Robot(params_for(model, turn_slip, left_scale, right_scale, axle_scale), start)
        if battery_v is not None:
            self.robot.set_battery(battery_v)
        self.motor_board = Omni3MD(self.robot, model)
        self.environment = Environment()
        self.sonars_fitted = sonars
        self.sonars = SonarChain(model.sonars if sonars else {}, self.world, self._pose_at)
        self.i2c: Dict[int, Any] = {
            ADDRESS: self.motor_board,
            THERMOPILE_ADDRESS: Thermopile(self.environment),
            COMPASS_ADDRESS: Compass(lambda time_s: self._pose_at(time_s).yaw_rad),
        }

    def advance(self, time_s: float) -> None:
        """Carries everything to `time_s` [s]."""
        while self.sonars.next_s <= time_s:
            self.sonars.advance(self.sonars.next_s)
        self.motor_board.advance(time_s)

    @property
    def true_pose(self) -> Pose:
        """Where the robot is at the time of the last `advance`: metres, and radians in -pi..pi."""
        state = self.robot.state
        return Pose(state.x_m, state.y_m, math.remainder(state.yaw_rad, math.tau))

    def adc_volts(self, channel: int, time_s: float) -> float:
        """Voltage at A0 to A3 [V]: sonars in firing order, or alcohol on A0 and light on A2."""
        self.advance(time_s)
        if self.sonars_fitted:
            return self.sonars.volts(channel, time_s)
        counts = {0: self.environment.alcohol_count, 2: self.environment.light_count}
        return (counts.get(channel, 0) + 0.5) * VOLTS_PER_COUNT

    def pin_changed(self, pin: int, level: int, time_s: float) -> None:
        """The board drives a pin (Arduino number)."""
        self.advance(time_s)
        if pin == SONAR_POWER:
            self.sonars.power(bool(level), time_s)
        elif pin == SONAR_TRIGGER and level:
            self.sonars.trigger(time_s)

    def _pose_at(self, time_s: float) -> Pose:
        self.motor_board.advance(time_s)
        state = self.robot.state
        return Pose(state.x_m, state.y_m, state.yaw_rad)
