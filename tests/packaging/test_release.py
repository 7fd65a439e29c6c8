"""What `make release` refuses, in a small repository with compilers that only know their version."""

import os
import re
import subprocess

import pytest

from tests.packaging import release

FILES = {
    "package.xml": "<package><version>1.2.3</version></package>\n",
    "CITATION.cff": "title: x\nversion: 1.2.3\ndate-released: 2026-11-24\n",
    "CHANGELOG.md": "# Changelog\n\n## 1.2.3 (2026-11-24)\n\n## 1.2.2 (2026-01-31)\n",
}
"""A tree that may be released."""


def git(tree, *words):
    who = ("-c", "user.name=x", "-c", "user.email=x@example.org")
    subprocess.run(("git", *who, *words), cwd=tree, check=True, stdout=subprocess.DEVNULL)


@pytest.fixture
def tree(tmp_path):
    tree = tmp_path / "tree"
    git(tmp_path, "init", "-q", str(tree))
    for name, text in FILES.items():
        (tree / name).write_text(text)
    git(tree, "add", ".")
    git(tree, "commit", "-q", "-m", "x")
    return tree


@pytest.fixture
def compiler(tmp_path, monkeypatch):
    """Puts an avr-gcc and an avr-g++ of given versions in front of others."""

    def put(gcc, gxx):
        for name, version in (("avr-gcc", gcc), ("avr-g++", gxx)):
            (tmp_path / name).write_text(f"#!/bin/sh\necho {version}\n")
            (tmp_path / name).chmod(0o755)

    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    return put


def refusal(check, tree):
    """The line that a check ends the release with."""
    with pytest.raises(release.Refused) as refused:
        check(tree)
    assert "\n" not in str(refused.value)
    return str(refused.value)


@pytest.mark.parametrize("name", ["package.xml", "new.py"])
def test_a_file_that_is_not_committed_is_refused(tree, name):
    (tree / name).write_text("")
    assert f"1 changes are not committed ({name}), expected none" in refusal(release.require_clean, tree)


@pytest.mark.parametrize("gcc, gxx, named", [("5.4.0", "14.2.0", "avr-g++"), ("7.3.0", "5.4.0", "avr-gcc")])
def test_another_compiler_is_refused_with_its_version(tree, compiler, gcc, gxx, named):
    compiler(gcc, gxx)
    got = {"avr-gcc": gcc, "avr-g++": gxx}[named]
    assert f"{named} is version {got}, expected 5.4" in refusal(release.require_compiler, tree)


@pytest.mark.parametrize(
    "heading",
    ["## Unreleased", "## 1.2.3", "## 1.2.2 (2026-11-24)", "## 1.2.3 (2026-13-24)", "## 1x2.3 (2026-11-24)"],
)
def test_a_changelog_without_the_dated_version_is_refused(tree, heading):
    (tree / "CHANGELOG.md").write_text(f"# Changelog\n\n{heading}\n\n{FILES['CHANGELOG.md']}")
    assert f"begins with '{heading}', expected '## 1.2.3 (" in refusal(release.require_changelog, tree)


@pytest.mark.parametrize(
    "key, got, expected", [("version", "1.2.2", "1.2.3"), ("date-released", "2026-01-31", "2026-11-24")]
)
def test_a_citation_of_another_version_or_date_is_refused(tree, key, got, expected):
    (tree / "CITATION.cff").write_text(FILES["CITATION.cff"].replace(expected, got))
    assert f"has {key} {got}, expected {expected}" in refusal(release.require_citation, tree)


def test_a_tag_on_another_commit_is_refused(tree):
    git(tree, "tag", "-a", "-m", "x", "v1.2.3")
    git(tree, "commit", "-q", "--allow-empty", "-m", "y")
    assert re.search(
        r"the tag v1\.2\.3 is on [0-9a-f]+, expected [0-9a-f]+", refusal(release.require_free_tag, tree)
    )


def test_citation_and_changelog_have_the_version_and_its_date():
    release.require_citation(release.ROOT)
