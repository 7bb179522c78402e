"""The go/no-go chart's files."""

import json
from dataclasses import replace
from pathlib import Path

from planfly.campaigns.find_winds import FEWEST, WindsFound, WindsGoal
from planfly.campaigns.flights.campaign_base import CampaignBase
from planfly.campaigns.report.wind_files import spokes, wind_lines, write_winds
from planfly.campaigns.statistics.wind_boundary import WindBoundary

FOUND = WindsFound(
    WindsGoal(0.9, 0.95, 4, 20.0, 99),
    (*(WindBoundary(7.0 + k, 6.5 + k, 7.5 + k, False) for k in range(3)), WindBoundary(20.0, 18.0, 20.0, True)),
    ((0, 8.0, True), (0, 8.0, False), (1, 5.0, True), (2, 5.0, True), (3, 20.0, True)),
    (1,),
)


def test_flights_are_counted_by_wind() -> None:
    first = spokes(FOUND)[0]
    assert (first.from_deg, first.flights) == (0.0, ((8.0, 2, 1),))
    assert wind_lines(FOUND)[0] == (
        "flies with P >= 0.9, by best estimate, in wind up to 7.0 m/s from 0° (the least; 6.5 to 7.5 m/s at 95 %),"
        " over 20 m/s from 270°"
    )


def test_what_flights_show_by_themselves_where_none_failed() -> None:
    """Of 132 in the largest wind 0.05 ** (1 / 132) at 95 %; fewer of one direction show less."""
    flights = (*((3, 20.0, True) for _ in range(132)), (3, 10.0, True), (0, 20.0, False))
    (line,) = (one for one in wind_lines(replace(FOUND, flights=flights)) if one.startswith("none failed"))
    assert line == "none failed from 1 of 4 directions: 132 flights in 20 m/s from each show P >= 0.978 by themselves"
    flights += tuple((2, 20.0, True) for _ in range(58))
    (line,) = (one for one in wind_lines(replace(FOUND, flights=flights)) if one.startswith("none failed"))
    assert "from 2 of 4 directions: 58 flights" in line
    assert "P >= 0.95 by" in line
    failed = replace(FOUND, flights=((3, 20.0, False), (0, 10.0, True)))
    assert not any(one.startswith("none failed") for one in wind_lines(failed))


def test_directions_for_which_flights_did_not_last_are_said() -> None:
    assert any("not settled: 4 of 4 directions" in line for line in wind_lines(FOUND))
    boundary = WindBoundary(7.0, 6.8, 7.3, False)
    settled = WindsFound(FOUND.goal, (boundary,), tuple((0, 7.0, True) for _ in range(FEWEST)))
    assert not any("not settled" in line for line in wind_lines(settled))
    fewer = WindsFound(FOUND.goal, (boundary,), settled.flights[1:])
    assert any("not settled: 1 of 1" in line for line in wind_lines(fewer))


def test_data_picture_and_page(base: CampaignBase, tmp_path: Path) -> None:
    write_winds(tmp_path, base, FOUND, "planfly winds x")
    data = json.loads((tmp_path / "winds.json").read_text())
    assert [one["boundary_mps"] for one in data["directions"]] == [7.0, 8.0, 9.0, 20.0]
    assert data["directions"][3]["beyond"] is True
    assert data["lost"] == [1]
    assert (tmp_path / "winds.png").read_bytes()[:4] == b"\x89PNG"
    page = (tmp_path / "winds.html").read_text()
    assert "over 20 m/s" in page
    assert page.count("<img") == 1
    # Of a direction that is known, and of one whose interval ends beyond.
    assert "6.5 to 7.5" in page
    assert "18.0 to over 20" in page
    assert "lost      1 could not be flown" in page


def test_flights_that_could_not_be_flown_are_named() -> None:
    assert any(line.endswith("and count as not flyable: 1 (8.0 m/s from 0°)") for line in wind_lines(FOUND))
    assert not any("lost" in line for line in wind_lines(replace(FOUND, lost=())))
