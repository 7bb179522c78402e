"""Seeded plans with numbers of our choosing, and the run of the default scenario."""

from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from planfly.cli import main
from planfly.planning.paper import SeededPlan
from planner.plan import Objectives, Violations
from tests.logs.blank_pictures import draw_nothing
from tests.shared import made_once


def made_plan(algorithm: str, seed: int, length: float, kill: float, bad: int = 0) -> SeededPlan:
    """A plan of the paper's problem of seven threats; bad: violations of the first kind.  Half a second a seed."""
    scores = Violations(bad, 0, 0, 0), Objectives(length, kill, 2.0 * seed, 5.0)
    numbers = (*scores, kill == 0.0, 0.1 * (kill > 0), 0.2)
    return SeededPlan(7, algorithm, seed, np.zeros((3, 3)), *numbers, 100, np.zeros((2, 3)), 0.5 * seed)


def default_run() -> tuple[int, str, dict[str, bytes]]:
    """Of ``planfly run`` its exit code, what it prints, and its files by name, the pictures blank."""

    def run() -> tuple[int, str, dict[str, bytes]]:
        with TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch, redirect_stdout(StringIO()) as out:
            draw_nothing(patch)
            patch.chdir(folder)
            code = main(["run"])
            return code, out.getvalue(), {file.name: file.read_bytes() for file in Path(DEFAULT_RUN).iterdir()}

    return made_once("default-run", run)


# Where it leaves them.
DEFAULT_RUN = "runs/jacksboro-seed1"
