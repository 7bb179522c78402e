"""The figures of the page on real flights are those that the benchmark wrote."""

import json
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "against-real-flights.md").read_text(encoding="utf-8")
RESULTS = json.loads((ROOT / "benchmarks" / "real_flights.json").read_text(encoding="utf-8"))
# Columns of the two tables of bands.
COLUMNS = {"thor": ("inside", "half_width", "unchanged"), "circle": ("on_circle", "inside", "half_width")}


@pytest.mark.parametrize("flight", COLUMNS)
def test_the_tables_of_bands_are_the_benchmarks(flight: str) -> None:
    """Each quantity's row on the page has the benchmark's figures."""
    result = RESULTS[flight]
    for name in result["inside"]:
        values = [f"{result[column][name]:g}" for column in COLUMNS[flight]]
        rows = [
            [f"{float(cell):g}" for cell in line.split("|")[2:-1]]
            for line in PAGE.splitlines()
            if line.startswith(f"| {name} (")
        ]
        assert values in rows, name


def test_the_other_figures_of_thor_are_the_benchmarks() -> None:
    """Errors of short predictions, power without current, and the number of windows."""
    thor = RESULTS["thor"]
    for row in ("ahead", "ahead_base_alone"):
        ahead = ", ".join(f"{thor[row][axis]:g}" for axis in ("roll", "pitch", "yaw"))
        assert f"| {ahead} |" in PAGE, row
    whites = sorted(thor["white"].values())
    share = f"{100.0 * whites[0]:.0f} to {100.0 * whites[-1]:.0f} %"
    assert f"{share} of the autocorrelations at lags up to 0.5 s" in PAGE
    low, middle, high = thor["power_without_current"]
    assert f"| {middle} W, {low} to {high} W |" in PAGE
    assert f"in {thor['windows']} windows of 2 s" in PAGE


def test_the_rows_hold() -> None:
    """The rows that the figures must meet: 0.88 to 0.99 inside, 0.6 of constant rates, 128 W inside the interval."""
    thor, circle = RESULTS["thor"], RESULTS["circle"]["on_circle"]
    for name in ("bank", "pitch", "airspeed", "height rate", "power"):
        assert 0.88 <= thor["inside"][name] <= 0.99, name
    for name in ("bank", "ground speed", "cross-track"):
        assert circle[name] >= 0.88, name
    assert max(thor["ahead"].values()) <= 0.6
    low, _, high = thor["power_without_current"]
    assert low <= 128.0 <= high
