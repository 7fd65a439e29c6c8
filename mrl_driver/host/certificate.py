"""The self-signed TLS certificate of this computer, for `mrl web`.

It is made on first use and stays the same, so that browsers know it again by its fingerprint.  No authority
signs it.  Certificate and private key are in one file that nobody else can read.
"""

import contextlib
import datetime
import hashlib
import ipaddress
import os
import ssl
from typing import Any, Callable, Iterator, Sequence, Tuple

from mrl_driver.errors import ConfigError
from mrl_driver.files import replace_file

from . import access

VALID_DAYS = 825
"""Browsers accept a self-signed certificate for at most this time [days]; source: https://support.apple.com/103769."""
EARLY_DAYS = 1  # it is valid from this time before it is made [days], for clients whose clock is slow
_REMEDY = "delete it, then start again: another one is made"


def path() -> str:
    """Return the file of certificate and private key; it may not exist."""
    return os.path.join(access.folder(), "certificate.pem")


def context(hosts: Sequence[str] = (), tell: Callable[[str], None] = lambda text: None) -> ssl.SSLContext:
    """Return the settings of a TLS server with this computer's certificate: TLS 1.2 and up.

    A certificate is made on first use, also for `hosts`.  If it has expired or is damaged, it is made again, and `tell`
    gets a line that says so.  ConfigError if the file cannot be used, other users can read it, or `cryptography` is
    missing.
    """
    with access.lock():
        if not os.path.exists(path()):
            replace_file(path(), _make(hosts), private=True)
        problem = _problem(access.read(path(), _REMEDY))
        if problem:
            replace_file(path(), _make(hosts), private=True)
            tell(
                f"the certificate {problem}, so another one was made: browsers ask again; "
                f"its SHA-256 is {fingerprint()}"
            )
        return _server_context()


def fingerprint() -> str:
    """Return the certificate's SHA-256 in 64 hexadecimal digits, after `context`; ConfigError if it is damaged."""
    text = access.read(path(), _REMEDY).decode("ascii", "replace")
    try:
        return hashlib.sha256(ssl.PEM_cert_to_DER_cert(text[text.index("-----BEGIN CERT") :])).hexdigest()
    except ValueError:
        raise ConfigError(f"{path()} is damaged, expected a certificate; {_REMEDY}") from None


def _server_context() -> ssl.SSLContext:
    made = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    made.minimum_version = ssl.TLSVersion.TLSv1_2
    made.options |= ssl.OP_NO_RENEGOTIATION
    made.load_cert_chain(path(), password="")  # or OpenSSL asks for the password of an encrypted key
    return made


def _problem(data: bytes) -> str:
    """Return what is wrong with the stored certificate; empty if it can be used."""
    x509, _, _, _, backend = _cryptography()
    try:
        found = x509.load_pem_x509_certificate(data, backend)
        _server_context()  # checks that the private key belongs to it
    except (ValueError, ssl.SSLError):
        return "was damaged"
    ends = getattr(found, "not_valid_after_utc", None)
    ends = ends or found.not_valid_after.replace(tzinfo=datetime.timezone.utc)  # before cryptography 42
    return "has expired" if ends < datetime.datetime.now(datetime.timezone.utc) else ""


def _make(hosts: Sequence[str]) -> bytes:
    x509, ec, hashes, serialization, backend = _cryptography()
    key = ec.generate_private_key(ec.SECP256R1(), backend)
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "mrl-driver")])
    now = datetime.datetime.now(datetime.timezone.utc)
    unused = "content_commitment key_encipherment data_encipherment key_agreement key_cert_sign crl_sign"
    usage = dict.fromkeys((*unused.split(), "encipher_only", "decipher_only"), False)
    made = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - datetime.timedelta(days=EARLY_DAYS))
        .not_valid_after(now + datetime.timedelta(days=VALID_DAYS - EARLY_DAYS))
        .add_extension(x509.SubjectAlternativeName(_alternatives(x509, hosts)), critical=False)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(x509.KeyUsage(digital_signature=True, **usage), critical=True)
        .add_extension(x509.ExtendedKeyUsage([x509.ExtendedKeyUsageOID.SERVER_AUTH]), critical=False)
        .sign(key, hashes.SHA256(), backend)
    )
    pem, form = serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8
    return key.private_bytes(pem, form, serialization.NoEncryption()) + made.public_bytes(pem)


def _alternatives(x509: Any, hosts: Sequence[str]) -> Iterator[Any]:
    """Yield the names and addresses that the certificate is for, without those that it cannot hold."""
    names = ["localhost", *access.own_names(), "127.0.0.1", "::1", *access.own_addresses(), *hosts]
    for name in (each for each in dict.fromkeys(names) if each not in access.ANY):
        try:
            yield x509.IPAddress(ipaddress.ip_address(name.partition("%")[0]))
        except ValueError:
            with contextlib.suppress(ValueError):
                yield x509.DNSName(name.encode("idna").decode("ascii"))


def _cryptography() -> Tuple[Any, Any, Any, Any, Any]:
    """Return the modules of the library: `x509`, `ec`, `hashes`, `serialization`, and its backend."""
    try:
        from cryptography import x509
        from cryptography.hazmat.backends import default_backend
        from cryptography.hazmat.primitives import hashes, serialization
        from cryptography.hazmat.primitives.asymmetric import ec
    except ImportError:
        raise ConfigError(
            "a TLS certificate needs the library cryptography, which is missing; install it with: "
            "pip install 'mrl-driver[web]'"
        ) from None
    return x509, ec, hashes, serialization, default_backend()
