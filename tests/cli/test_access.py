"""Tokens and certificate of this computer, and `mrl ports`: what may be opened, and what it says of each port."""

import datetime
import json
import os
import ssl
import stat
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from mrl_driver.driver import probe
from mrl_driver.errors import ConfigError
from mrl_driver.host import access, certificate
from mrl_driver.session.handshake import TIMEOUT_S
from mrl_driver.transport import port_info
from mrl_driver.transport.link import SerialLink
from mrl_driver.transport.port_info import Port

from .run import fails, mrl


@pytest.fixture
def x509():
    from cryptography import x509

    return x509


def mode(path):
    return stat.S_IMODE(os.stat(path).st_mode)


def stored(name):
    return Path(access.folder(), name)


def test_programs_that_start_at_once_agree():
    """The lock is between open files, so that threads find out as programs do."""

    def ask(_):
        certificate.context()
        return access.tokens(), certificate.fingerprint()

    with ThreadPoolExecutor(4) as programs:
        assert len(set(programs.map(ask, range(8)))) == 1


@pytest.mark.parametrize("umask", [0o000, 0o022])
def test_nobody_else_can_read_them(umask):
    before = os.umask(umask)
    try:
        access.tokens()
        certificate.context()
    finally:
        os.umask(before)
    assert mode(access.folder()) == 0o700
    assert {mode(each) for each in Path(access.folder()).iterdir()} == {0o600}


@pytest.mark.parametrize(
    ("given", "role"), [("drive", "drive"), ("watch", "watch"), ("", ""), ("x" * 32, ""), ("ä", "")]
)
def test_a_token_has_one_role(given, role):
    tokens = access.tokens()
    assert tokens.role(tokens._asdict().get(given, given)) == role


@pytest.mark.parametrize(
    "text", ["", "[]", '{"drive": "", "watch": ""}', '{"drive": 5, "watch": 5}', '{"x": 1}']
)
def test_damaged_tokens_are_refused_with_what_to_do(text):
    access.tokens()
    stored("tokens.json").write_text(text)
    with pytest.raises(
        ConfigError, match="is damaged, .*make new tokens with: mrl web --listen ADDRESS --new-tokens"
    ):
        access.tokens()
    assert access.tokens(renew=True) == access.tokens()


def test_new_tokens_of_another_program_are_noticed_once():
    watch = access.TokenWatch(access.tokens())
    assert watch.look() is None
    new = access.tokens(renew=True)
    assert (watch.look(), watch.look()) == (new, None)


def test_tokens_that_cannot_be_read_are_no_new_ones():
    watch = access.TokenWatch(access.tokens())
    stored("tokens.json").unlink()
    assert watch.look() is None


@pytest.mark.parametrize("use", [access.tokens, certificate.context])
def test_a_file_that_others_could_read_is_refused(use):
    use()
    (found,) = (each for each in Path(access.folder()).iterdir() if each.name != "lock")
    found.chmod(0o640)
    with pytest.raises(ConfigError, match="mode 0640, expected 0600"):
        use()


def test_only_this_computer_reaches_a_loopback_address():
    hosts = ("localhost", "LOCALHOST", "127.0.0.1", "127.8.9.1", "::1", "[::1]", "::ffff:127.0.0.1")
    assert [host for host in hosts if not access.is_loopback(host)] == []


def test_all_other_addresses_count_as_reachable_by_others():
    hosts = ("", "0.0.0.0", "::", "[::]", "10.0.0.7", "fe80::1%eth0", "robot", "localhost.lan", "127.1")
    assert [host for host in (*hosts, "127.0.0.1.nip.io") if access.is_loopback(host)] == []


def test_what_listens_on_all_addresses_of_ipv4_is_not_reached_by_ipv6(monkeypatch):
    monkeypatch.setattr(access, "own_addresses", lambda: ["10.0.0.7", "fd00::2"])
    assert access.reachable("0.0.0.0") == ["10.0.0.7"] and len(access.reachable("::")) == 2


def certificate_of_file(x509):
    return x509.load_pem_x509_certificate(stored("certificate.pem").read_bytes())


def lasting(found, name):
    """One end of the time of a certificate; before cryptography 42 without a time zone."""
    return getattr(found, f"{name}_utc", None) or getattr(found, name)


def test_a_certificate_is_one_that_browsers_accept(x509):
    """Source: https://support.apple.com/103769, the strictest of them."""
    certificate.context(["10.0.0.7", "robot.lan", "fe80::1%eth0"])
    found = certificate_of_file(x509)
    names = found.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert {"localhost", "robot.lan"} <= set(names.get_values_for_type(x509.DNSName))
    assert {"127.0.0.1", "10.0.0.7"} <= set(map(str, names.get_values_for_type(x509.IPAddress)))
    usage = found.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value
    assert x509.ExtendedKeyUsageOID.SERVER_AUTH in usage
    ends, begins = (lasting(found, each) for each in ("not_valid_after", "not_valid_before"))
    assert ends - begins <= datetime.timedelta(days=825)
    assert found.signature_hash_algorithm.name == "sha256"


def test_old_versions_of_tls_are_refused():
    assert certificate.context().minimum_version == ssl.TLSVersion.TLSv1_2


@pytest.mark.parametrize("content", [b"", b"\xff", "half"])
def test_a_damaged_certificate_is_made_again_and_told(content):
    certificate.context()
    before, whole = certificate.fingerprint(), stored("certificate.pem").read_bytes()
    stored("certificate.pem").write_bytes(whole[: len(whole) // 2] if content == "half" else content)
    told = []
    certificate.context(tell=told.append)
    assert len(told) == 1 and "was damaged, so another one was made" in told[0]
    assert certificate.fingerprint() in told[0] and certificate.fingerprint() != before


def test_an_expired_certificate_is_made_again_and_told(monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(certificate, "VALID_DAYS", 1)
        certificate.context()
    told = []
    certificate.context(tell=told.append)
    assert "has expired, so another one was made" in told[0]


UNO = Port("/dev/ttyACM7", ("/dev/serial/by-id/usb-Arduino_7",), 0x2341, 0x0043, "7")
COPY = Port("/dev/ttyUSB7", (), 0x1A86, 0x7523, None)


@pytest.fixture
def there(monkeypatch):
    """Lets these ports be there."""
    return lambda *ports: monkeypatch.setattr(port_info, "described", lambda: list(ports))


def rows(*args):
    return {row["device"]: row for row in json.loads(mrl("ports", "--json", *args).stdout)}


def test_ports_are_told_by_their_usb_ids(there):
    there(UNO, COPY, Port("/dev/ttyS7"))
    found = rows()
    assert [found[name]["kind"].partition(",")[0] for name in sorted(found)] == [
        "Arduino Uno R3",
        "serial port",
        "CH340 adapter",
    ]
    assert "asked" not in found["/dev/ttyACM7"]


def test_a_probe_asks_boards_of_arduino_named_robots_and_ports_given_but_no_others(there, serve):
    given, named, other = (serve(robot_id=i) for i in (1, 2, 3))
    there(Port(other.path), COPY, UNO)
    mrl("names", "add", "lab2", "--port", named.path)
    found = rows("--probe", given.path)
    assert {name for name, row in found.items() if row["asked"]} == {given.path, named.path, UNO.device}
    assert (found[given.path]["robot_id"], found[named.path]["robot_id"]) == (1, 2)
    assert found[named.path]["name"] == "lab2" and not other.received


def test_a_port_that_does_not_exist_is_an_error():
    assert "'/nope' does not exist" in fails(3, "ports", "--probe", "/nope")


def test_a_port_in_use_is_never_opened(there, serve):
    port = serve()
    there(Port(port.path, (), 0x2341, 0x0043))
    link = SerialLink(port.path)
    try:
        row = rows("--probe")[port.path]
    finally:
        link.close()
    assert not row["asked"] and "process" in row["used_by"] and not port.received


def test_a_port_that_a_program_opens_while_others_are_asked_is_not_opened(serve, monkeypatch):
    port, asked = serve(), []
    monkeypatch.setattr(probe, "probe", lambda *given: asked.append(given))
    link = SerialLink(port.path)
    try:
        ((_, answer),) = probe.probe_all([(port.path, 115200, 0.5)])
    finally:
        link.close()
    assert "in use by" in answer.error and not asked


def test_a_usb_port_has_time_for_boot_loader_and_old_firmware(there, serve, monkeypatch):
    asked, pty = {}, serve().path
    monkeypatch.setattr(probe, "probe", lambda *port: asked.update({port[0]: port[2]}) or probe.Answer())
    there(UNO)
    rows("--probe", pty)
    assert asked == {pty: probe.RUNNING_S, UNO.device: TIMEOUT_S}
