"""What benchmarks read of this repository is there: nobody runs all of them between two releases."""

import importlib

import pytest


@pytest.mark.parametrize(
    ("module", "name"),
    [
        ("benchmarks.task", "BEST_KNOWN"),
        ("benchmarks.campaigns.winds_reference", "REFERENCE"),
        ("benchmarks.identification", "MISSIONS"),
        ("benchmarks.tuning.published_aircraft", "FOLDER"),
    ],
)
def test_what_a_benchmark_reads_is_there(module: str, name: str) -> None:
    assert getattr(importlib.import_module(module), name).exists()


def test_the_best_known_path_of_a_hard_problem_is_read() -> None:
    """1.0099: the shortest of what CMA-ES, OMPL, SLSQP and the planner found (tests/authorities/best_known.json)."""
    from benchmarks.task import best_known

    assert 1.0 < best_known("hard-07") < 1.02
