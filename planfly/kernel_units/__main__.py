"""``python -m planfly.kernel_units``: do the units whose names come on standard input, and tell what is compiled.

Lines out: ``ready KERNEL`` for each kernel of a unit that is compiled or loaded, then ``done UNIT`` or ``failed UNIT``.
The process ends, wherever it stands, when its standard input does: nobody waits for it any more.
"""

import gc
import os
import queue
import signal
import sys
import threading


def answer_requests() -> int:
    """Do what is asked for until nothing more is."""
    # Ctrl-C reaches all processes of a terminal: this one ends with the one that started it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    asked: queue.Queue[str] = queue.Queue()
    threading.Thread(target=_listen, args=(asked,), daemon=True).start()
    # Looking for garbage among what numba makes takes a twentieth of the compiling, and finds little.
    gc.set_threshold(200_000, 50, 50)
    from planfly.kernel_units.ready_kernels import do_unit

    while True:
        unit = asked.get()
        try:
            do_unit(unit, _tell)
        except Exception:
            # What it was to compile is compiled where it is needed, and fails there by its own name.
            _tell(f"failed {unit}")
        else:
            _tell(f"done {unit}")


def _listen(asked: queue.Queue[str]) -> None:
    for line in sys.stdin:
        asked.put(line.strip())
    os._exit(0)


def _tell(line: str) -> None:
    print(line, flush=True)


if __name__ == "__main__":
    sys.exit(answer_requests())
