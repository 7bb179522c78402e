"""python -m tests.soak.meet_hostile_files FORMAT,FORMAT FIRST COUNT: each hostile file by the command that reads it.

In the folder that it is started in, which holds a valid file of each format.  A line of JSON for each: seed, exit code,
seconds, what was said on standard error, and a traceback if there was one.
"""

import contextlib
import io
import json
import resource
import sys
import time
import traceback
import warnings
from pathlib import Path

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
    "jsbsim": ("own/own.xml", "bad/own.xml", ("check", "m.waypoints", "--aircraft", "./bad")),
    "parameters": ("m.parm", "x.parm", ("check", "m.waypoints", "--params", "x.parm")),
}


def meet(kind: str, seed: int) -> dict[str, object]:
    """Have a command read one."""
    valid, name, argv = READ[kind]
    Path(name).write_bytes(hostile(kind, Path(valid).read_bytes(), seed))
    said, trace = io.StringIO(), ""
    begun = time.process_time()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
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
    for seed in range(first, first + count):
        for kind in kinds:
            print(json.dumps({"begun": seed}), flush=True)
            print(json.dumps(meet(kind, seed)), flush=True)
    left = set(Path().iterdir()) - here - {Path(READ[kind][1]) for kind in kinds}
    print(json.dumps({"left": sorted(map(str, left))}), flush=True)
