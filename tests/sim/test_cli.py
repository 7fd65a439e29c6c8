"""`mrl-sim` as a program: what it prints, serves, survives and leaves behind."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

from mrl_driver.robot import models
from tests.cli.terminal import Terminal
from tests.waiting import PATIENCE_S, wait_until

from .simulator import Client, Simulator

MRL_SIM = [sys.executable, "-m", "sim_arduino"]


def fail(*options):
    done = subprocess.run(
        [sys.executable, "-m", "sim_arduino.serve.main", *options],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
    )
    assert done.stdout == ""
    return done.returncode, done.stderr


def test_a_terminal_gets_the_next_command():
    terminal = Terminal(mrl=MRL_SIM)
    terminal.wait_for("Ctrl-C ends it; drive it .*: mrl drive --port /dev/")
    assert terminal.end(signal.SIGTERM) == 0


def test_below_roslaunch_there_is_no_next_command():
    """There it has the terminal, but a session of its own, and a node has the port."""
    ours, theirs = os.openpty()
    with subprocess.Popen(MRL_SIM, stdout=subprocess.PIPE, stderr=theirs, start_new_session=True) as started:
        os.close(theirs)
        started.stdout.readline()
        started.terminate()
    with pytest.raises(OSError):
        os.read(ours, 1)
    os.close(ours)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT])
def test_ends_cleanly_and_removes_its_link(tmp_path, number):
    link = tmp_path / "ttyTRAX0"
    with Simulator("--link", str(link)) as simulator:
        assert os.readlink(link) == simulator.path
        assert simulator.end(number) == 0
        assert not os.path.lexists(link)
        assert simulator.process.stderr.read() == ""


def test_goes_on_below_nohup_when_its_terminal_is_closed():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    with Simulator() as simulator, Client(simulator.path) as client:
        signal.signal(signal.SIGHUP, before)
        assert client.ask(b"@15e") == b"@15,0e\r\n"
        status = Path(f"/proc/{simulator.process.pid}/status").read_text()
        assert int(status.split("SigIgn:")[1].split()[0], 16) >> (signal.SIGHUP - 1) & 1


@pytest.mark.parametrize(
    "options, answer",
    [
        (("--environment", "--imu"), b"@29,2,4527e\r\n"),
        ((), b"@5,2500,172,1360,2,1e\r\n"),
        (("--robot", "stingbot"), b"@5,2500,172,1360,2,4e\r\n"),
        (("--id", "3"), b"@5,2500,172,1360,2,3e\r\n"),
        (("--profile", "2013-august"), b"@5,2500,172,1360,1,1e\r\n"),
        (("--engine", "avr"), b"@5,2500,172,1360,2,1e\r\n"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_options_of_the_board(options, answer):
    """Its time runs faster, for the old boards take 2 s to boot."""
    with Simulator("--speed", "4", *options) as simulator, Client(simulator.path) as client:
        assert client.ask(b"@29e" if answer.startswith(b"@29") else b"@5e") == answer


def test_log_holds_both_directions(tmp_path):
    log = tmp_path / "log.jsonl"
    with Simulator("--log", str(log)) as simulator, Client(simulator.path) as client:
        client.ask(b"@15e")
        simulator.end()
    rows = [json.loads(line) for line in log.read_text().splitlines()]
    assert [(row["from"], row["bytes"]) for row in rows] == [("host", "@15e"), ("board", "@15,0e\r\n")]


def test_survives_programs_that_die_and_come_back():
    with Simulator() as simulator:
        for _ in range(8):
            with Client(simulator.path) as client:
                client.send(b"@18,10e")
        with Client(simulator.path) as client:
            client.read_until(b"@8,")
            client.send(b"@19e@29e")
            client.read_until(b"@29,2,415e\r\n")


def test_survives_a_program_that_floods_and_never_reads():
    with Simulator() as simulator, Client(simulator.path) as client:
        end = time.monotonic() + 0.4
        while time.monotonic() < end:
            try:
                client.send(b"@5e\x80garbage@@1,,e" * 50)
            except BlockingIOError:
                time.sleep(0.01)
        client.read_until_quiet()
        assert client.ask(b"\r\n@15e") == b"@15,0e\r\n"


def test_opening_resets_the_board():
    with Simulator("--reset-on-open") as simulator:
        with Client(simulator.path) as client:
            client.ask(b"@15e")
            client.send(b"@16,1e")

        def was_reset():
            """The emulator notices an opening a little later; a request, or half of its answer, may fall into that."""
            with Client(simulator.path) as client:
                client.send(b"@15e")
                return client.read(0.3) == b"@15,0e\r\n"

        wait_until(was_reset, step_s=0.1)


def test_a_stopped_process_is_a_stall_of_the_board():
    """What waited is dropped, and the motors get a stop: reason 3."""
    with Simulator() as simulator, Client(simulator.path) as client:
        client.send(b"@11,100,0e")
        client.ask(b"@15e")
        simulator.process.send_signal(signal.SIGSTOP)
        time.sleep(0.5)
        client.send(b"@11,300,0e@16,1e")
        simulator.process.send_signal(signal.SIGCONT)
        assert client.ask_until(b"@15e", b"@15,").endswith(b"@15,0e\r\n")
        assert client.ask_until(b"@30e", b"@30,").endswith(b",3,0,0e\r\n")


@pytest.mark.parametrize(
    "options, text",
    [
        (("--robot", "nope"), f"robot 'nope' is unknown, expected {', '.join(models.packaged())}"),
        (("--speed", "nan"), "speed is nan, expected 0.01 to 1000 times real time"),
        (("--fault", "loss:rate=7"), "rate is '7', expected 0 to 1"),
        (("--plot", "run.gif"), "expected a file that ends in .png, .pdf, .svg"),
        (
            ("--engine", "avr", "--elf", "nope.elf"),
            "image nope.elf does not exist, expected an ELF or Intel HEX file; without --elf the packaged one runs",
        ),
        (("--engine", "avr", "--profile", "2013-august"), "expected --engine python"),
        (("--imu", "--profile", "2013-august"), "expected current: boards of 2013 have no IMU"),
        (("--truth", "/nope/truth"), "--truth /nope/truth cannot be written: No such file"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_a_wrong_option_is_one_line_and_exit_code_2(options, text):
    code, error = fail(*options)
    assert code == 2
    assert text in error
    assert error.startswith("mrl-sim: ")
    assert error.count("\n") == 1


def test_a_base_that_the_driver_refuses_is_not_served(tmp_path):
    with open(models.__file__.replace("__init__.py", "traxbot.yaml"), encoding="utf-8") as file:
        model = yaml.safe_load(file)
    model["drive"] = {"kind": "mecanum", "half_length_m": 0.2, "half_width_m": 0.15, "wheel_radius_m": 0.05}
    model["drive"].update(counts_per_turn=2000, full_speed_m_s=1.0)
    path = tmp_path / "four.yaml"
    path.write_text(yaml.safe_dump(model))
    code, error = fail("--robot", str(path))
    assert code == 2 and "wiring is empty, expected the pins of four motors on a Mega" in error


def test_an_error_with_a_code_shows_it():
    code, error = fail("--engine", "avr", "--elf", "/dev/null")
    assert code == 13 and error.endswith("[simulator_error]\n")


def test_a_full_disk_under_the_log_does_not_stop_the_board():
    with Simulator("--log", "/dev/full", "--truth", "/dev/full") as simulator, Client(
        simulator.path
    ) as client:
        assert client.ask(b"@15e") == b"@15,0e\r\n"
        client.ask(b"@15e")
        assert simulator.end() == 13
        assert "No space left" in simulator.process.stderr.read()
