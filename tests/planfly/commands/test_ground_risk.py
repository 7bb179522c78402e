"""``planfly ground-risk``: exit codes, files and answers."""

import json
from pathlib import Path

import pytest
import shapely

from planfly.cli import main
from planfly.terminal.ground_risk_answers import GroundRiskAnswer
from tests.planfly.campaigns.test_find_ground_risk import write_density
from tests.planfly.misuse.every_command import SHORT

_FLIGHTS = ("--flights", "20", "--workers", "2", "--seed", "1")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("short.waypoints").write_text(SHORT)
    return tmp_path


def test_a_mission_over_a_population(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_density(folder / "people.tif", 312.0, half_width=0.05)
    words = ("ground-risk", "tight", *_FLIGHTS, "--population", "people.tif", "--population-unit", "per-km2")
    assert main([*words, "--out", "risk", "--json", "answer.json"]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith(
        "risk      intrinsic ground risk class 5: 2.8956 m span, 31 m/s, at most 312 people/km²\n"
    )
    assert "not an approval" in printed
    answer = GroundRiskAnswer(**json.loads(Path("answer.json").read_text()))
    assert (answer.exit_code, answer.ground_risk_class, answer.flights) == (0, 5, 20)
    assert answer.population is not None
    assert answer.population.max_density_per_km2 == 312.0
    assert sorted(file.name for file in Path("risk").iterdir()) == [
        "ground-risk.geojson",
        "ground-risk.kml",
        "ground-risk.md",
        "ground-risk.png",
        "report.html",
    ]
    page = Path("risk/report.html").read_text(encoding="utf-8")
    assert '<div class="answer reached">' in page
    assert "<td><strong>class</strong></td><td><strong>5</strong></td>" in page.replace(' class=""', "")
    assert "planfly ground-risk tight --population people.tif --population-unit per-km2 --probability 0.95" in page
    features = json.loads(Path("risk/ground-risk.geojson").read_text())["features"]
    geography, volume, footprint = (shapely.geometry.shape(feature["geometry"]) for feature in features)
    assert volume.buffer(1e-6).covers(geography)
    assert footprint.buffer(1e-6).covers(volume)
    assert "| **class** | **5** |" in Path("risk/ground-risk.md").read_text()


def test_a_partial_cover_ends_with_3(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_density(folder / "people.tif", 312.0, half_width=0.05, nodata_from=64)
    words = ("ground-risk", "tight", *_FLIGHTS, "--population", "people.tif", "--population-unit", "per-km2")
    assert main([*words]) == 3
    assert capsys.readouterr().out.startswith("risk      class not judged: people.tif has data for ")


def test_a_bad_raster_ends_with_2_before_the_flights(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "people.tif").write_bytes(b"II*\0")
    assert main(["ground-risk", "tight", *_FLIGHTS, "--population", "people.tif", "--out", "risk", "--quiet"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "people.tif: not a readable population raster" in error
    assert not Path("risk").exists()


def test_a_mission_without_terrain_ends_with_2(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["ground-risk", "short.waypoints", *_FLIGHTS, "--quiet"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "heights above ground need terrain: name an elevation file" in error
