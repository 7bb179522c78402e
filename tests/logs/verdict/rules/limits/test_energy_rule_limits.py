"""A battery flown and predicted to just inside and just outside its reserve."""

from dataclasses import replace

import pytest

from aircraft.catalog import load_aircraft
from flight.dynamics.envelope_tables import load_envelope
from logs.verdict.judge_flight import judge_geometry
from logs.verdict.measures.route_requirements import predicted_energy, route_requirements
from tests.logs.verdict.judging import judge, of
from tests.synthetic import fly_path, make_scenario, make_setup

STRAIGHT = [[0, 0, 300], [0, 3000, 300]]


@pytest.mark.parametrize(("share", "ok"), [(0.795, True), (0.805, False)])
def test_a_fifth_of_the_battery_is_left_after_the_flight(share: float, ok: bool) -> None:
    """120 s of 300 W are 10 Wh; the made setup carries 100 Wh."""
    setup = make_setup(STRAIGHT)
    item = of(judge(setup, fly_path(setup, power=share * 100.0 * 3600.0 / 120.0)), "energy")
    assert item.ok is ok
    assert item.limit == pytest.approx(80.0)
    assert item.flown == pytest.approx(100.0 * share, rel=0.005)


@pytest.mark.parametrize(("share", "ok"), [(0.79, True), (0.81, False)])
def test_or_by_prediction(share: float, ok: bool) -> None:
    table = load_envelope(load_aircraft("aerosonde"))
    used, _ = predicted_energy(route_requirements(make_setup(STRAIGHT, table=table)))
    # Level at 25 m/s for 120 s.
    assert used == pytest.approx(table.power(25.0, 300.0, 0.0) * 120.0 / 3600.0, rel=1e-3)
    scenario = make_scenario(STRAIGHT, battery_wh=used / share)
    setup = make_setup(STRAIGHT, table=table, scenario=scenario)
    item = of(judge_geometry(replace(setup, battery=used / share)), "energy")
    assert item.ok is ok
