"""Figures in documents: each is marked once what it depends on has changed, and every experiment has some."""

import json

import pytest

from sim_arduino.experiments.cli import EXPERIMENTS
from tests.long.bench import figures, report

SUBJECT = ("part", "one.py")


@pytest.fixture
def tree(tmp_path):
    (tmp_path / "part").mkdir()
    for name in ("one.py", "part/two.py"):
        (tmp_path / name).write_text("x = 1\n")
    return tmp_path


@pytest.mark.parametrize(
    "change",
    [
        lambda tree: (tree / "part/two.py").write_text("x = 2\n"),
        lambda tree: (tree / "part/three.py").write_text(""),
        lambda tree: (tree / "part/two.py").rename(tree / "part/second.py"),
        lambda tree: (tree / "one.py").write_text("x = 1\n\n"),
    ],
    ids=["another byte", "another file", "another name", "a file alone"],
)
def test_a_subject_that_changes_has_another_hash(tree, change):
    before = figures.contents(SUBJECT, tree)
    change(tree)
    figures.contents.cache_clear()
    figures.bytes_of.cache_clear()
    assert figures.contents(SUBJECT, tree) != before


def test_documents_and_compiled_files_are_no_subject(tree):
    before = figures.contents(SUBJECT, tree)
    (tree / "part/README.md").write_text("It is.\n")
    (tree / "part/__pycache__").mkdir()
    (tree / "part/__pycache__/two.pyc").write_bytes(b"1")
    (tree / "other.py").write_text("")
    figures.contents.cache_clear()
    assert figures.contents(SUBJECT, tree) == before


def test_a_subject_that_is_not_there_is_an_error(tree):
    with pytest.raises(FileNotFoundError):
        figures.contents(("part", "nowhere.py"), tree)


def test_a_figure_that_a_bench_has_written_is_marked_once_its_subject_has_changed(tmp_path, monkeypatch):
    """Without a hash it is always marked."""
    table = figures.tables()["tip-over"]
    for name in ("KEPT", "FOLDER"):
        monkeypatch.setattr(report, name, tmp_path / name)
    monkeypatch.setattr(report, "KEEP", True)
    monkeypatch.setattr(report, "FAST", False)
    report.conclude("experiments", {"tip-over.tips_s": 1.0, "tip-over.unlisted": 2.0})
    kept = json.loads((tmp_path / "KEPT" / "experiments.json").read_text())
    written = kept["tip-over.tips_s"]
    assert figures.commits(table, [written]) == ""
    for changed in ({**written, "subject": "0"}, {"value": 1.0, "commit": written["commit"]}):
        assert figures.commits(table, [changed]) == written["commit"]


def test_each_experiment_has_figures():
    rows = {
        row.key for table in figures.tables().values() if table.file == "experiments" for row in table.rows
    }
    assert set(EXPERIMENTS) == {key.split(".")[0] for key in rows}
