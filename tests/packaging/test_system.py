"""udev rule and systemd unit: written, kept apart from other people's files, removed."""

import configparser
import re

import pytest
from click.testing import CliRunner

from mrl_driver import system
from mrl_driver.cli import cli
from mrl_driver.errors import ConfigError

TERM = re.compile(r'[A-Z]+(\{\w+(/\w+)?\})?(==|=|\+=)"[^"]*"')


def mrl_system(*words):
    done = CliRunner().invoke(cli, ["system", *map(str, words)], standalone_mode=False)
    if done.exception:
        raise done.exception
    return done.output


def lines(root):
    """Rules in force: comments gone, continued lines joined."""
    text = (root / system.RULES).read_text().replace("\\\n", " ")
    return [line for line in text.splitlines() if line and not line.startswith("#")]


def test_install_writes_both_files_and_remove_deletes_them(tmp_path):
    out = mrl_system("install", "--root", tmp_path, "--user", "ada")
    there = [(tmp_path / name).is_file() for name in (system.RULES, system.UNIT)]
    assert (there, out.count("wrote"), "ran" in out) == ([True, True], 2, False)
    mrl_system("remove", "--root", tmp_path)
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_twice_is_as_good_as_once(tmp_path):
    first = system.install("ada", str(tmp_path)), (tmp_path / system.RULES).read_text()
    assert first == (system.install("ada", str(tmp_path)), (tmp_path / system.RULES).read_text())


@pytest.mark.parametrize("action", ["install", "remove"])
def test_a_dry_run_changes_nothing(tmp_path, action):
    out = mrl_system(action, "--root", tmp_path, "--dry-run")
    assert not list(tmp_path.iterdir()) and str(tmp_path / system.RULES) in out


@pytest.mark.parametrize("action", [lambda root: system.install("ada", root), system.remove])
@pytest.mark.parametrize("name", [system.RULES, system.UNIT])
def test_files_of_other_people_stay(tmp_path, action, name):
    path = tmp_path / name
    path.parent.mkdir(parents=True)
    path.write_text("# mine\n")
    with pytest.raises(ConfigError, match="is not ours: it begins with '# mine'"):
        action(str(tmp_path))
    assert [p.read_text() for p in tmp_path.rglob("*") if p.is_file()] == ["# mine\n"]


def test_what_cannot_be_written_is_said_in_one_line(tmp_path):
    (tmp_path / "etc").write_text("a file where a folder should be")
    with pytest.raises(ConfigError, match="etc/udev/rules.d/70-mrl.rules: Not a directory"):
        system.install("ada", str(tmp_path))


@pytest.mark.parametrize("user", ["", "a b", "a\nExecStart=x"])
def test_a_user_that_is_none_is_refused(tmp_path, user):
    with pytest.raises(ConfigError, match="expected the name of a user"):
        system.install(user, str(tmp_path))


def test_remove_where_nothing_is(tmp_path):
    assert system.remove(str(tmp_path)) == ["nothing was installed"]


def test_rules_are_rules(tmp_path):
    system.install("ada", str(tmp_path))
    assert all(TERM.fullmatch(term) for line in lines(tmp_path) for term in re.split(r", +", line.strip()))


@pytest.mark.parametrize("kind", system.KINDS, ids=lambda kind: kind.text)
def test_each_adapter_is_left_alone_stays_awake_opens_and_has_a_name(tmp_path, kind):
    system.install("ada", str(tmp_path))
    own = [line for line in lines(tmp_path) if f'"{kind.vendor}"' in line and f'"{kind.product}"' in line]
    for part in (
        'ENV{ID_MM_DEVICE_IGNORE}="1"',
        'ATTR{power/control}="on"',
        'GROUP="dialout"',
        'SYMLINK+="mrl-$env{MRL_NAME}"',
    ):
        assert any(part in line for line in own)


def test_rules_come_before_modem_managers():
    """Whose own are numbered from 77 on."""
    assert int(system.RULES.rpartition("/")[2][:2]) < 77


def test_unit_runs_the_node_as_the_user_while_the_robot_is_there(tmp_path):
    system.install("ada", str(tmp_path))
    unit = configparser.ConfigParser(interpolation=None)
    unit.optionxform = str
    unit.read(tmp_path / system.UNIT)
    assert unit["Service"]["User"] == "ada"
    assert unit["Unit"]["BindsTo"] == unit["Install"]["WantedBy"] == r"dev-mrl\x2d%i.device"
    assert "roslaunch mrl_robots robot.launch port:=/dev/mrl-%I" in unit["Service"]["ExecStart"]


def test_on_the_machine_itself_it_takes_effect_at_once(monkeypatch):
    """And who may not be in the group yet is put there."""
    monkeypatch.setattr(system.shutil, "which", lambda name: name)
    words = [command[0] for command in system.commands("ada", True)]
    assert words == ["usermod", "udevadm", "udevadm", "systemctl"]
    assert ["usermod"] not in [command[:1] for command in system.commands("ada", False)]
