"""`mrl measure` on an emulated board: the command, its file and its page, comparisons, and the cable that is pulled."""

import contextlib
import errno
import json
import math
import os
import pathlib

import pytest

from mrl_driver.apps.measure import command, host, line, report
from mrl_driver.apps.measure.rows import (
    AGREES,
    BETTER,
    HOST,
    KINDS,
    LINE,
    REPORTED,
    WORSE,
    Row,
    absent,
    causes,
    compared,
    failed,
    keys_of,
    kind_of,
)  # fmt: skip
from mrl_driver.driver import Driver, Options
from mrl_driver.driver.simulated import SteppedDriver, SteppedLink
from mrl_driver.errors import ConfigError
from mrl_driver.files import unwritable
from mrl_driver.json_text import json_text
from mrl_driver.problems import PROBLEMS
from mrl_driver.protocol.table import BY_NAME
from mrl_driver.session.handshake import Board
from sim_arduino.serve import factory
from sim_arduino.testing import EmulatedBoard
from tests.cli.run import fails, mrl
from tests.cli.terminal import Terminal

FIGURES = pathlib.Path(__file__).resolve().parents[2] / "docs" / "figures"
ROWS = [
    compared(Row("stream_hz", 430.0), ""),
    compared(Row("watchdog_ms", 499.0), ""),
    compared(Row("frames_damaged", 0), ""),
    Row("driver_cpu_percent", 3.0),
    absent("lost_ms", "nobody was there"),
]


def result(rows=ROWS, about="<b>Uno</b>"):
    """A measurement."""
    return report.record(rows, {"robot": "duo", "robot_id": 23}, [], about)


@pytest.fixture
def files(tmp_path):
    """Writes measurements, and returns their paths."""

    def write(name, rows):
        path = tmp_path / name
        path.write_text(json_text(result(rows)))
        return path

    return write


@pytest.mark.parametrize(
    ("value", "verdict"),
    [(420.0, WORSE), (421.0, AGREES), (451.0, AGREES), (452.0, BETTER)],
)
def test_a_row_is_judged_by_its_tolerance_in_its_direction(value, verdict):
    assert Row("stream_hz", value, 436.0).verdict == verdict


def test_firmware_rows_are_compared_with_the_figure_of_their_build():
    figures = json.loads((FIGURES / "firmware.json").read_text())
    for kind in ("", "_hbridge", "_2013"):
        figure = figures[f"info_turnaround_us_median{kind}"]["value"]
        assert compared(Row("turnaround_info_us", 2000.0), kind).emulated == pytest.approx(figure, rel=1e-3)


def test_a_row_without_an_emulated_figure_keeps_what_it_expected():
    row = Row("turnaround_status_us", 2100.0, 2040.0)
    assert compared(row, "_hbridge") == row


@pytest.mark.parametrize(
    ("capabilities", "verdict"), [((), WORSE), (("bridge",), WORSE), (("bridge", "virtual"), AGREES)]
)
def test_only_a_virtual_board_may_have_passes_of_a_third_of_a_millisecond(capabilities, verdict):
    """A frame at either end of a gap may wait for one."""
    kind = kind_of(Board(23, 2, 0.0, 12.0, 25.0, 2, frozenset(capabilities)))
    row = compared(Row("stream_jitter_us", 384.0 + 2 * 64.0), kind)
    assert row.verdict == verdict and row.emulated is not None


@pytest.mark.parametrize("key", KINDS)
def test_each_kind_of_row_names_a_cause_that_is_explained_or_is_only_reported(key):
    kind = KINDS[key]
    assert kind.cause in PROBLEMS or math.isinf(kind.tolerance)


@contextlib.contextmanager
def simulated(**options):
    """An emulated robot, its link, and the line of a measurement."""
    with contextlib.closing(factory.make(factory.Options(**options))) as made:
        link = SteppedLink(made.engine)
        yield made, link, line.Line(link, lambda: link.now_s)


@pytest.mark.parametrize(
    ("wheels_s", "cause"),
    [((0.0, 0.0), "wheels_powerless"), ((0.0, 900.0), "wheel_dead"), ((900.0, 0.0), "wheel_dead")],
)
def test_a_watchdog_is_not_timed_by_wheels_that_stand_and_is_turned_off_again(monkeypatch, wheels_s, cause):
    monkeypatch.setattr(line, "way", lambda *_, **__: line.Way(0.0, wheels_s))
    with simulated(robot="duo") as (made, _, bare):
        assert line.watchdog(bare).likely == cause and made.engine.watchdog_ms == 0


@pytest.mark.parametrize("profile", ["current", "2013-august"])
def test_a_stop_is_not_timed_by_a_wheel_that_is_blocked(profile):
    options = factory.Options("traxbot", profile=profile, faults=("wheel_blocked:wheel=left",))
    with contextlib.closing(factory.make(options)) as made, SteppedDriver(made.engine) as driver:
        row = host.stops(driver, moves=True)
    assert row.likely == "wheel_dead"


@pytest.mark.parametrize("robot", ["omni", "duo", "stingbot"])
def test_a_stop_is_timed_by_wheels_that_turn(robot):
    """The rear one of three does not, straight ahead."""
    with contextlib.closing(factory.make(factory.Options(robot))) as made, SteppedDriver(
        made.engine
    ) as driver:
        assert host.stops(driver, moves=True).verdict == AGREES


def test_a_rate_that_a_board_of_2013_does_not_promise_is_only_reported():
    options = factory.Options("traxbot", profile="2013-august")
    with contextlib.closing(factory.make(options)) as made, SteppedDriver(made.engine) as driver:
        rows = {row.key: row for row in host.rows(driver, moves=False)}
    assert rows["telemetry_hz"].verdict == REPORTED


def test_a_value_that_is_no_number_is_worse():
    assert Row("stream_hz", math.nan, 430.0).verdict == WORSE


@pytest.mark.parametrize("robot", ["traxbot", "duo"])
def test_a_robot_stands_after_an_interruption_also_if_a_stop_is_damaged(monkeypatch, robot):
    """The watchdog must not be turned off while the wheels still turn."""
    stops = []

    def interrupted(bare, speed_mm_s, seconds):
        for _ in range(10):
            bare.send("move_differential", speed_mm_s, 0)
            list(bare.heard(line.FEED_S))
        raise KeyboardInterrupt

    with simulated(robot=robot, world="square", footprint="none") as (made, link, _):
        write = link.write

        def damage_the_first_stop(data):
            if data.startswith(b"@13") and made.plant.true_pose.x_m > 0.01:
                stops.append(data)
            write(data[:-1] if len(stops) == 1 else data)

        monkeypatch.setattr(link, "write", damage_the_first_stop)
        monkeypatch.setattr(line, "_roll", interrupted)
        with pytest.raises(KeyboardInterrupt):
            list(line.rows(link, lambda: link.now_s, moves=True))
        here_m = made.plant.true_pose.x_m
        link.skip(5.0)
        assert made.plant.true_pose.x_m == pytest.approx(here_m, abs=1e-3)
        assert set(stops) == {b"@13e"} and made.engine.watchdog_ms == 0


def test_a_watchdog_whose_measurement_is_interrupted_is_turned_off_again(monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(line, "way", interrupted)
    with contextlib.closing(factory.make(factory.Options("duo"))) as made:
        link = SteppedLink(made.engine)
        with pytest.raises(KeyboardInterrupt):
            list(line.rows(link, lambda: link.now_s, moves=True))
        link.skip(0.1)
        assert made.engine.watchdog_ms == 0


def test_a_stream_of_an_old_board_that_ends_at_once_is_worse(monkeypatch):
    monkeypatch.setattr(line, "streamed", lambda *_: line.Streamed([], 0.0, []))
    assert line.plain_stream(line.Line(None, lambda: 0.0, old=True)).verdict == WORSE


@pytest.mark.parametrize("key", ["full_speed", "full_stop"])
def test_what_was_not_reached_is_worse_in_each_direction(key):
    assert failed(key, "stopped early", "encoder_dead").verdict == WORSE


def test_causes_that_explain_others_are_named_alone():
    rows = [Row("turnaround_info_us", 9000.0), Row("host_late_ms", 80.0), Row("delay_ms", 80.0)]
    rows.append(failed("wheels_alike", "no data arrived from the robot", "no_telemetry"))
    assert [each.code for each in causes(rows)] == ["late_host"]


def test_the_page_is_complete_and_escapes_words_of_the_user():
    page = report.render(result())
    assert "&lt;b&gt;Uno" in page and "<b>Uno" not in page
    assert "<!--" not in page and "499 ms" in page and "worse by 249 ms" in page
    assert "mrl flash" in page and "default-src 'none'" in page and "<script" not in page


def test_a_terminal_shows_each_row_with_its_verdict():
    text = "\n".join(report.lines(result()))
    assert "worse by 249 ms" in text and "not measured: nobody was there" in text and REPORTED in text
    assert text.endswith(
        "1 of 3 rows are worse; first likely cause: no_watchdog: upload the current firmware with: mrl flash "
        "--port PORT"
    )


def test_a_result_that_is_not_whole_says_how_much_was_not_measured():
    assert report.verdict(result([ROWS[0], *ROWS[2:]])).endswith(
        "are as they should be; 1 were not measured."
    )


def test_no_line_is_longer_than_a_narrow_terminal():
    assert max(map(len, "\n".join(report.lines(result(), 60)).splitlines())) <= 60


def test_two_measurements_are_compared_row_by_row(files):
    first, second = (
        files("a.json", ROWS),
        files("b.json", [Row("stream_hz", 380.0), Row("frames_damaged", 0)]),
    )
    done = mrl("measure", "--compare", first, second)
    assert done.returncode == 0
    first, second, stream, damaged, watchdog, cpu = done.stdout.splitlines()
    assert first.startswith("A: <b>Uno</b>, duo, 20") and second.startswith("B: ")
    assert "differs by -50 Hz" in stream and "the same" in damaged
    assert watchdog.endswith("only in A") and cpu.endswith("only in A")


def test_a_comparison_says_that_boards_are_of_different_kinds():
    other = {**result(), "board": {"robot": "traxbot"}}
    assert "different kinds" in "\n".join(report.comparison(report.compared(result(), other)))


def test_a_row_without_bound_differs_from_one_with_a_value_and_not_from_itself(files):
    """No speed was smooth, or a wheel failed: the value is infinite."""
    first, second = (files(f"{value}.json", [Row("slowest_mm_s", value, 30)]) for value in (30, math.inf))
    assert mrl("measure", "--compare", first, second).stdout.endswith("differs\n")
    assert mrl("measure", "--compare", second, second).stdout.endswith("the same\n")


@pytest.mark.parametrize(
    "text",
    [
        *("", "[]", '{"format": 2}', '{"format": 1, "rows": [{"key": 1}]}', "[" * 9999, '{"rows": []}'),
        json_text({name: value for name, value in result().items() if name != "mrl_driver"}),
        json_text({**result(), "board": "duo"}),
    ],
)
def test_a_file_that_is_no_measurement_is_refused(tmp_path, text):
    path = tmp_path / "a.json"
    path.write_text(text)
    with pytest.raises(ConfigError, match="is not a measurement"):
        report.load(str(path))
    assert "is not a measurement" in fails(2, "measure", "--compare", path, path)


def test_a_file_of_another_format_names_the_version_that_wrote_it(tmp_path):
    path = tmp_path / "a.json"
    path.write_text(json_text({**result(), "format": 2, "mrl_driver": "9.1"}))
    said = fails(2, "measure", "--compare", path, path)
    assert "format 2 of mrl-driver 9.1, expected format 1" in said


def test_a_standing_board_is_measured_and_nothing_moves(tmp_path):
    """How fast this computer is, is not judged here: it may be busy."""
    path = tmp_path / "board.json"
    with EmulatedBoard(robot="duo") as board:
        done = mrl("measure", "--port", board.port, "-o", path, "--about", "emulated", "--json")
        assert board.true_pose == (0.0, 0.0, 0.0)
    found = json.loads(done.stdout)
    rows = {each["key"]: each for each in report.load(str(path))["rows"]}
    assert found["about"] == "emulated" and found["board"]["robot"] == "duo"
    assert set(rows) == {key for key in KINDS if KINDS[key].section in ("The line", "This computer")}
    assert rows["frames_damaged"]["value"] == rows["frames_lost"]["value"] == 0
    assert "--wheels-off-ground" in rows["watchdog_ms"]["note"] and rows["lost_ms"]["value"] is None
    assert (tmp_path / "board.html").read_text().startswith("<!doctype html>")


def test_a_cable_that_is_pulled_and_plugged_in_again_is_timed(tmp_path):
    link = tmp_path / "tty"
    with EmulatedBoard(robot="duo") as board:
        link.symlink_to(board.port)
        asked = []

        def hand(question):
            asked.append(question)
            turn = board.faults.unplug if len(asked) == 1 else back
            turn()
            return lambda: False

        def back():
            board.faults.plug()
            board.wait_until(lambda: os.path.exists(board.port))
            link.unlink()
            link.symlink_to(board.port)

        with Driver(str(link), options=Options(reconnect=True)) as driver:
            lost, back = host.unplugged(driver, str(link), hand)
    assert "Pull" in asked[0] and "Plug" in asked[1]
    assert 0 <= lost.value < 5000 and 0 <= back.value < 60


@pytest.mark.parametrize("pulled", [False, True])
def test_a_cable_that_is_not_pulled_or_does_not_return_is_not_waited_for_longer_than_a_minute(
    pulled, monkeypatch
):
    with EmulatedBoard(robot="duo") as board, Driver(board.port, options=Options(reconnect=True)) as driver:
        monkeypatch.setattr(host, "MOST_PULL_S", 0.5)

        def hand(question):
            if pulled:
                board.faults.unplug()
            return lambda: False

        *_, back = host.unplugged(driver, board.port, hand)
    assert back == absent("return_s", "the board did not return" if pulled else "the cable was not pulled")


def test_who_refuses_to_pull_the_cable_is_not_waited_for():
    with EmulatedBoard(robot="duo") as board, Driver(board.port) as driver:
        start_s = driver.now_s
        assert [row.value for row in host.unplugged(driver, board.port, lambda text: lambda: True)] == [
            None
        ] * 2
        assert driver.now_s - start_s < host.MOST_PULL_S / 2


@pytest.fixture
def short(monkeypatch):
    """All that is measured with the driver and on the line is measured a few times."""
    monkeypatch.setattr(host, "WAITS", 5)
    monkeypatch.setattr(host, "STOPS", 1)
    monkeypatch.setattr(line, "REQUESTS", 5)
    monkeypatch.setattr(line, "STREAM_S", 0.3)
    monkeypatch.setattr(line, "CLOCK_S", 0.5)
    monkeypatch.setattr(line, "ANSWER_S", 0.2)


def test_a_board_of_2013_is_measured_as_far_as_it_can(tmp_path, short):
    path = tmp_path / "a.json"
    with EmulatedBoard(profile="2013-august") as board:
        mrl("measure", "--port", board.port, "-o", path)
    rows = {each["key"]: each for each in report.load(str(path))["rows"]}
    measured = {"first_answer_s", "turnaround_info_us", "turnaround_encoders_us", "stream_hz", "telemetry_hz"}
    assert all(rows[key]["value"] is not None for key in measured)
    assert rows["watchdog_ms"]["value"] is None and "firmware of 2013" in rows["watchdog_ms"]["note"]
    assert rows["turnaround_info_us"]["emulated"] == pytest.approx(6442)


@pytest.mark.parametrize(("part", "name"), [(host, "stops"), (line, "turnaround"), (line, "plain_stream")])
def test_what_was_measured_before_a_board_fell_silent_is_written(part, name, tmp_path, short, monkeypatch):
    path, measured = tmp_path / "a.json", getattr(part, name)
    with EmulatedBoard(robot="duo") as board:

        def silent(*args):
            board.faults.freeze(1e6)
            if part is host:
                args[0].ask(BY_NAME["get_stream"].code)
            return measured(*args)

        monkeypatch.setattr(part, name, silent)
        said = fails(10, "measure", "--port", board.port, "-o", path)
    rows = {each["key"]: each for each in report.load(str(path))["rows"]}
    assert "board_timeout" in said and set(rows) == {*keys_of(LINE, HOST)}
    assert rows["host_late_ms"]["value"] is not None and rows["stream_hz"]["note"] in said
    assert (tmp_path / "a.html").exists()


def test_ctrl_c_at_a_question_stops_the_motors_and_writes_what_was_measured(tmp_path):
    with EmulatedBoard(robot="duo") as board:
        command = "measure", "--port", board.port, "--wheels-off-ground", "-o", tmp_path / "a.json"
        terminal = Terminal(*command)
        terminal.answer("Pull the cable", "\x03")
        assert terminal.end() == 130
        board.motors.assert_stopped()
    rows = {each["key"]: each for each in report.load(str(tmp_path / "a.json"))["rows"]}
    assert (
        rows["stop_confirmed_ms"]["value"] > 0
        and rows["stream_hz"]["note"] == "interrupted; the robot was stopped"
    )


def test_an_older_result_is_not_replaced_without_a_yes(tmp_path):
    path = tmp_path / "a.json"
    path.write_text("monday")
    assert "already exists" in fails(2, "measure", "--port", "tcp://x:1", "-o", path)
    assert path.read_text() == "monday"


def test_a_folder_is_not_a_file_for_the_result(tmp_path):
    path = tmp_path / "a.json"
    path.mkdir()
    assert "is not a plain file" in fails(2, "measure", "--port", "x", "-o", path)


def test_a_full_disk_does_not_take_the_figures(tmp_path, short, monkeypatch):
    def full(path, content):
        raise unwritable(path, OSError(errno.ENOSPC, "No space left on device"))

    monkeypatch.setattr(command, "replace_file", full)
    with EmulatedBoard(robot="duo") as board:
        done = mrl("measure", "--port", board.port, "-o", tmp_path / "a.json")
    assert done.returncode == 15 and done.stderr.count("\n") == 1 and "No space left" in done.stderr
    assert "stop to its confirmation" in done.stdout


def test_a_cable_that_nobody_pulls_is_said(monkeypatch):
    rows = list(host.unplugged(None, "/dev/null", None))
    assert [row.value for row in rows] == [None, None] and "nobody" in rows[0].note
