"""Temporary certificates, as Python's own TLS takes them."""

import socket
import ssl
import threading
from datetime import UTC, datetime
from pathlib import Path

import pytest
from cryptography import x509

from planfly.replays.certificates import Certificate, make_temporary_certificate


def context(kind: int, held: Certificate, trusted: Certificate, folder: Path) -> ssl.SSLContext:
    """TLS that shows a certificate, and demands that the other end shows one that it trusts."""
    for name, text in (("cert", held.certificate), ("key", held.key)):
        (folder / name).write_text(text)
    made = ssl.SSLContext(kind)
    made.load_cert_chain(folder / "cert", folder / "key")
    made.load_verify_locations(cadata=trusted.certificate)
    made.verify_mode = ssl.CERT_REQUIRED
    return made


def greeted(server: ssl.SSLContext, client: ssl.SSLContext) -> bytes:
    """What a client hears of a server through TLS that both check."""
    here, there = socket.socketpair()

    def serve() -> None:
        try:
            with server.wrap_socket(there, server_side=True) as stream:
                stream.sendall(b"welcome")
        except OSError:
            there.close()

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        with client.wrap_socket(here, server_hostname="localhost") as stream:
            return stream.recv(100)
    finally:
        here.close()
        thread.join()


def test_who_holds_it_is_known_and_who_does_not_is_refused(tmp_path: Path) -> None:
    ours, other = make_temporary_certificate(), make_temporary_certificate()
    server = context(ssl.PROTOCOL_TLS_SERVER, ours, ours, tmp_path)
    assert greeted(server, context(ssl.PROTOCOL_TLS_CLIENT, ours, ours, tmp_path)) == b"welcome"
    with pytest.raises(OSError, match=r"(?i)alert|certificate|reset"):
        greeted(server, context(ssl.PROTOCOL_TLS_CLIENT, other, ours, tmp_path))
    with pytest.raises(ssl.SSLCertVerificationError):
        greeted(server, context(ssl.PROTOCOL_TLS_CLIENT, ours, other, tmp_path))


def test_no_clock_makes_it_invalid() -> None:
    """A clock that is set back or on by decades during a run."""
    made = x509.load_pem_x509_certificate(make_temporary_certificate().certificate.encode())
    assert made.not_valid_before_utc <= datetime(1970, 1, 1, tzinfo=UTC)
    assert made.not_valid_after_utc >= datetime(2200, 1, 1, tzinfo=UTC)
