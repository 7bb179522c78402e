"""``python -m planfly.kernel_units``: compile units, and report their kernels.

The units are named on standard input.

Lines out: ``ready KERNEL`` for each kernel of a unit that is compiled or loaded, then ``done UNIT`` or ``failed UNIT``.
The process ends as soon as its standard input closes, since no process waits for it any more.
"""

import functools
import os
import queue
import signal
import sys
import threading

from planfly.runtime.process_setup import prepare_process, with_large_stack


def answer_requests() -> int:
    """Compile the units named on standard input, one after another; the process ends when the input ends.

    After each unit a line is printed: "done" or "failed", and the name of the unit.
    """
    # Ctrl-C reaches all processes of a terminal: this process ends with the process that started it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    requested: queue.Queue[str] = queue.Queue()
    threading.Thread(target=_queue_requests, args=(requested,), daemon=True).start()
    prepare_process()
    from planfly.kernel_units.ready_kernels import run_unit

    while True:
        unit = requested.get()
        try:
            with_large_stack(functools.partial(run_unit, unit, _print_line))
        except Exception:
            # The kernels of this unit are compiled later, where they are needed, and report their own errors there.
            _print_line(f"failed {unit}")
        else:
            _print_line(f"done {unit}")


def _queue_requests(requested: queue.Queue[str]) -> None:
    """Queue the lines of standard input; end the process when the input ends."""
    for line in sys.stdin:
        requested.put(line.strip())
    os._exit(0)


def _print_line(line: str) -> None:
    """Print a line for the parent process."""
    print(line, flush=True)


if __name__ == "__main__":
    sys.exit(answer_requests())
