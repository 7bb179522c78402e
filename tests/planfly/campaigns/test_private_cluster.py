"""The cluster of this machine against whoever else is on it: nobody without the run's certificate is answered."""

import asyncio
import contextlib
import os
import socket
import ssl
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import distributed.batched
import psutil
import pytest
from distributed import Security
from distributed.batched import BatchedSend
from distributed.core import rpc
from tornado.ioloop import IOLoop

from planfly.campaigns.private_cluster import keep_steady_time, private_security
from planfly.campaigns.worker_pool import Workers, connected
from planfly.certificates import Certificate, temporary_certificate

Address = tuple[str, int]
# s.  For an answer that must not come: a server that shuts a connection does so at once.
PATIENCE = 2.0


@dataclass(frozen=True)
class Cluster:
    """Every port on which a cluster listens, in this process and its children, and what its own client holds."""

    listeners: list[Address]
    security: Security


@pytest.fixture(scope="module")
def cluster() -> Iterator[Cluster]:
    """A cluster of one worker."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("planfly.campaigns.worker_pool._LOOK", 0.2)
        with connected(Workers(1)) as client:
            assert list(client.run(os.getuid).values()) == [os.getuid()], "who holds the certificate is served"
            clock = client.run(eval, "__import__('distributed').batched.time.__qualname__")
            assert list(clock.values()) == [distributed.batched.time.__qualname__] == ["monotonic"]
            processes = [psutil.Process(), *psutil.Process().children(recursive=True)]
            found = [
                (connection.laddr.ip, connection.laddr.port)
                for process in processes
                for connection in process.net_connections(kind="inet")
                if connection.status == psutil.CONN_LISTEN
            ]
            yield Cluster(found, client.security)


def told_by_dask(scheme: str, address: Address, security: Security, patience: float = PATIENCE) -> bool:
    """Whether a dask server says who it is to a client of dask's own."""

    async def ask() -> object:
        args = security.get_connection_args("client")
        async with rpc(f"{scheme}://{address[0]}:{address[1]}", timeout=patience, connection_args=args) as server:
            return await asyncio.wait_for(server.identity(), patience)

    try:
        return bool(asyncio.run(ask()))
    except (OSError, TimeoutError, ValueError, RuntimeError, TypeError):
        return False


def told(stream: socket.socket, said: bytes) -> bytes:
    """What comes back of bytes that are sent."""
    with contextlib.suppress(OSError):
        stream.sendall(said)
        return stream.recv(1000)
    return b""


def through_tls(address: Address, said: bytes, held: Certificate | None, folder: Path) -> bytes:
    """What comes back through TLS to a stranger, who checks nothing and shows a certificate of his own, or none."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    if held is not None:
        for name, text in (("cert", held.certificate), ("key", held.key)):
            (folder / name).write_text(text)
        context.load_cert_chain(folder / "cert", folder / "key")
    with (
        contextlib.suppress(OSError),
        socket.create_connection(address, PATIENCE) as plain,
        context.wrap_socket(plain) as stream,
    ):
        return told(stream, said)
    return b""


def test_scheduler_nanny_and_worker_listen_and_answer_who_holds_the_certificate(cluster: Cluster) -> None:
    """And nothing that speaks HTTP."""
    assert len(cluster.listeners) == 3
    assert all(told_by_dask("tls", address, cluster.security, 120.0) for address in cluster.listeners)


def test_no_listener_answers_a_stranger(cluster: Cluster, tmp_path: Path) -> None:
    """Dask's own client in plain TCP, with no certificate, with dask's temporary one, with another run's; and bytes."""
    identity = b"\x02\x00\x00\x00\x00\x00\x00\x00" + b"\x81\xa2op\xa8identity"
    web = b"GET /info/main/workers.html HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
    for address in cluster.listeners:
        assert not told_by_dask("tcp", address, Security())
        assert not told_by_dask("tls", address, Security.temporary())
        assert not told_by_dask("tls", address, private_security())
        for said in (identity, web):
            with socket.create_connection(address, PATIENCE) as plain:
                # A TLS server may send an alert, a record of type 21, and nothing else.
                assert told(plain, said)[:1] in (b"", b"\x15")
        assert through_tls(address, web, None, tmp_path) == b""
        assert through_tls(address, identity, None, tmp_path) == b""
        # It has the names of the run's certificate, but is another.
        assert through_tls(address, web, temporary_certificate(), tmp_path) == b""


def test_each_run_has_a_certificate_of_its_own() -> None:
    one, other = private_security(), private_security()
    assert one.require_encryption
    assert one.tls_ca_file == one.tls_worker_cert == one.tls_client_cert == one.tls_scheduler_cert
    assert one.tls_ca_file != other.tls_ca_file
    assert one.tls_worker_key != other.tls_worker_key


class Connection:
    """What a `BatchedSend` writes to."""

    def __init__(self) -> None:
        self.written: list[str] = []

    def closed(self) -> bool:
        return False

    async def write(self, payload: list[str], **_: object) -> int:
        self.written += payload
        return 0


async def sent(set_back: Callable[[], None]) -> list[str]:
    """What goes out of three messages within 5 s, where the clock is set back while the second is held back."""
    connection, stream = Connection(), BatchedSend("300 ms")
    stream.start(connection)
    until = time.monotonic() + 5.0
    for number, message in enumerate(("one", "two", "three"), start=1):
        stream.send(message)
        if message == "two":
            set_back()
        while len(connection.written) < number and time.monotonic() < until:
            await asyncio.sleep(0.001)
    return connection.written


def test_a_message_does_not_wait_for_a_clock_that_is_set_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """The wall clock loses an hour in the 0.3 s for which a message waits; a campaign was seen to stand still."""
    wall = [0.0]
    monkeypatch.setattr(time, "time", lambda real=time.time: real() + wall[0])
    # dask has the clock of the moment at which it was imported.
    monkeypatch.setattr(distributed.batched, "time", lambda: time.time())
    monkeypatch.setattr(IOLoop, "time", lambda _: time.time())
    keep_steady_time()
    assert asyncio.run(sent(lambda: wall.__setitem__(0, -3600.0))) == ["one", "two", "three"]
