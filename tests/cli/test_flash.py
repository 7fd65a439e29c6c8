"""`mrl flash`: the real avrdude against a bootloader on a pty, and what it says when things go wrong."""

import json
import os
import shlex
import stat
import termios
from pathlib import Path

import pytest

from mrl_driver.cli.commands import flash as command
from mrl_driver.driver.probe import Answer
from mrl_driver.errors import (
    BoardRefused,
    BoardTimeout,
    ConfigError,
    LinkLost,
    MrlError,
    NotARobot,
    PortBusy,
    PortDenied,
    PortMissing,
)
from mrl_driver.host import avrdude
from mrl_driver.host.named_robots import Target
from mrl_driver.robot import models
from mrl_driver.robot.chips import ATMEGA328P, ATMEGA2560
from mrl_driver.transport import port_info
from mrl_driver.transport.port_info import Port
from sim_arduino.testing import EmulatedBoard

from .bootloader import Bootloader, MegaBootloader
from .run import fails, mrl

HEX = ":10000000000102030405060708090A0B0C0D0E0F78\n:00000001FF\n"
NOT_IN_SYNC = "avrdude warning: attempt {0} of 10: not in sync: resp=0x00\n"
"""Of avrdude 7.1, as all the words below."""
WRITING = "Writing | ##---- | 4% 0.10s\n"


@pytest.fixture
def image(tmp_path):
    path = tmp_path / "image.hex"
    path.write_text(HEX)
    return str(path)


@pytest.fixture
def bootloader(close_later):
    return lambda kind=Bootloader, **options: close_later(kind(**options))


@pytest.fixture
def stand_in(tmp_path, monkeypatch):
    """A program called avrdude that notes its words, says something, and ends so."""

    def install(says="", code=0, signals=False, hangs=False):
        program = tmp_path / "bin" / "avrdude"
        program.parent.mkdir()
        noted = tmp_path / "noted"
        ends = "exec sleep 30" if hangs else f"exit {code}"
        if signals:
            ends = "kill -INT $PPID; exec sleep 30"
        program.write_text(
            f"#!/bin/sh\nprintf '%s\\n' \"$@\" >{shlex.quote(str(noted))}\n"
            f"printf %s {shlex.quote(says)} >&2\n{ends}\n"
        )
        program.chmod(program.stat().st_mode | stat.S_IXUSR)
        monkeypatch.setenv("PATH", f"{program.parent}{os.pathsep}{os.environ['PATH']}")
        return noted

    return install


def test_the_real_avrdude_writes_the_image_and_reads_it_back(bootloader, image):
    board, marks = bootloader(), []
    avrdude.upload(board.path, image, advance=marks.append)
    assert board.flash[:16] == bytes(range(16)) and sum(marks) == avrdude.MARKS


def test_an_image_of_the_mega_may_be_longer_than_128_kib(bootloader, tmp_path):
    """Its bootloader takes extended addresses."""
    image, board = tmp_path / "mega.hex", bootloader(MegaBootloader)
    image.write_text(HEX.replace(":00000001FF", ":020000040002F8\n:04001000DEADBEEFB4\n:00000001FF"))
    avrdude.upload(board.path, str(image), chip=ATMEGA2560)
    assert (board.flash[:16], board.flash[0x20010:0x20014]) == (bytes(range(16)), b"\xde\xad\xbe\xef")


@pytest.mark.parametrize("baud", [termios.B115200, termios.B57600])
def test_the_bootloaders_of_the_nano_answer_at_either_baud_rate(bootloader, image, baud):
    board = bootloader(baud=baud)
    avrdude.upload(board.path, image, bauds=avrdude.BAUDS)
    assert board.flash[:16] == bytes(range(16))


@pytest.mark.parametrize("kind, chip", [(Bootloader, ATMEGA328P), (MegaBootloader, ATMEGA2560)])
def test_another_chip_is_not_written(bootloader, image, kind, chip):
    board = bootloader(kind, signature=b"\x1e\x95\x16")
    with pytest.raises(BoardRefused, match=f"not that of an Arduino {chip.board}"):
        avrdude.upload(board.path, image, chip=chip)
    assert set(board.flash) == {0xFF}


def test_a_board_that_is_not_in_sync_is_given_up_after_the_third_attempt(stand_in, image):
    noted = stand_in("".join(map(NOT_IN_SYNC.format, (1, 2, 3))), hangs=True)
    with pytest.raises(NotARobot, match="press reset"):
        avrdude.upload("/dev/ttyACM7", image)
    words = noted.read_text().splitlines()
    assert words == avrdude.command("/dev/ttyACM7", image)[1:]
    assert "-c arduino -b 115200 -P /dev/ttyACM7" in " ".join(words)


@pytest.mark.parametrize(
    ("said", "kind"),
    [
        ('avrdude: can\'t open config file "/avrdude.conf": No such file or directory', ConfigError),
        ("avrdude OS error: cannot open port /dev/ttyACM7: No such file or directory", PortMissing),
        ("avrdude OS error: cannot open port /dev/ttyACM7: Permission denied", PortDenied),
        ("avrdude OS error: cannot open port /dev/ttyACM7: Device or resource busy", PortBusy),
        ("avrdude OS error: unable to read: Input/output error", LinkLost),
        ("avrdude: stk500_getsync() attempt 1 of 10: not in sync: resp=0x00", NotARobot),
        ("avrdude error: timeout communicating with programmer", NotARobot),
        ("avrdude error: protocol expects OK byte 0x10 but got 0xfc", NotARobot),
        ("avrdude: Expected signature for ATmega328P is 1E 95 0F", BoardRefused),
        ("avrdude: verification error, first mismatch at byte 0x0000", BoardRefused),
        ("avrdude error: the moon is full", MrlError),
    ],
)
def test_words_of_avrdude_become_errors_of_ours(said, kind):
    error = avrdude.explain(said, "/dev/ttyACM7", "image.hex")
    assert type(error) is kind and "\n" not in str(error)


@pytest.mark.parametrize(
    ("said", "kind"),
    [
        ("can't open device {port}: Permission denied", PortDenied),
        ("reading input file {image}\nnot in sync: resp=0x00", NotARobot),
        ("{port}: the moon is full: error\nreading input file {image}", MrlError),
    ],
)
def test_names_with_words_of_errors_are_no_errors(said, kind):
    names = {"port": "/dev/timeout", "image": "/home/locked #1/verification error/checksum.hex"}
    error = avrdude.explain(said.format(**names), **names)
    assert type(error) is kind and "/dev/timeout" in str(error)
    assert (kind is MrlError) == str(error).endswith("the moon is full: error")


@pytest.mark.parametrize(
    "said",
    ["Input/output error", "verification error", WRITING + "stk500_recv(): programmer is not responding"],
)
def test_an_upload_that_was_cut_warns_of_half_a_firmware(said):
    assert "which may turn the motors" in str(avrdude.explain(said, "/dev/ttyACM7", "image.hex"))


@pytest.mark.parametrize(
    "said", ["avrdude error: programmer is not responding\n", "avrdude error: timeout\n"]
)
def test_a_board_that_falls_silent_during_the_upload_is_given_up(stand_in, image, said):
    """avrdude would go on with the next page, for hours."""
    stand_in(WRITING + 3 * said, hangs=True)
    with pytest.raises(BoardTimeout, match="which may turn the motors"):
        avrdude.upload("/dev/ttyACM7", image)


def test_an_avrdude_that_falls_silent_during_the_upload_is_ended(stand_in, image, monkeypatch):
    """It says nothing of a port that has gone away, and computes without end."""
    heard = iter([[1], []])
    monkeypatch.setattr(avrdude.select, "select", lambda *_: (next(heard), [], []))
    stand_in(WRITING, hangs=True)
    with pytest.raises(BoardTimeout, match="which may turn the motors"):
        avrdude.upload("/dev/ttyACM7", image)


def test_a_byte_that_is_damaged_while_the_real_avrdude_writes_warns_of_half_a_firmware(bootloader, image):
    with pytest.raises(BoardTimeout, match="which may turn the motors"):
        avrdude.upload(bootloader(damaged_write=True).path, image)


def test_an_upload_that_ctrl_c_cuts_warns_of_half_a_firmware(stand_in, serve):
    """The signal comes while avrdude writes."""
    stand_in(says="Writing", signals=True)
    line = fails(130, "flash", "--port", serve().path, "--build", "sonar", "--yes")
    assert "which may turn the motors" in line


def test_without_avrdude_it_says_how_to_get_it(monkeypatch, serve, image):
    monkeypatch.setenv("PATH", "/nonexistent")
    line = fails(2, "flash", "--port", serve().path, "--image", image, "--yes")
    assert "sudo apt install avrdude" in line


def test_the_whole_command(stand_in, serve):
    port = serve()
    noted = stand_in()
    done = mrl("flash", "--port", port.path, "--yes")
    assert (
        done.stdout
        == f"{port.path} has the sonar build (as on the board now); robot 1 answers with firmware 2\n"
    )
    assert noted.read_text().splitlines()[-1].startswith("flash:w:")


def test_nothing_is_written_unasked(stand_in, serve):
    noted = stand_in()
    assert "--yes" in fails(2, "flash", "--port", serve().path, "--build", "xbee")
    assert not noted.exists()


@pytest.mark.parametrize(
    ("answer", "build"),
    [
        (Answer(1, "traxbot", 1), "sonar"),
        (Answer(7, "", 1), "environment"),
        (Answer(12, "", 2, capabilities=("check", "environment")), "environment"),
        (Answer(2, "traxbot", 2, capabilities=("sonars", "xbee")), "xbee"),
        (Answer(23, "duo", 2, capabilities=("bridge", "sonars")), "hbridge"),
        (Answer(23, "duo", 2, capabilities=("bridge", "sonars", "virtual")), "virtual"),
    ],
)
def test_the_build_follows_the_board(monkeypatch, answer, build):
    monkeypatch.setattr("mrl_driver.driver.probe.probe", lambda port, baud: answer)
    assert command.build_of(Target("/dev/ttyACM7"))[0] == build


def test_the_build_of_a_2013_board_is_that_of_its_model(monkeypatch):
    """The board does not report it; without the model it would get the build for sonars."""
    model = models.load("traxbot")._replace(build="environment")
    monkeypatch.setattr(models, "load", lambda name: model)
    monkeypatch.setattr("mrl_driver.driver.probe.probe", lambda port, baud: Answer(1, "traxbot", 1))
    assert command.build_of(Target("/dev/ttyACM7", "gas.yaml"))[0] == "environment"


@pytest.mark.parametrize(
    "model, usb, chip",
    [
        ("duo", 0x0042, ATMEGA328P),
        ("mega.yaml", 0x0043, ATMEGA2560),
        ("", 0x0042, ATMEGA2560),
        ("auto", 0x0043, ATMEGA328P),
    ],
)
def test_the_chip_is_that_of_the_robots_file_or_of_the_usb_device(monkeypatch, model, usb, chip):
    port, duo = "/dev/ttyACM7", models.load("duo")
    robots = {"duo": duo, "mega.yaml": duo._replace(chip=ATMEGA2560.name)}
    monkeypatch.setattr(models, "load", robots.get)
    monkeypatch.setattr(port_info, "described", lambda: [Port(port, (), 0x2341, usb)])
    assert command.chip_of(Target(port, model)) == chip
    assert command.bauds_of(port, ATMEGA2560) == (115200,)


def test_a_mega_gets_the_image_for_its_chip(stand_in, tmp_path, serve):
    """The other builds are for the Uno alone."""
    text = Path(models.path_of("duo")).read_text(encoding="utf-8").replace("encoder_a: 8", "encoder_a: 18")
    path = tmp_path / "mega.yaml"
    path.write_text(
        text.replace("wiring:", "wiring:\n  chip: atmega2560").replace("encoder_a: 2", "encoder_a: 19")
    )
    noted = stand_in()
    with EmulatedBoard(robot=str(path)) as board:
        done = mrl("flash", "--robot", str(path), "--port", board.port, "--yes")
        assert done.stdout.endswith("its pins are those of duo\n"), done.stderr
    words = noted.read_text()
    assert "m2560" in words and "wiring" in words and "mrl_firmware_hbridge_mega.hex" in words


@pytest.mark.parametrize(
    ("robot", "build", "words"),
    [
        ("duo", "xbee", "--build is xbee, but robot duo has an H-bridge, expected hbridge"),
        (
            "traxbot",
            "hbridge",
            "--build is hbridge, but robot traxbot has a motor board, expected another build",
        ),
        (
            "traxbot",
            "virtual",
            "--build is virtual, but robot traxbot has a motor board, expected another build",
        ),
    ],
)
def test_a_build_for_other_motors_is_refused(serve, robot, build, words):
    assert words in fails(2, "flash", "--port", serve().path, "--robot", robot, "--build", build, "--yes")


def test_without_a_port_the_only_arduino_is_taken(monkeypatch):
    uno = Port("/dev/ttyACM7", (), 0x2341, 0x0043)
    monkeypatch.setattr(port_info, "described", lambda: [Port("/dev/ttyS7"), uno])
    assert "'/dev/ttyACM7' does not exist" in fails(3, "flash", "--yes")
    monkeypatch.setattr(port_info, "described", lambda: [uno, uno._replace(device="/dev/ttyACM8")])
    assert "several boards are plugged in" in fails(2, "flash", "--yes")


def test_an_h_bridge_board_gets_the_pins_of_its_robot(stand_in, image):
    """One with pins of another wiring says what is wrong, and drives when its wiring is known again."""
    stand_in()
    with EmulatedBoard(robot="duo") as board:
        pins = ("pin_left_pwm_a", "4", "pin_right_encoder_b", "-1")
        assert "mrl calibrate wiring" in mrl("config", "set", *pins, "--yes", "--port", board.port).stderr
        words = "left_encoder_b is on D4, as left_pwm_a: another function has the same pin"
        assert words in mrl("info", "--port", board.port).stdout
        assert words in mrl("doctor", "--port", board.port).stdout
        done = mrl("flash", "--port", board.port, "--image", image, "--yes")
        assert done.stdout.endswith("robot 23 answers with firmware 2; its pins are those of duo\n")
        assert mrl("config", "set", "wiring", "1", "--yes", "--port", board.port).returncode == 0
        assert "wiring" not in json.loads(mrl("info", "--json", "--port", board.port).stdout)
        assert mrl("drive", "--linear", "0.1", "--for", "0.2", "--yes", "--port", board.port).returncode == 0
