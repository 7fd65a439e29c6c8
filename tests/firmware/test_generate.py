"""The generated files: current, and complete."""

import re

import pytest

from mrl_driver.errors import ConfigError
from mrl_driver.generate import render
from mrl_driver.protocol import table
from mrl_driver.protocol.table import COMMANDS, FAULTS, PARAMETERS, REASONS


def test_check_names_what_is_stale(monkeypatch, capsys):
    monkeypatch.setattr(render, "FILES", {"firmware/mrl_firmware/src/serial/protocol.h": lambda: "other"})
    assert render.main(["--check"]) == 1
    error = "firmware/mrl_firmware/src/serial/protocol.h is stale; render it with: python -m mrl_driver.generate\n"
    assert capsys.readouterr().err == error


def test_committed_files_are_current(capsys):
    assert render.main(["--check"]) == 0 and capsys.readouterr().err == ""


def test_stale_file_is_written(monkeypatch, tmp_path):
    monkeypatch.setattr(render, "ROOT", tmp_path)
    monkeypatch.setattr(render, "FILES", {"one": lambda: "text"})
    assert render.main([]) == 0 and (tmp_path / "one").read_text() == "text"


@pytest.mark.parametrize(
    "code, name, free",
    [(20, "read_air", 63), (0, "read_air", 63), (65, "read_air", 63), (63, "read_dust", 64)],
)
def test_row_without_a_code_and_a_name_of_its_own_is_an_error_of_one_line(
    monkeypatch, capsys, code, name, free
):
    monkeypatch.setattr(table, "COMMANDS", (*COMMANDS, COMMANDS[0]._replace(code=code, name=name)))
    assert render.main([]) == ConfigError.exit_code
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and f"{code} {name}" in error and f"the next free one is {free}\n" in error


def test_each_request_has_a_row():
    rows = [(str(row.code), row.name.upper(), row.name) for row in COMMANDS if row.name != "xbee_text"]
    assert re.findall(r" (?:REQUEST|QUERY)\((\d+), (\w+), (\w+), ", render.header()) == rows


def test_texts_that_only_the_board_sends_have_no_handler():
    assert "NO_REQUEST(39, XBEE_TEXT, " in render.header()


def test_reference_has_every_command():
    rows = re.findall(
        r"^\| (\d+)\*? \| (\w+)(?: \(!\))?(?: \(stamped\))? \| ", render.reference(), re.MULTILINE
    )
    assert {(str(row.code), row.name) for row in COMMANDS} - set(rows) == set()


def test_reference_has_every_parameter_reason_and_fault():
    text = render.reference()
    assert all(f"| {row.name} |" in text for row in PARAMETERS)
    assert all(f"| {row.name} |" in text for row in REASONS)
    assert all(f"| {name} |" in text for name, _ in FAULTS)
