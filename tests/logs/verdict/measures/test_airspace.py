"""The zones that a flight is judged by: the scenario's first, then its mission's fence."""

from dataclasses import replace

from flight.mission.items import Command, Frame, MissionItem
from logs.verdict.measures.airspace import airspace_of, with_fence_zones
from logs.verdict.places import Place
from tests.logs.verdict.judging import ROUTE
from tests.synthetic import make_setup
from world.airspace.zones import Cylinder, Zone


def circle(seq: int, radius: float) -> MissionItem:
    params = (radius, 0.0, 0.0, 0.0)
    return MissionItem(seq, int(Command.NAV_FENCE_CIRCLE_INCLUSION), int(Frame.GLOBAL), params, 46.0, 8.0, 0.0)


def test_the_scenarios_zones_come_before_the_fences() -> None:
    setup = make_setup(ROUTE)
    mast = Zone("mast", "exclusion", Cylinder(0.0, 0.0, 9.0))
    setup = replace(setup, scenario=replace(setup.scenario, zones=(mast,)))
    setup = replace(setup, mission=replace(setup.mission, fences=(circle(0, 500.0),)))
    airspace = airspace_of(setup)
    assert (len(airspace.zones), airspace.of_scenario, airspace.fault) == (2, 1, "")
    assert airspace.place(0) == Place("exclusion", 0, name="mast")
    assert airspace.place(1) == Place("inclusion", 1, name="fence item 0")
    assert float(airspace.records.zones[1].radius) == 500.0


def test_a_fence_that_is_none_is_named_and_left_out() -> None:
    setup = make_setup(ROUTE)
    setup = replace(setup, mission=replace(setup.mission, fences=(circle(3, -1.0),)))
    airspace = airspace_of(setup)
    assert airspace.zones == ()
    assert airspace.fault == "the mission: fence item 3: radius -1 m: must be above 0"


def test_what_draws_zones_has_the_fence_among_them() -> None:
    setup = make_setup(ROUTE)
    assert with_fence_zones(setup) is setup
    mast = Zone("mast", "exclusion", Cylinder(0.0, 0.0, 9.0))
    setup = replace(setup, scenario=replace(setup.scenario, zones=(mast,)))
    fenced = with_fence_zones(replace(setup, mission=replace(setup.mission, fences=(circle(0, 500.0),))))
    assert [zone.name for zone in fenced.scenario.zones] == ["mast", "fence item 0"]
    assert [zone.name for zone in setup.scenario.zones] == ["mast"]
