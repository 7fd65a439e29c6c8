"""The documentation site (`make docs`) has every document, and the modules that programs import."""

import importlib
import re

import yaml

from .blocks import ROOT
from .test_public_names import PUBLIC

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


def test_the_site_names_every_document():
    found = [*ROOT.glob("*.md"), *(path for folder in FOLDERS for path in (ROOT / folder).rglob("*.md"))]
    documents = {path.relative_to(ROOT).as_posix() for path in found if SITE not in path.parents}
    assert documents - set(NAMED) == set()


def test_the_site_names_its_own_pages():
    assert {path.relative_to(PAGES).as_posix() for path in PAGES.rglob("*.md")} - set(NAMED) == set()


def test_the_search_works_from_the_disk_without_another_host():
    """The plugin loads a stand-in for workers from another host unless one of this name is there."""
    assert "offline" in SETTINGS["plugins"] and (PAGES / "iframe-worker.js").is_file()
    assert SETTINGS["extra"]["polyfills"] == ["iframe-worker.js"]


def test_the_site_describes_each_public_module():
    pages = [path.read_text(encoding="utf-8") for path in PAGES.rglob("*.md")]
    described = {module for page in pages for module in re.findall(r"^::: (\S+)$", page, re.M)}
    assert {importlib.import_module(module).__name__ for module in PUBLIC} - described == set()
