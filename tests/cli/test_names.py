"""Robots by name: the user's file, what wins over what, and every way to get it wrong."""

import json
import os

import pytest

from mrl_driver.host import named_robots

from .run import fails, mrl


def write(text):
    os.makedirs(os.path.dirname(named_robots.path()), exist_ok=True)
    with open(named_robots.path(), "w", encoding="utf-8") as file:
        file.write(text)


def test_a_name_stands_for_port_model_and_baud(serve):
    port = serve(robot_id=2).path
    mrl("names", "add", "lab3", "--port", port, "--model", "traxbot", "--baud", "57600")
    facts = json.loads(mrl("--robot", "lab3", "info", "--json").stdout)
    assert (facts["port"], facts["robot_id"]) == (port, 2)
    assert json.loads(mrl("names", "--json").stdout) == {
        "lab3": {"port": port, "model": "traxbot", "baud": 57600}
    }


def test_an_explicit_port_wins_over_the_name_and_the_name_over_the_environment(monkeypatch):
    write("lab3: {port: /dev/one}\n")
    monkeypatch.setenv("MRL_PORT", "/dev/two")
    assert "'/dev/one' does not exist" in fails(3, "info", "--robot", "lab3")
    assert "'/dev/three' does not exist" in fails(3, "info", "--robot", "lab3", "--port", "/dev/three")
    assert "'/dev/two' does not exist" in fails(3, "info")


def test_the_robot_of_the_environment(monkeypatch):
    write("lab3: {port: /dev/one}\n")
    monkeypatch.setenv("MRL_ROBOT", "lab3")
    assert "'/dev/one' does not exist" in fails(3, "info")


def test_a_name_is_forgotten():
    write("lab3: {port: /dev/one}\nlab4: {port: /dev/two}\n")
    assert mrl("names", "remove", "lab3").returncode == 0
    assert list(named_robots.read()) == ["lab4"]
    assert "expected lab4" in fails(2, "names", "remove", "lab3")


def test_without_names_it_says_how_to_give_one():
    assert "mrl names add" in mrl("names").stdout
    assert "mrl names add lab9" in fails(2, "info", "--robot", "lab9")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("lab3: {prot: /dev/one}\n", "key lab3.prot is unknown, expected port, model, baud"),
        ("lab3: {model: traxbot}\n", "key lab3.port is missing"),
        ("lab3: {port: 7}\n", "lab3.port is 7, expected a serial port"),
        ("lab3: {port: ''}\n", "lab3.port is ''"),
        ("lab3: {port: /dev/one, baud: fast}\n", "lab3.baud is 'fast', expected a whole number from 300"),
        ("lab3: {port: /dev/one, baud: true}\n", "lab3.baud is True"),
        ("lab3: {port: /dev/one, baud: 0}\n", "lab3.baud is 0"),
        ("lab3: {port: /dev/one, baud: .nan}\n", "lab3.baud is nan"),
        ("lab3: {port: /dev/one, model: [1]}\n", "lab3.model is [1]"),
        ("lab3: /dev/one\n", "lab3 is '/dev/one', expected a mapping"),
        ("- lab3\n", "expected a mapping of names, each with a port"),
        ("traxbot: {port: /dev/one}\n", "name 'traxbot' is a robot model"),
        ("'a b': {port: /dev/one}\n", "name is 'a b'"),
        ("lab3:\n\tport: /dev/one\n", "no YAML"),
        ("lab3: {port: [\n", "no YAML"),
        ("lab3: {port: 2020-01-99}\n", "no YAML"),
        pytest.param("[" * 5000, "no YAML", id="deep"),
    ],
)
def test_a_wrong_file_names_key_value_and_what_was_expected(text, words):
    write(text)
    line = fails(2, "info", "--robot", "lab3")
    assert words in line and named_robots.path() in line


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (["auto", "--port", "/dev/one"], "is a robot model"),
        (["3lab", "--port", "/dev/one"], "name is '3lab'"),
        (["lab3", "--port", " "], "--port is ' '"),
        (["lab3", "--port", "/dev/one", "--baud", "1"], "--baud is 1"),
        (["lab3", "--port", "/dev/one", "--model", "nix"], "robot 'nix' is unknown"),
    ],
)
def test_nothing_wrong_gets_into_the_file(args, words):
    assert words in fails(2, "names", "add", *args)
    assert not os.path.exists(named_robots.path())


def test_a_folder_that_cannot_be_written(tmp_path):
    (tmp_path / "config").write_text("a file")
    assert "config/mrl-driver/robots.yaml cannot be" in fails(2, "names", "add", "lab3", "--port", "/dev/one")
