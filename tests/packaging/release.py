"""`make release`: wheel and sdist of the commit, with firmware images of the compiler that all figures come from.

Everything is built in a clone of the commit, so that the packages have no file that git does not have.  The wheel is
built from the sdist, which shows that the sdist is complete.  FAST=1 leaves out the checks, takes the images that are
built, and makes the packages in build/smoke/dist.
"""

import datetime
import hashlib
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import xml.etree.ElementTree
import zipfile
from pathlib import Path
from typing import Dict

from mrl_driver.host.firmware_images import IMAGES
from sim_arduino.avr import intel_hex

ROOT = Path(__file__).resolve().parents[2]
FAST = os.environ.get("FAST") == "1"
DIST = ROOT / "build" / ("smoke/dist" if FAST else "dist")
COMPILER = "5.4"
"""Version of gcc-avr, which is Debian 12's; another one makes images that no figure of BENCHMARKS.md belongs to."""


class Refused(Exception):
    """Why there is no release: what was got, what was expected, what to do."""


def output_of(*command: str, cwd: Path = ROOT) -> str:
    """What a command prints.

    Raises:
        Refused: it is missing or fails.
    """
    try:
        done = subprocess.run(command, cwd=str(cwd), capture_output=True, text=True)
    except FileNotFoundError:
        raise Refused(f"{command[0]} is missing; install what `make setup` names") from None
    if done.returncode:
        last = (done.stderr or done.stdout).strip().splitlines()[-1:]
        raise Refused(f"{' '.join(command[:3])} failed: {''.join(last)}")
    return done.stdout


def version_of(tree: Path) -> str:
    """The version in package.xml."""
    return str(xml.etree.ElementTree.parse(str(tree / "package.xml")).findtext("version"))


def require_clean(tree: Path) -> None:
    """Raises Refused if a file differs from the commit, or is not in it."""
    changes = output_of("git", "status", "--porcelain", cwd=tree).splitlines()
    if changes:
        names = ", ".join(line[3:] for line in changes[:3])
        raise Refused(
            f"{len(changes)} changes are not committed ({names}), expected none; commit or remove them"
        )


def require_compiler(tree: Path) -> None:
    """Raises Refused unless the compiler of C and that of C++ are of the version COMPILER."""
    for name in ("avr-gcc", "avr-g++"):
        got = output_of(name, "-dumpversion", cwd=tree).strip()
        if got != COMPILER and not got.startswith(f"{COMPILER}."):
            raise Refused(f"{name} is version {got}, expected {COMPILER}; build the release on Debian 12")


def require_changelog(tree: Path) -> None:
    """Raises Refused unless the first heading of CHANGELOG.md is the version with a date."""
    version, text = version_of(tree), (tree / "CHANGELOG.md").read_text(encoding="utf-8")
    heading = next((line for line in text.splitlines() if line.startswith("## ")), "no heading")
    dated = re.match(rf"## {re.escape(version)} \((\d{{4}}-\d\d-\d\d)\)$", heading)
    try:
        datetime.datetime.strptime(dated[1] if dated else "", "%Y-%m-%d")
    except ValueError:
        expected = f"'## {version} (YEAR-MONTH-DAY)'"
        raise Refused(
            f"CHANGELOG.md begins with '{heading}', expected {expected}; write the date of today"
        ) from None


def require_citation(tree: Path) -> None:
    """Raises Refused unless CITATION.cff names the version, and the date that CHANGELOG.md gives it."""
    version, text = version_of(tree), (tree / "CITATION.cff").read_text(encoding="utf-8")
    changes = (tree / "CHANGELOG.md").read_text(encoding="utf-8")
    for key, expected in (
        ("version", [version]),
        ("date-released", re.findall(rf"^## {re.escape(version)} \((.*)\)$", changes, re.M)),
    ):
        got = re.findall(rf"^{key}: (.*)$", text, re.M)
        if got != expected:
            raise Refused(
                f"CITATION.cff has {key} {', '.join(got)}, expected {', '.join(expected)} as in package.xml and "
                "CHANGELOG.md; change it"
            )


def require_free_tag(tree: Path) -> None:
    """Raises Refused if the version has a tag on another commit."""
    tag = f"v{version_of(tree)}"
    if not output_of("git", "tag", "--list", tag, cwd=tree):
        return
    tagged, head = (
        output_of("git", "rev-parse", "--short", f"{name}^0", cwd=tree).strip() for name in (tag, "HEAD")
    )
    if tagged != head:
        raise Refused(f"the tag {tag} is on {tagged}, expected {head}; raise the version in package.xml")


CHECKS = (require_clean, require_changelog, require_citation, require_free_tag, require_compiler)


def build(tree: Path, dist: Path) -> Dict[str, bytes]:
    """Build images, sdist and wheel in a clone of a commit; returns the images by their file names.

    Raises:
        Refused: a step fails, or a package does not have the images that were built.
    """
    code = "import sys, setuptools.build_meta as b; getattr(b, f'build_{sys.argv[1]}')(sys.argv[2])"
    with tempfile.TemporaryDirectory(prefix="mrl-release-") as name:
        clone, unpacked = Path(name, "clone"), Path(name, "unpacked")
        output_of("git", "clone", "-q", str(tree), str(clone))
        if FAST:
            shutil.copytree(
                str(tree / "build/firmware"), str(clone / "build/firmware"), copy_function=shutil.copy
            )
        subprocess.run(
            ["make", "--no-print-directory", *["--touch"] * FAST, "firmware"], cwd=str(clone), check=True
        )
        images = {image: (clone / "build/firmware" / image).read_bytes() for image in IMAGES}
        made = Path(name, "dist")
        made.mkdir()
        output_of(sys.executable, "-c", code, "sdist", str(made), cwd=clone)
        (archive,) = made.glob("*.tar.gz")
        shutil.unpack_archive(str(archive), str(unpacked))
        (source,) = unpacked.iterdir()
        output_of(sys.executable, "-c", code, "wheel", str(made), cwd=source)
        for package in made.iterdir():
            require_images(package, images)
        shutil.rmtree(str(dist), ignore_errors=True)
        dist.parent.mkdir(exist_ok=True)
        shutil.copytree(str(made), str(dist))
    return images


def require_images(package: Path, images: Dict[str, bytes]) -> None:
    """Raises Refused unless a wheel or sdist has these images, byte by byte."""
    if package.suffix == ".whl":
        with zipfile.ZipFile(str(package)) as wheel:
            found = {
                os.path.basename(name): wheel.read(name) for name in wheel.namelist() if name.endswith(".hex")
            }
    else:
        with tarfile.open(str(package)) as sdist:
            members = [each for each in sdist.getmembers() if each.name.endswith(".hex")]
            found = {os.path.basename(each.name): sdist.extractfile(each).read() for each in members}  # type: ignore[union-attr]
    for name, content in images.items():
        if found.get(name) != content:
            raise Refused(
                f"{package.name}: {name} is missing or differs from the one that was built; see MANIFEST.in"
            )


def sha256(content: bytes) -> str:
    """The SHA-256 as people compare it."""
    return hashlib.sha256(content).hexdigest()


def report(tree: Path, dist: Path, images: Dict[str, bytes]) -> None:
    """Print what a reader needs to compare the files, and the commands that publish the version."""
    version = version_of(tree)
    commit = output_of("git", "rev-parse", "HEAD", cwd=tree).strip()
    print(f"\nmrl-driver {version}, commit {commit}")
    print(f"compiler: {output_of('avr-g++', '--version').splitlines()[0]}\n")
    for image, content in images.items():
        size = sum(len(data) for _, data in intel_hex.read(content.decode("ascii")))
        print(f"{image:<46} {size:>8} bytes  SHA-256 {sha256(content)}")
    for path in sorted(dist.iterdir()):
        shown = os.path.relpath(str(path), str(tree))
        print(f"{shown:<46} {path.stat().st_size:>8} bytes  SHA-256 {sha256(path.read_bytes())}")
    print(
        f"\nTry the packages, then:\n  git tag -a v{version} -m 'mrl-driver {version}'\n  git push origin v{version}"
    )


def main() -> None:
    """Check the commit, build, and report."""
    try:
        for check in () if FAST else CHECKS:
            check(ROOT)
        report(ROOT, DIST, build(ROOT, DIST))
    except (Refused, subprocess.CalledProcessError) as error:
        sys.exit(f"make release: {error}")


if __name__ == "__main__":
    main()
