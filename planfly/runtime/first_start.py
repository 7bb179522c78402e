"""Compile kernels at the first start after an install, in two processes, before the work begins."""

import contextlib
import os
import queue
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path

from planfly.kernel_units.unit_kernels import list_unit_kernels
from planfly.runtime.stages import has_receiver, report_line, stage
from world.kernel_cache import CACHE_DIR_VARIABLE, can_write

# ----------------------------------------------------------------------
# Units of kernels are compiled by separate processes, which store them in the cache.

# Number of processes; with more, some would only wait, because the longest unit takes nearly half of the total time.
PROCESS_COUNT = 2
# Arguments of Python; -P leaves out the current folder, whose modules may have the names of planfly's modules.
PYTHON_ARGUMENTS = ("-P", "-m", "planfly.kernel_units")
# Line that marks the end of the output of a process.
_END_OF_OUTPUT = ""


def compile_units(units: list[str], folder: Path, on_ready: Callable[[int], None]) -> None:
    """Compile units of `planfly.kernel_units` in `PROCESS_COUNT` processes.

    Return when each is ready or has failed.

    units: names of units, the unit that takes longest first.
    folder: cache folder of the kernels.
    on_ready: called with the number of kernels that are ready so far.
    The processes end with this call, even if it raises an error, and with this process.
    """
    remaining_units, lines = deque(units), queue.SimpleQueue[str]()
    process_count = min(PROCESS_COUNT, len(units), os.cpu_count() or 1)
    # Each process compiles units named on its standard input.
    home = str(Path(__file__).parents[2])
    path = os.pathsep.join(filter(None, [home, os.environ.get("PYTHONPATH", "")]))
    processes = [
        subprocess.Popen(
            [sys.executable, *PYTHON_ARGUMENTS],
            env=os.environ | {"PYTHONPATH": path, "NUMBA_CACHE_DIR": str(folder)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            bufsize=1,
        )
        for _ in range(process_count)
    ]
    threads = [
        threading.Thread(target=_feed_process, args=(process, remaining_units, lines), daemon=True)
        for process in processes
    ]
    try:
        for thread in threads:
            thread.start()
        ready_kernels: set[str] = set()
        ended_process_count = 0
        while ended_process_count < process_count:
            line = lines.get()
            ended_process_count += line == _END_OF_OUTPUT
            state, _, name = line.partition(" ")
            if state == "ready" and name not in ready_kernels:
                ready_kernels.add(name)
                on_ready(len(ready_kernels))
    finally:
        for process in processes:
            process.kill()
        for process, thread in zip(processes, threads, strict=True):
            process.wait()
            thread.join()


def _feed_process(
    process: "subprocess.Popen[str]", remaining_units: "deque[str]", lines: "queue.SimpleQueue[str]"
) -> None:
    """Send unit names to a process, one after another, and queue the lines that it prints.

    Run in a thread.

    `_END_OF_OUTPUT` is queued when no unit remains or the process has died.

    remaining_units: names of the units that no process has started; shared by the threads.
    lines: queue for the printed lines.
    """
    requests, answers = process.stdin, process.stdout
    # The process may have died, or the other process may have taken the last unit.
    with contextlib.suppress(OSError, IndexError):
        while requests is not None and answers is not None:
            requests.write(f"{remaining_units.popleft()}\n")
            line = "ready"
            while line.startswith("ready"):
                line = answers.readline()
                lines.put(line.strip() or "died")
            if not line:
                break
    for pipe in (requests, answers):
        with contextlib.suppress(OSError):
            if pipe is not None:
                pipe.close()
    lines.put(_END_OF_OUTPUT)


# ----------------------------------------------------------------------
# When the first kernel has to be compiled, all kernels that the work needs are compiled in parallel.

# Title of the stage; a command may show it more than once, because each group of kernels is compiled at its first use.
STAGE_TITLE = "compiling numeric kernels"
# End of the title if the compiled kernels are stored.
_CACHE_NOTE = ", which later runs load"
# Hint at the environment variable that names another cache folder.
_CACHE_DIR_HINT = f"set {CACHE_DIR_VARIABLE} to a folder that can be written"
# Units that this process has compiled or tried to compile.
_compiled_units: set[str] = set()


def compile_and_report(all_units: Sequence[str]) -> None:
    """Compile the units that this process has not compiled, with a progress report.

    If the cache cannot be written, only the reason is reported, and each kernel is compiled when it is called.  The
    same holds, without a reason, for an embedded Python, which has no executable to start processes with.

    all_units: units of `planfly.kernel_units`, the unit that takes longest first.
    """
    # Imported here: code that compiles kernels has already imported it.
    from world.kernels import IS_TEMPORARY, PREFERRED_FOLDER, cache_folder

    units = [unit for unit in all_units if unit not in _compiled_units]
    folder = cache_folder()
    if not can_write(folder):
        report_line(
            f"compiling the numeric kernels: {folder} cannot be written, so they are not stored; {_CACHE_DIR_HINT}"
        )
        return
    if IS_TEMPORARY:
        report_line(
            f"compiling the numeric kernels for this command only: {PREFERRED_FOLDER} cannot be written;"
            f" {_CACHE_DIR_HINT}"
        )
    title = STAGE_TITLE if IS_TEMPORARY else STAGE_TITLE + _CACHE_NOTE
    if not (units and sys.executable and has_receiver()):
        report_line(f"{title} ...")
    if not units or not sys.executable:
        return
    total = len(list_unit_kernels(tuple(units)))
    with stage(title, STAGE_TITLE) as advance:
        advance(0, total, f"0 of {total}")
        compile_units(units, folder, lambda done: advance(done, total, f"{done} of {total}"))
    _compiled_units.update(units)
