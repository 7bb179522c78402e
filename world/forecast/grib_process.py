"""Read a GRIB file in another process.

Its library, eccodes, aborts the process on some damaged files.  It also brings other versions of PROJ and SQLite, with
which pyproj and rasterio, if they are imported later, end the process, and prints to standard error.
"""

import os
import pickle
import subprocess
import sys
from pathlib import Path

from world.errors import ForecastError
from world.forecast.forecast import Box, Forecast

# Writes a pickled Forecast or ForecastError to standard output, to which no library prints.
_PROGRAM = """
import os, pickle, sys
try:
    import resource
    resource.setrlimit(resource.RLIMIT_DATA, (int(sys.argv[1]),) * 2)
except (ImportError, ValueError):
    pass  # Windows has no such limit, and the limit of a shell may be lower.
answer = os.fdopen(os.dup(1), "wb")
os.dup2(2, 1)
from world.errors import ForecastError
from world.forecast.read_forecast import read_grib
try:
    found = read_grib(*pickle.load(sys.stdin.buffer))
except ForecastError as error:
    found = error
pickle.dump(found, answer)
"""
# Limit of the process's memory, bytes: one changed byte in a message can ask eccodes for 16 GB.  A file of 2 million
# places is read in less than 1 GB, message by message.
_MEMORY_LIMIT_BYTES = 3 * 2**30
# Time after which the process is ended, s.
_TIMEOUT_S = 1800.0


def read_in_process(path: Path, box: Box, ground_amsl: float) -> Forecast:
    """Read a GRIB file in another process, because its library aborts the process on some damaged files.

    box: area around the mission.
    ground_amsl: altitude of the ground at the mission's start, m, for heights above ground.

    Raises ForecastError for a file that cannot be read.
    """
    # The child process finds planfly's packages where this process found them.
    root = str(Path(__file__).parents[2])
    paths = os.pathsep.join([root, *filter(None, [os.environ.get("PYTHONPATH")])])
    try:
        process = subprocess.run(
            [sys.executable, "-c", _PROGRAM, str(_MEMORY_LIMIT_BYTES)],
            input=pickle.dumps((path, box, ground_amsl)),
            env=os.environ | {"PYTHONPATH": paths},
            capture_output=True,
            check=False,
            timeout=_TIMEOUT_S,
        )
        code, lines = process.returncode, process.stderr.decode(errors="replace").splitlines()
    except subprocess.TimeoutExpired:
        code, lines = None, []
    if code == 0:
        answer: Forecast | ForecastError = pickle.loads(process.stdout)
        if isinstance(answer, ForecastError):
            raise answer
        return answer
    # The last line of a Python traceback states the reason.
    reason = (
        lines[-1][:150] if code == 1 and lines else f"eccodes {'hangs' if code is None else 'aborts'} with this file"
    )
    raise ForecastError(f"{path}: damaged or incomplete: {reason}", file=str(path))
