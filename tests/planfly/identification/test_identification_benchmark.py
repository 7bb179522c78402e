"""A log that is refused is an answer of the benchmark, not its end."""

import json
from pathlib import Path
from typing import Any

import pytest

from benchmarks import identification
from world.errors import LogError


def test_a_refused_log_is_a_row_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def variant(seed: int, *_: object, **__: object) -> dict[str, Any]:
        if seed == 12:
            raise identification.NotFlown("seed 12: ended after 1 min")
        raise LogError(f"v{seed}.BIN: 1.2 min of it are flight on the wing")

    monkeypatch.setattr(identification, "one_variant", variant)
    out = tmp_path / "rows.json"
    monkeypatch.setattr("sys.argv", ["identification", "--first", "11", "--count", "2", "--out", str(out)])
    identification.main()
    # One that does not fly is none: the next seed takes its place.
    assert [row["seed"] for row in json.loads(out.read_text())] == [11, 13]
    assert "v11.BIN: 1.2 min of it are flight on the wing" in out.read_text()
    assert "seed 12: ended after 1 min" in capsys.readouterr().out


def test_what_was_refused_is_in_the_summary() -> None:
    assert identification.summary([{"seed": 11, "refused": "too short"}]) == {"refused": [11]}
