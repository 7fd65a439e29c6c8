"""The tutorials: what they mark, what they run.  `make test-tutorials` carries all of them out."""

import pytest

from .blocks import blocks
from .tutorials import carry_out, names

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
