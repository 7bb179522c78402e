"""Third-party clients: where they are, and what happens where they are not."""

import os
import shutil
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
# Set by .ci/run, which installs every client: a missing one then fails its tests.  The variable CI alone does not mean
# that a machine has them.
NEED_CLIENTS = "PLANFLY_NEED_CLIENTS"
# What `make` installs with npm; a checkout shares it with none.
NODE_MODULES = Path(os.environ.get("PLANFLY_NODE_MODULES", ROOT / ".node" / "node_modules"))


def need(found: str | Path | None, name: str, how: str) -> str:
    """Return a client's path; without it fail under .ci/run, and skip elsewhere with the reason.

    found: None, or a path that does not exist, for a client that is not there.
    """
    if found is not None and Path(found).exists():
        return str(found)
    reason = f"{name} is not installed ({how})"
    if os.environ.get(NEED_CLIENTS):
        pytest.fail(f"{reason}: under .ci/run every client is needed")
    pytest.skip(reason)


def beside_python(name: str) -> Path | None:
    """A command that pip installed into this interpreter's environment, or one on the path."""
    here = Path(sys.executable).with_name(name)
    if here.exists():
        return here
    found = shutil.which(name)
    return None if found is None else Path(found)
