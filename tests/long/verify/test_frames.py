"""Short forms of `make frames`: frames of a few bytes, and some of the functions that share data with interrupts."""

from pathlib import Path

import pytest

from tests.long.verify import frames, interrupts

UNCHECKED = ("-O0",)
DEFECT = next(each for each in interrupts.CONTROLS if each[3] == "encoder_read, left edge")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is built goes here, so that `make frames` may run at the same time."""
    monkeypatch.setattr(frames, "BUILD", tmp_path)
    monkeypatch.setattr(interrupts, "BUILD", tmp_path)


def test_decoder_agrees_with_the_reference_in_all_states_of_short_frames():
    right, output = frames.search(frames.compile_search("frames", flags=UNCHECKED), frames.SHORT)
    assert right, output


@pytest.mark.parametrize("build", ["", "bridge", "environment"])
def test_an_interrupt_amid_a_function_is_one_before_or_after_it(build):
    chip = interrupts.Chip(interrupts.build(build))
    quick = ("serial_overruns", "encoder_read, left", "take_news", "sleep_until, a byte", "dust")
    for check in interrupts.CHECKS.values():
        if check.build == build and check.name.startswith(quick):
            check.run(chip)
    chip.machine.close()


def test_a_function_that_does_not_hold_interrupts_off_is_noticed():
    assert "encoder_read" in interrupts.find(DEFECT)
