"""What a soak has found: faults by kind and row, figures, problems; and how it becomes a report."""

import json
import threading
import time
from collections import Counter
from pathlib import Path
from typing import Any, Dict, List, Mapping, Optional

MOST_PROBLEMS = 200


class Tally:
    """Counts from several threads; each fault and problem is also a line of `log`, if there is one."""

    def __init__(self, log: Optional[Path] = None) -> None:
        self._lock = threading.Lock()
        self._log = log
        self.faults: Counter[str] = Counter()
        self.rows: Counter[int] = Counter()
        self.judged: Counter[str] = Counter()
        self.not_judged: Counter[str] = Counter()
        self.problems: List[Dict[str, Any]] = []
        self.kinds: Counter[str] = Counter()
        self.largest: Dict[str, float] = {}

    def struck(self, name: str, *rows: int) -> None:
        """A fault has struck; it is one of these rows of the faults table."""
        with self._lock:
            self.faults[name] += 1
            self.rows.update(rows)
            self._write({"fault": name, "rows": rows})

    def measured(self, figure: str, value: float) -> None:
        """Keep the largest value of a figure."""
        with self._lock:
            self.largest[figure] = max(value, self.largest.get(figure, value))

    def passed(self, judge: str) -> None:
        """A judge had nothing to say."""
        with self._lock:
            self.judged[judge] += 1

    def busy(self, judge: str, **what: Any) -> None:
        """A judge could not tell, because the computer held up the emulator."""
        with self._lock:
            self.not_judged[judge] += 1
            self._write({"not_judged": judge, **what})

    def problem(self, judge: str, **what: Any) -> None:
        """A judge reports something."""
        with self._lock:
            self.judged[judge] += 1
            self.kinds[judge] += 1
            row = {"problem": judge, "at_s": round(time.monotonic(), 3), **what}
            if len(self.problems) < MOST_PROBLEMS:
                self.problems.append(row)
            self._write(row)

    def growth(
        self, name: str, before: Mapping[str, Any], after: Mapping[str, Any], most: Mapping[str, int]
    ) -> None:
        """Judge what a process holds now, compared with earlier: each key may grow by so much."""
        for key, limit in most.items():
            grown = after[key] - before[key]
            self.measured(f"{key}_growth_{name}", grown)
            if grown <= limit:
                self.passed(f"growth_{key}")
            else:
                self.problem(f"growth_{key}", process=name, before=before[key], after=after[key])

    def add(self, other: "Tally") -> None:
        """Add what another one has found."""
        for name in ("faults", "rows", "judged", "not_judged", "kinds"):
            getattr(self, name).update(getattr(other, name))
        self.problems = (self.problems + other.problems)[:MOST_PROBLEMS]
        for figure, value in other.largest.items():
            self.measured(figure, value)

    def __getstate__(self) -> Dict[str, Any]:
        """To another process, without the lock."""
        return {key: value for key, value in vars(self).items() if key != "_lock"}

    def __setstate__(self, state: Dict[str, Any]) -> None:
        """In the other process."""
        vars(self).update(state, _lock=threading.Lock())

    def _write(self, row: Dict[str, Any]) -> None:
        if self._log:
            with self._log.open("a", encoding="utf-8") as file:
                file.write(json.dumps({"t": round(time.monotonic(), 3), **row}) + "\n")

    def report(self) -> Dict[str, Any]:
        """All of it, for JSON."""
        return {
            "faults": sum(self.faults.values()),
            "faults_by_kind": dict(sorted(self.faults.items())),
            "rows": {str(row): count for row, count in sorted(self.rows.items())},
            "judged": dict(sorted(self.judged.items())),
            "not_judged": dict(sorted(self.not_judged.items())),
            "problems": dict(sorted(self.kinds.items())),
            "first_problems": self.problems[:20],
            "largest": {key: round(value, 4) for key, value in sorted(self.largest.items())},
        }
