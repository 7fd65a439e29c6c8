"""Drives that are made up: what a page shows, without a robot and without a recording."""

import math

import numpy as np

from mrl_driver.apps.review.drive_data import Column, DriveData, Frames, Stop
from mrl_driver.apps.review.findings import Finding
from mrl_driver.protocol import encode_reply, encode_request
from mrl_driver.robot import models

COUNTS = encode_reply(8, 2000, 1900, 100, 200, 645)
STOP = encode_request(13)


def column(time_s, *values):
    """A column; one of several values has the shape (N, k)."""
    time_s = np.asarray(time_s, float)
    return Column(time_s, np.asarray(values[0], float) if len(values) == 1 else np.array(values, float).T)


def drive(duration_s=60.0, period_s=0.02, path="drive.mrl", **others):
    """A drive along an arc with changing speed, three sonars, a battery, and a link that loses a frame."""
    n = round(duration_s / period_s)
    t = np.arange(1, n + 1) * period_s
    turns = 2 * math.pi * t / 30.0
    speed, turn = 0.2 + 0.05 * np.sin(turns * 3), 0.3 * np.cos(turns)
    yaw = np.cumsum(turn) * period_s
    x, y = np.cumsum(speed * np.cos(yaw)) * period_s, np.cumsum(speed * np.sin(yaw)) * period_s
    front = np.where(np.sin(turns) > 0.9, math.inf, 1.5 + np.sin(turns))
    asked_s = np.arange(0.1, duration_s, 0.1)
    model = models.load("traxbot")
    scale = model.drive.metres_per_count
    wheel = np.cumsum(speed) * period_s / scale
    battery_s = np.arange(0.5, duration_s, 1.0)
    found = DriveData(
        path,
        "2026-03-01T12:00:00+00:00",
        "/dev/ttyACM0",
        model,
        1,
        None,
        duration_s,
        column(t, x, y, yaw),
        column(t, speed + 0.004 * np.sin(137 * t), turn, np.zeros(n)),
        column(asked_s, np.full(len(asked_s), 0.2), 0.3 * np.cos(2 * math.pi * asked_s / 30), 0 * asked_s),
        column(t, wheel, wheel),
        t,
        {
            "front": column(t, front),
            "left": column(t, 0.8 + 0 * t),
            "right": column(t, 2.0 + 0.1 * np.sin(turns)),
        },
        column(battery_s, 12.0 - 0.01 * battery_s, 25.0 + 0.02 * battery_s),
        column([], *[[]] * 5),
        {},
        [],
        [
            Stop(duration_s / 3, "command_timeout", "stopped: no new command arrived in time", ">", STOP),
            Stop(duration_s / 2, "user", "stopped", ">", STOP),
        ],
        [(duration_s / 4, "<", "check", b"@8,1,2\xffe\r\n")],
        column([duration_s / 4], [1.0]),
        column(t, 0.002 + 0.001 * np.abs(np.sin(99 * t))),
        column(battery_s, 0.008 + 0 * battery_s),
        [(0.0, "/dev/ttyACM0")],
        [],
        [],
        Frames(),
        Frames(),
        0,
        [],
        False,
    )
    return found._replace(**others)


FINDING = Finding(
    "sonar_stuck",
    "The front sonar never changes",
    "It measured 1.00 m in all 3000 readings, while the robot drove 12.3 m.",
    42.0,
    "<",
    COUNTS,
    5.0,
)
