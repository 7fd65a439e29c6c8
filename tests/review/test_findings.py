"""What went wrong comes first: twenty drives with one fault each, and good ones as the control.

`python -m tests.review.holdout` drives many more, with other seeds, robots, worlds and faults.
"""

import pytest

from mrl_driver.driver.recorded import RecordedDriver
from mrl_driver.review.drive_data import read
from mrl_driver.review.findings import find

from .drives import record
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
