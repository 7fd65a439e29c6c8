"""A page that is one HTML file: a template, styles and scripts of the page of `mrl web`, and escaped texts.

The page's policy allows only its own scripts and styles, by their hash, so it makes no request.
"""

import base64
import hashlib
import html
import pathlib
import re
from typing import Dict, Tuple

SHARED = pathlib.Path(__file__).resolve().parent.parent / "web" / "page"
COMMON_STYLE = SHARED / "common.css"
_HEAD = pathlib.Path(__file__).with_name("page") / "head.html"
Pair = Tuple[str, str]


def read(path: pathlib.Path) -> str:
    """Return the text of a part."""
    return path.read_text(encoding="utf-8")


def filled(template: pathlib.Path, parts: Dict[str, str]) -> str:
    """Return the head of all pages and a template; marks, such as `<!--title-->`, are replaced by HTML."""
    return re.sub(r"<!--(\w+)-->", lambda match: parts[match[1]], read(_HEAD) + "\n" + read(template))


def policy(style: str, *scripts: str) -> str:
    """Return the policy that allows these parts alone."""
    allowed = f"script-src {' '.join(map(_hash, scripts))}; " if scripts else ""
    return f"default-src 'none'; style-src {_hash(style)}; {allowed}base-uri 'none'; form-action 'none'"


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def escaped(text: object) -> str:
    """Return a text in HTML; bytes of a file name that are not UTF-8 become question marks."""
    return html.escape(str(text)).encode(errors="replace").decode()


def tile(title: str, value: str, unit: str, small: str = "") -> str:
    """Return a number with its title."""
    return (
        f'<div class="tile"><dt>{escaped(title)}</dt><dd><b>{escaped(value)}</b><i>{escaped(unit)}</i></dd>'
        f'<dd class="small">{escaped(small)}</dd></div>'
    )


def row(pair: Pair) -> str:
    """Return a name and its text."""
    return f"<div><dt>{escaped(pair[0])}</dt><dd>{escaped(pair[1])}</dd></div>"
