"""The generated files: current, and complete."""

import re

import pytest

from mrl_driver import generate
from mrl_driver.table import COMMANDS, FAULTS, PARAMETERS, REASONS


def test_committed_files_are_current():
    assert generate.stale() == []


def test_check_names_what_is_stale(monkeypatch, capsys):
    monkeypatch.setattr(generate, "FILES", {"firmware/mrl_firmware/protocol.h": lambda: "other"})
    assert generate.main(["--check"]) == 1
    error = "firmware/mrl_firmware/protocol.h is stale: run `python -m mrl_driver.generate`\n"
    assert capsys.readouterr().err == error


def test_check_is_silent_when_all_is_current(capsys):
    assert generate.main(["--check"]) == 0 and capsys.readouterr().err == ""


def test_stale_file_is_written(monkeypatch, tmp_path):
    monkeypatch.setattr(generate, "ROOT", tmp_path)
    monkeypatch.setattr(generate, "FILES", {"one": lambda: "text"})
    assert generate.main([]) == 0 and (tmp_path / "one").read_text() == "text"


@pytest.mark.parametrize(
    "row", [row for row in COMMANDS if row.name != "xbee_text"], ids=lambda row: row.name
)
def test_each_request_has_a_handler_prototype(row):
    assert f"void {row.name}(const int16_t*" in generate.header()


def test_texts_that_only_the_board_sends_have_no_handler():
    assert "NO_REQUEST(39, xbee_text" in generate.header()


@pytest.mark.parametrize("row", COMMANDS, ids=lambda row: row.name)
def test_reference_has_every_command(row):
    assert re.search(
        rf"^\| {row.code}\*? \| {row.name}( \(stamped\))? \| ", generate.reference(), re.MULTILINE
    )


def test_reference_has_every_parameter_reason_and_fault():
    text = generate.reference()
    assert all(f"| {row.name} |" in text for row in PARAMETERS)
    assert all(f"| {row.name} |" in text for row in REASONS)
    assert all(f"| {name} |" in text for name, _ in FAULTS)
