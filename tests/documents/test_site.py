"""Documents, their links and limits, and the site that has them all (`make docs`)."""

import functools
import importlib
import re

import pytest
import yaml

import mrl_driver
from mrl_driver.protocol.table import MOST_HOLDERS
from ros1_bridge.relay import relay_frames, topic_sender
from tests.compatibility.present import PUBLIC

from .blocks import ROOT, blocks

SITE = ROOT / "docs" / "site"
PAGES = SITE / "pages"
FOLDERS = ("docs", "firmware", "mrl_driver", "ros1_bridge", "sim_arduino", "tests")


def named(nav):
    """The paths of a part of the navigation, in its order."""
    if isinstance(nav, str):
        return [nav]
    return [path for each in (nav.values() if isinstance(nav, dict) else nav) for path in named(each)]


SETTINGS = yaml.safe_load((SITE / "mkdocs.yml").read_text(encoding="utf-8"))
NAMED = named(SETTINGS["nav"])


DOCUMENTS = sorted(
    [*ROOT.glob("*.md"), *(path for folder in FOLDERS for path in (ROOT / folder).rglob("*.md"))]
)


def test_the_site_names_every_document():
    documents = {path.relative_to(ROOT).as_posix() for path in DOCUMENTS if SITE not in path.parents}
    documents |= {path.relative_to(PAGES).as_posix() for path in PAGES.rglob("*.md")}
    assert documents - set(NAMED) == set()


def test_the_search_works_from_the_disk_without_another_host():
    """The plugin loads a stand-in for workers from another host unless one of this name is there."""
    assert "offline" in SETTINGS["plugins"] and (PAGES / "iframe-worker.js").is_file()
    assert SETTINGS["extra"]["polyfills"] == ["iframe-worker.js"]


def test_the_search_finds_a_code_as_it_is_printed():
    separator = next(each["search"]["separator"] for each in SETTINGS["plugins"] if "search" in each)
    assert "no_telemetry" in re.split(separator, "no data arrived from the robot  [no_telemetry]")


def test_the_site_describes_each_public_module():
    pages = [path.read_text(encoding="utf-8") for path in PAGES.rglob("*.md")]
    described = {module for page in pages for module in re.findall(r"^::: (\S+)$", page, re.M)}
    assert {importlib.import_module(module).__name__ for module in PUBLIC} - described == set()


def test_the_packages_example_is_the_readmes():
    example = next(each.text for each in blocks("README.md") if each.language == "python")
    assert example in (mrl_driver.__doc__ or "")


@functools.lru_cache(maxsize=None)
def anchors(path):
    """The anchors of a document, as GitHub makes them from its headings, and those that it sets itself."""
    text = re.sub(r"^```.*?^```", "", path.read_text(encoding="utf-8"), flags=re.S | re.M)
    headings = re.findall(r"^#+ (.*)$", text, re.M)
    made = {re.sub(r"[^\w\- ]", "", each.lower()).replace(" ", "-") for each in headings}
    return made | set(re.findall(r'<a id="(\w+)">', text))


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_somewhere(path):
    wrong = []
    for link in re.findall(r"\]\(([^)\s]+)\)", path.read_text(encoding="utf-8")):
        file, _, anchor = link.partition("#")
        target = path.parent / file if file else path
        if not link.startswith("http"):
            known = target.exists() and (not anchor or anchor in anchors(target.resolve()))
            wrong += [] if known else [link]
    assert wrong == []


def number(file, name):
    """A constant of a module that needs optional packages."""
    return int(re.search(rf"^(?:\w+, )*{name}\b.*?= .*?(\d+)", (ROOT / file).read_text(), re.M)[1])


@pytest.mark.parametrize(
    "words",
    [
        f"at most {number('mrl_driver/apps/web/messages.py', 'MOST_BYTES')} bytes",
        f"{number('mrl_driver/apps/web/client.py', 'MOST_PER_S')} messages and pings a second from each",
        "16 pages, 100 connections,",
        f"{topic_sender.MOST_RECEIVERS} connections",
        f"frames of at most {relay_frames.LONGEST_BYTES // (1 << 20)} MB",
        {4: "at most four holders"}[MOST_HOLDERS],
    ],
)
def test_limits_in_the_security_notes_are_those_of_the_code(words):
    assert words in (ROOT / "SECURITY.md").read_text(encoding="utf-8")


def test_pages_and_connections_are_limited_as_it_says():
    source = (ROOT / "mrl_driver/apps/web/server.py").read_text()
    assert "MOST_CLIENTS, MOST_CONNECTIONS = 16, 100" in source
