"""The check for phrases that are hard to read."""

import pytest

from .plain_english import NOT_YET, ROOT, findings, texts, without_code


@pytest.mark.parametrize(
    "text",
    [
        "a reply that is no frame",
        "Wait so long for the port",
        "a board\nwithout check\nvalue",
        "Surely reached",
        "who\ncannot move",
    ],
)
def test_a_phrase_is_found_across_lines_and_in_any_case(text):
    assert len(list(findings(text))) == 1


@pytest.mark.parametrize(
    "text", ["There is no password", "it is no longer needed", "the cannot", "so longer"]
)
def test_plain_words_are_not_found(text):
    assert list(findings(text)) == []


def test_code_in_a_document_is_not_read():
    assert "told" not in without_code("a `told` b\n```python\ntold = 1\n```\n")


def test_docstrings_help_and_errors_are_read():
    source = (
        '"""One."""\n\ndef f(x):\n    """Two."""\n    raise E(f"three {x}") if x else option(help="four")\n'
    )
    assert sorted(texts(source)) == ["One.", "Two.", "four", "three "]


def test_files_that_are_not_rewritten_yet_exist():
    assert [name for name in NOT_YET if not (ROOT / name).exists()] == []
