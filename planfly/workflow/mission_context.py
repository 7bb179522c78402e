"""Context of a mission whose items change.

It gives their positions, the setup of its flight, and its geometric verdict.

Scenario and aircraft are loaded once.  An unchanged mission is judged as it was opened, a plan with its certificate;
a changed mission is judged like a mission file.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from flight.mission.edits import movable_indices
from flight.mission.from_plan import acceptance_radii
from flight.mission.items import AMSL, LANDINGS, OVER_HOME, Command, Mission, MissionItem
from flight.mission.placing import PlacedMission, place_stops
from flight.simulation.setup import FlightSetup
from logs.verdict.judge_geometry import judge_geometry
from logs.verdict.measures.route_requirements import RouteRequirements, route_requirements
from logs.verdict.verdict import Verdict
from planfly.workflow.open_flight import make_setup
from planfly.workflow.uav import Uav, uav_of_setup
from world.arrays import Floats
from world.frames import to_geo, to_map
from world.scenario import Scenario


@dataclass(frozen=True, slots=True)
class JudgedMission:
    """Mission with its setup, its route requirements and its verdict, by geometry or on a flight."""

    mission: Mission
    setup: FlightSetup
    requirements: RouteRequirements
    verdict: Verdict


@dataclass(frozen=True, slots=True)
class MissionContext:
    """Context in which a changed mission is judged.

    scenario: world of the mission.
    uav: aircraft loaded for the mission.
    seed: seed of the flight.
    opened_setup: the setup as it was opened, with its plan if there is one.
    planned: True if planfly set the acceptance radii, which then follow the turns.
    """

    scenario: Scenario
    uav: Uav
    seed: int
    opened_setup: FlightSetup
    planned: bool = False

    @classmethod
    def from_setup(cls, setup: FlightSetup) -> "MissionContext":
        """Return the context of a setup's mission, flown by the control law of its autopilot.

        Raises FlightError if the aircraft is missing.
        """
        uav = uav_of_setup(setup)
        uav = replace(uav, autopilot=setup.autopilot.model)
        return cls(setup.scenario, uav, setup.seed, setup, planned=setup.plan is not None)

    # ------------------------------------------------------------------
    # Places.

    def place_mission(self, mission: Mission) -> PlacedMission:
        """Return a mission with its stops on the map; jumps are unrolled."""
        resets = self.uav.autopilot.checks.resets_jump_counters
        scenario = self.scenario
        return place_stops(mission, scenario.origin, scenario.terrain, vertical_legs=True, resets_jump_counters=resets)

    def item_positions(self, mission: Mission, placed: PlacedMission | None = None) -> Floats:
        """Return the positions (n, 3) of the movable items: east, north and altitude AMSL, m.

        Movable items are those of `flight.mission.edits.movable_indices`, in this order.

        placed: the mission placed on the map, if already computed.

        The altitude of a landing is the altitude of its touchdown.  An item that no flight reaches has its stated
        altitude, or NaN if this is unknown.
        """
        placed = self.place_mission(mission) if placed is None else placed
        reached_altitudes = {stop.item: stop.map_position[2] for stop in reversed(placed.stops)}
        items = [mission.items[k] for k in movable_indices(mission)]
        east, north = to_map(self.scenario.origin, [item.lat_deg for item in items], [item.lon_deg for item in items])
        altitudes = [
            self._stated_altitude(mission, item, x, y)
            if item.command in LANDINGS or item.seq not in reached_altitudes
            else reached_altitudes[item.seq]
            for item, x, y in zip(items, np.asarray(east).tolist(), np.asarray(north).tolist(), strict=True)
        ]
        return np.stack([east, north, altitudes], axis=1)

    def _stated_altitude(self, mission: Mission, item: MissionItem, east: float, north: float) -> float:
        """Return the altitude AMSL that an item states, m; NaN if home or the ground below is unknown.

        east, north: map position of the item, m.
        """
        if item.frame in AMSL:
            return item.alt
        terrain, home = self.scenario.terrain, mission.home
        if item.frame in OVER_HOME and home is not None and math.isfinite(home.alt):
            return home.alt + item.alt
        if item.frame in OVER_HOME:
            if home is None:
                return math.nan
            home_east, home_north = to_map(self.scenario.origin, home.lat_deg, home.lon_deg)
            east, north = float(home_east), float(home_north)
        return math.nan if terrain is None else float(terrain.height(east, north)) + item.alt

    def reached_items(self, mission: Mission) -> frozenset[int]:
        """Return the sequence numbers of the items that a flight reaches."""
        return frozenset(stop.item for stop in self.place_mission(mission).stops)

    def to_geographic(self, east: float, north: float) -> tuple[float, float]:
        """Return latitude and longitude, degrees, of a map position, m."""
        lat, lon = to_geo(self.scenario.origin, east, north)
        return float(lat), float(lon)

    def with_updated_radii(self, mission: Mission, index: int) -> Mission:
        """Return the mission with the acceptance radii near a moved item adapted to the new turns.

        A mission that planfly did not plan keeps its radii.

        index: index of the moved item in the mission.
        """
        if not self.planned:
            return mission
        item_indices = movable_indices(mission)
        position = int(np.searchsorted(item_indices, index))
        nearby = item_indices[max(0, position - 2) : position + 3]
        # A planned item states its altitude AMSL; a landing has the altitude of the item before it.
        origin, near_items, uav = self.scenario.origin, [mission.items[k] for k in nearby], self.uav
        east, north = to_map(origin, [item.lat_deg for item in near_items], [item.lon_deg for item in near_items])
        altitudes = [item.alt for item in near_items]
        for k, item in enumerate(near_items):
            if item.command in LANDINGS and k:
                altitudes[k] = altitudes[k - 1]
        points = np.stack([east, north, altitudes], axis=1)
        radii = acceptance_radii(self.scenario, points, uav.airspeed, uav.max_bank, uav.limits.tracking)
        items = list(mission.items)
        for k, radius in zip(nearby, radii.tolist(), strict=True):
            # The turn at the first and last nearby item is unknown, except at an end of the mission, where there is no
            # turn.
            has_known_turn = k not in (nearby[0], nearby[-1]) or k in (item_indices[0], item_indices[-1])
            if has_known_turn and items[k].command == Command.NAV_WAYPOINT:
                params = items[k].params
                items[k] = replace(items[k], params=(params[0], radius, *params[2:]))
        return replace(mission, items=tuple(items))

    # ------------------------------------------------------------------
    # Verdicts.

    def setup(self, mission: Mission) -> FlightSetup:
        """Return the flight setup of a mission; the opened setup if the mission has not changed.

        Raises MissionError for a mission without a valid route.
        """
        opened = self.opened_setup
        # The mission of the setup names its autopilot, so compare the items and home, not the missions.
        is_opened_mission = mission.items is opened.mission.items and mission.home == opened.mission.home
        if is_opened_mission and self.scenario is opened.scenario:
            return opened
        return make_setup(self.scenario, self.uav, mission, self.seed, placed=self.place_mission(mission))

    def setup_with_parameters(self, mission: Mission, parameters: Mapping[str, float]) -> FlightSetup:
        """Return the flight setup of a mission with other values of some autopilot parameters, by name."""
        uav = replace(self.uav, autopilot=self.uav.autopilot.with_parameters(**parameters))
        return make_setup(self.scenario, uav, mission, self.seed, placed=self.place_mission(mission))

    def judge(self, mission: Mission) -> JudgedMission:
        """Judge a mission by its geometry, without a flight."""
        setup = self.setup(mission)
        requirements = route_requirements(setup)
        return JudgedMission(mission, setup, requirements, judge_geometry(setup, requirements))
