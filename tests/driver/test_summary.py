"""Lines of a recording that are damaged, and a summary whose parts are known."""

from mrl_driver.recording import entry
from mrl_driver.recording.recording import Recording


def test_a_damaged_digit_of_a_time_costs_its_own_line(tmp_path):
    times = [f"{i / 50:.6f}" for i in range(100)]
    times[40] = "9" + times[40][1:]
    (tmp_path / "log").write_text("#mrl-recording 1 {}\n" + "".join(f"{each} < a\n" for each in times))
    recording = Recording(str(tmp_path / "log"))
    assert len(list(recording)) == 99
    assert recording.skipped == {42: "time 9.8 is after that of most of the 7 lines behind it"}


def test_a_line_that_is_too_long_is_skipped(tmp_path):
    long = b"0.5 < " + b"a" * entry.LONGEST_LINE
    (tmp_path / "log").write_bytes(b"#mrl-recording 1 {}\n0.1 < a\n" + long + b"\n0.6 < b\n")
    recording = Recording(str(tmp_path / "log"))
    assert [each.data for each in recording] == [b"a", b"b"]
    assert recording.skipped == {3: f"longer than {entry.LONGEST_LINE} bytes"}
