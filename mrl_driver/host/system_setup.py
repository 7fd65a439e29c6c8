"""Set-up of the operating system for robots: writes and removes udev rules and a systemd unit.

Only `install`, `remove` and `run` change the system; the root of the file system is an argument.  Files that do not
begin with `MARK` are not changed.
"""

import contextlib
import glob
import os
import pwd
import re
import shlex
import shutil
import subprocess
import sys
from typing import Dict, Iterator, List, Tuple

from mrl_driver.errors import ConfigError
from mrl_driver.transport.port_info import KINDS

MARK = "# Written by `mrl system install`; `mrl system remove` deletes it."
RULES = "etc/udev/rules.d/70-mrl.rules"
UNIT = "etc/systemd/system/mrl-robot@.service"
LINKS = "etc/systemd/system/*.wants/mrl-robot@*.service"
"""What `systemctl enable` makes: links that start the service by itself."""
SETTINGS = "etc/default/mrl-robot*"
GROUP = "dialout"
BRLTTY_UNITS = ("brltty-udev.service", "brltty.path", "brltty.service")
"""Units of the driver of Braille displays, which takes USB serial adapters for them, in Debian, Ubuntu and Arch."""
RULES_HEAD = """{mark}
# For the USB serial adapters of robots: ModemManager does not write to them, members of {group} may open them, they
# never sleep, and each has its own name: /dev/mrl-SERIAL.  Cheap adapters have no serial number, or all the same one of
# zeros and ones: their name is that of the USB socket, such as /dev/mrl-pci-0000:00:14.0-usb-0:2:1.0.
"""
RULES_FOR_KIND = """
# {text}
SUBSYSTEM=="usb", ATTR{{idVendor}}=="{vendor}", ATTR{{idProduct}}=="{product}", \\
  ENV{{ID_MM_DEVICE_IGNORE}}="1", TEST=="power/control", ATTR{{power/control}}="on"
SUBSYSTEM=="tty", ATTRS{{idVendor}}=="{vendor}", ATTRS{{idProduct}}=="{product}", ENV{{ID_MM_DEVICE_IGNORE}}="1", \\
  GROUP="{group}", MODE="0660", TAG+="systemd", ENV{{MRL_NAME}}="$env{{ID_PATH}}"
SUBSYSTEM=="tty", ATTRS{{idVendor}}=="{vendor}", ATTRS{{idProduct}}=="{product}", ENV{{ID_SERIAL_SHORT}}=="*[!01]*", \\
  ENV{{MRL_NAME}}="$env{{ID_SERIAL_SHORT}}"
SUBSYSTEM=="tty", ATTRS{{idVendor}}=="{vendor}", ATTRS{{idProduct}}=="{product}", SYMLINK+="mrl-$env{{MRL_NAME}}"
"""
LATENCY_RULE = """
# An FTDI chip holds bytes back for 16 ms by default.
SUBSYSTEM=="usb-serial", DRIVERS=="ftdi_sio", TEST=="latency_timer", ATTR{latency_timer}="1"
"""
UART_RULE = """
# The UART on the pins of a Raspberry Pi, if neither Bluetooth nor a login prompt has it.
SUBSYSTEM=="tty", KERNEL=="ttyAMA0", SYMLINK+="mrl-uart"
"""
UNIT_TEXT = """{mark}
# Runs the ROS node of the robot on /dev/mrl-NAME from the time on when it is plugged in; the node finds it again:
# systemctl enable --now mrl-robot@$(systemd-escape NAME)
# /etc/default/mrl-robot may set ROS_SETUP=/opt/ros/noetic/setup.sh (or a workspace's), MRL_LAUNCH="robot.launch
# robot:=traxbot" (launch file, arguments), and for other machines ROS_HOSTNAME=(name of this one, here also without a
# network) and ROS_MASTER_URI=...
# /etc/default/mrl-robot@NAME sets the same for one robot: a second one needs a ROS_MASTER_URI (or ROS_NAMESPACE) and a
# page of its own, because two nodes of one name on one master end each other.
# The journal keeps what the nodes print, and rotates.  ROS' own logs are in memory until the unit stops.
[Unit]
Description=Robot on /dev/mrl-%I
After=dev-mrl\\x2d%i.device network.target

[Service]
User={user}
SupplementaryGroups={group}
Environment="MRL_CHECKOUT={checkout}" "MRL_LAUNCH={launch} respawn:=true" PYTHONUNBUFFERED=1
EnvironmentFile=-/etc/default/mrl-robot
EnvironmentFile=-/etc/default/mrl-robot@%I
RuntimeDirectory=mrl-robot/%i
# ROS_SETUP replaces ROS_PACKAGE_PATH, so a checkout is added after it.  With ROS_IP=127.0.0.1, nodes in C++ accept no
# other machine, even if ROS_HOSTNAME is set.
ExecStart=/bin/sh -c '[ -z "$ROS_SETUP" ] || . "$ROS_SETUP"; export ROS_LOG_DIR="$RUNTIME_DIRECTORY"; \
  [ -n "$ROS_IP$ROS_HOSTNAME" ] || export ROS_IP=127.0.0.1; \
  mkdir -p "$HOME/.ros" || export ROS_HOME="$RUNTIME_DIRECTORY"; \
  lock="/run/lock/mrl-robot$(systemd-escape "$ROS_MASTER_URI $ROS_NAMESPACE")"; \
  [ -e "$lock" ] || : >"$lock"; exec 9<"$lock"; flock -n 9 || {{ \
  echo "another robot has this master: set ROS_MASTER_URI or ROS_NAMESPACE in /etc/default/mrl-robot@%I"; exit 78; }}; \
  [ -z "$MRL_CHECKOUT" ] || [ -e "$MRL_CHECKOUT/package.xml" ] || {{ \
  echo "no clone in $MRL_CHECKOUT: where it is now, make .venv again, and run mrl system install"; \
  sleep 30; exit 1; }}; \
  [ -z "$MRL_CHECKOUT" ] || export ROS_PACKAGE_PATH="$MRL_CHECKOUT:$ROS_PACKAGE_PATH"; \
  exec roslaunch mrl_robots $MRL_LAUNCH port:=/dev/mrl-%I'
# The nodes go before other programs when the processor is busy.  With autogroups, which Raspberry Pi OS has, Nice
# counts only among the processes of one session, and each node is a session of its own: there the weight counts.
Nice=-10
CPUWeight=1000
# Stops the robot, also at a shutdown: each node gets the signal, and robot_node stops the motors before it ends.
KillSignal=SIGINT
TimeoutStopSec=10
# roslaunch ends without an error if its master is killed.
Restart=always
RestartSec=2
RestartPreventExitStatus=78

[Install]
WantedBy=dev-mrl\\x2d%i.device
"""


def rules() -> str:
    """Return the text of the udev rules."""
    kinds = (
        RULES_FOR_KIND.format(
            vendor=f"{kind.vendor:04x}", product=f"{kind.product:04x}", text=kind.text, group=GROUP
        )
        for kind in KINDS
    )
    return RULES_HEAD.format(mark=MARK, group=GROUP) + "".join(kinds) + LATENCY_RULE + UART_RULE


def unit(user: str, page: str = "") -> str:
    """Return the text of the unit, which runs as `user`; in a checkout it adds the checkout to ROS_PACKAGE_PATH.

    `page` is where a page listens, HOST or HOST:PORT; empty for none.  ConfigError if it cannot be an address.
    """
    if re.search(r"[^\w.:\[\]-]", page):
        raise ConfigError(f"page is {page!r}, expected HOST or HOST:PORT, such as 127.0.0.1 or 0.0.0.0:8642")
    launch = f"web.launch listen:={page}" if page else "robot.launch"
    checkout = re.sub(r'(["\\])', r"\\\1", _checkout()).replace("%", "%%")
    return UNIT_TEXT.format(mark=MARK, user=user, group=GROUP, checkout=checkout, launch=launch)


def _checkout() -> str:
    """Return the folder of the clone that this program is in, or an empty text."""
    folder = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
    return folder if os.path.isfile(os.path.join(folder, "package.xml")) else ""


def before(root: str) -> Tuple[str, str]:
    """Return user and page of the service that is installed, each empty if there is none."""
    path, text = os.path.join(root, UNIT), ""
    with contextlib.suppress(OSError), open(path, encoding="utf-8", errors="replace") as file:
        text = file.read()
    found = (re.search(pattern, text) for pattern in (r"\nUser=(\S+)", r" listen:=(\S+) "))
    user, page = (match[1] if match and text.startswith(MARK) else "" for match in found)
    return user, page


def files(user: str, page: str = "") -> Dict[str, str]:
    """Return the files that `install` writes: paths relative to the root, and texts."""
    return {RULES: rules(), UNIT: unit(user, page)}


def commands(user: str, installing: bool) -> List[List[str]]:
    """Return the commands that make the change take effect at once, without those that are not installed."""
    wanted = [["usermod", "-aG", GROUP, user]] if installing and user != "root" else []
    wanted += [] if installing else [["systemctl", "stop", "mrl-robot@*"]]
    wanted += [
        ["udevadm", "control", "--reload"],
        ["udevadm", "trigger", "--subsystem-match=usb", "--subsystem-match=tty", "--action=add"],
        ["systemctl", "daemon-reload"],
    ]
    return [words for words in wanted if shutil.which(words[0])]


def brltty_units() -> List[str]:
    """Return the systemd units of brltty that may start on this machine; masked ones lead to /dev/null."""
    folders = ("/etc/systemd/system", "/usr/lib/systemd/system", "/lib/systemd/system")
    found = []
    for unit in BRLTTY_UNITS:
        paths = [path for path in (os.path.join(folder, unit) for folder in folders) if os.path.lexists(path)]
        if paths and os.path.realpath(paths[0]) != os.devnull:
            found.append(unit)
    return found


def mask_brltty() -> List[str]:
    """Keep brltty from starting, also now; it then takes no adapters.  Return one line per action."""
    return run([["systemctl", "mask", "--now", *brltty_units()]])


def install(user: str, root: str = "/", page: str = "", service_user: str = "") -> List[str]:
    """Write the files; if `root` is this machine's own, make them take effect.  Return one line per action.

    `user` may open ports; the service runs as `service_user`, by default the same.  ConfigError if a user does not
    exist, `page` is not an address, another program's file has the same name, or a file cannot be written.
    """
    for name in (user, service_user or user):
        require_user(name, root)
    paths = {os.path.join(root, name): text for name, text in files(service_user or user, page).items()}
    for path in paths:
        _require_ours(path)
    for path, text in paths.items():
        with _changing(path):
            os.makedirs(os.path.dirname(path), exist_ok=True)
            with open(path, "w", encoding="utf-8") as file:
                file.write(text)
    done = [f"wrote {path}" for path in paths]
    if not _checkout():
        done.append(
            "the service, if you switch it on, needs mrl_robots in ROS; or install it with the mrl of a clone's .venv"
        )
    if not is_machine(root):
        return done
    new = (
        [] if user == "root" else [f"if {user} was not in the group {GROUP} before, log out and in again now"]
    )
    return [*done, *run(commands(user, True)), *new]


def removed(root: str) -> List[str]:
    """Return the paths that `remove` deletes, if they are there."""
    return [*(os.path.join(root, name) for name in (RULES, UNIT)), *_found(root, LINKS)]


def _found(root: str, pattern: str) -> List[str]:
    return sorted(glob.glob(os.path.join(glob.escape(root), pattern)))


def remove(root: str = "/") -> List[str]:
    """Delete the files that `install` wrote, and the links that start the service; return a line per action.

    ConfigError if a file is not ours, or stays.
    """
    for name in (RULES, UNIT):
        _require_ours(os.path.join(root, name))
    there = [path for path in removed(root) if os.path.lexists(path)]
    for path in there:
        with _changing(path):
            os.unlink(path)
    if not there:
        return ["nothing was installed"]
    done = [f"removed {path}" for path in there]
    done += [f"{path} stays: it has your settings" for path in _found(root, SETTINGS)]
    return done + run(commands("root", False)) if is_machine(root) else done


def _require_ours(path: str) -> None:
    if not os.path.exists(path):
        return
    with _changing(path), open(path, encoding="utf-8", errors="replace") as file:
        first = file.readline().rstrip("\n")
    if first != MARK:
        raise ConfigError(
            f"{path} was not written by mrl: it begins with {first[:40]!r}; move it away, then try again"
        )


@contextlib.contextmanager
def _changing(path: str) -> Iterator[None]:
    """In this block, an error of the system is one of the file that is read or changed."""
    try:
        yield
    except OSError as error:
        hint = "; run as root: sudo " + shlex.join(sys.argv) if isinstance(error, PermissionError) else ""
        raise ConfigError(f"{path} cannot be changed: {error.strerror}{hint}") from None


def require_user(user: str, root: str = "/") -> None:
    """Check that this machine has the user, or in an image only the form of the name; ConfigError if it is wrong."""
    if not user.isprintable() or not user or any(c.isspace() for c in user):
        raise ConfigError(f"user is {user!r}, expected a user name")
    try:
        if is_machine(root):
            pwd.getpwnam(user)
    except KeyError:
        raise ConfigError(
            f"user {user!r} does not exist; give another one with --user, or create it with: sudo adduser {user}"
        ) from None


def is_machine(root: str) -> bool:
    """Return whether `root` is this machine's own file system, not an image."""
    return os.path.realpath(root) == "/"


def run(wanted: List[List[str]]) -> List[str]:
    """Run commands and return one line per command; a failed command does not stop the others."""
    done = []
    for words in wanted:
        result = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
        reason = " ".join(result.stdout.decode(errors="replace").split())
        command = " ".join(words)
        done.append(
            f"{command} failed: {reason or result.returncode}" if result.returncode else f"ran {command}"
        )
    return done
