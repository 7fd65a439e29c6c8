"""udev rule and systemd unit: written, kept apart from other people's files, removed."""

import fnmatch
import os
import pathlib
import re
import subprocess
import sys
import tempfile
from unittest.mock import Mock

import pytest
from click.testing import CliRunner

from mrl_driver.cli.main import cli
from mrl_driver.errors import ConfigError
from mrl_driver.host import system_setup
from mrl_driver.transport import port_info
from mrl_driver.transport.port_info import tells_apart
from tests.network import own_network
from tests.service_unit import environment, installed, start_line
from tests.waiting import PATIENCE, wait_until


def mrl_system(*words):
    done = CliRunner().invoke(cli, ["system", *map(str, words)], standalone_mode=False)
    if done.exception:
        raise done.exception
    return done.output


def lines(root):
    """Rules in force: comments gone, continued lines joined."""
    text = (root / system_setup.RULES).read_text().replace("\\\n", " ")
    return [line for line in text.splitlines() if line and not line.startswith("#")]


def test_install_writes_both_files_and_remove_deletes_them(tmp_path):
    out = mrl_system("install", "--root", tmp_path, "--user", "ada")
    there = [(tmp_path / name).is_file() for name in (system_setup.RULES, system_setup.UNIT)]
    assert (there, out.count("wrote"), "ran" in out) == ([True, True], 2, False)
    mrl_system("remove", "--root", tmp_path)
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_a_service_that_was_removed_does_not_start_again_when_it_is_installed_again(tmp_path):
    system_setup.install("ada", str(tmp_path))
    link = tmp_path / r"etc/systemd/system/dev-mrl\x2dNAME.device.wants/mrl-robot@NAME.service"
    link.parent.mkdir()
    link.symlink_to(f"/{system_setup.UNIT}")
    system_setup.remove(str(tmp_path))
    assert not os.path.lexists(link)


def test_settings_of_the_service_stay_and_are_named_when_it_is_removed(tmp_path):
    system_setup.install("ada", str(tmp_path))
    settings = tmp_path / "etc/default/mrl-robot@NAME"
    settings.parent.mkdir()
    settings.touch()
    assert (
        f"{settings} stays: it has your settings" in system_setup.remove(str(tmp_path)) and settings.exists()
    )


@pytest.mark.parametrize("action", ["install", "remove"])
def test_a_dry_run_changes_nothing(tmp_path, action):
    out = mrl_system(action, "--root", tmp_path, "--dry-run")
    assert not list(tmp_path.iterdir()) and str(tmp_path / system_setup.RULES) in out


@pytest.mark.parametrize("action", [lambda root: system_setup.install("ada", root), system_setup.remove])
@pytest.mark.parametrize("name", [system_setup.RULES, system_setup.UNIT])
def test_files_of_other_people_stay(tmp_path, action, name):
    path = tmp_path / name
    path.parent.mkdir(parents=True)
    path.write_text("# mine\n")
    with pytest.raises(ConfigError, match="was not written by mrl: it begins with '# mine'"):
        action(str(tmp_path))
    assert [p.read_text() for p in tmp_path.rglob("*") if p.is_file()] == ["# mine\n"]


@pytest.mark.parametrize("user", ["", "a b", "a\nExecStart=x"])
def test_a_user_that_is_none_is_refused(tmp_path, user):
    with pytest.raises(ConfigError, match="expected a user name"):
        system_setup.install(user, str(tmp_path))


def test_the_usb_ids_are_those_in_the_board_file_of_the_core_and_of_the_usual_adapters():
    text = pathlib.Path("/usr/share/arduino/hardware/arduino/avr/boards.txt").read_text()
    ids = (re.findall(rf"^(?:uno|mega)\.{of}\.\d+=0x(\w+)$", text, re.M) for of in ("vid", "pid"))
    named = {f"{vendor}:{product}".lower() for vendor, product in zip(*ids)}
    adapters = "0403:6001 0403:6015 067b:2303 10c4:ea60 1a86:5523 1a86:7522 1a86:7523 1a86:55d3 1a86:55d4"
    assert {f"{kind.vendor:04x}:{kind.product:04x}" for kind in port_info.KINDS} == named | set(
        adapters.split()
    )


@pytest.mark.parametrize("kind", port_info.KINDS, ids=lambda kind: f"{kind.vendor:04x}:{kind.product:04x}")
def test_each_adapter_is_left_alone_stays_awake_opens_and_has_a_name(tmp_path, kind):
    system_setup.install("ada", str(tmp_path))
    own = [
        line for line in lines(tmp_path) if f'"{kind.vendor:04x}"' in line and f'"{kind.product:04x}"' in line
    ]
    for part in (
        'ENV{ID_MM_DEVICE_IGNORE}="1"',
        'ATTR{power/control}="on"',
        'GROUP="dialout"',
        'SYMLINK+="mrl-$env{MRL_NAME}"',
    ):
        assert any(part in line for line in own)


def test_an_adapter_is_named_by_its_serial_number_or_else_by_its_socket(tmp_path):
    """The kernel's name leads to another adapter tomorrow, and the number 0001 to the one that came last."""
    system_setup.install("ada", str(tmp_path))
    named = [
        line for line in lines(tmp_path) if "1a86" in line and "7523" in line and "ENV{MRL_NAME}=" in line
    ]
    socket, serial = named
    assert socket.endswith('ENV{MRL_NAME}="$env{ID_PATH}"')
    pattern = re.search(r'ENV\{ID_SERIAL_SHORT\}=="([^"]*)"', serial)[1]
    numbers = ["", "0001", "00000000", "1", "A50285BI", "85430353531351", "10"]
    assert [number for number in numbers if fnmatch.fnmatchcase(number, pattern)] == [
        number for number in numbers if tells_apart(number)
    ]


@pytest.fixture
def brltty(tmp_path, monkeypatch):
    """A machine, its root in a folder, with brltty; the commands that were run."""
    run = []
    monkeypatch.setattr(system_setup, "is_machine", lambda root: True)
    monkeypatch.setattr(system_setup, "require_user", lambda user, root: None)
    monkeypatch.setattr(system_setup, "brltty_units", lambda: ["brltty-udev.service"])
    monkeypatch.setattr(system_setup, "run", lambda commands: run.extend(commands) or [])
    return run


@pytest.mark.parametrize(("option", "masked"), [("--mask-brltty", True), ("--keep-brltty", False)])
def test_brltty_is_masked_if_that_is_wanted(brltty, tmp_path, option, masked):
    out = mrl_system("install", "--root", tmp_path, "--user", "ada", option)
    assert (
        ["systemctl", "mask", "--now", "brltty-udev.service"] in brltty
    ) is masked and "may take" not in out


@pytest.mark.parametrize("user, told", [("ada", True), ("root", False)])
def test_who_gets_the_ports_is_told_to_log_in_again(brltty, tmp_path, user, told):
    out = mrl_system("install", "--root", tmp_path, "--user", user, "--keep-brltty")
    assert ("log out and in again" in out) is told


def test_the_command_for_root_can_be_copied_if_its_path_has_a_space(monkeypatch, tmp_path):
    monkeypatch.setattr(sys, "argv", ["/a b/mrl", "system", "install"])
    monkeypatch.setattr(os, "makedirs", Mock(side_effect=PermissionError(1, "no")))
    with pytest.raises(ConfigError, match="run as root: sudo '/a b/mrl' system install"):
        system_setup.install("ada", str(tmp_path))


def test_unit_runs_the_node_as_the_user_once_the_robot_is_there(tmp_path):
    """It stays when the board goes: systemd would not start it for one that is back at once (systemd, issue 11526)."""
    unit = installed(tmp_path)
    assert (unit["Service"]["User"], unit["Service"]["Restart"]) == ("ada", "always")
    assert unit["Install"]["WantedBy"] == r"dev-mrl\x2d%i.device" and "BindsTo" not in unit["Unit"]
    assert unit["Service"]["ExecStart"].endswith("exec roslaunch mrl_robots $MRL_LAUNCH port:=/dev/mrl-%I'")


def test_a_second_robot_on_one_master_is_refused_and_not_started_again(tmp_path):
    """Two nodes of one name would end each other for ever."""
    unit, begun = installed(tmp_path), tmp_path / "begun"
    fake = tmp_path / "roslaunch"
    fake.write_text(f"#!/bin/sh\ntouch '{begun}'\nexec sleep 999\n")
    fake.chmod(0o755)
    command = start_line(unit, tmp_path)
    env = {**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}", "RUNTIME_DIRECTORY": str(tmp_path)}
    env.update(ROS_SETUP="", MRL_CHECKOUT="", MRL_LAUNCH="x", ROS_NAMESPACE="")
    with subprocess.Popen(command, env=env) as first:
        try:
            wait_until(begun.exists)
            second = subprocess.run(command, env=env, capture_output=True, text=True, check=False)
        finally:
            first.kill()
    assert str(second.returncode) == unit["Service"]["RestartPreventExitStatus"]
    assert second.stdout.startswith(
        "another robot has this master: set ROS_MASTER_URI or ROS_NAMESPACE in /etc/"
    )


def started(folder, as_user=(), passed="ROS_HOME", **env):
    """What the unit's command passes to roslaunch as a variable of the environment."""
    fake = folder / "roslaunch"
    fake.write_text(f'#!/bin/sh\necho "${passed}"\n')
    fake.chmod(0o755)
    unit = installed(folder)
    given = {**environment(unit), "PATH": f"{folder}:{os.environ['PATH']}"}
    given.update(RUNTIME_DIRECTORY="/run/robot", HOME=str(folder))
    command = [*as_user, *start_line(unit, folder)]
    done = subprocess.run(command, env={**given, **env}, capture_output=True, text=True, check=True)
    return done.stdout.strip()


@pytest.mark.parametrize(("home", "expected"), [("", ""), ("/dev/null/ada", "/run/robot")])
def test_a_home_that_cannot_be_written_does_not_keep_the_robot_from_its_start(tmp_path, home, expected):
    assert started(tmp_path, HOME=home or str(tmp_path), ROS_HOME="") == expected


@pytest.mark.parametrize(
    ("given", "expected"),
    [({}, "127.0.0.1"), ({"ROS_HOSTNAME": "robot.local"}, ""), ({"ROS_IP": "10.0.0.2"}, "10.0.0.2")],
)
def test_nodes_listen_on_this_computer_alone_unless_it_has_a_name_or_address_for_others(
    tmp_path, given, expected
):
    assert started(tmp_path, passed="ROS_IP", **given) == expected


def test_topics_of_nodes_in_python_and_in_cpp_reach_another_machine(tmp_path):
    """Nodes in C++ accept no other machine while ROS_IP begins with 127, whatever ROS_HOSTNAME is."""
    command = [*own_network(), sys.executable, "-m", "tests.ros.service_and_desk", str(tmp_path)]
    seen = subprocess.run(command, capture_output=True, text=True, timeout=110 * PATIENCE, check=False)
    assert (seen.stdout.split(), seen.stderr) == (["/odom", "/tf_static"], "")


def test_a_clone_that_has_moved_is_named_with_what_to_do(tmp_path):
    """systemd starts the service again, because the clone may lie on a disk that is not there yet."""
    unit = installed(tmp_path)
    (tmp_path / "sleep").symlink_to("/bin/true")
    env = {**environment(unit), "PATH": f"{tmp_path}:{os.environ['PATH']}", "HOME": str(tmp_path)}
    env.update(RUNTIME_DIRECTORY=str(tmp_path), MRL_CHECKOUT="/old/place")
    done = subprocess.run(start_line(unit, tmp_path), env=env, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (1, "")
    assert (
        done.stdout.startswith("no clone in /old/place: where it is now, ") and done.stdout.count("\n") == 1
    )


def test_a_lock_that_another_user_has_left_is_taken():
    nobody = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"] if os.geteuid() == 0 else []
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        folder.chmod(0o755)
        started(folder)
        next(folder.glob("mrl-robot*")).chmod(0o444)
        started(folder, nobody)


def test_any_path_of_a_clone_can_be_in_the_unit(tmp_path, monkeypatch):
    monkeypatch.setattr(system_setup, "_checkout", lambda: '/home/ä b/50%hours/a"b\\t')
    system_setup.install("root", str(tmp_path))
    text = (tmp_path / system_setup.UNIT).read_text(encoding="utf-8")
    assert '"MRL_CHECKOUT=/home/ä b/50%%hours/a\\"b\\\\t"' in text
    verify = ["systemd-analyze", "verify", str(tmp_path / system_setup.UNIT)]
    assert subprocess.run(verify, capture_output=True, check=False).stderr == b""


@pytest.mark.parametrize("page", ["", "0.0.0.0:8642"])
def test_systemd_finds_no_fault_in_the_unit(tmp_path, page):
    system_setup.install("root", str(tmp_path), page)
    verify = ["systemd-analyze", "verify", str(tmp_path / system_setup.UNIT)]
    done = subprocess.run(verify, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
    assert (done.returncode, done.stdout) == (0, b"")


def test_service_serves_the_page_where_it_is_wanted(tmp_path):
    mrl_system("install", "--root", tmp_path, "--user", "ada", "--page", "0.0.0.0")
    assert (
        '"MRL_LAUNCH=web.launch listen:=0.0.0.0 respawn:=true"' in (tmp_path / system_setup.UNIT).read_text()
    )


def service_after(root, *words):
    """User and launch file of the service that is installed once more, and what was said."""
    said = mrl_system("install", "--root", root, *words)
    unit = (root / system_setup.UNIT).read_text()
    return re.search("\nUser=(.*)\n", unit)[1], re.search('"MRL_LAUNCH=(.*) respawn', unit)[1], said


def test_a_service_that_is_installed_again_keeps_its_user_and_page(tmp_path, monkeypatch):
    monkeypatch.setenv("SUDO_USER", "bob")
    mrl_system("install", "--root", tmp_path, "--user", "ada", "--page", "0.0.0.0:99")
    user, launch, said = service_after(tmp_path)
    assert (user, launch) == ("ada", "web.launch listen:=0.0.0.0:99")
    assert "the service still runs as ada; add --user bob to change that" in said
    assert "the service still serves the page at 0.0.0.0:99; add --page '' to end that" in said


def test_user_and_page_of_a_service_can_be_changed(tmp_path):
    mrl_system("install", "--root", tmp_path, "--user", "ada", "--page", "0.0.0.0:99")
    user, launch, said = service_after(tmp_path, "--user", "bob", "--page", "")
    assert (user, launch, "still" in said) == ("bob", "robot.launch", False)


def test_a_page_that_is_not_an_address_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="page is '0.0.0.0 x', expected HOST or HOST:PORT"):
        mrl_system("install", "--root", tmp_path, "--user", "ada", "--page", "0.0.0.0 x")


@pytest.mark.parametrize("clone", [True, False])
def test_who_installs_the_service_outside_a_clone_is_told_what_it_needs(tmp_path, monkeypatch, clone):
    if not clone:
        monkeypatch.setattr(system_setup, "__file__", str(tmp_path / "site/mrl_driver/host/system_setup.py"))
    said = system_setup.install("ada", str(tmp_path))
    assert clone is not any("needs mrl_robots in ROS" in line for line in said)


@pytest.mark.parametrize("setup", ["", "export ROS_PACKAGE_PATH=/opt/ros/noetic/share\n"])
def test_unit_finds_the_checkout_although_setup_files_of_ros_replace_the_package_path(tmp_path, setup):
    service = installed(tmp_path)
    (tmp_path / "setup.sh").write_text(setup)
    (tmp_path / "roslaunch").write_text('#!/bin/sh\necho "$ROS_PACKAGE_PATH"\n')
    (tmp_path / "roslaunch").chmod(0o755)
    env = environment(service)
    env.update(PATH=f"{tmp_path}:{os.environ['PATH']}", ROS_SETUP=str(tmp_path / "setup.sh") if setup else "")
    env["HOME"] = str(tmp_path)
    found = subprocess.run(
        start_line(service, tmp_path), env=env, stdout=subprocess.PIPE, check=True
    ).stdout.decode()
    wanted = [str(pathlib.Path(__file__).resolve().parents[2]), *(["/opt/ros/noetic/share"] if setup else [])]
    assert [path for path in found.strip().split(":") if path] == wanted


@pytest.mark.parametrize("words", [(), ("--dry-run",)])
def test_a_user_whom_the_machine_does_not_know_is_refused_before_anything_is_written(words):
    with pytest.raises(ConfigError, match="user 'nosuchuser' does not exist; give another one with --user"):
        mrl_system("install", "--user", "nosuchuser", *words)


def test_a_command_that_failed_is_not_said_to_have_run():
    assert system_setup.run([["false"], ["true"]]) == ["false failed: 1", "ran true"]
