"""Hook of MkDocs: the site takes each document from its own place in the repository, with its pictures and sources.

Documents keep their relative paths, and so do the files that they link to.  Pictures and layouts are copied.  Of any
other file the site has a page with its text: the site needs no repository on the network.
"""

import pathlib
import posixpath
import re
from typing import Any, Iterator

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files, InclusionLevel
from mkdocs.structure.pages import Page
from pymdownx.slugs import slugify

ROOT = pathlib.Path(__file__).resolve().parents[2]
COPIED = {".png", ".svg", ".json", ".xml"}
"""Files that a browser shows or a program loads."""
BOOSTS = {"docs/troubleshooting.md": 4, "api/": 0.5, "tests/": 0.5}
"""Of a document or a folder in the search: who looks for a message or its code wants the remedy first."""
_LINK = re.compile(r"\]\(([^)\s#]+)")


def on_config(config: MkDocsConfig) -> None:
    """Headings get the anchors that GitHub gives them."""
    config.mdx_configs["toc"]["slugify"] = slugify(case="lower")


def on_files(files: Files, config: MkDocsConfig) -> None:
    """Adds the documents of `nav`, and the files that they link to."""
    documents = {path for path in _paths(config.nav) if (ROOT / path).is_file()}
    for path in documents:
        files.append(File.generated(config, path, abs_src_path=str(ROOT / path)))
    linked = {_target(path, link) for path in documents for link in _LINK.findall(_read(path))} - documents
    for path in sorted(linked):
        if not (ROOT / path).is_file():
            continue  # MkDocs names a link that leads nowhere
        if pathlib.PurePath(path).suffix in COPIED:
            files.append(File.generated(config, path, abs_src_path=str(ROOT / path)))
        else:
            text = f"---\nsearch: {{exclude: true}}\n---\n# {path}\n\n~~~~~~{_language(path)}\n{_read(path)}\n~~~~~~\n"
            page = File.generated(config, f"{path}.md", content=text, inclusion=InclusionLevel.NOT_IN_NAV)
            files.append(page)


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Links to sources lead to their pages, and the search puts pages in order."""
    for begin, boost in BOOSTS.items():
        if page.file.src_uri.startswith(begin):
            page.meta.setdefault("search", {"boost": boost})

    def to_page(link: "re.Match[str]") -> str:
        is_source = files.get_file_from_path(_target(page.file.src_uri, link[1]) + ".md")
        return f"{link[0]}.md" if is_source else link[0]

    return _LINK.sub(to_page, markdown)


def _paths(nav: Any) -> Iterator[str]:
    """The documents that a part of `nav` names."""
    if isinstance(nav, str):
        yield nav
    else:
        for each in nav.values() if isinstance(nav, dict) else nav:
            yield from _paths(each)


def _target(path: str, link: str) -> str:
    return posixpath.normpath(posixpath.join(posixpath.dirname(path), link))


def _read(path: str) -> str:
    return (ROOT / path).read_text(encoding="utf-8")


def _language(path: str) -> str:
    return {".py": "python", ".cpp": "cpp", ".yaml": "yaml"}.get(pathlib.PurePath(path).suffix, "text")
