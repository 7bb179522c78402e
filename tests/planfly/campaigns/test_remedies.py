"""Suggested changes for each rule that fails."""

from dataclasses import replace
from pathlib import Path

from logs.verdict.places import Place
from planfly.campaigns.campaign_base import CampaignBase
from planfly.campaigns.failure_counts import count_failures
from planfly.campaigns.remedies import remedies
from planfly.campaigns.summary import CampaignSummary, DecidingRule
from tests.planfly.campaigns.made_report import made_report
from world.airfield import LandingStrip
from world.scenario import Scenario, load_scenario

WEATHER = "less wind or turbulence"
APPROACH = "another approach ([landing] course_deg, approach_m, slope_deg)"
SURVEY = "a survey of the strip's height ([landing] height_sd_m)"


def summary_of(base: CampaignBase, folder: Path, low_margin: float | None, *rules: tuple[str, ...]) -> CampaignSummary:
    """A summary in which each flight fails these rules; the first rule decides."""
    with made_report(base, folder) as (_, summary):
        pass
    by_rule = count_failures([[(rule, Place("leg", 1)) for rule in failed] for failed in rules])
    deciding = rules[0][0] if rules else "clearance"
    return replace(summary, by_rule=by_rule, deciding=(DecidingRule(deciding, low_margin, "m", ()),))


def strip_scenario(height_sd: float | None) -> Scenario:
    return replace(load_scenario("jacksboro-air"), landing=LandingStrip(0.0, 0.0, height_sd=height_sd))


def test_a_campaign_without_failures_needs_nothing(base: CampaignBase, tmp_path: Path) -> None:
    assert remedies(summary_of(base, tmp_path, 12.0), strip_scenario(None)) == ()


def test_a_strip_is_longer_at_both_ends_by_what_one_flight_in_twenty_lacks(base: CampaignBase, tmp_path: Path) -> None:
    """42 m at each end are 84 m: 90 m in steps of 10 m."""
    summary = summary_of(base, tmp_path, -42.0, ("touchdown",))
    longer = "a strip that is 90 m longer"
    assert remedies(summary, strip_scenario(0.5)) == (longer, APPROACH, WEATHER)
    assert remedies(summary, strip_scenario(None)) == (SURVEY, longer, APPROACH, WEATHER)


def test_the_rule_that_most_flights_fail_comes_first_and_each_remedy_once(base: CampaignBase, tmp_path: Path) -> None:
    summary = summary_of(base, tmp_path, -6.5, ("clearance",), ("clearance", "slope"), ("approach",))
    first, second, third, last = remedies(summary, strip_scenario(0.5))
    assert "7 m higher above ground" in first
    assert "gentler legs" in second or "gentler legs" in third
    assert last == WEATHER
