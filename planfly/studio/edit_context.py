"""Place the items of an edited mission, lay out its route, and judge its geometry.

Scenario and aircraft are loaded once.  An unchanged mission is judged as it was opened, and a plan with its
certificate; a changed mission is judged like a mission file.
"""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from flight.mission.from_plan import acceptance_radii
from flight.mission.implied_scenario import implied_scenario
from flight.mission.items import AMSL, LANDINGS, OVER_HOME, Command, Mission, MissionItem
from flight.mission.placing import PlacedMission, place_stops
from flight.mission.route import Route, lay_route, with_end_courses
from flight.simulation.setup import FlightSetup
from logs.verdict.judge_geometry import judge_geometry
from logs.verdict.measures.route_requirements import RouteRequirements, route_requirements
from logs.verdict.verdict import Verdict
from planfly.named_fences import NamedFences
from planfly.studio.edits import places
from planfly.studio.settings import SetParameters
from planfly.workflow.airframe import Airframe, airframe_of
from planfly.workflow.open_flight import make_setup
from planner.plan import Plan
from world.arrays import Floats
from world.frames import to_geo, to_map
from world.scenario import Scenario

# Distance from the edge of its scenario, m, at which a mission without a given scenario gets a new scenario around it.
_EDGE_DISTANCE_M = 500.0
_NO_FENCES = NamedFences()
_DEFAULT_PARAMETERS = SetParameters()


@dataclass(frozen=True, slots=True)
class Judged:
    """Mission with its setup, its route requirements and its geometric verdict."""

    mission: Mission
    setup: FlightSetup
    requirements: RouteRequirements
    verdict: Verdict


@dataclass(frozen=True, slots=True)
class EditContext:
    """Everything that an edited mission is judged with.

    scenario: scenario of the mission.
    airframe: the aircraft loaded for this scenario.
    seed: seed of the flight.
    opened: the setup as it was opened, with its plan if there is one.
    terrain: elevation file named for a mission without a scenario, or None.
    planned: True if planfly set the acceptance radii, which then follow the turns.
    fences: fences named with a mission; their zones are part of every scenario that is made around the mission.
    parameters: parameters of the autopilot that were set in the studio.
    """

    scenario: Scenario
    airframe: Airframe
    seed: int
    opened: FlightSetup
    terrain: str | None = None
    planned: bool = False
    fences: NamedFences = _NO_FENCES
    parameters: SetParameters = _DEFAULT_PARAMETERS

    @classmethod
    def of(
        cls, setup: FlightSetup, terrain: str | Path | None = None, fences: NamedFences = _NO_FENCES
    ) -> "EditContext":
        """Make the editing context of an opened mission or plan."""
        return cls(
            setup.scenario,
            airframe_of(setup),
            setup.seed,
            setup,
            None if terrain is None else str(terrain),
            planned=setup.plan is not None,
            fences=fences,
        )

    def flown_as(self, scenario: Scenario, parameters: SetParameters) -> "EditContext":
        """Return the context of the same mission in another scenario, with its weather, aircraft and autopilot.

        The certificate of a plan applies only to the world in which it was planned.
        """
        airframe = parameters.airframe(scenario)
        setup = make_setup(scenario, airframe, self.opened.mission, self.seed)
        return replace(self, scenario=scenario, airframe=airframe, opened=setup, parameters=parameters)

    def of_plan(self, plan: Plan, mission: Mission) -> "EditContext":
        """Return the context of a new plan; its certificate applies until the mission is changed."""
        setup = make_setup(self.scenario, self.airframe, mission, self.seed, plan=plan)
        return replace(self, opened=setup, planned=True)

    def around(self, mission: Mission) -> "EditContext":
        """Return the context, with a new scenario if the mission has left the scenario that was made around it."""
        if not self.scenario.external:
            return self
        points = self.points(mission)[:, :2]
        (west, east), (south, north) = self.scenario.bounds.tolist()
        low, high = points.min(axis=0), points.max(axis=0)
        if (
            low[0] > west + _EDGE_DISTANCE_M
            and high[0] < east - _EDGE_DISTANCE_M
            and low[1] > south + _EDGE_DISTANCE_M
            and high[1] < north - _EDGE_DISTANCE_M
        ):
            return self
        made = implied_scenario(mission, self.terrain, self.scenario.flight, vertical_legs=True).scenario
        spec = made.spec.model_copy(update={"wind": self.scenario.spec.wind, "limits": self.scenario.spec.limits})
        made = replace(made, spec=spec, wind=self.scenario.wind, limits=self.scenario.limits)
        return replace(self, scenario=self.fences.on_scenario(made))

    # ------------------------------------------------------------------
    # Places.

    def placed(self, mission: Mission) -> PlacedMission:
        """Return the stops of a mission on the map, with jumps unrolled."""
        return place_stops(mission, self.scenario.origin, self.scenario.terrain, vertical_legs=True)

    def points(self, mission: Mission, placed: PlacedMission | None = None) -> Floats:
        """Return east, north and altitude AMSL of each place of `edits.places`, (n, 3), m.

        The altitude of a landing is that of its touchdown.  An item that no flight reaches has its stated altitude, or
        NaN if this is unknown.
        """
        placed = self.placed(mission) if placed is None else placed
        heights = {stop.stop.item: float(stop.position[2]) for stop in reversed(placed.stops)}
        items = [mission.items[k] for k in places(mission)]
        east, north = to_map(self.scenario.origin, [one.lat_deg for one in items], [one.lon_deg for one in items])
        up = [
            self._stated_altitude(mission, one, x, y)
            if one.command in LANDINGS or one.seq not in heights
            else heights[one.seq]
            for one, x, y in zip(items, np.asarray(east).tolist(), np.asarray(north).tolist(), strict=True)
        ]
        return np.stack([east, north, up], axis=1)

    def _stated_altitude(self, mission: Mission, item: MissionItem, east: float, north: float) -> float:
        """Return the altitude AMSL that an item states, m, or NaN if the item or the terrain does not determine it."""
        if item.frame in AMSL:
            return item.alt
        terrain, home = self.scenario.terrain, mission.home
        if item.frame in OVER_HOME and home is not None and math.isfinite(home.alt):
            return home.alt + item.alt
        if item.frame in OVER_HOME:
            if home is None:
                return math.nan
            x, y = to_map(self.scenario.origin, home.lat_deg, home.lon_deg)
            east, north = float(x), float(y)
        return math.nan if terrain is None else float(terrain.height(east, north)) + item.alt

    def flown(self, mission: Mission) -> frozenset[int]:
        """Return the numbers of the items that a flight reaches."""
        return frozenset(stop.stop.item for stop in self.placed(mission).stops)

    def geographic(self, east: float, north: float) -> tuple[float, float]:
        """Return latitude and longitude of a place on the map, degrees."""
        lat, lon = to_geo(self.scenario.origin, east, north)
        return float(lat), float(lon)

    def retuned(self, mission: Mission, index: int) -> Mission:
        """Return a planned mission with its acceptance radii near an item adapted to its turns; other missions stay."""
        if not self.planned:
            return mission
        own = places(mission)
        at = int(np.searchsorted(own, index))
        chain = own[max(0, at - 2) : at + 3]
        points = self._planned_points(mission, chain)
        frame = self.airframe
        radii = acceptance_radii(self.scenario, points, frame.airspeed, frame.max_bank, frame.limits.tracking)
        items = list(mission.items)
        for k, radius in zip(chain, radii.tolist(), strict=True):
            # The turn at an end of the chain is unknown, except at an end of the mission, which has no turn.
            inner = k not in (chain[0], chain[-1]) or k in (own[0], own[-1])
            if inner and items[k].command == Command.NAV_WAYPOINT:
                params = items[k].params
                items[k] = replace(items[k], params=(params[0], radius, *params[2:]))
        return replace(mission, items=tuple(items))

    def _planned_points(self, mission: Mission, chosen: tuple[int, ...]) -> Floats:
        """Return chosen places of a planned mission with altitude AMSL; a landing has the previous item's altitude."""
        items = [mission.items[k] for k in chosen]
        east, north = to_map(self.scenario.origin, [one.lat_deg for one in items], [one.lon_deg for one in items])
        up = [one.alt for one in items]
        for k, item in enumerate(items):
            if item.command in LANDINGS and k:
                up[k] = up[k - 1]
        return np.stack([east, north, up], axis=1)

    # ------------------------------------------------------------------
    # Verdicts.

    def setup(self, mission: Mission) -> FlightSetup:
        """Return the flight setup of a mission.  Raises MissionError for a mission without a valid route."""
        # Compare the items, because the mission of the setup names its autopilot and is therefore another object.
        if mission.items is self.opened.mission.items and self.scenario is self.opened.scenario:
            return self.opened
        return make_setup(self.scenario, self.airframe, mission, self.seed, placed=self.placed(mission))

    def judge(self, mission: Mission) -> Judged:
        """Judge the whole geometry of a mission."""
        setup = self.setup(mission)
        requirements = route_requirements(setup)
        return Judged(mission, setup, requirements, judge_geometry(setup, requirements))

    def route(self, mission: Mission) -> Route:
        """Return the route of a mission, without the notes for the user."""
        frame, fly_over = self.airframe, self.scenario.flight.fly_over
        rules = frame.autopilot.route_rules
        laid = lay_route(self.placed(mission), frame.airspeed, fly_over, frame.limits, rules)
        return with_end_courses(laid, self.scenario, frame.limits)

    def part(self, mission: Mission, route: Route) -> FlightSetup:
        """Return a setup for judging the legs and corners of a part of the route; nothing is flown."""
        frame = self.airframe
        return FlightSetup(
            scenario=self.scenario,
            mission=mission,
            route=route,
            limits=frame.limits,
            aircraft=frame.aircraft.name,
            battery=frame.battery,
            seed=self.seed,
            autopilot=frame.autopilot,
            nav=self.scenario.flight.steering.nav,
            guidance_hz=self.scenario.flight.guidance_hz,
        )
