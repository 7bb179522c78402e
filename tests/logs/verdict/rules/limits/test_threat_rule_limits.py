"""A missile's sphere passed just outside and just inside its surface, planned and flown, and above as beside."""

import pytest

from logs.verdict.judge_flight import judge_geometry
from tests.logs.verdict.judging import failing, judge, missile, of
from tests.synthetic import fly_path, make_scenario, make_setup

WAY = [[0, 0, 300], [0, 6000, 300]]
THREAT = {"name": "battery", "north_m": 3000.0, "kill_radius_m": 500.0, "kill_scale_m": 100.0}


@pytest.mark.parametrize(("outside", "ok"), [(0.05, True), (-0.05, False), (-2.5, False)])
@pytest.mark.parametrize("place", [{"east_m": 1.0, "amsl_m": 0.0}, {"east_m": 0.0, "amsl_m": 1.0}])
def test_a_sphere_is_entered_at_its_surface(place: dict[str, float], outside: float, ok: bool) -> None:
    """Beside the path, and straight below it."""
    away = 500.0 + outside
    threat = THREAT | {"east_m": away * place["east_m"], "amsl_m": 300.0 - away * place["amsl_m"]}
    ground = {"kind": "flat", "amsl_m": -400.0}
    setup = make_setup(WAY, scenario=make_scenario(WAY, threats=[threat], terrain=ground))
    for verdict in (judge_geometry(setup), judge(setup, fly_path(setup))):
        assert (("threat", missile("battery")) not in failing(verdict)) is ok


@pytest.mark.parametrize(("swerve", "ok"), [(-39.9, True), (-40.1, False), (-42.5, False)])
def test_a_flight_is_judged_where_it_was_and_not_where_it_was_planned(swerve: float, ok: bool) -> None:
    threat = THREAT | {"east_m": -540.0, "amsl_m": 300.0}
    setup = make_setup(WAY, scenario=make_scenario(WAY, threats=[threat]))
    flown = judge(setup, fly_path(setup, across=lambda s: 0.0 * s + swerve))
    assert judge_geometry(setup).flyable
    assert (("threat", missile("battery")) not in failing(flown)) is ok
    if not ok:
        assert of(flown, "threat", missile("battery")).margin is not None
