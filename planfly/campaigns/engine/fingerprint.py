"""What a worker flies with: two that differ in it may not fly flights of one campaign."""

import hashlib
import platform
from functools import cache
from importlib import metadata, resources
from pathlib import Path

from aircraft.catalog import find_aircraft, model_hash
from planfly import __version__
from world.errors import PlanflyError

# Packages whose version may move a bit of a flight.
_PACKAGES = ("jsbsim", "numba", "numpy", "scipy")
_ROOMS = ("aircraft", "flight", "logs", "planfly", "planner", "world")


class WorkerError(PlanflyError):
    """A worker does not fly what the campaign flies."""


@cache
def code_hash() -> str:
    """Hash of planfly's own sources, as installed here."""
    digest = hashlib.sha256()
    for room in _ROOMS:
        root = Path(str(resources.files(room)))
        for file in sorted(root.rglob("*.py")):
            digest.update(str(file.relative_to(root)).encode())
            digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def fingerprint(aircraft: str) -> dict[str, str]:
    """What decides a flight of this aircraft on this machine, by name.

    >>> sorted(fingerprint("aerosonde"))
    ['jsbsim', 'model', 'numba', 'numpy', 'planfly', 'python', 'scipy', 'sources']
    """
    try:
        model = model_hash(find_aircraft(aircraft))
    except PlanflyError as error:
        model = f"none: {error}"
    return {
        "planfly": __version__,
        "sources": code_hash(),
        "model": model,
        "python": ".".join(platform.python_version_tuple()[:2]),
        **{name: metadata.version(name) for name in _PACKAGES},
    }


def refuse_different(mine: dict[str, str], theirs: dict[str, str], worker: str) -> None:
    """Raise WorkerError, naming the worker and what differs first, unless it flies what this process would.

    >>> refuse_different({"planfly": "0.1.0"}, {"planfly": "0.0.9"}, "tls://10.0.0.7:4000")
    Traceback (most recent call last):
    ...
    planfly.campaigns.engine.fingerprint.WorkerError: worker tls://10.0.0.7:4000: planfly 0.0.9, not 0.1.0 as here
    """
    for name, value in mine.items():
        if theirs.get(name) != value:
            found, allowed = theirs.get(name), f"not {value} as here"
            message = f"worker {worker}: {name} {found or 'missing'}, {allowed}"
            raise WorkerError(message, file=f"worker {worker}", field=name, value=found, allowed=allowed)
