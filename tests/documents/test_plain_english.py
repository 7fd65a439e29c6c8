"""The check for phrases that are hard to read."""

import pytest

from .plain_english import comments, files, findings, texts, without_code


@pytest.mark.parametrize(
    "text",
    [
        "a reply that is no frame",
        "Wait so long for the port",
        "a board\nwithout check\nvalue",
        "Surely reached",
        "who\ncannot move",
        "clear the way",
        "a wheel turns the wrong way",
        "Tell whether a port is open",
        "the port takes no more bytes",
        "on a slow line",
        "at most so fast",
        "the logs beside it",
    ],
)
def test_a_phrase_is_found_across_lines_and_in_any_case(text):
    assert len(list(findings(text))) == 1


@pytest.mark.parametrize(
    "text",
    [
        "There is no password",
        "it is no longer needed",
        "the cannot",
        "so longer",
        "anybody who can reach it",
        "an obstacle in the way",
        "a way to stop",
        "one line of text",
    ],
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


def test_comments_are_read():
    assert "# why" in texts("x = 1  # why\n")
    assert comments("int a;  // so\n// many\nint b; /* or\nmore */\n").split() == ["so", "many", "or", "more"]


def test_documents_modules_firmware_and_launch_files_are_checked():
    assert {path.suffix for path in files()} >= {".md", ".py", ".h", ".cpp", ".c", ".launch", ".mk"}
