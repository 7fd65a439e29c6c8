"""Frames to bytes, checked against the rows of the table."""

from typing import Optional, Sequence

from mrl_driver.errors import FrameError

from .frames import Stamp, check_value
from .table import BY_CODE, Command, Field


def encode_request(code: int, *args: int, checked: bool = False) -> bytes:
    """Return the bytes of a request, host to board.

    Raises:
        FrameError: the table has no such request, or does not allow these arguments.
    """
    row = _row(code)
    _require(row, row.request, row.optional, args)
    return _frame(code, args, checked or row.guarded)


def encode_reply(code: int, *args: int, stamp: Optional[Stamp] = None, checked: bool = False) -> bytes:
    """Return the bytes of a reply or stream frame, board to host, with its line end.

    `stamp` is used only for stamped rows with `checked` set.

    Raises:
        FrameError: the table has no such reply, or does not allow these arguments, or the stamp is missing.
    """
    row = _row(code)
    _require(row, row.reply, row.optional_reply, args)
    if checked and row.stamped:
        if stamp is None:
            raise FrameError(f"reply {code} ({row.name}) is stamped, got no stamp")
        args = args + stamp
    return _frame(code, args, checked) + b"\r\n"


def _row(code: int) -> Command:
    try:
        return BY_CODE[code]
    except KeyError:
        raise FrameError(f"command {code} is not in the table, expected 1 to {max(BY_CODE)}") from None


def _require(row: Command, fields: Sequence[Field], optional: int, args: Sequence[int]) -> None:
    if not len(fields) - optional <= len(args) <= len(fields):
        raise FrameError(
            f"command {row.code} ({row.name}) takes {len(fields)} arguments, got {len(args)}: {args}"
        )
    for field, value in zip(fields, args):
        if not field.low <= value <= field.high:
            raise FrameError(
                f"{row.name}: {field.name} is {value}, expected {field.low} to {field.high} {field.unit}"
            )


def _frame(code: int, args: Sequence[int], checked: bool) -> bytes:
    body = (b"@%d" + b",%d" * len(args)) % (code, *args)
    return b"%s,%de" % (body, check_value(body)) if checked else body + b"e"
