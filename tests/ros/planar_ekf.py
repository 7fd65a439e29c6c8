"""The planar part of robot_localization's ekf_localization_node, after its documentation and its paper.

Moore, Stouch: A Generalized Extended Kalman Filter Implementation for the Robot Operating System, 2014.
"""

import math

import numpy as np

X, Y, YAW, VX, VY, VYAW, AX, AY = range(8)
SPEEDS = (VX, VY, VYAW)
IN_3D = (0, 1, 5, 6, 7, 11, 12, 13)  # Places of these states among the filter's fifteen


class PlanarEkf:
    """The filter, fed with twists; `noise`: process noise of the eight states, variances per second; `dynamic`: that of
    the pose counts times the square of the speed.
    """

    def __init__(self, noise, dynamic):
        self.state, self._spread = np.zeros(8), np.eye(8) * 1e-9
        self._noise, self._dynamic = np.asarray(noise), dynamic

    @property
    def spread(self):
        """Covariance of the pose: xx, xy, x-yaw, yy, y-yaw, yaw-yaw."""
        return tuple(self._spread[at] for at in ((X, X), (X, Y), (X, YAW), (Y, Y), (Y, YAW), (YAW, YAW)))

    def update(self, dt_s, twist, variances):
        """Predict over `dt_s`, and correct by forward speed, speed to the left and yaw rate."""
        self._predict(dt_s)
        gain = self._spread[:, SPEEDS] @ np.linalg.inv(
            self._spread[np.ix_(SPEEDS, SPEEDS)] + np.diag(variances)
        )
        self.state = self.state + gain @ (np.asarray(twist) - self.state[list(SPEEDS)])
        left = np.eye(8)
        left[:, SPEEDS] -= gain
        self._spread = left @ self._spread @ left.T + gain @ np.diag(variances) @ gain.T

    def _predict(self, dt_s):
        cos, sin = math.cos(self.state[YAW]), math.sin(self.state[YAW])
        to = np.eye(8)
        for row, along, aside in ((X, cos, -sin), (Y, sin, cos)):
            to[row, [VX, VY]] = along * dt_s, aside * dt_s
            to[row, [AX, AY]] = along * dt_s**2 / 2, aside * dt_s**2 / 2
        to[YAW, VYAW] = to[VX, AX] = to[VY, AY] = dt_s
        vx, vy, vyaw = self.state[list(SPEEDS)]
        jacobian = to.copy()
        jacobian[[X, Y], YAW] = -(sin * vx + cos * vy) * dt_s, (cos * vx - sin * vy) * dt_s
        noise = self._noise.copy()
        if self._dynamic:
            noise[[X, Y, YAW]] *= vx * vx + vy * vy + vyaw * vyaw
        self.state = to @ self.state
        self._spread = jacobian @ self._spread @ jacobian.T + dt_s * np.diag(noise)
