"""Replacing files completely or not at all: a full disk leaves the old file as it was."""

import contextlib
import os
import shutil
from typing import Union

from .errors import OutputError


def replace_file(path: str, content: Union[str, bytes], private: bool = False) -> None:
    """Write a file completely, or leave the old one.  A symbolic link stays a link; permissions do not change.

    A `private` file gets mode 0600 before anything is written to it.

    Raises:
        OutputError: the file cannot be written.
    """
    target = os.path.realpath(path)
    temporary = f"{target}.{os.getpid()}.new"
    try:
        with open(temporary, "wb", opener=_open_private if private else None) as file:
            file.write(content.encode() if isinstance(content, str) else content)
            file.flush()
            os.fsync(file.fileno())
        if os.path.exists(target) and not private:
            shutil.copymode(target, temporary)
        os.replace(temporary, target)
    except OSError as error:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        raise OutputError(
            f"{path} cannot be written: {error.strerror}; nothing was changed; make room, or choose another place"
        ) from None


def _open_private(path: str, flags: int) -> int:
    fd = os.open(path, flags, 0o600)
    os.fchmod(fd, 0o600)  # also if a file of this name was left behind
    return fd
