"""Scenarios, envelopes, routes and setups made by hand, put together from small parts.

Tests build their own worlds of these: a scenario's data around some waypoints, a route along them, a mission of them,
and the setup of a flight.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from aircraft.catalog import Aircraft
from aircraft.envelope import Envelope
from flight.dynamics.envelope_tables import load_envelope
from flight.mission.items import Command, Frame, Mission, MissionItem, round_to_grid
from flight.mission.route import Route, route_points
from flight.simulation.setup import FlightSetup, make_limits
from planner.plan import Plan
from world.arrays import Floats
from world.frames import GeoOrigin, to_geo
from world.scenario import Scenario, scenario_from_spec

MakeSetup = Callable[..., FlightSetup]


def end_table(point: ArrayLike) -> dict[str, float]:
    """[start] or [destination] at a point (3,)."""
    east, north, up = np.asarray(point, dtype=np.float64).tolist()
    return {"east_m": east, "north_m": north, "amsl_m": up}


def spec_around(
    points: ArrayLike, *, name: str = "made", buffer: float, ceiling: float, **tables: Any
) -> dict[str, Any]:
    """JSON data of a scenario from the first to the last of some waypoints (w, 3), over level ground at the sea.

    buffer: m of area about them.  ceiling: m AMSL.  tables: of the file, which come on top or replace these.
    """
    way = np.asarray(points, dtype=np.float64)
    low, high = (way.min(axis=0) - buffer).tolist(), (way.max(axis=0) + buffer).tolist()
    spec = {
        "name": name,
        "terrain": {"kind": "flat", "amsl_m": 0.0},
        "area": {"east_m": [low[0], high[0]], "north_m": [low[1], high[1]], "ceiling_amsl_m": ceiling},
        "start": end_table(way[0]),
        "destination": end_table(way[-1]),
    }
    return spec | tables


def route_along(
    points: ArrayLike, speeds: float | Sequence[float], *, fly_over: Sequence[int] = (), started: str = ""
) -> Route:
    """A route of waypoints (w, 3), no two of one mission item; speeds: m/s, one or one a leg."""
    way = np.array(points, dtype=np.float64)
    numbers = np.arange(len(way))
    return Route(route_points(way, speeds, fly_over=np.isin(numbers, fly_over), item=numbers), started)


def setup_along(
    scenario: Scenario,
    route: Route,
    envelope: Envelope,
    *,
    airspeed: float,
    bank_deg: float = 30.0,
    aircraft: str = "aerosonde",
    battery: float = 100.0,
    seed: int = 1,
    source: str = "mission",
) -> FlightSetup:
    """A setup of a route without a mission file; battery: Wh."""
    limits = make_limits(scenario, envelope, airspeed, math.radians(bank_deg))
    return FlightSetup(scenario, Mission(None, (), source=source), route, limits, aircraft, battery, seed)


def waypoint_mission(points: Floats, speeds: Floats, origin: GeoOrigin) -> Mission:
    """Waypoints (w, 3) above mean sea level, with a speed command before each leg that has another."""
    items: list[MissionItem] = []
    lat, lon = to_geo(origin, points[:, 0], points[:, 1])
    for k, (point, y, x) in enumerate(zip(points, lat.tolist(), lon.tolist(), strict=True)):
        place = (round_to_grid(y), round_to_grid(x), float(point[2]))
        items.append(MissionItem(len(items) + 1, int(Command.NAV_WAYPOINT), int(Frame.GLOBAL), (0.0,) * 4, *place))
        if k < len(speeds) and (k == 0 or speeds[k] != speeds[k - 1]):
            change = (0.0, float(speeds[k]), -1.0, 0.0)
            items.append(
                MissionItem(len(items) + 1, int(Command.DO_CHANGE_SPEED), int(Frame.MISSION), change, 0.0, 0.0, 0.0)
            )
    return Mission(None, tuple(items), source="made mission")


def setup_maker(aircraft: Aircraft) -> MakeSetup:
    """A function that makes a setup through some points, (w, 3) m, for an aircraft and its own envelope.

    Its keywords: wind: speed m/s, from degrees.  speeds: m/s, one or one a leg.  More replace tables of the scenario.
    """
    envelope = load_envelope(aircraft)

    def make(
        points: ArrayLike,
        *,
        wind: tuple[float, float] = (0.0, 0.0),
        turbulence: str = "none",
        seed: int = 1,
        bank_deg: float = 30.0,
        speeds: float | Sequence[float] = 25.0,
        fly_over: Sequence[int] = (),
        **tables: Any,
    ) -> FlightSetup:
        made = {
            "terrain": {"kind": "flat", "amsl_m": 100.0},
            "wind": {"speed_mps": wind[0], "from_deg": wind[1], "turbulence": turbulence},
        }
        scenario = scenario_from_spec(
            spec_around(points, buffer=2000.0, ceiling=9000.0, **made | tables), "made", external=True
        )
        route = route_along(points, speeds, fly_over=fly_over)
        return setup_along(
            scenario,
            route,
            envelope,
            airspeed=float(route.leg_airspeeds[0]),
            bank_deg=bank_deg,
            aircraft=aircraft.name,
            battery=888.0,
            seed=seed,
            source="made",
        )

    return make


def standard(leg: float = 1450.0) -> Floats:
    """Nine legs, 13 km of 1450 m each, with turns up to 45 degrees, climbs to 6 and dives to 5."""
    way, course = [np.array([0.0, 0.0, 500.0])], 0.3
    for turn, slope in ((0, 0), (40, 6), (-45, -5), (30, 4), (45, -3), (-35, 0), (-45, 6), (20, -5), (45, 0)):
        course += math.radians(turn)
        up = math.tan(math.radians(slope))
        way.append(way[-1] + leg * np.array([math.sin(course), math.cos(course), up]))
    return np.array(way)


def falling_envelope() -> Envelope:
    """About an Aerosonde: 13.7 degrees of climb at 25 m/s and 500 m, falling with height; 7.8 of descent."""
    speeds, heights = np.array([20.0, 25.0, 30.0]), np.array([0.0, 1000.0, 3000.0])
    fall = np.array([0.0, 2.4, 7.2])
    climb = np.radians(np.array([17.0, 14.9, 6.0])[:, None] - fall[None, :])
    descent = np.radians(np.array([6.5, 7.8, 10.0])[:, None] + 0.0 * heights[None, :])
    return Envelope(
        aircraft="by hand",
        model_hash="",
        motor_braking=False,
        airspeed=speeds,
        amsl=heights,
        climb=climb,
        descent=descent,
        level_speed_min=np.full(3, 18.0),
        level_speed_max=np.full(3, 33.0),
        max_bank=math.radians(45.0),
    )


def small_scenario(**changes: Any) -> Scenario:
    """A small scenario: one hill and one missile on a 6 km line; tables of the file may be replaced."""
    spec = spec_around(
        [[0.0, 0.0, 150.0], [6000.0, 0.0, 150.0]],
        name="small",
        buffer=0.0,
        ceiling=450.0,
        terrain={"kind": "peaks", "peak": [{"east_m": 2000, "north_m": 200, "height_m": 500, "sigma_m": 400}]},
        area={"east_m": [-500, 6500], "north_m": [-3000, 3000], "ceiling_amsl_m": 450},
        threats=[
            {
                "east_m": 4200,
                "north_m": -200,
                "kill_radius_m": 700,
                "kill_scale_m": 200,
                "detection_radius_m": 1200,
                "detection_scale_m": 400,
            }
        ],
        planner={"waypoints": 8, "population": 60, "generations": 25},
    )
    return scenario_from_spec(spec | changes, "small")


def with_path(plan: Plan, waypoints: ArrayLike) -> Plan:
    """A plan of other waypoints, as if they had its certificate."""
    certificate = replace(plan.certificate, path_digest="")
    return replace(plan, waypoints=np.asarray(waypoints, dtype=np.float64), certificate=certificate)
