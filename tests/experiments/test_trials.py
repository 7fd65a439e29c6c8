"""Figures over many seeds: which seeds, and what is reported of them."""

from sim_arduino.experiments import trials
from sim_arduino.experiments.experiment_report import Figure, cells
from sim_arduino.experiments.experiment_robot import Setting


def test_each_run_has_a_seed_of_its_own():
    """Settings with other seeds share no run."""
    one, two = (trials.over_seeds(lambda each: each.seed, Setting("", seed=seed)) for seed in (1, 2))
    assert len({*one, *two}) == len(one) + len(two) == 2 * trials.SEEDS


def test_figure_is_the_median_with_the_worst_run_and_the_median_of_the_control():
    figure = trials.figure(
        "error_cm", "error", [1.0, 9.0, 2.0], "cm", control=[4.0, 5.0, 6.0], published="3 cm"
    )
    assert trials.figure("found", "", [80.0, 90.0], worst=min).worst == 80.0
    assert figure == Figure("error_cm", "error", 2.0, "cm", "3 cm", worst=9.0, control=5.0, seeds=3)


def test_cells_show_seeds_control_and_what_was_put_in():
    figure = Figure("error", "error", 2.0, "cm", "3 cm", worst=9.0, control=5.0, seeds=10, put_in=True)
    assert cells(figure) == ["error", "2 cm (put in)", "9 cm of 10", "5 cm", "3 cm"]
    assert cells(Figure("mean", "mean of all", 2.0, seeds=100)) == ["mean of all", "2", "", "", ""]
