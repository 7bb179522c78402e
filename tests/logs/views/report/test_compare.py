"""Two flights are measured alike, and nothing differs where nothing differs."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial import KDTree

from flight.simulation.track import Track
from logs.recording.reader import FlightLog, read_log
from logs.verdict.findings import make_finding
from logs.verdict.places import Place
from logs.verdict.verdict import Verdict
from logs.views.compare import NamedFlight
from logs.views.report.compare import (
    Comparison,
    compare_logs,
    comparison_data,
    comparison_views,
    difference_lines,
    measure_nearest_distances,
    write_comparison,
)
from tests.soak import SOAK


def compared(first: FlightLog, second: FlightLog) -> tuple[Comparison, dict[str, Any]]:
    found = compare_logs(first, second, names=("a.mcap", "b.mcap"))
    return found, {item.name: item for item in found.differences}


def test_a_flight_does_not_differ_from_itself(log_file: Path) -> None:
    log = read_log(log_file)
    found, items = compared(log, log)
    assert all(item.first == item.second or math.isnan(item.first) for item in items.values())
    assert found.notes == ("tracks: 0.00 m apart on average, 0.00 m at most",)
    assert compare_logs(log, log, names=("x", "x")).names == ("x (first)", "x (second)")


def test_a_rule_that_fails_shows_no_margin_of_what_passes_beside_it(
    log_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    passed = make_finding("slope", Place("leg", 1), ok=True, reason="", margin=1.47, unit="deg")
    failed = make_finding("slope", Place("leg", 2), ok=False, reason="too steep", margin=11.6, unit="deg")
    verdicts = iter([(passed,), (passed, failed)])
    monkeypatch.setattr(
        "logs.views.report.compare._judge_log",
        lambda _: Verdict(next(verdicts), flyable=False, complete=True, lines=("",), level="flown"),
    )
    log = read_log(log_file)
    found, items = compared(log, log)
    assert (items["findings that fail"].first, items["findings that fail"].second) == (0.0, 1.0)
    assert items["smallest margin: slope"].first == 1.47
    assert math.isnan(items["smallest margin: slope"].second)
    (line,) = (line for line in difference_lines(found) if "smallest margin: slope" in line)
    assert "11.6" not in line


def test_a_name_is_printed_whole(log_file: Path) -> None:
    """The names of two logs may differ at their beginnings only."""
    log = read_log(log_file)
    names = ("north-02-bad-ridge-cross.waypoints.mcap", "south-02-bad-ridge-cross.waypoints.mcap")
    header = difference_lines(compare_logs(log, log, names=names))[0]
    assert header.split() == [*names, "difference"]


def test_a_rule_is_called_as_on_the_terminal(log_file: Path) -> None:
    log = read_log(log_file)
    _, items = compared(log, log)
    assert "smallest margin: loss of control" in items
    assert not [name for name in items if "departure" in name]


def test_differences_and_notes_state_what_differs(log_file: Path, other: FlightLog, track: Track) -> None:
    found, items = compared(read_log(log_file), other)
    assert items["time in the air"].second - items["time in the air"].first == pytest.approx(0.5)
    assert items["energy used"].second == pytest.approx(2 * items["energy used"].first)
    assert items["energy used"].first == pytest.approx(float(track.energy[-1]))
    assert any(note.startswith("wind: 3.3 m/s from 211°") for note in found.notes)
    assert "10.0 m at most" in found.notes[-1]
    lines = difference_lines(found)
    assert len({len(line) for line in lines[2:-4]}) == 1
    assert "energy used (Wh)" in "\n".join(lines)


def test_a_flight_without_guidance_has_its_cross_track_named(log_file: Path) -> None:
    ours = read_log(log_file)
    none = np.full_like(ours.track.cross_track, np.nan)
    recorded = replace(ours, track=replace(ours.track, cross_track=none, height_error=none))
    found, items = compared(ours, recorded)
    assert math.isnan(items["largest cross-track"].second)
    (note,) = (note for note in found.notes if "cross-track" in note)
    assert "the log of b.mcap does not contain" in note


# ----------------------------------------------------------------------
# The comparison's pictures and page: whole, with both verdicts, the same bytes each time.


def test_pictures_and_page_are_whole(log_file: Path, other: FlightLog, tmp_path: Path) -> None:
    found = compare_logs(read_log(log_file), other, names=("a.mcap", "b.mcap"))
    files = write_comparison(tmp_path / "out", found, svg=True)
    assert [file.name for file in files] == [
        "compare-map.png",
        "compare-profile.png",
        "compare-map.svg",
        "compare-profile.svg",
        "compare.html",
    ]
    first = [file.read_bytes() for file in files]
    assert all(data.startswith(b"\x89PNG") for data in first[:2])
    assert all(ElementTree.fromstring(data).tag.endswith("svg") for data in first[2:4])
    assert b"energy used" in first[4]
    # Both verdicts in a sentence first, and the pictures inside: the page can be sent alone.
    page = first[4].decode("utf-8")
    assert 0 < page.index("a.mcap:</strong>") < page.index("b.mcap:</strong>") < page.index("<table")
    assert page.count("data:image/") == 2
    assert 'src="compare' not in page
    if SOAK:
        assert [file.read_bytes() for file in write_comparison(tmp_path / "out", found, svg=True)] == first


def test_the_page_has_both_flights_and_a_map_where_they_share_an_origin(log_file: Path) -> None:
    log = read_log(log_file)
    first = NamedFlight("a.mcap", log.setup, log.track)

    def data(second: NamedFlight) -> dict[str, Any]:
        return comparison_data((first, second), comparison_views((first, second)))

    made = data(replace(first, name="b.mcap"))
    assert [(one["name"], one["role"]) for one in made["flight"]["flights"]] == [
        ("a.mcap", "flown"),
        ("b.mcap", "other"),
    ]
    assert [layer["name"] for layer in made["charts"]["along"]["panels"][0]["layers"]] == ["a.mcap", "b.mcap"]
    origin = log.setup.scenario.origin
    away = replace(log.setup.scenario, origin=replace(origin, lat_deg=origin.lat_deg + 1.0))
    apart = data(replace(first, setup=replace(log.setup, scenario=away)))
    assert (apart["scene"], "map" in apart["charts"]) == (None, False)


@pytest.mark.parametrize("apart", [0.0, 40.0, 9000.0])
def test_the_nearest_of_a_track_is_that_of_a_tree(apart: float) -> None:
    """Turns, a climb, and a second way that is noise about the first, some way off, and of another length."""
    time = np.arange(0.0, 400.0, 0.25)
    course = np.cumsum(0.02 * np.sign(np.sin(time / 25.0)))
    track = np.cumsum(np.column_stack([6.0 * np.sin(course), 6.0 * np.cos(course), 0.3 + 0.0 * time]), axis=0)
    points = track[100:1333] + np.random.default_rng(2).normal(0.0, 4.0, (1233, 3)) + np.array([apart, 0.0, 0.0])
    wanted = KDTree(track).query(points)[0]
    assert measure_nearest_distances(points, track) == pytest.approx(wanted, abs=1e-9)
