"""What keeps a dask cluster of this machine to itself: a certificate that nobody else holds, and no HTTP beside it.

A dask scheduler and its workers run whatever they are sent, and loopback is open to every user of the machine.
"""

from typing import Any

from planfly.certificates import temporary_certificate

_ROLES = ("client", "scheduler", "worker")


def private_security() -> Any:
    """A `distributed.Security` with a new certificate: each end of a connection must prove that it holds it.

    It goes to the workers through the pipes by which they are started, and with this process it is gone.
    """
    from distributed.security import Security

    made = temporary_certificate()
    held = {
        f"tls_{role}_{part}": pem for role in _ROLES for part, pem in (("cert", made.certificate), ("key", made.key))
    }
    # It states no types.
    security: Any = Security
    return security(require_encryption=True, tls_ca_file=made.certificate, **held)


def dask_setup(server: Any) -> None:
    """Close the HTTP server of a scheduler or worker, which dask opens in any case and which asks nobody who he is.

    dask calls it, by this name, of a module that is preloaded.
    """
    server.http_server.stop()
