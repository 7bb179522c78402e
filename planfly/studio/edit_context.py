"""Store the settings with which an edited mission is judged.

Its route is computed while it is dragged.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from flight.mission.items import Mission
from flight.mission.placing import implied_scenario
from flight.mission.route import Route, route_through_stops, with_end_courses
from flight.simulation.setup import FlightSetup, make_limits
from planfly.flight_options import NamedFences
from planfly.studio.settings import ChangedParameters
from planfly.workflow.mission_context import MissionContext
from planfly.workflow.open_flight import make_setup, with_landing_parameters
from planfly.workflow.uav import Uav, uav_of_setup
from planner.plan import Plan
from world.scenario import Scenario

# Distance from the edge of its scenario, m, at which a mission without a given scenario gets a new scenario around it.
_EDGE_DISTANCE_M = 500.0
_NO_FENCES = NamedFences()
_DEFAULT_PARAMETERS = ChangedParameters()


@dataclass(frozen=True, slots=True)
class EditContext(MissionContext):
    """Scenario, UAV and settings with which an edited mission is judged.

    terrain: elevation file that the user named for a mission without a scenario, or None.
    fences: fences that the user named; their zones are added to every scenario that is made around the mission.
    parameters: autopilot parameters that were set in the studio.
    """

    terrain: str | None = None
    fences: NamedFences = _NO_FENCES
    parameters: ChangedParameters = _DEFAULT_PARAMETERS

    @classmethod
    def from_setup(
        cls, setup: FlightSetup, terrain: str | Path | None = None, fences: NamedFences = _NO_FENCES
    ) -> "EditContext":
        """Make the editing context of an opened mission or plan.

        terrain, fences: as the attributes.
        """
        return cls(
            setup.scenario,
            uav_of_setup(setup),
            setup.seed,
            setup,
            planned=setup.plan is not None,
            terrain=None if terrain is None else str(terrain),
            fences=fences,
        )

    def with_settings(self, scenario: Scenario, parameters: ChangedParameters) -> "EditContext":
        """Return the context of the opened mission in another scenario and with other autopilot parameters.

        The new context has no plan, because the certificate of a plan applies only to the scenario of the plan.
        """
        uav = parameters.load_uav(scenario)
        setup = make_setup(scenario, uav, self.opened_setup.mission, self.seed)
        return replace(self, scenario=scenario, uav=uav, opened_setup=setup, parameters=parameters)

    def with_plan(self, plan: Plan, mission: Mission) -> "EditContext":
        """Return the context with a new plan, whose certificate applies until the mission is changed."""
        setup = make_setup(self.scenario, self.uav, mission, self.seed, plan=plan)
        return replace(self, opened_setup=setup, planned=True)

    def planning_uav(self, mission: Mission, index: int | None = None) -> Uav:
        """Return the UAV at the airspeed that the mission commands where a new path starts.

        index: index of the item at which the path starts; None for a path from the start of the mission.
        """
        route, leg = self.route(mission), 0
        if index is not None:
            legs_from_item = np.flatnonzero(route.items[:-1] == mission.items[index].seq)
            leg = int(legs_from_item[-1]) if legs_from_item.size else 0
        airspeed = float(route.leg_airspeeds[leg])
        # A mission states its airspeed in thousandths.
        if abs(airspeed - self.uav.airspeed) < 1e-3:
            return self.uav
        limits = self.uav.limits
        new_limits = make_limits(self.scenario, limits.envelope, airspeed, limits.max_bank, self.uav.autopilot)
        return replace(self.uav, limits=new_limits)

    def with_area_around_mission(self, mission: Mission) -> "EditContext":
        """Return the context, with a larger scenario if the mission comes close to the edges of its area.

        Only a scenario that planfly made around the mission is replaced; a named scenario is kept.
        """
        if not self.scenario.external:
            return self
        points = self.item_positions(mission)[:, :2]
        (west, east), (south, north) = self.scenario.bounds.tolist()
        min_corner, max_corner = points.min(axis=0), points.max(axis=0)
        if (
            min_corner[0] > west + _EDGE_DISTANCE_M
            and max_corner[0] < east - _EDGE_DISTANCE_M
            and min_corner[1] > south + _EDGE_DISTANCE_M
            and max_corner[1] < north - _EDGE_DISTANCE_M
        ):
            return self
        new_scenario = implied_scenario(mission, self.terrain, self.scenario.flight, vertical_legs=True).scenario
        spec = new_scenario.spec.model_copy(
            update={"wind": self.scenario.spec.wind, "limits": self.scenario.spec.limits}
        )
        new_scenario = replace(new_scenario, spec=spec, wind=self.scenario.wind, limits=self.scenario.limits)
        return replace(self, scenario=self.fences.add_to_scenario(new_scenario))

    # ------------------------------------------------------------------
    # Verdicts while a mission is dragged.

    def uav_for_mission(self, mission: Mission) -> Uav:
        """Return the UAV with the autopilot's landing parameters for a mission, as in `make_setup`."""
        return replace(self.uav, autopilot=with_landing_parameters(self.uav.autopilot, mission))

    def route(self, mission: Mission) -> Route:
        """Return the route that the autopilot flies in a mission, without notes for the user."""
        uav, fly_over = self.uav_for_mission(mission), self.scenario.flight.fly_over
        rules = uav.autopilot.route_rules
        route = route_through_stops(self.place_mission(mission), uav.airspeed, fly_over, uav.limits, rules)
        return with_end_courses(route, self.scenario, uav.limits)

    def part_setup(self, mission: Mission, route: Route) -> FlightSetup:
        """Return a setup for judging a route by its geometry.

        Unlike `make_setup`, it makes no checks, path or notes.

        route: the mission's route, or a part of it.
        """
        uav = self.uav_for_mission(mission)
        return FlightSetup(
            scenario=self.scenario,
            mission=mission,
            route=route,
            limits=uav.limits,
            aircraft=uav.aircraft.name,
            battery=uav.battery,
            seed=self.seed,
            autopilot=uav.autopilot,
            nav=self.scenario.flight.steering.nav,
            guidance_hz=self.scenario.flight.guidance_hz,
        )
