"""`mrl review`: a recording to a page, and its findings for people and programs."""

import json

import pytest

from mrl_driver.driver import Options
from mrl_driver.driver.simulated import SteppedDriver
from sim_arduino.serve import factory

from .run import fails, mrl


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """Two seconds ahead in simulated time, and a stop."""
    path = tmp_path_factory.mktemp("drive") / "drive.mrl"
    emulated = factory.make(factory.Options(robot="traxbot", seed=1))
    with SteppedDriver(emulated.engine, options=Options(record=str(path))) as robot:
        for _ in range(20):
            robot.drive(0.2, 0.0)
            robot.wait(0.1)
        robot.stop()
        robot.wait(0.3)
    emulated.close()
    return path


def test_the_page_is_written_next_to_the_recording(recording):
    done = mrl("review", recording)
    page = recording.with_suffix(".html")
    assert done.returncode == 0 and done.stdout.splitlines()[-1].endswith(str(page))
    assert "Review of drive.mrl" in page.read_text(encoding="utf-8")


def test_programs_get_findings_and_stops(recording, tmp_path):
    page = tmp_path / "page.html"
    done = mrl("review", recording, "-o", page, "--json")
    found = json.loads(done.stdout)
    assert (found["page"], found["robot"], found["findings"]) == (str(page), "traxbot", [])
    stop = found["stops"][0]
    assert (stop["reason"], stop["direction"], stop["data"]) == ("user", ">", "@13e")
    assert stop["time_s"] == pytest.approx(2.0, abs=0.2) and page.exists()


def test_the_page_never_replaces_the_recording(recording):
    before = recording.read_bytes()
    assert "would replace the recording" in fails(2, "review", recording, "-o", recording)
    assert recording.read_bytes() == before
