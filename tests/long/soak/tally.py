"""What a soak has found: faults by kind and row, figures, problems; and how it becomes a report."""

import threading
import time
from collections import Counter
from typing import Any, Dict, List, Mapping

MOST_PROBLEMS = 200
GROWTH = {"memory_kb": 5000, "descriptors": 0, "threads": 0}  # How much more a program may hold in the end


class Tally:
    """Counts from several threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
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

    def measured(self, figure: str, value: float) -> None:
        with self._lock:
            self.largest[figure] = max(value, self.largest.get(figure, value))

    def check(self, judge: str, good: bool, **what: Any) -> None:
        """A judge has nothing to say, or reports something."""
        if not good:
            self.problem(judge, **what)
            return
        with self._lock:
            self.judged[judge] += 1

    def busy(self, judge: str) -> None:
        """A judge could not tell, because the computer held up the emulator."""
        with self._lock:
            self.not_judged[judge] += 1

    def problem(self, judge: str, **what: Any) -> None:
        with self._lock:
            self.judged[judge] += 1
            self.kinds[judge] += 1
            row = {"problem": judge, "at_s": round(time.monotonic(), 3), **what}
            if len(self.problems) < MOST_PROBLEMS:
                self.problems.append(row)

    def growth(
        self, name: str, before: Mapping[str, Any], after: Mapping[str, Any], most: Mapping[str, int]
    ) -> None:
        """Judge what a process holds now, compared with earlier: each key may grow by so much."""
        for key, limit in most.items():
            grown = after[key] - before[key]
            self.measured(f"{key}_growth_{name}", grown)
            self.check(f"growth_{key}", grown <= limit, process=name, before=before[key], after=after[key])

    def add(self, other: "Tally") -> None:
        for name in ("faults", "rows", "judged", "not_judged", "kinds"):
            getattr(self, name).update(getattr(other, name))
        self.problems = (self.problems + other.problems)[:MOST_PROBLEMS]
        for figure, value in other.largest.items():
            self.measured(figure, value)

    def __getstate__(self) -> Dict[str, Any]:
        """To another process, without the lock."""
        return {key: value for key, value in vars(self).items() if key != "_lock"}

    def __setstate__(self, state: Dict[str, Any]) -> None:
        vars(self).update(state, _lock=threading.Lock())

    def report(self) -> Dict[str, Any]:
        """All of it, for JSON."""
        counts = {name: getattr(self, name) for name in ("rows", "judged", "not_judged", "largest")}
        return {
            **{name: dict(sorted(found.items())) for name, found in counts.items()},
            "faults": sum(self.faults.values()),
            "faults_by_kind": dict(sorted(self.faults.items())),
            "problems": dict(sorted(self.kinds.items())),
            "first_problems": self.problems[:20],
        }
