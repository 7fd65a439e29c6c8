"""`make bench-relay`: delay of a relayed topic, and what a pulled cable does.  Writes build/bench/relay.json.

Two networks with a cable between them, a master and a relay in each; beside each figure, the same without relays, or
without the guard.  FAST=1 measures once.
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile
from typing import Any, Dict, List

from tests.network import own_network

from . import report
from .bench_ros import p99

RUNS = 1 if os.environ.get("FAST") == "1" else 5


def measured(name: str) -> Any:
    """One measurement in networks of its own."""
    with tempfile.TemporaryDirectory() as folder:
        command = [*own_network(), sys.executable, "-m", "tests.bench.relay_measures", folder, name]
        done = subprocess.run(
            command, cwd=str(report.FOLDER.parents[1]), stdout=subprocess.PIPE, text=True, check=True
        )
    return json.loads(done.stdout.splitlines()[-1])


def runs(name: str) -> List[Any]:
    return report.repeat(name, RUNS, lambda: measured(name))


def delay_figures() -> Dict[str, float]:
    """Median and 99th percentile [ms], each the median of the runs; and the share of messages that arrived."""
    found, every = {}, runs("delays")
    for key, name in ("relayed", "relayed"), ("direct", "one_master"):
        ms = [[1e3 * delay for _, delay in run[key]] for run in every]
        found[f"{name}_delay_ms_median"] = statistics.median(map(statistics.median, ms))
        found[f"{name}_delay_ms_p99"] = statistics.median(map(p99, ms))
    counts = [len(run["relayed"]) / len(run["direct"]) for run in every]
    return {**found, "relayed_over_one_master_messages": statistics.median(counts)}


def slow_figures() -> Dict[str, float]:
    """Delay of the messages of the last third, over a slow cable [ms]: largest of all runs."""
    found = {}
    for name, key, figure in ("slow", "relayed", "relayed"), ("one_master", "direct", "one_master"):
        every = [run[key] for run in runs(name)]
        last = [[delay for at, delay in run if at > 2 * run[-1][0] / 3] for run in every]
        found[f"{figure}_slow_delay_ms_median"] = 1e3 * statistics.median(map(statistics.median, last))
        found[f"{figure}_slow_delay_ms_worst"] = 1e3 * max(map(max, last))
        found[f"{figure}_slow_messages_hz"] = statistics.median((len(run) - 1) / run[-1][0] for run in every)
    return found


def cut_figures() -> Dict[str, float]:
    """Times after the cut and after the restore [ms]."""
    found: Dict[str, float] = {}
    for name, keys in ("cut", ("noticed_s", "stop_s", "restored_s")), ("plain_cut", ("stop_s", "again_s")):
        every = runs(name)
        for key in keys:
            figure = f"{name}_{key[:-2]}_ms"
            found[f"{figure}_median"] = 1e3 * statistics.median(run[key] for run in every)
            found[f"{figure}_worst"] = 1e3 * max(run[key] for run in every)
        found[f"{name}_replayed"] = sum(run.get("replayed", False) for run in every)
    for name in "short_cut", "short_cut_any_age":
        found[f"{name}_drove_again"] = sum(run["drove_again"] for run in runs(name))
    return {**found, "runs": RUNS}


def main() -> None:
    figures = {**delay_figures(), **slow_figures(), **cut_figures()}
    for key, value in figures.items():
        print(f"{key:40}{value:10.4g}")
    print(report.write("relay", figures))


if __name__ == "__main__":
    main()
