"""``planfly run --refine N``: tighten, plan and fly again, keep every round."""

import json
from pathlib import Path

import pytest

from planfly.cli import main

HILL = """\
name = "hill"
[terrain]
kind = "peaks"
@@PEAKS@@
[area]
east_m = [-500, 6000]
north_m = [-3000, 3000]
ceiling_amsl_m = 1000
[start]
east_m = 0
north_m = 0
amsl_m = 120
[destination]
east_m = 5500
north_m = 0
amsl_m = 200
[limits]
max_climb_deg = 30
max_turn_deg = 40
min_clearance_m = 60
"""


# A ridge with a way round its northern end, 1.5 km off the straight line.
RIDGE = "".join(
    f"[[terrain.peak]]\neast_m = 1500\nnorth_m = {north}\nheight_m = 180\nsigma_m = 350\n"
    for north in range(-4200, 1201, 300)
)


def rounds_of(folder: Path) -> list[dict[str, object]]:
    loaded = json.loads((folder / "rounds.json").read_text(encoding="utf-8"))
    assert isinstance(loaded, list)
    return loaded


def test_a_plan_over_the_hill_becomes_one_round_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "hill.toml").write_text(HILL.replace("@@PEAKS@@\n", RIDGE), encoding="utf-8")
    out = tmp_path / "out"
    assert main(["run", str(tmp_path / "hill.toml"), "--out", str(out), "--refine", "3", "--guidance", "path"]) == 0
    rounds = rounds_of(out)
    assert 2 <= len(rounds) <= 4
    assert rounds[0]["flyable"] is False
    assert rounds[-1]["flyable"] is True
    assert rounds[-1]["next"] == "done: it flies"
    assert "limits.max_climb_deg: 30.0 to aircraft" in str(rounds[1]["changes"])
    assert json.loads((out / "verdict.json").read_text(encoding="utf-8"))["flyable"] is True
    for number in range(len(rounds) - 1):
        kept = json.loads((out / f"round-{number}" / "verdict.json").read_text(encoding="utf-8"))
        assert kept["flyable"] is False
        assert (out / f"round-{number}" / "flight.mcap").exists()
    # The scenario that a round is judged in stays the one given; only the planning is tightened.
    plan = json.loads((out / "plan.json").read_text(encoding="utf-8"))
    assert plan["scenario"]["limits"]["max_climb_deg"] == "aircraft"
    assert "rounds\n" in capsys.readouterr().out


def test_what_cannot_fly_is_shown_not_to(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["run", "tight", "--out", str(out), "--refine", "2"]) == 4
    rounds = rounds_of(out)
    assert len(rounds) >= 2
    assert not any(entry["flyable"] for entry in rounds)
    assert str(rounds[-1]["next"]).startswith("ended: ")
    # Run again, the old rounds are cleared away, whatever else lies there stays.
    (out / "mine.txt").write_text("keep", encoding="utf-8")
    assert main(["run", "jacksboro", "--out", str(out), "--overwrite"]) == 0
    assert (out / "mine.txt").exists()
    assert not list(out.glob("round*"))
    capsys.readouterr()
