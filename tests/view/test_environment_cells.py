"""The cells of a map of alcohol, dust and heat."""

import math

import pytest

from mrl_driver.view.environment_cells import ALCOHOL, DUST, HEAT, LATEST, MOST_CELLS, VARIABLES, Cells


@pytest.mark.parametrize("shown, value", [("highest", 9.0), (LATEST, 7.0)])
def test_a_cell_shows_the_highest_reading_or_the_latest(shown, value):
    cells = Cells(0.5, shown)
    for reading in (5.0, 9.0, 7.0):
        cells.put(-0.1, 0.1, reading)
    assert cells.values == {(-1, 0): value} and cells.peak == (-0.25, 0.25)


def test_heat_is_the_mean_of_the_pixels():
    """One that is hot says nothing of the distance; a lamp fills more of them the closer it is."""
    assert HEAT.value([22.0] * 6 + [62.0] * 2) == 32.0


@pytest.mark.parametrize("fields", [(), (math.nan, 40.0), (math.inf, 40.0), (22.0,) * 7 + (255.0,)])
def test_a_reading_that_no_sensor_makes_is_refused(fields):
    with pytest.raises(ValueError, match="connect or calibrate the sensor thermopile"):
        HEAT.value(fields)


def test_a_map_has_no_cells_without_end():
    cells = Cells()
    for number in range(MOST_CELLS):
        cells.put(number * 0.2 + 0.1, 0.0, 1.0)
    cells.put(0.1, 0.0, 2.0)
    with pytest.raises(ValueError, match="the map has 10000 cells"):
        cells.put(-1.0, 0.0, 1.0)
    assert len(cells.values) == MOST_CELLS and cells.values[0, 0] == 2.0


def test_colours_and_places_of_the_variables_differ():
    assert len({each.colour for each in VARIABLES}) == len({each.third for each in VARIABLES}) == 3
    assert (HEAT.alert, DUST.alert) == (39.0, 5500.0) and ALCOHOL.notice < ALCOHOL.alert
