"""Options of `mrl-sim` for a robot with an H-bridge."""

import pytest

from mrl_driver.errors import ConfigError
from sim_arduino.serve import factory


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"robot": "traxbot", "wiring": 1}, "robot traxbot, which has an OMNI-3MD; expected .* duo"),
        ({"robot": "duo", "wiring": 256}, "wiring is 256, expected 0 to 255"),
        ({"robot": "duo", "environment": True}, "--environment is given for robot duo"),
        ({"robot": "duo", "omni": True}, "--omni is given for robot duo"),
        ({"robot": "duo", "profile": "2013-august"}, "boards of 2013 have no H-bridge"),
    ],
)
def test_options_that_do_not_fit_are_refused_in_one_line(options, message):
    with pytest.raises(ConfigError, match=message) as error:
        factory.make(factory.Options(**options))
    assert "\n" not in str(error.value)
