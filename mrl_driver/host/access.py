"""Access to a robot over the network: two tokens, stored on this computer, and the addresses that need them.

Anybody with the drive token may drive; anybody with the watch token may see and stop.  `mrl web` asks for them on every
address that other computers can reach.
"""

import contextlib
import fcntl
import hmac
import ipaddress
import json
import os
import secrets
import socket
import stat
import struct
from typing import Iterator, List, NamedTuple, Optional

from mrl_driver import folders
from mrl_driver.errors import ConfigError
from mrl_driver.files import open_plain, replace_file

DRIVE, WATCH = "drive", "watch"
TOKEN_BYTES = 16
NEW = "make new tokens with: mrl web --listen ADDRESS --new-tokens"
_SIOCGIFADDR = 0x8915  # request of Linux for the IPv4 address of a network interface; see netdevice(7)
ANY = ("", "0.0.0.0", "::")  # hosts to listen on that mean all addresses of this computer


class Tokens(NamedTuple):
    """Tokens of 32 hexadecimal digits, 128 random bits each."""

    drive: str
    watch: str

    def role(self, token: str) -> str:
        """Return what `token` allows: `drive`, `watch`, or empty for nothing.

        The time that this takes tells nothing about the tokens.
        """
        given = token.encode("utf-8", "replace")
        drives = hmac.compare_digest(given, self.drive.encode())
        watches = hmac.compare_digest(given, self.watch.encode())
        return DRIVE if drives else WATCH if watches else ""


def folder() -> str:
    """Return the folder of tokens and certificate; nobody else may look into it."""
    return os.path.join(folders.config(), "access")


def tokens(renew: bool = False) -> Tokens:
    """Return this computer's tokens.  They are made on first use, and made again with `renew`.

    Two programs that start at once get the same tokens.  ConfigError if the file cannot be written, is damaged, or
    other users can read it.
    """
    path = _path()
    with lock():
        if renew or not os.path.exists(path):
            made = Tokens(secrets.token_hex(TOKEN_BYTES), secrets.token_hex(TOKEN_BYTES))
            replace_file(path, json.dumps(made._asdict()) + "\n", private=True)
        return _stored()


class TokenWatch:
    """Notices that another program has made new tokens."""

    def __init__(self, known: Tokens) -> None:
        self._known = known

    def look(self) -> Optional[Tokens]:
        """Return the stored tokens if they are others than before; None if they are not.

        Tokens that cannot be read count as unchanged: their pages need their STOP also when the disk fails.
        """
        with contextlib.suppress(ConfigError):
            found = _stored()
            if found != self._known:
                self._known = found
                return found
        return None


def _path() -> str:
    return os.path.join(folder(), "tokens.json")


def _stored() -> Tokens:
    path = _path()
    data = read(path, NEW)
    try:
        found = Tokens(**json.loads(data))
        for token in found:
            if len(token) != 2 * TOKEN_BYTES or bytes.fromhex(token).hex() != token:
                raise ValueError
        return found
    except (ValueError, TypeError, RecursionError):
        raise ConfigError(
            f"{path} is damaged, expected two tokens of {2 * TOKEN_BYTES} hexadecimal digits; {NEW}"
        ) from None


# -- private files, for tokens and certificate


@contextlib.contextmanager
def lock() -> Iterator[None]:
    """Make the folder if necessary, and let no other program change its files; ConfigError if it cannot be used."""
    place = folder()
    try:
        os.makedirs(place, 0o700, exist_ok=True)
        os.chmod(place, 0o700)
        fd = os.open(os.path.join(place, "lock"), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    except OSError as error:
        raise ConfigError(
            f"{place} cannot be used ({error.strerror}); it holds tokens and certificate: give your user the folder, "
            "or choose another one with XDG_CONFIG_HOME"
        ) from None
    try:
        fcntl.flock(fd, fcntl.LOCK_EX)
    except OSError as error:
        os.close(fd)
        raise ConfigError(
            f"{place} cannot be locked ({error.strerror}); choose a local folder with XDG_CONFIG_HOME"
        ) from None
    try:
        yield
    finally:
        os.close(fd)


def read(path: str, remedy: str) -> bytes:
    """Return a private file's content; ConfigError, which ends with `remedy`, if it is unreadable, or not private."""
    try:
        with open_plain(path) as file:
            mode = stat.S_IMODE(os.fstat(file.fileno()).st_mode)
            data = file.read()
    except OSError as error:
        raise ConfigError(f"{path} cannot be read ({error.strerror}); {remedy}") from None
    if mode & 0o077:
        raise ConfigError(
            f"{path} has mode {mode:04o}, expected 0600: other users may have read it; "
            f"delete it, or trust them and run: chmod 600 {path}"
        )
    return data


# -- addresses


def is_loopback(host: str) -> bool:
    """Return whether only this computer can reach `host`: `localhost`, 127.0.0.0/8 or ::1.

    Other names count as reachable by all, whatever they resolve to; so do `0.0.0.0` and `::`, all addresses of this
    computer.
    """
    if host.lower() == "localhost":
        return True
    try:
        address = ipaddress.ip_address(host[1:-1] if host.startswith("[") and host.endswith("]") else host)
    except ValueError:
        return False
    mapped = address.ipv4_mapped if isinstance(address, ipaddress.IPv6Address) else None
    return (mapped or address).is_loopback


def own_names() -> List[str]:
    """Return this computer's name, alone and with `.local` (multicast DNS)."""
    name = socket.gethostname().partition(".")[0]
    return [name, f"{name}.local"] if name and name != "localhost" else []


def own_addresses() -> List[str]:
    """Return this computer's numeric addresses that others can reach, IPv4 first; without link-local ones."""
    found = dict.fromkeys(map(ipaddress.ip_address, (*_ipv4(), *_ipv6())))
    return [str(address) for address in found if not address.is_loopback | address.is_link_local]


def reachable(host: str) -> List[str]:
    """Return the hosts under which others find what listens on `host`: it alone, or all of this computer's.

    `0.0.0.0` listens on IPv4 alone.
    """
    if host not in ANY:
        return [host]
    found = [address for address in own_addresses() if host != "0.0.0.0" or ":" not in address]
    return found or own_names() or ["localhost"]


def _ipv4() -> List[str]:
    addresses = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as end:
        for _, name in socket.if_nameindex():
            with contextlib.suppress(OSError):  # an interface without an IPv4 address
                answer = fcntl.ioctl(end.fileno(), _SIOCGIFADDR, struct.pack("256s", name.encode()[:15]))
                addresses.append(socket.inet_ntoa(answer[20:24]))
    return addresses


def _ipv6() -> List[str]:
    try:
        with open("/proc/net/if_inet6", encoding="ascii") as file:
            return [str(ipaddress.IPv6Address(int(line.split()[0], 16))) for line in file]
    except OSError:
        return []
