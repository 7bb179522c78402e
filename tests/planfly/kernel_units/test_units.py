"""Units call the kernels that are counted for them, and no others."""

import json
import subprocess
import sys
from pathlib import Path

from planfly.kernel_units.unit_kernels import BOTH, UNIT_KERNELS, kernels_of

ROOT = Path(__file__).parents[3]
# The kernels that a process calls are those with types, where all are in the cache: what they call comes with them.
CODE = """
import json, sys
from planfly.kernel_units.ready_kernels import do_unit
said = {}
for unit in sys.argv[1:]:
    said[unit] = []
    do_unit(unit, said[unit].append)
rooms = ("aircraft", "flight", "logs", "planner", "world")
modules = [module for name, module in list(sys.modules.items()) if name.split(".")[0] in rooms]
every = [one for module in modules for one in vars(module).values() if getattr(one, "signatures", ())]
missed = sum(sum(one.stats.cache_misses.values()) for one in every)
print(json.dumps([missed, said, sorted({f"{one.py_func.__module__}.{one.py_func.__name__}" for one in every})]))
"""


def test_units_call_what_is_counted_for_them() -> None:
    missed = 1
    while missed:
        done = subprocess.run([sys.executable, "-c", CODE, *BOTH], cwd=ROOT, capture_output=True, text=True, check=True)
        missed, said, called = json.loads(done.stdout)
    for unit, lines in said.items():
        assert sorted(lines) == sorted(f"ready {name}" for name in UNIT_KERNELS[unit]), unit
    assert called == sorted(kernels_of(BOTH))
