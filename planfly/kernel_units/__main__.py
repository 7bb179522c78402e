"""``python -m planfly.kernel_units``: do the units named on standard input, and report which kernels are compiled.

Lines out: ``ready KERNEL`` for each kernel of a unit that is compiled or loaded, then ``done UNIT`` or ``failed UNIT``.
The process ends at once when its standard input does, since no process waits for it any more.
"""

import functools
import os
import queue
import signal
import sys
import threading

from planfly.runtime.process_setup import prepare_process, with_large_stack


def answer_requests() -> int:
    """Do one unit after another until standard input ends."""
    # Ctrl-C reaches all processes of a terminal: this one ends with the one that started it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    requested: queue.Queue[str] = queue.Queue()
    threading.Thread(target=_listen, args=(requested,), daemon=True).start()
    prepare_process()
    from planfly.kernel_units.ready_kernels import do_unit

    while True:
        unit = requested.get()
        try:
            with_large_stack(functools.partial(do_unit, unit, _report))
        except Exception:
            # What it was to compile is compiled where it is needed, and fails there by its own name.
            _report(f"failed {unit}")
        else:
            _report(f"done {unit}")


def _listen(requested: queue.Queue[str]) -> None:
    for line in sys.stdin:
        requested.put(line.strip())
    os._exit(0)


def _report(line: str) -> None:
    print(line, flush=True)


if __name__ == "__main__":
    sys.exit(answer_requests())
