"""Runs with drawn errors: each condition has as many as seeds, and those that are done are kept.  No ROS."""

import json
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Dict, Iterable, List, NamedTuple, Sequence

from mrl_driver.errors import MrlError

from .stack import ROOT, require_packages


class Runs(NamedTuple):
    """Results of a module's conditions, in a file each; `python -m MODULE KEY` runs those that a condition lacks."""

    folder: Path
    module: str
    count: int  # of each condition

    def done(self, key: str) -> List[Any]:
        """Results so far, in the order of the seeds."""
        path = self.folder / f"{key}.json"
        return json.loads(path.read_text()) if path.exists() else []

    def add(self, key: str, result: Any) -> None:
        """Keep the result of the next seed."""
        self.folder.mkdir(parents=True, exist_ok=True)
        (self.folder / f"{key}.json").write_text(json.dumps([*self.done(key), result]) + "\n")

    def missing(self, key: str) -> Iterable[int]:
        """Seeds that have no result."""
        return range(len(self.done(key)), self.count)

    def all(self, keys: Sequence[str], needed: Sequence[str], workers: int) -> Dict[str, List[Any]]:
        """The results of all conditions; runs what is missing, in `workers` processes at a time.

        Raises:
            ConfigError: one of the packages `needed` is missing.
            MrlError: a run has failed.
        """
        require_packages(needed)
        with ThreadPoolExecutor(workers) as pool:
            list(pool.map(self._run, keys))
        lacking = [key for key in keys if self.missing(key)]
        if lacking:
            raise MrlError(
                f"{', '.join(lacking)}: runs are missing, see the logs in {self.folder}; run it again"
            )
        return {key: self.done(key) for key in keys}

    def _run(self, key: str) -> None:
        """In a process of its own, because it is a ROS node; one that fails leaves results missing."""
        if self.missing(key):
            subprocess.run([sys.executable, "-m", self.module, key], cwd=str(ROOT), check=False)
