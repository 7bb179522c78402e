"""The drawn ground is the real one, in a campaign's own judgement as when the log of its flight is judged again."""

import math
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from logs.recording.reader import read_log
from logs.verdict.verdict import Verdict
from planfly.api.flying import check
from planfly.campaigns.campaign_base import CampaignBase, open_campaign, vary_flight
from planfly.campaigns.dispersions import QUANTITIES, Draw, parse_dispersions
from planfly.campaigns.flight_row import FlightRow, find_minimum_margins, fly_one, list_failed_findings
from tests.planfly.campaigns.made_campaigns import MISSION, SCENARIO
from world.scenario import Scenario, scenario_from_spec, with_ground

# Height error of the map, m: the ground, at 100 m on the map, is at 120 m.
ERROR_M = 20.0
# The mission is flown 80 m above the map's ground, at 180 m AMSL, over this place.
MISSILE = (1000.0, 0.0)
SPREAD = f'[terrain_height]\ndistribution = "uniform"\nloc = {ERROR_M}\nscale = 1e-9\nsource = "x"\n'
# Start and destination are as high as in `SCENARIO`, but stated above ground; the area has no stated ceiling.
ABOVE_GROUND = (
    SCENARIO.replace("amsl_m = 180", "height_m = 80")
    .replace("ceiling_amsl_m = 400\n", "")
    .replace('turbulence = "light"', 'turbulence = "none"\ngradient = 0.01')
)


def campaign_over(folder: Path, radius: float, extra: str = "") -> CampaignBase:
    """A campaign whose flights pass over a missile of this radius, m, which stands on the ground."""
    missile = f"[[threats]]\neast_m = {MISSILE[0]}\nnorth_m = {MISSILE[1]}\nkill_radius_m = {radius}\n"
    (folder / "short.toml").write_text(ABOVE_GROUND + missile + extra)
    (folder / "short.waypoints").write_text(MISSION)
    options = {"scenario": folder / "short.toml", "seed": 1}
    return open_campaign(str(folder / "short.waypoints"), parse_dispersions(SPREAD, "x"), options)


def assert_same_judgement(row: FlightRow, verdict: Verdict) -> None:
    """The row says of its flight what the verdict on its log says."""
    assert (row.outcome == "flyable") is verdict.flyable
    assert row.failed == list_failed_findings(verdict)
    judged = dict(find_minimum_margins(verdict.findings))
    assert [rule for rule, _ in row.margins] == list(judged)
    for rule, margin in row.margins:
        assert margin.value == pytest.approx(judged[rule].value, abs=1e-6), rule
        assert margin.place == judged[rule].place


@pytest.mark.parametrize(("radius", "flies"), [(50.0, True), (70.0, False)])
def test_a_missile_on_the_ground_stands_on_the_drawn_ground(tmp_path: Path, radius: float, flies: bool) -> None:
    """Overhead, the cosine is 1: 80 m above the map's ground are 60 m above the drawn one, inside of 70 m."""
    base, log = campaign_over(tmp_path, radius), tmp_path / "flight.mcap"
    row = fly_one(base, 0, log=log)
    verdict, flight = check(log), read_log(log)
    assert row.missile_distance is not None
    # The distance from the missile on the drawn ground, point by point of the track.
    place = np.array([*MISSILE, 100.0 + ERROR_M])
    distance = float(np.linalg.norm(flight.track.position - place, axis=1).min())
    assert row.missile_distance == pytest.approx(distance - radius, abs=0.05)
    assert row.missile_distance == pytest.approx(80.0 - ERROR_M - radius, abs=5.0)
    assert (row.outcome == "flyable") is flies
    assert_same_judgement(row, verdict)
    # Nothing is said of a destination that the mission misses.
    assert not [finding.reason for finding in verdict.findings if "scenario's destination" in finding.reason]


@pytest.mark.parametrize("away", [0.0, 60.0, 200.0])
def test_the_distance_from_a_missile_changes_by_the_error_times_the_direction_cosine(away: float) -> None:
    """At 80 m above the map's ground and `away` m beside it: 80 / r times a small error."""
    text = ABOVE_GROUND + f"[[threats]]\neast_m = 1000\nnorth_m = {away}\nkill_radius_m = 10\n"
    scenario = _scenario(text)
    assert scenario.terrain is not None
    point, error = np.array([1000.0, 0.0, 180.0]), 0.5
    raised = with_ground(scenario, replace(scenario.terrain, heights=scenario.terrain.heights + np.float32(error)))
    near, far = (float(np.linalg.norm(point - one.threats.position[0])) for one in (raised, scenario))
    cosine = 80.0 / math.hypot(80.0, away)
    assert far - near == pytest.approx(error * cosine, abs=error**2 / 80.0)


def _scenario(text: str) -> Scenario:
    return scenario_from_spec(tomllib.loads(text), "made")


ON_THE_GROUND = """\
[[threats]]
east_m = 900
north_m = 300
height_m = 12
detection_radius_m = 400
[[threats]]
east_m = 900
north_m = 500
amsl_m = 131
kill_radius_m = 20
[home]
place = "start"
[returns]
rally = [{east_m = 500, north_m = 100, height_m = 15}, {east_m = 500, north_m = 200, amsl_m = 118}]
[[zones]]
name = "mast"
kind = "exclusion"
east_m = 700
north_m = 500
radius_m = 50
floor_agl_m = 0
ceiling_agl_m = 40
[link]
frequency_mhz = 868
power_dbm = 20
sensitivity_dbm = -110
east_m = 0
north_m = 0
"""


def test_what_stands_on_the_ground_moves_and_planned_altitudes_stay(tmp_path: Path) -> None:
    """Threats and rally points above ground, and home; not start, destination, ceiling, wind, or what is AMSL."""
    base = campaign_over(tmp_path, 10.0, ON_THE_GROUND)
    draw = Draw(0, 99, {one.name: one.nominal for one in QUANTITIES} | {"terrain_height": ERROR_M})
    drawn, planned = vary_flight(base, draw).setup.scenario, base.scenario
    assert drawn.threats.position[:, 2].tolist() == [120.0, 132.0, 131.0]
    assert drawn.home is not None
    assert drawn.home[2] == 120.0
    assert (drawn.start[2], drawn.destination[2], drawn.ceiling) == (180.0, 180.0, 1100.0)
    assert drawn.returns is not None
    assert drawn.returns.rally[:, 2].tolist() == [135.0, 118.0]
    assert drawn.zones == planned.zones
    # From the file of the scenario and the ground, as a log has them, it is the same scenario: rally points below
    # the ground are judged, not refused.
    again = scenario_from_spec(drawn.to_json(), "log", ground=drawn.terrain, is_stored=True)
    assert again.to_json() == drawn.to_json()
    for name in ("start", "destination", "home", "bounds"):
        np.testing.assert_array_equal(getattr(again, name), getattr(drawn, name))
    np.testing.assert_array_equal(again.threats.position, drawn.threats.position)
    np.testing.assert_array_equal(again.returns.rally, drawn.returns.rally)
    assert (again.ceiling, again.floor, again.wind) == (drawn.ceiling, drawn.floor, drawn.wind)
    assert again.link == drawn.link


@pytest.mark.parametrize(("error", "flies"), [(-15.0, True), (70.0, False)])
def test_a_flight_far_above_or_just_above_the_drawn_ground_is_judged_alike(
    tmp_path: Path, error: float, flies: bool
) -> None:
    """Of 80 m above the map's ground 95 m or 10 m are left; 60 m are required."""
    base, log = campaign_over(tmp_path, 5.0), tmp_path / "flight.mcap"
    base = replace(base, dispersions=parse_dispersions(SPREAD.replace(f"{ERROR_M}", f"{error}"), "x"))
    row = fly_one(base, 0, log=log)
    assert (row.outcome == "flyable") is flies
    assert dict(row.margins)["clearance"].value == pytest.approx(20.0 - error, abs=5.0)
    assert_same_judgement(row, check(log))


def test_the_plan_of_a_flight_is_in_the_drawn_world(tmp_path: Path) -> None:
    """The log of a planned mission, too, keeps the destination where it was planned."""
    (tmp_path / "short.toml").write_text(ABOVE_GROUND.replace("[limits]", "[planner]\nwaypoints = 4\n[limits]"))
    base = open_campaign(str(tmp_path / "short.toml"), parse_dispersions(SPREAD, "x"), {})
    assert base.plan is not None
    log = tmp_path / "flight.mcap"
    row = fly_one(base, 0, log=log)
    plan = read_log(log).setup.plan
    assert plan is not None
    np.testing.assert_array_equal(plan.scenario.destination, base.plan.scenario.destination)
    assert_same_judgement(row, check(log))
