"""`make bench-ros`: latencies, CPU and memory of the node beside a bare rospy loop.  Writes build/bench/ros.json.

FAST=1 measures CPU over 10 s instead of 60 s.  Every figure is the median of `RUNS` runs.
"""

import math
import os
import statistics
from typing import Callable, Dict, List

from mrl_driver.robot.models import load
from mrl_driver.robot.odometry import Odometry, fastest_wheel_m_s

from . import report
from .ros_bench import BARE, NODE, Bench, Master

FAST = os.environ.get("FAST") == "1"
RUNS = 5
CPU_S = 10.0 if FAST else 60.0
LATENCY_S = 10.0
RATES_HZ = (2000, 1750, 1500, 1250, 1000, 750, 500)
RATE_S = 4.0
GROWTH_S = 0.005
"""A delay that grows by more than this over a run is growing."""
TEN_S = 10.0
GOALS = {
    "odom_latency_ms_median": 0.50,
    "odom_latency_ms_p99": 0.90,
    "cmd_latency_ms_median": 0.40,
    "cmd_latency_ms_p99": 0.80,
    "node_cpu_percent_50hz": math.inf,
    "node_over_bare_cpu": 1.3,
    "node_full_over_bare_cpu": 3.0,
    "node_imu_cpu_percent_50hz": math.inf,
    "imu_cpu_percent_more": 2.0,
    "imu_odom_latency_ms_median": 0.50,
    "imu_odom_latency_ms_p99": 0.90,
    "max_frames_hz": 1000,
    "rss_mib": 70,
    "ten_robots_latency_ms_p99": 3.0,
    "motion_to_true_pose_mm": 0.15,
}
IMU = "imu/data"
TEN_NODE = [*NODE, "_robot:=traxbot", "_rate:=20"]


def p99(values: List[float]) -> float:
    return sorted(values)[math.ceil(0.99 * len(values)) - 1]


def medians(runs: List[Dict[str, float]]) -> Dict[str, float]:
    return {key: statistics.median(run[key] for run in runs) for key in runs[0]}


def latencies(program: List[str], prefix: str = "") -> Dict[str, float]:
    """Of odometry and commands [ms]."""
    with Bench(program) as bench:
        odom = bench.latencies_s(50.0, LATENCY_S)[0]
        command = bench.command_latencies_s(2)
    assert len(odom) > 0.95 * 50 * LATENCY_S and len(command) > 300, (len(odom), len(command))
    return {
        f"{prefix}odom_latency_ms_median": 1e3 * statistics.median(odom),
        f"{prefix}odom_latency_ms_p99": 1e3 * p99(odom),
        f"{prefix}cmd_latency_ms_median": 1e3 * statistics.median(command),
        f"{prefix}cmd_latency_ms_p99": 1e3 * p99(command),
    }


def imu_latencies() -> Dict[str, float]:
    """Of odometry while an IMU streams beside it at the same rate [ms]."""
    with Bench(NODE, imu=IMU) as bench:
        odom = bench.latencies_s(50.0, LATENCY_S)[0]
    return {
        "imu_odom_latency_ms_median": 1e3 * statistics.median(odom),
        "imu_odom_latency_ms_p99": 1e3 * p99(odom),
    }


def load_run() -> Dict[str, float]:
    """CPU of the node, with an IMU, with every topic subscribed, and of the reference, one after the other."""
    with Bench(NODE) as bench:
        node = bench.cpu_percent(CPU_S)
    with Bench(NODE, imu=IMU) as bench:
        imu = bench.cpu_percent(CPU_S)
    with Bench(BARE) as bench:
        bare = bench.cpu_percent(CPU_S)
    with Bench(NODE, full=True) as bench:
        full = bench.cpu_percent(CPU_S)
        rss = bench.rss_mib()
    return {
        "node_cpu_percent_50hz": node,
        "node_imu_cpu_percent_50hz": imu,
        "imu_cpu_percent_more": imu - node,
        "bare_cpu_percent_50hz": bare,
        "node_over_bare_cpu": node / bare,
        "node_full_over_bare_cpu": full / bare,
        "rss_mib": rss,
    }


def max_rate() -> float:
    """The highest rate of frames that the node follows: none missing, the delay at the end as at the start."""
    with Bench(NODE) as bench:
        for hz in RATES_HZ:
            delays = bench.latencies_s(hz, RATE_S)[0]
            tenth = max(1, len(delays) // 10)
            growth_s = statistics.median(delays[-tenth:]) - statistics.median(delays[tenth : 2 * tenth])
            if len(delays) > 0.9 * hz * RATE_S and growth_s < GROWTH_S:
                return hz
    return 0


def ten_robots() -> Dict[str, float]:
    """Latency of ten nodes on ten boards at 20 Hz, p99 over all [ms], and of ten references in their place."""
    found = {}
    for key, program in ("", TEN_NODE), ("bare_", BARE):
        with Bench(program, boards=10, hz=20.0) as bench:
            every = bench.latencies_s(20.0, TEN_S)
        found[f"{key}ten_robots_latency_ms_p99"] = 1e3 * p99([delay for each in every for delay in each])
    return found


def circle_error_mm(phase: float) -> float:
    """Largest pose error on a circle of 0.3 m radius at 0.3 m/s and 50 Hz, from whole counts."""
    drive = load("traxbot").drive
    odometry = Odometry(drive, fastest_wheel_m_s(0.65, 5.0, drive.wheel_separation_m))
    radius_m, speed_m_s, worst_m = 0.3, 0.3, 0.0
    rates = [speed_m_s * (1 + side * drive.wheel_separation_m / 2 / radius_m) for side in (1, -1)]
    for i in range(math.ceil(50 * 2 * math.pi * radius_m / speed_m_s) + 1):
        time_s = i / 50
        right, left = (math.floor(rate * time_s / drive.metres_per_count + phase) for rate in rates)
        odometry.update((right + 0x8000) % 0x10000 - 0x8000, (left + 0x8000) % 0x10000 - 0x8000, time_s)
        turn = speed_m_s * time_s / radius_m
        x, y = radius_m * math.sin(turn), radius_m * (1 - math.cos(turn))
        worst_m = max(worst_m, math.hypot(odometry.pose.x_m - x, odometry.pose.y_m - y))
    return 1e3 * worst_m


def repeated(name: str, measure: Callable[[], Dict[str, float]], runs: int = RUNS) -> Dict[str, float]:
    return medians(report.repeat(name, runs, measure))


def main() -> None:
    figures = {"motion_to_true_pose_mm": statistics.median(circle_error_mm(i / 12) for i in range(12))}
    with Master():
        figures.update(repeated("latencies of the node", lambda: latencies(NODE)))
        figures.update(repeated("latencies with an IMU", imu_latencies))
        figures.update(repeated("latencies of a bare loop", lambda: latencies(BARE, "bare_")))
        figures.update(repeated("CPU and memory", load_run))
        figures["max_frames_hz"] = report.median_of("highest rate", RUNS, max_rate)
        figures.update(repeated("ten robots", ten_robots))
    print(f"{'figure':32}{'ours':>10}{'bare':>10}  goal")
    for key, goal in GOALS.items():
        bare = figures.get(f"bare_{key.replace('node_', '')}", figures.get(f"bare_{key}"))
        sign = ">=" if key == "max_frames_hz" else "<="
        shown = f"{bare:10.3g}" if bare is not None else f"{'':10}"
        print(f"{key:32}{figures[key]:10.3g}{shown}  {'' if goal == math.inf else f'{sign} {goal:g}'}")
    print(report.write("ros", figures))


if __name__ == "__main__":
    main()
