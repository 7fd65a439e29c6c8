"""Replacing files completely or not at all: a full disk leaves the old file as it was."""

import contextlib
import os
import shutil
from typing import Union

from .errors import OutputError


def replace_file(path: str, content: Union[str, bytes]) -> None:
    """Write a file completely, or leave the old one.  A symbolic link stays a link; permissions do not change.

    Raises:
        OutputError: the file cannot be written.
    """
    target = os.path.realpath(path)
    temporary = f"{target}.{os.getpid()}.new"
    try:
        with open(temporary, "wb") as file:
            file.write(content.encode() if isinstance(content, str) else content)
            file.flush()
            os.fsync(file.fileno())
        if os.path.exists(target):
            shutil.copymode(target, temporary)
        os.replace(temporary, target)
    except OSError as error:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        raise OutputError(
            f"{path} cannot be written: {error.strerror}; nothing was changed; make room, or choose another place"
        ) from None
