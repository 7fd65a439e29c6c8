"""The page of a review, without a browser: what it holds, what it keeps of a long drive, and hostile texts."""

import base64
import hashlib
import json
from html.parser import HTMLParser

import numpy as np
import pytest

from mrl_driver.apps.review.charts import NEAR_S, reduced
from mrl_driver.apps.review.drive_data import Stop
from mrl_driver.apps.review.page import MOST_LISTED, MOST_REMARKS, frame_text, render
from mrl_driver.protocol import encode_reply, encode_request
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.protocol.table import SENSOR_BY_NAME

from .page_drives import COUNTS, FINDING, column, drive

MOST_BYTES = 1_000_000
HOSTILE = """</script><script>alert(1)</script><!--title--><!-- "><img src=x onerror='alert(2)'> </style>\u2028&lt;"""
PIXELS = SENSOR_BY_NAME["thermopile"].fields


class Tags(HTMLParser):
    """The elements of a page, and the text of each script and style."""

    def __init__(self, page):
        super().__init__(convert_charrefs=True)
        self.tags, self.contents, self.text = [], [], ""
        self._inside = ""
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        self._inside = tag
        self.contents += [""] * (tag in ("script", "style"))

    def handle_endtag(self, tag):
        self._inside = ""

    def handle_data(self, data):
        if self._inside in ("script", "style"):
            self.contents[-1] += data
        else:
            self.text += data


@pytest.fixture(scope="module")
def ten_minutes():
    return drive(600.0)


def curve_of(found, title, name):
    """Times and values of one curve of a reduced drive."""
    chart = next(each for each in found["charts"] if each["title"] == title)
    curve = next(each for each in chart["curves"] if each["name"] == name)
    return 0.001 * np.array(found["times"]), curve["step"] * np.array(curve["values"])


def test_the_page_has_findings_and_stops_without_javascript():
    text = Tags(render(drive(), [FINDING])).text
    finding = (FINDING.title, FINDING.text, FINDING.remedy, "At 42.00 s")
    for words in (
        *finding,
        "no new command arrived in time",
        "@8,2000,1900,100,200,645e",
        "right 2000 count",
    ):
        assert words in text
    page = render(drive(path="drive\udcff.mrl"), []).encode()
    assert b"No fault was found" in page and b"drive?.mrl" in page


def test_the_page_names_no_other_file_and_runs_only_its_own_scripts():
    page = Tags(render(drive(), [FINDING]))
    assert (
        page.tags
        and [attrs for _, attrs in page.tags if {"src", "href", "style", "action"} & set(attrs)] == []
    )
    assert [attrs for _, attrs in page.tags if any(name.startswith("on") for name in attrs)] == []
    policy = next(attrs["content"] for _, attrs in page.tags if attrs.get("http-equiv"))
    style, _, *scripts = page.contents
    for content in (style, *scripts):
        assert base64.b64encode(hashlib.sha256(content.encode()).digest()).decode() in policy
    assert policy.startswith("default-src 'none'") and "unsafe" not in policy


def test_texts_of_a_recording_add_no_element_to_the_page():
    def page(text):
        found = drive(
            path=f"{text}.mrl",
            started=text,
            port=text,
            remarks=[(1.0, text)],
            opened=[(0.0, text), (1.0, text)],
            garbage=[(1.0, "<", text, text.encode())],
            stops=[Stop(1.0, StopReason.STALL, text, "<", text.encode())],
            ranges={text: drive().ranges["front"]},
        )
        found = found._replace(model=found.model._replace(name=text))
        return Tags(render(found, [FINDING._replace(title=text, text=text, data=text.encode())]))

    harmless, hostile = page("harmless"), page(HOSTILE)
    assert [tag for tag, _ in hostile.tags] == [tag for tag, _ in harmless.tags]
    assert [set(attrs) for _, attrs in hostile.tags] == [set(attrs) for _, attrs in harmless.tags]
    assert hostile.contents[2:] == harmless.contents[2:] and HOSTILE in hostile.text
    assert HOSTILE in [
        curve["name"] for chart in json.loads(hostile.contents[1])["charts"] for curve in chart["curves"]
    ]


def test_the_longest_and_noisiest_drive_is_below_a_megabyte(ten_minutes):
    chance, t = np.random.default_rng(1), ten_minutes.poses.time_s

    def noise(size):
        return column(t, *chance.uniform(-size, size, (3, len(t))))

    imu = column(t, *chance.uniform(-9, 9, (5, len(t))))
    noisy = ten_minutes._replace(
        duration_s=36000.0,
        poses=noise(500.0),
        speeds=noise(3.0),
        imu=imu,
        sensors={"thermopile": column(t, *chance.uniform(0, 300, (len(PIXELS), len(t))))},
        delays=column(t, chance.uniform(0, 9, len(t))),
        stops=[
            Stop(float(s), StopReason.NO_TELEMETRY, "stopped: silent", "<", b"\xff" * 500)
            for s in range(3 * MOST_LISTED)
        ],
        remarks=[(1.0, "x" * 9999)] * 999,
    )
    findings = [FINDING._replace(time_s=float(10 * i)) for i in range(100)]
    page = render(noisy, findings)
    assert len(page.encode()) < MOST_BYTES
    assert f"{2 * MOST_LISTED} further stops are not listed" in page
    assert (
        page.count('class="found"') == MOST_LISTED + len(findings)
        and page.count("<dt>1.00 s</dt>") == MOST_REMARKS
    )


def test_a_peak_of_one_frame_is_kept_and_all_telemetry_near_a_finding(ten_minutes):
    speeds = ten_minutes.speeds.values.copy()
    speeds[12345] = 1.234, -3.0, 0.0
    spiked = ten_minutes._replace(speeds=ten_minutes.speeds._replace(values=speeds))
    times, driven = curve_of(reduced(spiked, [FINDING.time_s]), "Speed", "driven")
    assert np.max(driven) == pytest.approx(1.234)
    assert times[np.argmax(driven)] == pytest.approx(ten_minutes.speeds.time_s[12345], abs=0.2)
    near = np.abs(ten_minutes.speeds.time_s - FINDING.time_s) < NEAR_S - 0.1
    kept = np.isin(np.rint(times * 1000), np.rint(ten_minutes.speeds.time_s[near] * 1000))
    assert np.count_nonzero(kept) == np.count_nonzero(near) > 0
    assert driven[kept] == pytest.approx(ten_minutes.speeds.values[near, 0], abs=0.0006)
    times = 0.001 * np.array(reduced(ten_minutes, [1.0, 42.0, 599.9, 42.5])["times"])
    assert np.all(np.diff(times) >= 0) and times[0] == 0.0


def test_a_frame_is_explained():
    counts = "read_encoders_and_sonars: right 2000 count, left 1900 count, front 100 cm, left 200 cm"
    assert counts in frame_text("<", COUNTS)
    move = encode_request(11, 250, -100, checked=True)
    assert frame_text(">", move) == "move_differential: linear 250 mm/s, angular -100 mrad/s"
    status = frame_text("<", encode_reply(30, 0, 20, 1, 8, 5, 0))
    assert "uptime 20 s, reset_cause power_on, " in status
    assert "stop_reason encoder, faults motor_board eeprom, clamped 0" in status
    assert "not a valid frame" in frame_text("<", b"@8,1\xffe")
