"""The results of `mrl doctor` as plain text, to paste into a bug report."""

import datetime
import platform
from typing import Any, Iterator, Mapping, Sequence

from mrl_driver.host.named_robots import Target

from .findings import Finding, verdict


def text(findings: Sequence[Finding], facts: Mapping[str, Any], target: Target) -> str:
    """Return the whole report, with the versions of the software."""
    return "\n".join(_lines(findings, facts, target))


def _lines(findings: Sequence[Finding], facts: Mapping[str, Any], target: Target) -> Iterator[str]:
    yield f"mrl doctor, {datetime.datetime.now().astimezone().isoformat(timespec='seconds')}"
    yield f"mrl-driver {_version('mrl-driver')}, pyserial {_version('pyserial')}, Python {platform.python_version()}"
    yield f"{platform.platform()}"
    yield f"port {target.port}, model {target.model}, {target.baud} Bd"
    yield ""
    for finding in findings:
        code = f"  [{finding.code}]" if finding.code else ""
        yield f"{finding.level:<8} {finding.subject:<18} {finding.text}{code}"
        if finding.advice:
            yield f"{'':27} -> {finding.advice}"
    yield ""
    yield f"verdict: {verdict(findings)}"
    yield ""
    for key, value in facts.items():
        yield f"{key}: {value}"


def _version(package: str) -> str:
    from importlib import metadata

    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "unknown"
