"""Workers of this machine stay as many as were asked for, no fewer and no more, whichever of them die.

dask starts a worker anew that dies at work, but gives up one that dies while it starts.
"""

import contextlib
import threading
import time
from collections.abc import Iterator
from typing import Any

# s between two looks, and for which a worker may be away: it is back in some seconds, and dask strikes it off its list
# after 15 (`distributed.deploy.lost-worker-timeout`).
_LOOK, _PATIENCE = 1.0, 20.0


@contextlib.contextmanager
def kept_workers(cluster: Any, count: int, patience: float = _PATIENCE) -> Iterator[None]:
    """Start others where workers of a cluster stay away, and end those that are too many.

    cluster: a `distributed.LocalCluster`.
    patience: s.
    """
    over = threading.Event()

    def watch() -> None:
        whole_at, asked = time.monotonic(), False
        while not over.wait(_LOOK):
            missing = count - len(cluster.scheduler_info["workers"])
            if missing <= 0:
                whole_at, asked = time.monotonic(), False
                if len(cluster.worker_spec) > count:
                    # Those that others were started for came back after all.
                    cluster.scale(count)
            elif time.monotonic() - whole_at > patience:
                # What was struck off is started under its old name; what still does not come back, under a new one.
                cluster.scale(len(cluster.worker_spec) + (missing if asked else 0))
                whole_at, asked = time.monotonic(), True

    watcher = threading.Thread(target=watch, name="kept workers", daemon=True)
    watcher.start()
    try:
        yield
    finally:
        over.set()
        watcher.join()
