"""Runs of an experiment over many seeds, and their median and worst value next to those of a control."""

from statistics import median
from typing import Any, Callable, List, Sequence, TypeVar

from .experiment_report import Figure
from .experiment_robot import Setting

SEEDS = 10
"""Runs of an experiment, each with random numbers of its own."""
_APART = 1000
"""The seeds of two settings differ from each other if theirs do."""
_T = TypeVar("_T")


def over_seeds(run: Callable[[Setting], _T], setting: Setting, count: int = SEEDS) -> List[_T]:
    """The results of `count` runs, or of as many as the setting asks for, each with a seed of its own."""
    numbers = range(setting.seeds or count)
    return [run(setting._replace(seed=_APART * setting.seed + number)) for number in numbers]


def figure(
    key: str,
    text: str,
    values: Sequence[float],
    unit: str = "",
    control: Sequence[float] = (),
    worst: Callable[[Sequence[float]], float] = max,
    **others: Any,
) -> Figure:
    """The figure of many runs: their median and their worst value.

    Args:
        values: One value of each seed.
        control: The values of the runs without the feature under test; empty if there are none.
        worst: Picks the worst value: `max` for errors, `min` for shares found.
        others: More attributes of the figure.
    """
    return Figure(
        key,
        text,
        median(values),
        unit,
        worst=worst(values),
        control=median(control) if control else None,
        seeds=len(values),
        **others,
    )
