"""Reading plain files of a limited size; replacing files completely or not at all: a full disk leaves the old one."""

import contextlib
import errno
import os
import shutil
import stat
from functools import partial
from typing import BinaryIO, Iterator, Sequence, Union

from .errors import ConfigError, OutputError


@contextlib.contextmanager
def replacing(path: str, private: bool = False) -> Iterator[str]:
    """Yield the name of a temporary file, which the block makes; at its end, that file gets the name `path`.

    If the block raises, the temporary file is removed, and an old file at `path` stays as it was.  A symbolic link
    stays a link.  Permissions of an old file do not change, unless the new one is `private`.

    Raises:
        OutputError: the file cannot be written: the block has raised OSError, or the file cannot be renamed, or `path`
            is a device or another file that is not plain, which would be lost.
    """
    import tempfile  # late: the driver, which replaces no file, does not wait for it

    target = os.path.realpath(path)
    try:
        if os.path.exists(target) and not os.path.isfile(target):
            raise OSError(errno.EINVAL, "it is not a plain file")
        # In a folder of its own: elsewhere another user may have put a symbolic link in the way, such as in /tmp.
        with tempfile.TemporaryDirectory(dir=os.path.dirname(target), prefix=".mrl-") as folder:
            temporary = os.path.join(folder, "new")
            yield temporary
            if os.path.exists(target) and not private:
                shutil.copymode(target, temporary)
            os.replace(temporary, target)
    except OSError as error:
        raise unwritable(path, error) from None


def unwritable(path: str, error: OSError) -> OutputError:
    """Return the error for a file that cannot be written, while an older one stays as it was."""
    return OutputError(
        f"{path} cannot be written: {error.strerror or error}; nothing was changed; make room, or choose another place"
    )


def require_writable(path: str, what: str, endings: Sequence[str]) -> None:
    """Check at the start that a file can be written at the end; `what` names its option.

    Raises:
        ConfigError: the file's ending is unknown, the folder cannot be written, or `path` is a folder or a device.
    """
    if os.path.splitext(path)[1].lower() not in endings:
        raise ConfigError(f"{what} {path}: expected a file that ends in {', '.join(endings)}")
    folder = os.path.dirname(path) or "."
    if not os.path.isdir(folder) or not os.access(folder, os.W_OK):
        raise ConfigError(f"{what} {path}: folder {folder} cannot be written, expected one that can")
    if os.path.exists(path) and not os.path.isfile(path):
        raise ConfigError(f"{what} {path}: it is not a plain file, expected another name")


def open_plain(path: str) -> BinaryIO:
    """Open a plain file for reading.

    Raises:
        OSError: it cannot be opened, or is not a plain file: a pipe or a port would be waited for.
    """
    try:
        fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
    except ValueError:
        raise OSError(errno.EINVAL, "its name holds a zero byte") from None
    if not stat.S_ISREG(os.fstat(fd).st_mode):
        os.close(fd)
        raise OSError(errno.EINVAL, "it is not a plain file")
    return os.fdopen(fd, "rb")


def read_plain(path: str, most_bytes: int) -> bytes:
    """Return the content of a plain file; raise OSError as `open_plain`, or if it is longer than `most_bytes`."""
    with open_plain(path) as file:
        data = file.read(most_bytes + 1)
    if len(data) > most_bytes:
        raise OSError(errno.EFBIG, f"it is longer than {most_bytes} bytes")
    return data


def create_unused(path: str, active: str = "") -> str:
    """Create an empty file that only this user can read, for a program that opens it later; return its name.

    The name is `path`; if a plain file has it, the first with a number before its ending that none has, so that two
    programs never get the same one.  A device keeps its name.  If nothing can be created, opening it tells why.

    Args:
        active: follows the name of the file while it is written; neither it nor the returned name exists then.
    """
    stem, ending = os.path.splitext(path)
    number, found = 1, path
    while True:
        try:
            os.close(os.open(found + active, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600))
            if not active or not os.path.exists(found):
                return found
            os.unlink(found + active)
        except FileExistsError:
            if not os.path.isfile(found + active):
                return found
        except OSError:
            return found
        number += 1
        found = f"{stem}-{number}{ending}"


def replace_file(path: str, content: Union[str, bytes], private: bool = False) -> None:
    """Write a file completely, or leave the old one.  A symbolic link stays a link; permissions do not change.

    A `private` file gets mode 0600 before anything is written to it.

    Raises:
        OutputError: the file cannot be written.
    """
    opener = partial(os.open, mode=0o600 if private else 0o666)
    with replacing(path, private) as temporary, open(temporary, "wb", opener=opener) as file:
        file.write(content.encode() if isinstance(content, str) else content)
        file.flush()
        os.fsync(file.fileno())
