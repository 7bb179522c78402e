"""Half the steps of JSBSim change neither verdict nor track."""

import os

import pytest

from aircraft.catalog import Aircraft, load_aircraft
from planfly.campaigns.flights.campaign_base import CampaignBase
from planfly.campaigns.flights.step_rate import steps_of
from planfly.campaigns.flights.varied_flight import vary
from planfly.campaigns.spread.draws import draw_flight
from tests.bench.campaigns.compare_step_rates import MOST_APART, compare_all

SOAK = "PLANFLY_SOAK" in os.environ


def test_flights_are_the_same_at_half_the_steps() -> None:
    found = compare_all(range(200 if SOAK else 3))
    assert found["verdicts that differ"] == 0
    assert found["missions with other failed findings"] == 0
    for weather in ("calm", "wind without gusts"):
        # Not nothing: the two were flown at two rates.
        assert 1e-4 < found[f"{weather}: most between the tracks, m"] < MOST_APART


def test_flights_of_a_campaign_take_them(base: CampaignBase) -> None:
    assert vary(base, draw_flight(base.spread, base.seed, 0)).setup.fdm_hz == 60


@pytest.mark.parametrize(("name", "steps"), [("aerosonde", 60), ("c172x", 120)])
def test_only_what_was_compared_takes_them(name: str, steps: int) -> None:
    aircraft: Aircraft = load_aircraft(name)
    assert steps_of(aircraft) == steps
