"""The tutorials: what they mark, what they run.  `make test-tutorials` carries all of them out."""

import pytest

from .blocks import blocks
from .tutorials import Failed, carry_out, check_output, names

SHORT = "8_own_test"  # The tutorial that is carried out in each test run


def steps(name):
    found = blocks(f"docs/tutorials/{name}.md")
    assert found
    return found


@pytest.mark.parametrize("name", names())
def test_hardware_steps_are_marked_as_untested(name):
    """A step with the port of a real board is not run, and its paragraph says so."""
    for block in steps(name):
        if "/dev/tty" in block.text:
            assert block.language == "console" and "untested here" in block.before, block.text


def test_a_short_tutorial_is_carried_out(tmp_path):
    assert carry_out(SHORT, tmp_path) == 1


@pytest.mark.parametrize(
    "said, got",
    [
        ("x 0.33 m", "x   0.36 m  y  0.000 m"),
        ("wheel_offset: 0.02", "wheel_offset: 0.0298"),
        ("yaw 0.0 deg", "yaw   -0.09 deg"),
        ("robot id 1", "robot  traxbot\nrobot id       1"),
    ],
)
def test_a_number_of_a_page_may_be_a_little_off(said, got):
    check_output(said, got)


@pytest.mark.parametrize(
    "said, got",
    [
        ("x 0.39 m", "x   0.33 m"),
        ("wheel_offset: 0.02", "wheel_offset: 0.0345"),
        ("yaw 0.0 deg", "yaw   0.11 deg"),
        ("robot id 1", "robot id  2"),
        ("2 cells", "no cells"),
    ],
)
def test_a_number_that_the_run_does_not_give_fails_the_tutorial(said, got):
    with pytest.raises(Failed):
        check_output(said, got)
