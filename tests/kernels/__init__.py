"""What a whole run of the tests compiles before it begins."""

import hashlib
from pathlib import Path

from planfly.campaigns.flight_requests import code_hash
from world.kernel_cache import PACKAGES
from world.kernels import cache_folder

ROOT = Path(__file__).parents[2]


def note_of_compiled() -> Path:
    """Return the file that exists once ``python -m tests.kernels`` has compiled these very sources.

    Its name has a digest of the sources, their paths and their times: numba keeps its kernels by all three.
    """
    stamps = [(str(file), file.stat().st_mtime_ns) for name in PACKAGES for file in (ROOT / name).rglob("*.py")]
    digest = hashlib.sha256(f"{code_hash()} {sorted(stamps)}".encode()).hexdigest()[:16]
    return cache_folder() / f"compiled-for-tests-{digest}"
