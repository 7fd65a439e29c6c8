"""`mrl review`: a page of a recording, with what went wrong in it."""

import os
from typing import Any, Dict, Optional, Tuple

import click

from mrl_driver.cli.commands.progress import progress
from mrl_driver.cli.commands.shared import complete_robot, json_option, print_json
from mrl_driver.errors import ConfigError
from mrl_driver.files import replace_file
from mrl_driver.host.named_robots import resolve

robot_option = click.option(
    "--robot",
    metavar="ROBOT",
    default="auto",
    shell_complete=complete_robot,
    help="Robot model; by default that of the recording.",
)


def read_drive(file: str, robot: str) -> Tuple[Any, Any]:
    """Play a recording and show the progress; return the `RecordedDriver` and its `DriveData`."""
    from mrl_driver.apps.review import drive_data
    from mrl_driver.driver.recorded import RecordedDriver

    recorded = RecordedDriver(file, resolve(robot).model)
    with progress(f"reading {os.path.basename(file)}", 1.0) as advance:
        return recorded, drive_data.read(recorded, advance)


@click.command(short_help="Make a page of a recording: what went wrong, path, charts, stops.")
@click.argument("file", type=click.Path())
@click.option(
    "-o", "--output", type=click.Path(), metavar="PAGE", help="Page to write.  [default: FILE.html]"
)
@robot_option
@json_option
def review(file: str, output: Optional[str], robot: str, as_json: bool) -> None:
    """Make a page of a recording: what went wrong, the path, charts, stops and the quality of the link.

    The page is one HTML file.  It opens in any browser, without a network.  Each finding has its moment, and the frame
    that proves it.  The exit code is 0 even if something went wrong in the drive.

    \b
    Examples:
      mrl review drive.mrl
      mrl review drive.mrl -o monday.html
      mrl review drive.mrl --json
    """
    from mrl_driver.apps.review import page
    from mrl_driver.apps.review.findings import find

    written = output or f"{os.path.splitext(file)[0]}.html"
    if os.path.exists(written) and os.path.exists(file) and os.path.samefile(written, file):
        raise ConfigError(f"the page would replace the recording {file}; give another file with --output")
    _, drive = read_drive(file, robot)
    findings = find(drive)
    replace_file(written, page.render(drive, findings))
    if as_json:
        print_json({"page": written, **_facts(drive, findings)})
        return
    for number, finding in enumerate(findings, 1):
        click.echo(
            f"{number}. {finding.title} (at {finding.time_s:.2f} s): {finding.text} {finding.remedy}  [{finding.kind}]"
        )
    click.echo(written if findings else f"no fault was found; {written}")


def _facts(drive: Any, findings: Any) -> Dict[str, Any]:
    """Return findings and stops, with frames as they are written in the recording."""
    from mrl_driver.apps.review.page import raw_text

    return {
        "robot": drive.model.name,
        "robot_id": drive.robot_id,
        "virtual": drive.board.virtual if drive.board else None,
        "duration_s": drive.duration_s,
        "findings": [
            {**each._asdict(), "remedy": each.remedy, "data": raw_text(each.data)} for each in findings
        ],
        "stops": [{**each._asdict(), "data": raw_text(each.data)} for each in drive.stops],
        "skipped_lines": drive.skipped_lines,
    }
