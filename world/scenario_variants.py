"""Variants of a scenario: another terrain, wind, flight or planner, or more threats."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from world.airspace.zone_tables import MOST_ZONES, ZoneTable
from world.airspace.zones_on_map import check_ends, make_zones
from world.errors import ScenarioError
from world.scenario import Scenario, from_spec
from world.scenario_file import checked_table
from world.scenario_positions import make_threats
from world.scenario_tables import FlightTable, PlannerTable, ThreatTable, WindTable

Floats = NDArray[np.float64]


def over_terrain(scenario: Scenario, terrain: str) -> Scenario:
    """A scenario over another elevation file.

    Its ends keep their heights above sea level; threats that stand on the ground stand on the new one.
    Raises TerrainError for a file that cannot be read or does not cover the area.

    >>> from world.scenario import load_scenario
    >>> over_terrain(load_scenario("jacksboro"), "jacksboro").terrain.source
    'jacksboro'
    """
    spec = fixed_ends(scenario.to_json(), scenario.start, scenario.destination)
    return from_spec(spec, scenario.name, terrain=terrain, external=scenario.external)


def fixed_ends(spec: dict[str, Any], start: Floats, destination: Floats) -> dict[str, Any]:
    """A scenario's JSON data with its ends at the heights of these points (m AMSL), whatever is below them.

    start, destination: (3,).  A height above ground (`height_m`) gives way to the one above mean sea level.

    >>> data = {"start": {"east_m": 0.0, "north_m": 0.0, "height_m": 50.0}, "destination": {"amsl_m": 300.0}}
    >>> fixed_ends(data, np.array([0.0, 0.0, 250.0]), np.array([900.0, 0.0, 300.0]))["start"]
    {'east_m': 0.0, 'north_m': 0.0, 'amsl_m': 250.0}
    """
    changed = dict(spec)
    for key, point in (("start", start), ("destination", destination)):
        if isinstance(spec.get(key), dict):
            kept = {name: value for name, value in spec[key].items() if name != "height_m"}
            changed[key] = kept | {"amsl_m": float(point[2])}
    return changed


def with_wind(scenario: Scenario, speed: float | None, from_course: float | None, turbulence: str | None) -> Scenario:
    """A scenario in another wind; None keeps what it has.

    speed: m/s, with from_course: rad, where it comes from.  turbulence: "none", "light" or "moderate".
    Raises ScenarioError for a wind that a scenario file may not have either.

    >>> from world.scenario import load_scenario
    >>> with_wind(load_scenario("tight"), 5.0, math.radians(270.0), "light").wind.at(75.0)
    (5.0, ...)
    """
    table = scenario.spec.wind
    changes: dict[str, Any] = {}
    if speed is not None and from_course is not None:
        changes |= {"speed_mps": speed, "from_deg": math.degrees(from_course)}
    if turbulence is not None:
        changes["turbulence"] = turbulence
    changed = checked_table(lambda: WindTable(**(table.model_dump() | changes)), f"{scenario.name}: wind")
    spec = scenario.spec.model_copy(update={"wind": changed})
    wind = replace(
        scenario.wind,
        speed=spec.wind.speed_mps,
        from_course=math.radians(spec.wind.from_deg),
        turbulence=spec.wind.turbulence,
    )
    return replace(scenario, spec=spec, wind=wind)


def with_flight(scenario: Scenario, **changes: Any) -> Scenario:
    """A scenario with other entries of [flight]; None keeps what it has.

    A law of guidance takes the place of an autopilot and its parameters, and they take that of a law.
    Raises ScenarioError for a value that a scenario file may not have either.

    >>> from world.scenario import load_scenario
    >>> with_flight(load_scenario("tight"), airspeed_mps=28.0, nav=None).flight.airspeed_mps
    28.0
    """
    given = {key: value for key, value in changes.items() if value is not None}
    kept = scenario.flight.model_dump()
    if "guidance" in given or "params" in given or "autopilot" in given:
        kept |= {"autopilot": None, "guidance": None, "params": None}
    table = checked_table(lambda: FlightTable(**(kept | given)), f"{scenario.name}: flight")
    return replace(scenario, spec=scenario.spec.model_copy(update={"flight": table}), flight=table)


def with_zones(scenario: Scenario, tables: Sequence[ZoneTable], source: str) -> Scenario:
    """A scenario with more zones; source: names them in messages.

    Raises ScenarioError for a shape that is none, for a level above ground where there is no terrain, and for more
    zones than a scenario may have; and, but in a scenario made around a mission, for a zone that an end violates.

    >>> from world.scenario import load_scenario
    >>> mast = ZoneTable(name="mast", kind="exclusion", east_m=1300.0, north_m=400.0, radius_m=200.0)
    >>> [zone.name for zone in with_zones(load_scenario("tight"), [mast], "masts.geojson").zones]
    ['mast']
    """
    if len(scenario.zones) + len(tables) > MOST_ZONES:
        raise ScenarioError(f"{source}: {len(tables):,} zones more: at most {MOST_ZONES:,} in all", file=source)
    zones = make_zones(tables, source, scenario.origin, scenario.terrain)
    ends = (("start", scenario.start), ("destination", scenario.destination))
    check_ends(zones, source, () if scenario.external else ends, scenario.terrain)
    spec = scenario.spec.model_copy(update={"zones": [*(scenario.spec.zones or ()), *tables]})
    return replace(scenario, spec=spec, zones=(*scenario.zones, *zones))


def with_threats(
    scenario: Scenario,
    added: Sequence[tuple[float, float, float, float]],
    source: str,
    kept: Sequence[ThreatTable] = (),
) -> Scenario:
    """A scenario with more threats on its ground.

    added: east, north, kill radius and detection radius of each, m; a radius of 0 for none.  Their scales are the
    median shares of the radius of those that the scenario has, or a quarter and a third.
    source: names them in messages.  kept: tables that come before them.
    Raises ScenarioError for a threat that a scenario file may not have either.

    >>> from world.scenario import load_scenario
    >>> more = with_threats(load_scenario("tight"), [(1300.0, 90.0, 20.0, 0.0)], "--threat")
    >>> more.threats.names[-1], float(more.threats.kill_radius[-1])
    ('pop-up 1', 20.0)
    """

    def share(radius: Floats, scale: Floats, default: float) -> float:
        armed = radius > 0.0
        return float(np.median(scale[armed] / radius[armed])) if armed.any() else default

    known = scenario.threats
    kill_share = share(known.kill_radius, known.kill_scale, 1.0 / 4.0)
    detection_share = share(known.detection_radius, known.detection_scale, 1.0 / 3.0)
    tables = [*scenario.spec.threats, *kept]
    for number, (east, north, kill, detection) in enumerate(added):
        data: dict[str, Any] = {"name": f"pop-up {len(kept) + number + 1}", "east_m": east, "north_m": north}
        if kill != 0.0:
            data |= {"kill_radius_m": kill, "kill_scale_m": kill * kill_share}
        if detection != 0.0:
            data |= {"detection_radius_m": detection, "detection_scale_m": detection * detection_share}
        tables.append(checked_table(partial(ThreatTable, **data), source))
    spec = scenario.spec.model_copy(update={"threats": tables})
    return replace(scenario, spec=spec, threats=make_threats(tables, source, scenario.origin, scenario.terrain))


def with_planner(scenario: Scenario, source: str, **changes: Any) -> Scenario:
    """A scenario with other keys of [planner]; ``source`` names them in messages.

    Raises ScenarioError for a value that a scenario file may not have either.

    >>> from world.scenario import load_scenario
    >>> with_planner(load_scenario("tight"), "--seed", seed=7).planner.seed
    7
    """
    table = scenario.planner.model_dump() | changes
    changed = checked_table(lambda: PlannerTable(**table), source)
    return replace(scenario, spec=scenario.spec.model_copy(update={"planner": changed}), planner=changed)
