"""Compare flights with and without fused multiply-add in all kernels, as compilers for other processors use it.

``python -m benchmarks.fused_multiply_add``: plans and flies `jacksboro-air` as usual, and flies the same plan again in
a process whose kernels may fuse products and sums (LLVM's ``contract``), in a cache folder of its own (some minutes).
The compiled model then differs from JSBSim in its last bits, so its comparison with JSBSim is left out.  Prints the
largest difference of each column of the tracks in units of the column's resolution.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import planfly
from flight.simulation.track import COLUMNS, DIGITS

# Program of the second process: plan and target are its arguments.
_FLY_FUSED = """
import sys
import numba

_njit = numba.njit
numba.njit = lambda *args, **keywords: _njit(*args, **(keywords | {"fastmath": {"contract"}}))

import numpy as np
import planfly
from flight.dynamics.compiled_model import CompiledModel
from flight.simulation.track import COLUMNS
from planfly.api import api_function

# Other processes would compile the kernels without fused multiply-add.
api_function.compile_and_report = lambda units: None
CompiledModel.find_differences = lambda self: []
flown = planfly.fly(sys.argv[1], seed=1)
np.savez(sys.argv[2], **{name: getattr(flown.track, name) for name in COLUMNS})
"""


def main() -> None:
    """Fly twice, compare and print."""
    with tempfile.TemporaryDirectory() as folder_name:
        folder = Path(folder_name)
        command = [sys.executable, "-m", "planfly", "plan", "jacksboro-air", "--seed", "1", "--quiet"]
        subprocess.run([*command, "--out", str(folder / "plan.json")], check=True)
        track = planfly.fly(folder / "plan.json", seed=1).track
        subprocess.run(
            [sys.executable, "-c", _FLY_FUSED, str(folder / "plan.json"), str(folder / "fused.npz")],
            env=os.environ | {"NUMBA_CACHE_DIR": str(folder / "cache")},
            check=True,
        )
        fused = np.load(folder / "fused.npz")
        print(f"{len(track)} rows without and {len(fused['time'])} rows with fused multiply-add")
        count = min(len(track), len(fused["time"]))
        for name in COLUMNS:
            resolution = 2.0 ** -DIGITS.get(name, 0)
            difference = np.abs(getattr(track, name)[:count] - fused[name][:count]).max()
            print(f"  {name:14s} largest difference {difference:.3g} = {difference / resolution:.3g} quanta")


if __name__ == "__main__":
    main()
