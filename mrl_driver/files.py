"""Replacing files completely or not at all: a full disk leaves the old file as it was."""

import contextlib
import errno
import os
import shutil
from typing import Iterator, Union

from .errors import OutputError


@contextlib.contextmanager
def replacing(path: str, private: bool = False) -> Iterator[str]:
    """Yield the name of a temporary file, which the block makes; at its end, that file gets the name `path`.

    If the block raises, the temporary file is removed, and an old file at `path` stays as it was.  A symbolic link
    stays a link.  Permissions of an old file do not change, unless the new one is `private`.

    Raises:
        OutputError: the file cannot be written: the block has raised OSError, or the file cannot be renamed, or `path`
            is a device or another file that is not plain, which would be lost.
    """
    target = os.path.realpath(path)
    temporary = f"{target}.{os.getpid()}.new"
    try:
        if os.path.exists(target) and not os.path.isfile(target):
            raise OSError(errno.EINVAL, "it is not a plain file")
        yield temporary
        if os.path.exists(target) and not private:
            shutil.copymode(target, temporary)
        os.replace(temporary, target)
    except BaseException as error:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        if isinstance(error, OSError):
            raise unwritable(path, error) from None
        raise


def unwritable(path: str, error: OSError) -> OutputError:
    """Return the error for a file that cannot be written, while an older one stays as it was."""
    return OutputError(
        f"{path} cannot be written: {error.strerror or error}; nothing was changed; make room, or choose another place"
    )


def unused(path: str) -> str:
    """Return `path`; if a plain file has this name, the first with a number before its ending that none has."""
    stem, ending = os.path.splitext(path)
    number, found = 1, path
    while os.path.isfile(found):
        number += 1
        found = f"{stem}-{number}{ending}"
    return found


def replace_file(path: str, content: Union[str, bytes], private: bool = False) -> None:
    """Write a file completely, or leave the old one.  A symbolic link stays a link; permissions do not change.

    A `private` file gets mode 0600 before anything is written to it.

    Raises:
        OutputError: the file cannot be written.
    """
    with replacing(path, private) as temporary, open(
        temporary, "wb", opener=_open_private if private else None
    ) as file:
        file.write(content.encode() if isinstance(content, str) else content)
        file.flush()
        os.fsync(file.fileno())


def _open_private(path: str, flags: int) -> int:
    fd = os.open(path, flags, 0o600)
    os.fchmod(fd, 0o600)  # also if a file of this name was left behind
    return fd
