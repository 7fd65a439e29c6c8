"""`make bench-relay`: delay of a relayed topic, and what a pulled cable does.  Writes build/bench/relay.json.

Two networks with a cable between them, a master and a relay in each; beside each figure, the same without relays, or
without the guard.  FAST=1 is shorter.
"""

import json
import statistics
import subprocess
import sys
import tempfile
from typing import Any, Dict, List

from tests.network import own_network

from . import report
from .bench_ros import p99
from .figures import ROOT

RUNS = report.either(5, 1)


def measured(name: str) -> Any:
    with tempfile.TemporaryDirectory() as folder:
        command = [*own_network(), sys.executable, "-m", "tests.long.bench.relay_measures", folder, name]
        done = subprocess.run(command, cwd=str(ROOT), stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def runs(name: str) -> List[Any]:
    return report.repeat(name, RUNS, lambda: measured(name))


def delay_figures() -> Dict[str, report.Measured]:
    """Median and 99th percentile of each run [ms], and the share of messages that arrived."""
    found: Dict[str, report.Measured] = {}
    every = runs("delays")
    for key, name in ("relayed", "relayed"), ("direct", "one_master"):
        ms = [[1e3 * delay for _, delay in run[key]] for run in every]
        found[f"{name}_delay_ms_median"] = [statistics.median(run) for run in ms]
        found[f"{name}_delay_ms_p99"] = [p99(run) for run in ms]
    found["relayed_over_one_master_messages"] = [len(run["relayed"]) / len(run["direct"]) for run in every]
    return found


def cut_figures() -> Dict[str, report.Measured]:
    """Times after the cut and after the restore [ms]."""
    found: Dict[str, report.Measured] = {}
    for name, keys in ("cut", ("noticed_s", "stop_s", "restored_s")), ("plain_cut", ("stop_s", "again_s")):
        every = runs(name)
        for key in keys:
            ms = [1e3 * run[key] for run in every]
            found[f"{name}_{key[:-2]}_ms_median"] = ms
            found[f"{name}_{key[:-2]}_ms_worst"] = max(ms)
        found[f"{name}_replayed"] = sum(run.get("replayed", False) for run in every)
    return found


def figures() -> Dict[str, report.Measured]:
    return {**delay_figures(), **cut_figures()}
