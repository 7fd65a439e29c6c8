"""Every command that a document shows: run, or parsed where it sets the machine up, needs a person or takes minutes."""

import re
import xml.etree.ElementTree

import click
import pytest
from click.testing import CliRunner

from mrl_driver.apps.measure.rows import KINDS
from mrl_driver.cli.main import cli
from mrl_driver.problems import PROBLEMS
from sim_arduino.serve.main import parser

from .blocks import ROOT, blocks
from .shown import shown
from .test_robot_recipe import TEXT

SHOWN = shown()
PORT = "/dev/ttyACM0"
ENDS = {
    "info": [],
    "monitor": ["--seconds", "0.5"],
    "record": ["--seconds", "0.5"],
    "set-id": ["--yes"],
    "ports": [],
}
"""Sub-commands that are run against an emulated board, and what makes them end by themselves."""


def of(*programs):
    named = [each for each in SHOWN if each.words[0].rpartition("/")[2] in programs]
    found = list(
        {tuple(each.words): each for each in reversed(named)}.values()
    )  # each once, in its first document
    assert found, f"no document shows {programs}"
    return pytest.mark.parametrize("words", [each.words for each in found], ids=map(str, found))


@pytest.fixture(autouse=True)
def place(tmp_path, monkeypatch):
    """A folder with what the documents' commands speak of."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    folder = tmp_path / "mrl-driver" / "robots"
    folder.mkdir(parents=True)
    (folder / "eswarbot.yaml").write_text(TEXT)
    traxbot = (ROOT / "mrl_driver" / "robot" / "models" / "traxbot.yaml").read_text()
    (tmp_path / "gas.yaml").write_text(f"{traxbot}build: environment\n")
    (folder.parent / "robots.yaml").write_text(f"lab3: {{port: {PORT}}}\n")
    (tmp_path / "drive.log").write_text('#mrl-recording 1 {"port": "x"}\n0.0 < @5,2500,172,1180,2,1e\\r\\n\n')


@of("make")
def test_targets_and_variables_exist(words):
    makefiles = [ROOT / "Makefile", *ROOT.glob("*/*.mk")]
    text = "\n".join(path.read_text() for path in makefiles)
    targets = {name for line in re.findall(r"^([a-z][\w -]*):", text, re.M) for name in line.split()}
    for word in words[1:]:
        name, given, _ = word.partition("=")
        assert f"$({name})" in text if given else name in targets


def parse(command, words):
    """Raises what a user would see; a command without any words is its mere name."""
    name, parent = "mrl", None
    while isinstance(command, click.Group):
        context = click.Context(command, parent, info_name=name, **command.context_settings)
        _, words, _ = command.make_parser(context).parse_args(args=list(words))
        if not words:
            return
        name, parent, command = words[0], context, command.get_command(context, words[0])
        assert command is not None, f"{context.command_path} has no {name}"
        words = words[1:]
    if words:
        command.make_context(name, list(words), parent=parent)


def ends_by_itself(words):
    """On an emulated TraxBot in place of the port."""
    return PORT in words and "eswarbot" not in words and (words[0] in ENDS or "--for" in words)


@of("mrl")
def test_mrl_is_run_or_parsed(words, request):
    """`mrl system` and what needs a keyboard or a person is parsed."""
    words = words[1:]
    if ends_by_itself(words):
        port = request.getfixturevalue("emulated_board").port
        words = [port if word == PORT else word for word in words] + ENDS.get(words[0], [])
        done = CliRunner().invoke(cli, words, standalone_mode=False)
        assert done.exception is None and done.output
    elif words[0] == "replay" and words[1:] == ["drive.log"]:
        CliRunner().invoke(cli, words, standalone_mode=False, catch_exceptions=False)
    else:
        try:
            parse(cli, words)
        except click.exceptions.Exit as ended:
            assert ended.exit_code == 0


def test_a_command_of_a_remedy_is_whole():
    """Those that need a port name one, and all that they need."""
    values = {"PORT": PORT, "FILE": "gas.yaml", "NAME": "kp", "VALUE": "700", "ID": "1"}
    commands = [
        found.split()
        for remedy in [
            *(each.remedy for each in PROBLEMS.values()),
            *(each.command for each in KINDS.values()),
        ]
        for found in re.findall(r"(?:: |run |and )mrl ([^;,(]*)", remedy)
    ]
    needless = ("ports", "system", "web")
    for words in commands:
        assert words[0] in needless or words[-2:] == ["--port", "PORT"], words
        if words[0] not in needless:
            parse(cli, [values.get(word, word) for word in words])
    assert len(commands) > 20


@of("mrl-sim")
def test_emulators_options_are_read(words):
    try:
        parser().parse_args(words[1:])
    except SystemExit as ended:
        assert ended.code == 0


def launch_file(words):
    return ROOT / words[1] if "/" in words[1] else ROOT / "ros1_bridge" / "launch" / words[2]


@of("roslaunch", "rosrun")
def test_launch_files_with_their_arguments_and_nodes_exist(words):
    if words[0] == "rosrun" and words[1] != "mrl_robots":
        assert f">{words[1]}</exec_depend>" in (ROOT / "package.xml").read_text()
    elif words[0] == "rosrun":
        assert (ROOT / "ros1_bridge" / "nodes" / words[2]).is_file()
    elif not words[1].startswith("--"):
        root = xml.etree.ElementTree.parse(launch_file(words)).getroot()
        known = {each.get("name") for each in root.findall("arg")}
        assert {word.partition(":=")[0] for word in words if ":=" in word} <= known


@pytest.mark.parametrize("document", ["README.md"])
def test_python_of_the_document_runs(document, emulated_board):
    code = [block.text for block in blocks(document) if block.language == "python"]
    for text in code:
        exec(compile(text.replace(PORT, emulated_board.port), document, "exec"), {})
    assert code
