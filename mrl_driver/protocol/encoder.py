"""Frames to bytes, checked against the rows of the table."""

from typing import Optional, Sequence

from mrl_driver.arguments import number_of, require_whole, shown
from mrl_driver.errors import FrameError

from .frames import Stamp, check_value
from .table import BY_CODE, WRAP, Command, Field


def encode_request(code: int, *args: int, checked: bool = False, wrapped: bool = False) -> bytes:
    """Return the bytes of a request, host to board; `wrapped` for a board of 2013, see `WRAP`.

    Raises:
        FrameError: the table has no such request, or does not allow these arguments.
    """
    row = _row(code)
    if wrapped:
        return _encode(row, row.request, row.optional, args, (), False, WRAP)
    return _encode(row, row.request, row.optional, args, (), checked or row.guarded)


def encode_reply(code: int, *args: int, stamp: Optional[Stamp] = None, checked: bool = False) -> bytes:
    """Return the bytes of a reply or stream frame, board to host, with its line end.

    `stamp` is used only for stamped rows with `checked` set.

    Raises:
        FrameError: the table has no such reply, or does not allow these arguments, or the stamp is missing.
    """
    row = _row(code)
    tail: Sequence[int] = ()
    if checked and row.stamped:
        if stamp is None:
            raise FrameError(f"reply {code} ({row.name}) is stamped, got no stamp")
        tail = stamp
    return _encode(row, row.reply, row.optional_reply, args, tail, checked) + b"\r\n"


def _row(code: int) -> Command:
    row = BY_CODE.get(code if type(code) is int else require_whole("command", code, FrameError))
    if row is None:
        raise FrameError(f"command {code} is not in the table, expected 1 to {max(BY_CODE)}")
    return row


def _encode(
    row: Command,
    fields: Sequence[Field],
    optional: int,
    args: Sequence[int],
    tail: Sequence[int],
    checked: bool,
    wrap: int = 0,
) -> bytes:
    """Return a frame whose arguments are checked; `tail` follows them unchecked."""
    if not len(fields) - optional <= len(args) <= len(fields):
        raise FrameError(
            f"command {row.code} ({row.name}) takes {len(fields)} arguments, got {len(args)}: {args}"
        )
    numbers = [value if type(value) is int else number_of(value) for value in args]
    for field, number, value in zip(fields, numbers, args):
        if not (field.low <= number <= field.high and number == int(number)):
            raise FrameError(
                f"{row.name}: {field.name} is {shown(value)}, expected {field.low} to {field.high} {field.unit}"
            )
    body = (b"@%d" + b",%d" * (len(args) + len(tail))) % (row.code + wrap, *numbers, *tail)
    if not checked:
        return body + b"e"
    return b"%s,%de" % (body, check_value(body))
