"""python -m tests.soak.meet_hostile_files FORMAT,FORMAT FIRST COUNT: each hostile file by the command that reads it.

In the folder that it is started in, which holds a valid file of each format; that is read first.  A line of JSON for
each: seed, exit code, seconds, what was said on standard error, and a traceback if there was one.
"""

import contextlib
import io
import json
import os
import resource
import subprocess
import sys
import time
import traceback
import warnings
from pathlib import Path
from typing import Any
from unittest import mock

# Loaded once for all: each model is tried in a process of its own.
import flight.dynamics.fdm  # noqa: F401
from planfly.cli import main
from tests.soak.hostile_files import hostile

MISSION = ("--scenario", "field.toml", "--guidance", "path")
# The valid file, the hostile one, and the command that reads it.
READ: dict[str, tuple[str, str, tuple[str, ...]]] = {
    "wpl": ("m.waypoints", "x.waypoints", ("check", "x.waypoints")),
    "plan": ("m.plan", "x.plan", ("check", "x.plan")),
    "toml": ("field.toml", "x.toml", ("check", "m.waypoints", "--scenario", "x.toml")),
    "geotiff": ("m.tif", "x.tif", ("check", "m.waypoints", "--terrain", "x.tif")),
    "mcap": ("m.mcap", "x.mcap", ("check", "x.mcap")),
    "jsbsim": ("own/own.xml", "bad/own/own.xml", ("check", "m.waypoints", "--aircraft", "./bad/own")),
    "parameters": ("m.parm", "x.parm", ("check", "m.waypoints", "--params", "x.parm")),
}


def run_in_fork(command: list[str], *, timeout: float, **_: Any) -> "subprocess.CompletedProcess[bytes]":
    """What ``python -c CODE ARGUMENTS`` does, in a fork of this process, which has loaded everything."""
    _, _, code, *arguments = command
    child = os.fork()
    if child == 0:
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        for number in (1, 2):
            os.dup2(os.open(os.devnull, os.O_WRONLY), number)
        sys.argv = ["-c", *arguments]
        ended = 1
        try:
            exec(compile(code, "trial", "exec"), {"__name__": "__main__"})
            ended = 0
        except SystemExit as stop:
            ended = int(stop.code or 0)
        finally:
            os._exit(ended)
    until = time.monotonic() + timeout
    while (found := os.waitpid(child, os.WNOHANG))[0] == 0:
        if time.monotonic() > until:
            os.kill(child, 9)
            os.waitpid(child, 0)
            raise subprocess.TimeoutExpired(command, timeout)
        time.sleep(0.002)
    return subprocess.CompletedProcess(command, os.waitstatus_to_exitcode(found[1]))


def meet(kind: str, seed: int | None) -> dict[str, Any]:
    """Have a command read one; None stands for the valid file."""
    valid, name, argv = READ[kind]
    data = Path(valid).read_bytes()
    Path(name).write_bytes(data if seed is None else hostile(kind, data, seed))
    said, trace = io.StringIO(), ""
    begun = time.process_time()
    forked = mock.patch("flight.dynamics.model_check.subprocess.run", run_in_fork)
    with forked, contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
        try:
            code = main(argv)
        except SystemExit as stop:
            code = int(stop.code or 0)
        except BaseException:
            code, trace = -1, traceback.format_exc()
    spent = time.process_time() - begun
    return {"seed": seed, "code": code, "seconds": round(spent, 3), "said": said.getvalue(), "trace": trace}


if __name__ == "__main__":
    # What a library warns of is met as a user meets it, and would be seen in what was said.
    warnings.simplefilter("default")
    here = set(Path().iterdir())
    size = int(Path("/proc/self/statm").read_text("ascii").split()[0]) * resource.getpagesize()
    limit = size + 3 * 2**30
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    kinds, first, count = sys.argv[1].split(","), int(sys.argv[2]), int(sys.argv[3])
    for kind in kinds:
        print(json.dumps({"valid": meet(kind, None)}), flush=True)
    for seed in range(first, first + count):
        for kind in kinds:
            print(json.dumps({"begun": seed}), flush=True)
            print(json.dumps(meet(kind, seed)), flush=True)
    left = set(Path().iterdir()) - here - {Path(READ[kind][1]) for kind in kinds}
    print(json.dumps({"left": sorted(map(str, left))}), flush=True)
