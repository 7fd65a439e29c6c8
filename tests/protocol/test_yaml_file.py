"""YAML that people write: whatever is wrong with it is one line with file and line."""

import pytest

from mrl_driver.errors import ConfigError
from mrl_driver.yaml_file import read, read_expected


def fault_of(tmp_path, text):
    path = tmp_path / "robot.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError) as caught:
        read(str(path))
    words = str(caught.value)
    assert (
        words.startswith(f"{path}: ") and len(words.splitlines()) == 1 and len(words) < len(str(path)) + 200
    )
    return words[len(str(path)) + 2 :]


@pytest.mark.parametrize(
    "value",
    [
        "!!timestamp x",
        '!!int "_"',
        "!!int 0x",
        "!!bool x",
        '!!float ""',
        "2020-01-99",
        "!!python/name:os.system",
    ],
)
def test_a_value_that_does_not_fit_its_tag(tmp_path, value):
    assert fault_of(tmp_path, f"name: one\nids: [{value}]\n").startswith("line 2: ")


@pytest.mark.parametrize(
    "digits", ["0x" + "f" * 6000, "9" * 6000, "1" + ":59" * 2000, "!!int '" + "1" * 6000 + "'"]
)
def test_a_number_beyond_all_sense(tmp_path, digits):
    """Python takes long to read one of a megabyte, in base 60 half a minute."""
    assert "characters are too many for tag:yaml.org,2002:int" in fault_of(tmp_path, f"name: {digits}")


@pytest.mark.parametrize(
    ("digits", "meaning"), [("0700", "448"), ("-012", "-10"), ("7:17", "437"), ("1:30.5", "90.5")]
)
def test_a_number_that_is_not_decimal(tmp_path, digits, meaning):
    """A pin 010 was pin 8, and gains of 0700 were 448."""
    words = f"{digits} means {meaning} in base 8 or 60, expected a decimal number"
    assert fault_of(tmp_path, f"name: one\nkp: {digits}\n") == f"line 2: no YAML: {words}"


@pytest.mark.parametrize("text", ["name: a\nids: [1]\nname: b\n", "drive: {}\nsonars:\n  x: 1\n  x: 1\n"])
def test_a_key_that_stands_twice(tmp_path, text):
    line = len(text.splitlines())
    assert fault_of(tmp_path, text).startswith(f"line {line}: ") and "stands twice" in fault_of(
        tmp_path, text
    )


def test_the_same_key_in_two_mappings_is_none_twice(tmp_path):
    path = tmp_path / "robot.yaml"
    path.write_text("a: {x: 1}\nb: {x: 2}\n")
    assert read(str(path)) == {"a": {"x": 1}, "b": {"x": 2}}


@pytest.mark.parametrize(
    ("path", "problem"), [("/dev/zero", "it is not a plain file"), ("a\0b", "its name holds a zero byte")]
)
def test_only_plain_files_are_read(path, problem):
    with pytest.raises(ConfigError, match=f"{problem}, expected a robot"):
        read_expected(path, "a robot")


def test_a_long_file_is_refused(tmp_path):
    path = tmp_path / "robot.yaml"
    path.write_bytes(b"#" * ((1 << 19) + 1))
    with pytest.raises(ConfigError, match="it is longer than 524288 bytes, expected a robot"):
        read_expected(str(path), "a robot")


def test_bytes_that_are_not_text(tmp_path):
    path = tmp_path / "robot.yaml"
    path.write_bytes(b"name: \xff")
    with pytest.raises(ConfigError, match="no YAML: .*utf-8"):
        read(str(path))


@pytest.mark.parametrize("text", ["a:\n\t- 1", "\ta: 1", "a:\n  b: 1\n  \tc: 2", "- \ta: 1\n  b: 2"])
def test_a_tab_is_named(tmp_path, text):
    assert "a tab, expected spaces" in fault_of(tmp_path, text)
