"""A TLS listener on loopback with a certificate and a token of its own."""

from mrl_driver.host import certificate
from mrl_driver.transport.address import parse
from mrl_driver.transport.tls_listener import TlsListener

TOKEN = "0123456789abcdef" * 2


def encrypted(tell, port=0, asked=None):
    """A listener, and the link that its clients open; `asked` gets the tokens that were shown."""

    def admits(token):
        if asked is not None:
            asked.append(token)
        return token == TOKEN

    context = certificate.context()
    listener = TlsListener(parse(f"tls://127.0.0.1:{port}", listening=True), context, admits, tell)
    return listener, link_of(listener.address)


def link_of(address, token=TOKEN, sha256=None):
    """The link of a listener with the certificate of the user's folder."""
    return f"tls://{token}@{address.host}:{address.port}?sha256={sha256 or certificate.fingerprint()}"
