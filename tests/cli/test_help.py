"""Help, completion, start: every command has examples, and the examples are words that `mrl` takes."""

import os
import pathlib
import re
import shlex
import signal
import subprocess
import sys

import click
import pytest
from click.shell_completion import BashComplete

from mrl_driver.cli import main
from mrl_driver.errors import ConfigError, OutputError
from tests.waiting import PATIENCE_S

from .terminal import MRL


def every(command=main.cli, path=("mrl",)):
    """All commands, each with the words that lead to it."""
    found = [(path, command)]
    if isinstance(command, click.Group):
        ctx = click.Context(command, **command.context_settings)
        for name in command.list_commands(ctx):
            found += every(command.get_command(ctx, name), (*path, name))
    return found


def python(*words, path):
    """Python with these words, in the root of the project, with a path for modules."""
    return subprocess.run(
        [sys.executable, *words],
        cwd=pathlib.Path(__file__).resolve().parents[2],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        env={**os.environ, "PYTHONPATH": str(path)},
    )


COMMANDS = dict(every())
EXAMPLES = sorted(
    {
        part.strip()
        for command in COMMANDS.values()
        for line in (command.help or "").splitlines()
        if line.strip().startswith("mrl ")
        for part in re.split(r";| > |\|", re.split(r"\s{3,}", line.strip())[0])
        if part.strip().startswith("mrl ")
    }
)


@pytest.mark.parametrize("path", COMMANDS, ids=" ".join)
def test_each_command_says_what_it_does(path):
    command = COMMANDS[path]
    assert command.help and len(command.get_short_help_str(200)) > 10
    assert all(option.help for option in command.params if isinstance(option, click.Option))


@pytest.mark.parametrize("example", EXAMPLES)
def test_examples_parse(example, monkeypatch):
    called, words = [], shlex.split(example)
    for path, command in COMMANDS.items():
        if not isinstance(command, click.Group):
            monkeypatch.setattr(command, "callback", lambda *_, path=path, **__: called.append(path))
    main.cli.main(words[1:], "mrl", standalone_mode=False)
    assert len(called) == 1 and set(called[0]) <= set(words)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["mo"], ["monitor"]),
        (["go"], ["goto"]),
        (["config", "set", "ramp"], ["ramp_time", "ramp_gain"]),
        (["info", "--robot", "st"], ["stingbot"]),
        (["--robot", "st"], ["stingbot"]),
    ],
)
def test_what_the_shell_completes(words, expected):
    *before, begun = words
    found = BashComplete(main.cli, {}, "mrl", "_MRL_COMPLETE").get_completions(before, begun)
    assert [each.value for each in found] == expected


@pytest.mark.parametrize(
    ("code", "heavy"),
    [
        (
            "c.cli.get_command(None, 'info'); import mrl_driver.driver.driver",
            ["rich.console", "numpy", "importlib.metadata"],
        ),
        ("c.cli.get_help(c.cli.make_context('mrl', ['info']))", ["rich.console", "numpy", "serial", "yaml"]),
    ],
    ids=["info", "the list of commands"],
)
def test_what_a_quick_command_does_not_load(code, heavy):
    """They start in a tenth, and in two tenths of a second of computing."""
    code = f"import sys, mrl_driver.cli.main as c\n{code}\nprint([m for m in {heavy} if m in sys.modules])"
    assert python("-S", "-c", code, path=os.pathsep.join(sys.path)).stdout.strip() == "[]"


def test_output_that_cannot_be_written_costs_a_line():
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [*MRL, "names"], stdout=full, stderr=subprocess.PIPE, text=True, timeout=PATIENCE_S
        )
    assert done.returncode == OutputError.exit_code
    text = "the output cannot be written: No space left on device; free disk space, or choose another folder"
    assert done.stderr == f"mrl: {text}  [output_error]\n"


def test_ctrl_c_while_it_still_loads_says_nothing(tmp_path):
    (tmp_path / "click.py").write_text(
        "import os, signal, time\nos.kill(os.getpid(), signal.SIGINT)\ntime.sleep(20)\n"
    )
    done = python("-m", "mrl_driver", "--help", path=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGINT, "", "")


@pytest.mark.parametrize(
    ("missing", "package", "words"),
    [
        ("click", "click", ["mrl_driver", "--help"]),
        ("serial", "pyserial", ["mrl_driver", "info", "--port", "/dev/null"]),
        ("click", "click", ["sim_arduino", "--help"]),
    ],
)
def test_a_package_that_is_missing_costs_a_line(tmp_path, missing, package, words):
    """As with catkin's `mrl` and `mrl-sim`, which come without the dependencies that pip would install."""
    (tmp_path / f"{missing}.py").write_text(f"raise ModuleNotFoundError('No module', name='{missing}')\n")
    done = python("-m", *words, path=tmp_path)
    name = {"mrl_driver": "mrl", "sim_arduino": "mrl-sim"}[words[0]]
    assert (done.returncode, done.stdout) == (ConfigError.exit_code, "")
    assert done.stderr == (
        f"{name}: the Python package {missing} is missing; install it with: sudo apt install python3-{missing}, "
        f"or: pip install {package}\n"
    )
