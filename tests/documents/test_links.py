"""Links between the documents lead to a file, and to a heading in it."""

import functools
import re

import pytest

from .blocks import ROOT

PATHS = sorted((*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("[frst]*/*.md")))


@functools.lru_cache(maxsize=None)
def anchors(path):
    """The anchors of a document, as GitHub makes them from its headings, and those that it sets itself."""
    text = re.sub(r"^```.*?^```", "", path.read_text(encoding="utf-8"), flags=re.S | re.M)
    headings = re.findall(r"^#+ (.*)$", text, re.M)
    made = {re.sub(r"[^\w\- ]", "", each.lower()).replace(" ", "-") for each in headings}
    return made | set(re.findall(r'<a id="(\w+)">', text))


@pytest.mark.parametrize("path", PATHS, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_somewhere(path):
    wrong = []
    for link in re.findall(r"\]\(([^)\s]+)\)", path.read_text(encoding="utf-8")):
        file, _, anchor = link.partition("#")
        target = path.parent / file if file else path
        if not link.startswith("http"):
            known = target.exists() and (not anchor or anchor in anchors(target.resolve()))
            wrong += [] if known else [link]
    assert wrong == []
