"""A first run of somebody's model in a process of its own, because JSBSim may abort where it should complain."""

import os
import subprocess
import sys
from functools import cache
from pathlib import Path

from aircraft.catalog import Aircraft, model_hash
from world.errors import FlightError

_SECONDS = 60.0
_REFUSED = 3
_RUN = f"""
import sys
from pathlib import Path
from aircraft.catalog import read_aircraft
from flight.dynamics.fdm import Fdm
from world.errors import FlightError
try:
    fdm = Fdm(read_aircraft(Path(sys.argv[1])), tried=True)
    fdm.move_to(500.0)
    fdm.balance(fdm.first_guess())
    fdm.step(10)
    del fdm
except FlightError:
    sys.exit({_REFUSED})
"""


def try_model(aircraft: Aircraft) -> None:
    """Load and step a model in another process, once for each version of it.

    Raises FlightError where that process dies.  Where it only refuses the model, nothing is raised:
    loading it here will refuse it again, with the reason.
    """
    code = _try(str(aircraft.folder), model_hash(aircraft))
    if code not in {0, _REFUSED}:
        how = "hangs" if code is None else "aborts the process"
        raise FlightError(
            f"{aircraft.model_file}: JSBSim {how} with this model, probably over an undefined property",
            file=aircraft.model_file,
        )


@cache
def _try(folder: str, _version: str) -> int | None:
    """The exit code of the process, or None if it does not end."""
    # The child finds our packages where this process found them.
    root = str(Path(__file__).parents[2])
    paths = os.pathsep.join([root, *filter(None, [os.environ.get("PYTHONPATH")])])
    try:
        done = subprocess.run(
            [sys.executable, "-c", _RUN, folder],
            env=os.environ | {"PYTHONPATH": paths}, capture_output=True, check=False, timeout=_SECONDS,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return None
    return done.returncode
