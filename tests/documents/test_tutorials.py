"""The tutorials: what they mark, what they run.  `make test-tutorials` carries all of them out."""

import pytest

from .blocks import blocks
from .tutorials import FOLDER, RUNS_ON, Failed, carry_out, check_output, names

INDEX = (FOLDER / "README.md").read_text(encoding="utf-8")
SHORT = "8_own_test"
"""The tutorial that is carried out in each test run."""


def steps(name):
    found = blocks(f"docs/tutorials/{name}.md")
    assert found
    return found


def test_there_are_eight_and_the_index_has_them_in_their_order():
    places = [INDEX.index(f"({name}.md)") for name in names()]
    assert len(places) == 8 and places == sorted(places)


@pytest.mark.parametrize("name", names())
def test_hardware_steps_are_marked_as_untested(name):
    """A step with the port of a real board is not run, and its paragraph says so."""
    for block in steps(name):
        if "/dev/tty" in block.text:
            assert block.language == "console" and "untested here" in block.before, block.text


@pytest.mark.parametrize("name", names())
def test_a_tutorial_is_run_and_its_output_looked_at(name):
    languages = [block.language for block in steps(name)]
    assert "sh" in languages and "text" in languages


@pytest.mark.parametrize("name", names())
def test_programs_that_run_on_are_said_to(name):
    """Or else a reader would wait for their end."""
    for block in steps(name):
        runs_on = block.text.startswith(("mrl-sim", "roslaunch", "mrl web"))
        assert block.language != "sh" or runs_on == (RUNS_ON in block.before), block.text


def test_a_short_tutorial_is_carried_out(tmp_path):
    assert carry_out(SHORT, tmp_path) == 1


@pytest.mark.parametrize(
    "output, matches",
    [
        ("a 7.50 m\nend 1", True),
        ("x\na  6.1 m\n\nend 1e0", True),
        ("a 0 m\na 7 m\nend 2\nend 1", True),
        ("a m\nend 1", False),
        ("end 1\na 7 m", False),
        ("a 8.5 m\nend 1", False),
        ("a 7 m\nend 2", False),
    ],
)
def test_lines_are_found_in_their_order_with_numbers_like_these(output, matches):
    if matches:
        check_output("a 7 m\nend 1\n", output)
    else:
        with pytest.raises(Failed):
            check_output("a 7 m\nend 1\n", output)
