"""A desk and a robot, each in a network of its own with a cable between them; run it with `unshare --net`.

The board is served on the robot's address, by TCP and by UDP, and driven from the desk; then the cable is pulled.
Prints what was seen as JSON, in metres.
"""

import json
import math
import subprocess
import sys
import time
from pathlib import Path

from mrl_driver.driver import Driver, Options
from tests.network import ip, lay_cable
from tests.waiting import drive_until, wait_until

DESK, ROBOT = "10.78.0.1", "10.78.0.2"
CUT_S, WATCH_S = 0.65, 0.2
"""The cut until the robot must stand, by its watchdog and its brakes; how long that is watched."""
AGAIN_M = 0.02  # The robot drives again once it has come so far


def rows(truth):
    """All whole lines of a file of true poses."""
    return [json.loads(line) for line in truth.read_text().splitlines() if line.endswith("}")]


def rolled(truth, cut_s):
    """Way [m] that the robot made once it had to stand, by the times that its board noted."""
    wait_until(lambda: rows(truth)[-1]["host_monotonic"] >= cut_s + CUT_S + WATCH_S)
    late = [row["x"] for row in rows(truth) if row["host_monotonic"] >= cut_s + CUT_S]
    return late[-1] - late[0]


def trial(scheme, robot_net, folder):
    """Drive, pull the cable, plug it in again."""
    truth = folder / f"{scheme}.jsonl"
    command = ["nsenter", f"--net=/proc/{robot_net}/ns/net", sys.executable, "-m", "sim_arduino.serve.main"]
    command += ["--world", "square", "--listen", f"{scheme}://{ROBOT}:7000", "--truth", str(truth)]
    board = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        port = board.stdout.readline().strip()
        with Driver(port, options=Options(reconnect=True, command_timeout_s=None)) as robot:
            drive_until(robot, 0.2, 0.3, lambda: robot.pose.x_m > 0.1)
            robot.stop()
            wait_until(lambda: robot.stopped)
            stood_s = time.monotonic()
            wait_until(lambda: rows(truth)[-1]["host_monotonic"] > stood_s)
            true = rows(truth)[-1]
            error_m = math.hypot(robot.pose.x_m - true["x"], robot.pose.y_m - true["y"])
            robot.drive(0.2, 0.0)
            robot.wait(0.5)
            ip("link", "set", "desk0", "down")
            rolled_m = rolled(truth, time.monotonic())
            ip("link", "set", "desk0", "up")
            stood_m = rows(truth)[-1]["x"]
            wait_until(lambda: robot.drive(0.2, 0.0) and rows(truth)[-1]["x"] > stood_m + AGAIN_M)
            return {"error_m": error_m, "rolled_m": rolled_m, "again_m": rows(truth)[-1]["x"] - stood_m}
    finally:
        board.terminate()
        board.wait()


def main(folder):
    """Both trials; their files go to `folder`."""
    holder = subprocess.Popen(
        ["unshare", "--net", "sh", "-c", "echo $$; exec sleep 1000"], stdout=subprocess.PIPE, text=True
    )
    try:
        robot_net = holder.stdout.readline().strip()
        lay_cable(robot_net, DESK, ROBOT)
        seen = {scheme: trial(scheme, robot_net, folder) for scheme in ("tcp", "udp")}
        sys.stdout.write(json.dumps(seen) + "\n")
    finally:
        holder.kill()
        holder.wait()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
