"""Runs of an experiment over many seeds, and their median and worst value next to those of a control."""

from statistics import median
from typing import Any, Callable, List, NamedTuple, Optional, Sequence, TypeVar

from .experiment_report import Figure
from .experiment_robot import Setting

SEEDS = 10  # runs of an experiment, each with random numbers of its own
_APART = 1000  # the seeds of two settings differ from each other if theirs do
_T = TypeVar("_T")


def over_seeds(run: Callable[[Setting], _T], setting: Setting, count: int = 0) -> List[_T]:
    """The results of `count` or `SEEDS` runs, or of as many as the setting asks for, each with a seed of its own."""
    numbers = range(setting.seeds or count or SEEDS)
    return [run(setting._replace(seed=_APART * setting.seed + number)) for number in numbers]


class Measure(NamedTuple):
    """A figure of many runs.

    Attributes:
        of: Computes its value of a run; by default it is the attribute `key` of the run.
        worst: Picks the worst value: `max` for errors, `min` for shares found.
        published, put_in: As in `Figure`.
    """

    key: str
    text: str
    unit: str = ""
    of: Optional[Callable[[Any], float]] = None
    worst: Callable[[Sequence[float]], float] = max
    published: str = ""
    put_in: bool = False

    def figure(self, runs: Sequence[Any], control: Sequence[Any] = ()) -> Figure:
        """Median and worst value of runs; `control` are the runs without the feature under test, if there are any."""
        values, others = ([self._value(run) for run in each] for each in (runs, control))
        beside = median(others) if others else None
        worst, middle = self.worst(values), median(values)
        return Figure(
            self.key, self.text, middle, self.unit, self.published, worst, beside, len(values), self.put_in
        )

    def _value(self, run: Any) -> Any:
        return self.of(run) if self.of else getattr(run, self.key)


def figures(measures: Sequence[Measure], runs: Sequence[Any], control: Sequence[Any] = ()) -> List[Figure]:
    """The figures of runs, one for each measure."""
    return [each.figure(runs, control) for each in measures]
