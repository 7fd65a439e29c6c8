"""What went wrong comes first: twenty drives with one fault each, and good ones as the control.

`python -m tests.review.holdout` drives many more, with other seeds, robots, worlds and faults.
"""

import pytest

from mrl_driver.driver.recorded import RecordedDriver
from mrl_driver.review.drive_data import read
from mrl_driver.review.findings import find

from .drives import Drive, record
from .faulty_drives import faulty, good

FAULTY = faulty()


@pytest.mark.parametrize("drive", FAULTY, ids=[each.name.replace(" ", "-") for each in FAULTY])
def test_the_fault_of_a_drive_comes_first(drive, tmp_path):
    path = str(tmp_path / "drive.mrl")
    record(drive, path)
    found = find(read(RecordedDriver(path)))
    assert [each.kind for each in found][:1] and found[0].kind in drive.expected
    assert found[0].data and 0.0 <= found[0].time_s <= drive.duration_s + 5.0


@pytest.mark.parametrize("seed", range(1, 21))
def test_a_good_drive_has_no_finding(seed, tmp_path):
    path = str(tmp_path / "drive.mrl")
    record(good(seed), path)
    assert find(read(RecordedDriver(path))) == []


def findings_of(drive, tmp_path):
    path = str(tmp_path / "drive.mrl")
    record(drive, path)
    return find(read(RecordedDriver(path)))


def test_answers_that_a_bad_cable_damages_are_not_lost_requests(tmp_path):
    drive = Drive("bytes lost both ways", board={"faults": ("loss:rate=0.005",)}, duration_s=13.0)
    assert [each.kind for each in findings_of(drive, tmp_path)] == ["bad_cable"]


def test_the_frame_that_proves_a_restart_has_its_cause(tmp_path):
    drive = Drive("reset", board={"faults": ("reset:at=4",)}, duration_s=8.0)
    assert findings_of(drive, tmp_path)[0].data.startswith(b"@30,0,0,2,")
