"""`make bench-ros`: latencies, CPU and memory of the node beside a bare rospy loop; build/bench/ros.json.

The robot drives with commands at 10 Hz.  Node and bare loop take turns; a figure over that of the bare loop is the
median of `PAIRS` pairs.  FAST=1 is shorter.
"""

import math
import statistics
import time
from typing import Dict, List

from mrl_driver.robot.models import load
from mrl_driver.robot.odometry import Odometry, fastest_wheel_m_s

from . import report
from .ros_bench import BARE, NODE, SETTLED_S, STEPS, Bench, Master

PAIRS = report.either(5, 1)
CPU_S = report.either(20.0, 1.0)
LATENCY_S, ROUNDS = report.either((10.0, 2), (1.0, 1))
LEAST = report.either(0.9, 0.3)  # Share of the frames that must have arrived
RATES_HZ = report.either((2000, 1750, 1500, 1250, 1000, 750, 500), (500,))
RATE_S = report.either(4.0, 0.5)
GROWTH_S = report.either(0.005, 1.0)  # A delay that grows by more than this over a run is growing
ROBOTS, ROBOTS_S = report.either((10, 10.0), (2, 1.0))
IMU = "imu/data"
TEN_NODE = [*NODE, "_robot:=traxbot", "_rate:=20"]
Figures = Dict[str, float]


def p99(values: List[float]) -> float:
    return sorted(values)[math.ceil(0.99 * len(values)) - 1]


def latency(name: str, delays_s: List[float], least: float) -> Figures:
    """Median and p99 of so many delays at least [ms]."""
    assert len(delays_s) > least, f"{name}: {len(delays_s)} delays, expected more than {least:g}"
    return {
        f"{name}_latency_ms_median": 1e3 * statistics.median(delays_s),
        f"{name}_latency_ms_p99": 1e3 * p99(delays_s),
    }


def measured(program: List[str]) -> Figures:
    """CPU [%] and memory [MiB] of a program, its latencies of odometry and commands [ms], and its highest rate."""
    with Bench(program) as bench:
        used = {"cpu_percent_50hz": bench.cpu_percent(CPU_S), "rss_mib": bench.rss_mib()}
        odom = bench.latencies_s(50.0, LATENCY_S)[0]
        command = bench.command_latencies_s(ROUNDS)
        rate = max_rate(bench)
    return {
        **used,
        **latency("odom", odom, LEAST * 50 * LATENCY_S),
        **latency("cmd", command, LEAST * STEPS * ROUNDS),
        "max_frames_hz": rate,
    }


def max_rate(bench: Bench) -> float:
    """The highest rate of frames that is followed: none missing, the delay at the end as at the start."""
    for hz in RATES_HZ:
        delays = bench.latencies_s(hz, RATE_S)[0]
        tenth = max(1, len(delays) // 10)
        growth_s = statistics.median(delays[-tenth:]) - statistics.median(delays[tenth : 2 * tenth])
        if len(delays) > LEAST * hz * RATE_S and growth_s < GROWTH_S:
            return hz
    return 0


def pair() -> Figures:
    """The node, the bare loop, and the node with every topic subscribed and with an IMU at the same rate."""
    node, bare = measured(NODE), measured(BARE)
    with Bench(NODE, full=True) as bench:
        full, rss = bench.cpu_percent(CPU_S), bench.rss_mib()
    with Bench(NODE, imu=IMU) as bench:
        imu = bench.cpu_percent(CPU_S)
        imu_delays = bench.latencies_s(50.0, LATENCY_S)[0]
    over = {key.replace("_ms", "_over_bare_ms"): node[key] - bare[key] for key in node if "latency" in key}
    alone = node["cpu_percent_50hz"]
    return {
        **{f"bare_{key}": value for key, value in bare.items()},
        **{key: value for key, value in node.items() if key != "cpu_percent_50hz"},
        **over,
        **latency("imu_odom", imu_delays, LEAST * 50 * LATENCY_S),
        "node_cpu_percent_50hz": alone,
        "node_full_cpu_percent_50hz": full,
        "node_imu_cpu_percent_50hz": imu,
        "node_over_bare_cpu": alone / bare["cpu_percent_50hz"],
        "node_full_over_bare_cpu": full / bare["cpu_percent_50hz"],
        "imu_cpu_percent_more": imu - alone,
        "rss_mib": rss,
        "rss_over_bare_mib": rss - bare["rss_mib"],
    }


def many_pair() -> Figures:
    """Latency of ten nodes on ten boards at 20 Hz, p99 over all, and of ten bare loops in their place [ms]."""
    found = {}
    for key, program in ("", TEN_NODE), ("bare_", BARE):
        with Bench(program, boards=ROBOTS, hz=20.0) as bench:
            time.sleep(SETTLED_S)
            every = bench.latencies_s(20.0, ROBOTS_S)
        found[f"{key}ten_robots_latency_ms_p99"] = 1e3 * p99([delay for each in every for delay in each])
    ours, bare = found.values()
    return {**found, "ten_robots_over_bare_p99": ours / bare}


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


def figures() -> Dict[str, report.Measured]:
    found: Dict[str, report.Measured] = {
        "motion_to_true_pose_mm": [circle_error_mm(i / 12) for i in range(12)]
    }
    with Master():
        for measure in pair, many_pair:
            found.update(report.by_key(report.repeat(measure.__name__, PAIRS, measure)))
    return found
