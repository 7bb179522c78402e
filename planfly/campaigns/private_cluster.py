"""What a dask cluster of this machine needs beside dask's own: a certificate, no HTTP, and a clock that nobody sets.

A dask scheduler and its workers run whatever they are sent, and loopback is open to every user of the machine.
"""

import time
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
    keep_steady_time()


def keep_steady_time() -> None:
    """Let dask's messages in this process go out by a clock that nobody sets.

    dask holds a message back for some milliseconds after the one before, until a time of the wall clock: where that is
    set back by an hour meanwhile, the message, and all that follow on its connection, wait for the hour.  Tornado says
    of `IOLoop.time` that it is relative to any time, but compares it with that of dask.  Neither has a setting for it.
    """
    import distributed.batched
    from tornado.ioloop import IOLoop

    # They state no types that a clock of another kind would fit.
    messages: Any = distributed.batched
    loop: Any = IOLoop
    messages.time, loop.time = time.monotonic, staticmethod(time.monotonic)
