"""Open what a campaign's flights share, and vary it for each flight.

The flights share mission, world, aircraft and dispersions.
"""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeGuard

import numpy as np

from aircraft.catalog import Aircraft, model_hash
from aircraft.tracking import corridor_half_width
from aircraft.uncertainty import DRAWS_FILE, read_draws
from flight.dynamics.fdm import Fdm, Variation
from flight.dynamics.trim import steady_flight
from flight.mission.items import Mission
from flight.mission.placing import PlacedMission, place_stops
from flight.mission_files.formats import mission_text
from flight.simulation.setup import FlightSetup, make_limits
from logs.verdict.conditions import Conditions, judging_conditions
from planfly.campaigns.campaign_inputs import describe_differences, flatten_inputs, hash_input
from planfly.campaigns.dispersions import DEFAULT_DISPERSIONS_NAME, QUANTITIES_OF_DRAWS, Dispersions, Draw, SpreadError
from planfly.flight_options import MissionOptions, load_scenario_with_options, read_named_fences
from planfly.workflow.make_plan import Advance, make_plan
from planfly.workflow.open_flight import make_setup, mission_of_plan, open_flight
from planfly.workflow.pipeline import OffNominal
from planfly.workflow.uav import (
    Uav,
    check_level_flight,
    choose_seed,
    load_uav,
    max_turn_bank,
    uav_of_setup,
)
from planner.plan import Plan, plan_json, read_plan
from world.airfield import LandingStrip
from world.errors import FlightError, MissionError
from world.files import absolute_path, write_atomically
from world.forecast.scenario_wind import with_mean_wind
from world.frames import to_map
from world.scenario import Scenario, with_ground
from world.terrain import Terrain

# Distance beyond the ends of a strip over which its surveyed height applies, m: the flare and the end of the approach.
_SURVEYED_DISTANCE_M = 200.0
# Distance over which the height error changes from the survey's error to the elevation file's error, m.
_SURVEY_BLEND_DISTANCE_M = 1000.0
# Distance over which the size of a terrain pixel is measured, m.
_PROBE_DISTANCE_M = 100.0
# Stream of random numbers for the error of a strip's survey, independent of the flight's other draws.
_STRIP_ERROR_STREAM = 71


@dataclass(frozen=True)
class CampaignBase:
    """Inputs that all flights of a campaign share: the mission, its scenario and UAV, and the dispersions.

    scenario: the planned scenario; every flight flies `mission` in this scenario, with its own wind.
    uav: the UAV in this scenario.
    placed: the mission placed on the terrain that the planner knows, even if a flight has another terrain.
    plan: the plan of the mission; None for a mission from a file.
    seed: seed of the draws.
    name: stem of file names.
    """

    scenario: Scenario
    uav: Uav
    mission: Mission
    placed: PlacedMission
    plan: Plan | None
    dispersions: Dispersions
    seed: int
    name: str

    def nominal_setup(self) -> FlightSetup:
        """Return the setup of the flight without dispersions.

        Raises PlanflyError for a mission without a valid route.
        """
        return make_setup(self.scenario, self.uav, self.mission, self.seed, plan=self.plan, placed=self.placed)

    def conditions(self) -> Conditions:
        """Return the nominal conditions of the flights: aircraft, weather, world and autopilot."""
        return judging_conditions(self.nominal_setup())

    def inputs(self) -> dict[str, Any]:
        """Return all inputs of the flights except the code, by name; long inputs are replaced by hashes.

        The inputs are seed, scenario, terrain, mission, aircraft model, autopilot parameters and dispersions, and the
        limits that aircraft and autopilot set because the scenario does not state them.
        """
        terrain, autopilot = self.scenario.terrain, self.uav.autopilot
        implied_limits: dict[str, float] = {}
        if self.scenario.limits.corridor_m is None:
            implied_limits["corridor_m"] = corridor_half_width(None, autopilot.turns.acceptance_radius)
        if self.scenario.flight.max_bank_deg is None:
            implied_limits["max_bank_deg"] = round(math.degrees(self.uav.max_bank), 6)
        if self.scenario.flight.airspeed_mps is None:
            implied_limits["airspeed_mps"] = self.uav.airspeed
        parameters = autopilot.parameters
        return flatten_inputs(
            {
                "seed": self.seed,
                **self.scenario.to_json(),
                "limits in effect": implied_limits,
                "elevations": None if terrain is None else hash_input(terrain.heights.tobytes()),
                "mission": hash_input(mission_text(self.mission, "waypoints")),
                "fences": hash_input(repr(self.mission.fences)),
                "aircraft model": hash_input(model_hash(self.uav.aircraft)),
                "autopilot": f"{autopilot.title} {autopilot.version}".strip(),
                "parameters": {}
                if parameters is None
                else {name: f"{value!r} ({origin})" for name, value, origin in parameters.values},
                "unused parameters": "" if parameters is None else hash_input(repr(parameters.unused)),
                "spread": hash_input(json.dumps(self.dispersions.to_json(), sort_keys=True)),
            }
        )

    def settings_to_store(self, stored: Mapping[str, Any], options: Mapping[str, object] | None) -> dict[str, Any]:
        """Return the settings that a table stores for its campaign, in addition to the goal.

        stored: settings of a resumed campaign, whose options are kept; empty for a new one.
        options: options of the flights, for a new table.
        """
        return {
            "name": self.name,
            "seed": self.seed,
            "spread": self.dispersions.to_json(),
            "inputs": self.inputs(),
            "options": stored.get("options") or json.loads(json.dumps(dict(options or {}), default=absolute_path)),
        }

    def inputs_hash(self) -> str:
        """Return a hash of all inputs of the flights except the code."""
        return hashlib.sha256(json.dumps(self.inputs(), sort_keys=True).encode()).hexdigest()[:16]


def is_mission_file(target: Scenario | str) -> TypeGuard[str]:
    """Return True if a target is named like a plan or mission file, not like a scenario.

    >>> is_mission_file("a/plan.json"), is_mission_file("jacksboro"), is_mission_file("valley.toml")
    (True, False, False)
    """
    return isinstance(target, str) and Path(target).suffix.lower() in (".json", ".waypoints", ".plan")


def open_campaign(
    target: Plan | Scenario | str,
    dispersions: Dispersions,
    options: MissionOptions,
    *,
    plan_file: Path | None = None,
    advance: Advance | None = None,
) -> CampaignBase:
    """Open the base of a campaign for a plan, a mission file or a scenario; plan a path for a scenario.

    target: a built-in scenario's name, a scenario's TOML file, a scenario, a plan, or a plan.json, .waypoints or .plan.
    options: options of the flights.  A planned path avoids the zones of the option "fence"; plan and draws use the
        option "seed".
    plan_file: file of a scenario's plan, which is read if it exists, and written otherwise; None for no file.

    Raises a PlanflyError for bad input, for a plan that is not feasible, and if the aircraft cannot fly at the medians
    of the dispersions.
    """
    if isinstance(target, Plan) or is_mission_file(target):
        return campaign_of_setup(open_flight(target, options), dispersions)
    fences, seed = read_named_fences(options.get("fence") or ()), options.get("seed")
    scenario = fences.add_to_scenario(load_scenario_with_options(target, options))
    has_plan_file = plan_file is not None and plan_file.is_file()
    if has_plan_file and plan_file is not None:
        plan = read_plan(plan_file)
    else:
        plan = make_plan(scenario, load_uav(scenario), choose_seed(scenario, seed), advance=advance)
        if not plan.feasible:
            raise MissionError(
                f"{scenario.name}: no feasible plan was found, so there is no mission to fly; `planfly plan` shows why",
                file=scenario.name,
            )
    if has_plan_file and plan.scenario.to_json() != scenario.to_json():
        differences = describe_differences(*(flatten_inputs(opened.to_json()) for opened in (plan.scenario, scenario)))
        name = target if isinstance(target, str) else scenario.name
        message = f"{plan_file}: this plan was made for another scenario, not {name}: {differences}"
        raise MissionError(message, file=str(plan_file))
    if plan_file is not None and not has_plan_file:
        write_atomically(plan_file, plan_json(plan))
    campaign_seed = choose_seed(scenario, seed)
    plan_scenario = plan.scenario
    uav = load_uav(plan_scenario)
    mission = fences.add_to_mission(mission_of_plan(plan, uav))
    placed_mission = place_stops(mission, plan_scenario.origin, plan_scenario.terrain)
    dispersions = with_aircraft_draws(dispersions, uav.aircraft)
    return _check_base(
        CampaignBase(plan_scenario, uav, mission, placed_mission, plan, dispersions, campaign_seed, plan_scenario.name)
    )


def campaign_of_setup(setup: FlightSetup, dispersions: Dispersions) -> CampaignBase:
    """Make a campaign base from a flight setup; each of its flights flies the setup's mission.

    Raises PlanflyError if the aircraft cannot fly at the medians of the dispersions, or if the mission has no valid
    route.
    """
    # Use the name without the folder, because the folder does not affect the flight.
    mission = replace(setup.mission, source=Path(setup.mission.source).name)
    scenario, uav = setup.scenario, uav_of_setup(setup)
    placed_mission = place_stops(mission, scenario.origin, scenario.terrain, vertical_legs=setup.plan is None)
    dispersions = with_aircraft_draws(dispersions, uav.aircraft)
    return _check_base(
        CampaignBase(scenario, uav, mission, placed_mission, setup.plan, dispersions, setup.seed, setup.name)
    )


def _check_base(base: CampaignBase) -> CampaignBase:
    """Return a campaign base unchanged after its checks.

    Its aircraft must be able to fly, and its mission must have a route.

    Raises PlanflyError if the aircraft cannot fly level at the medians of the dispersions, or if the mission has no
    valid route.
    """
    check_level_flight_at_medians(base)
    # Refuse a mission without a valid route here, before the workers start.
    base.nominal_setup()
    return base


def check_level_flight_at_medians(base: CampaignBase) -> None:
    """Raise SpreadError if the aircraft cannot fly level at the medians of the dispersions.

    Raises FlightError if the aircraft cannot fly level at all.
    """
    medians = {varying.quantity.name: varying.value(0.5) for varying in base.dispersions.varying}
    variation = Variation(
        mass=medians.get("mass", 1.0), drag=medians.get("drag", 1.0), control=medians.get("control_power", 1.0)
    )
    aircraft = base.uav.aircraft
    check_level_flight(aircraft, base.uav.limits.envelope)
    draws = base.dispersions.draws
    if draws is not None:
        try:
            Fdm(base.uav.aircraft, variation=Variation(properties=draws.properties(0)))
        except FlightError as error:
            message = f"{draws.source}: these draws belong to another aircraft: {error}"
            raise SpreadError(message, file=draws.source, field=error.field) from error
    try:
        model = Fdm(aircraft, motor_braking=base.scenario.flight.motor_braking, variation=variation)
    except FlightError as error:
        quantity = _VARIED_PROPERTIES.get(error.field)
        if quantity is None:
            raise
        raise SpreadError(
            f"{base.dispersions.name}: {quantity}: this quantity varies the property {error.field}, which the model of"
            f" {aircraft.name} does not have; use a file of dispersions without {quantity} (--spread FILE)",
            file=base.dispersions.name,
            field=quantity,
        ) from error
    amsl = float(base.scenario.start[2])
    if steady_flight(model, base.uav.airspeed, amsl) is None:
        factors = ", ".join(
            f"{name} {medians[name]:g}" for name in ("mass", "drag", "control_power") if name in medians
        )
        raise SpreadError(
            f"{base.dispersions.name}: {aircraft.name} cannot fly level at {base.uav.airspeed:g} m/s with the medians"
            f" of these factors: {factors}",
            file=base.dispersions.name,
            value=factors,
        )


# Dispersed quantity that varies a property of a JSBSim model.
_VARIED_PROPERTIES = {"aero/drag-factor": "drag", "aero/control-factor": "control_power"}


def with_aircraft_draws(dispersions: Dispersions, aircraft: Aircraft) -> Dispersions:
    """Return dispersions with the draws of the aircraft's properties.

    The draws are in a file in the aircraft's folder, if it has one.

    A dispersions file is used unchanged if it names other draws, or disperses drag or control power itself.
    """
    file = aircraft.folder / DRAWS_FILE
    has_own_dispersions = dispersions.name != DEFAULT_DISPERSIONS_NAME and any(
        varying.quantity.name in QUANTITIES_OF_DRAWS for varying in dispersions.varying
    )
    if has_own_dispersions or dispersions.draws is not None or not file.is_file():
        return dispersions
    return dispersions.with_draws(read_draws(file, SpreadError))


# ----------------------------------------------------------------------
# Vary a flight by its draw, and record the differences that are unknown to the guidance.

# Levels of turbulence in increasing order.
TURBULENCE_LEVELS: tuple[Literal["none", "light", "moderate"], ...] = ("none", "light", "moderate")
# Maximum wind speed of a varied flight, m/s.
MAX_WIND_MPS = 40.0
# Maximum wind gradient of a varied flight, 1/s.
MAX_WIND_GRADIENT = 0.05


class GivenWind(NamedTuple):
    """Mean wind that replaces the scenario's wind.

    speed: wind speed, m/s.
    from_deg: direction from which the wind blows, degrees.
    """

    speed: float
    from_deg: float


@dataclass(frozen=True)
class VariedFlight:
    """A flight with the values of a draw.

    setup, uav: setup and UAV in the drawn wind and terrain.
    off_nominal: drawn differences that the autopilot does not know.
    """

    setup: FlightSetup
    uav: Uav
    off_nominal: OffNominal


def vary_flight(base: CampaignBase, draw: Draw, wind: GivenWind | None = None) -> VariedFlight:
    """Return the flight of a draw: setup, UAV, and the differences that the autopilot does not know.

    Scenario and limits are adapted to the wind of the flight, as in `planfly fly --wind`.  The autopilot does not know
    the drawn mass, drag, control power, aircraft properties and start position.

    wind: mean wind to which the draw adds its differences; None for the wind of the scenario.
    """
    # The gusts of the drawn wind have no seed of their own.
    values, old_wind = draw.values, base.scenario.wind
    nominal = wind or GivenWind(old_wind.speed, math.degrees(old_wind.from_course))
    speed = min(MAX_WIND_MPS, max(0.0, nominal.speed + values["wind_speed"]))
    from_deg = (nominal.from_deg + values["wind_from"]) % 360.0
    gradient = min(MAX_WIND_GRADIENT, max(-MAX_WIND_GRADIENT, old_wind.gradient + values["wind_gradient"]))
    level = TURBULENCE_LEVELS.index(old_wind.turbulence) + round(values["turbulence"])
    turbulence = TURBULENCE_LEVELS[min(len(TURBULENCE_LEVELS) - 1, max(0, level))]
    drawn_wind = with_mean_wind(old_wind, speed, math.radians(from_deg), gradient)
    drawn_wind = replace(drawn_wind, turbulence=turbulence, seed=None)
    changes = {"speed_mps": speed, "from_deg": from_deg, "gradient": drawn_wind.gradient}
    wind_table = base.scenario.spec.wind.model_copy(update=changes | {"turbulence": turbulence, "seed": None})
    spec = base.scenario.spec.model_copy(update={"wind": wind_table})
    scenario, mission, placed = replace(base.scenario, spec=spec, wind=drawn_wind), base.mission, base.placed
    map_terrain, plan = scenario.terrain, base.plan
    if map_terrain is not None:
        strip_error = _draw_strip_error(scenario.landing, draw.seed)
        terrain = vary_terrain(map_terrain, values["terrain_height"], scenario.landing, strip_error)
        if terrain is not map_terrain:
            scenario = with_ground(scenario, terrain)
            plan = None if plan is None else replace(plan, scenario=with_ground(plan.scenario, terrain))
        home_error = _terrain_error_at_home(base, terrain)
        if home_error:
            # An autopilot measures the altitude of home where it is armed, so heights above home shift with it.
            # ArduPlane also corrects its terrain data by their error at home (`AP_Terrain::update_reference_offset`),
            # so heights above terrain shift by the same amount. Altitudes AMSL do not change.
            mission, shifted_terrain = base.mission, base.scenario.terrain
            if mission.home is not None:
                mission = replace(mission, home=replace(mission.home, alt=mission.home.alt + home_error))
            if shifted_terrain is not None:
                shifted_terrain = replace(shifted_terrain, heights=shifted_terrain.heights + np.float32(home_error))
            placed = place_stops(mission, base.scenario.origin, shifted_terrain, vertical_legs=base.plan is None)
    battery = base.uav.battery * values["battery"]
    draws = base.dispersions.draws
    uav_limits = base.uav.limits
    # The performance of a drawn aircraft is known exactly: its standard deviations are 0.
    exact_envelope = replace(
        uav_limits.envelope, climb_sd=0.0, descent_sd=0.0, fastest_sd=0.0, power_sd=0.0, climb_shortfall=0.0
    )
    envelope = exact_envelope if draws is not None else uav_limits.envelope
    max_bank = max_turn_bank(scenario, base.uav.autopilot)
    limits = make_limits(scenario, envelope, uav_limits.airspeed, max_bank, base.uav.autopilot)
    uav = replace(base.uav, limits=limits, battery=battery)
    setup = make_setup(scenario, uav, mission, draw.seed, plan=plan, placed=placed)
    properties = () if draws is None else draws.properties(draw.seed)
    variation = Variation(
        mass=values["mass"], drag=values["drag"], control=values["control_power"], properties=properties
    )
    start_offset = (values["start_east"], values["start_north"], values["start_up"])
    return VariedFlight(setup, uav, OffNominal(variation, start_offset))


def _draw_strip_error(strip: LandingStrip | None, seed: int) -> float | None:
    """Draw a random error of a landing strip's surveyed height, m; None if the height was not surveyed.

    seed: seed of the flight.
    """
    if strip is None or strip.height_sd is None:
        return None
    return float(np.random.default_rng([seed, _STRIP_ERROR_STREAM]).normal(0.0, strip.height_sd))


def vary_terrain(terrain: Terrain, error: float, strip: LandingStrip | None, strip_error: float | None) -> Terrain:
    """Return a terrain with an error added to all heights, except near a surveyed landing strip.

    At the strip, and up to `_SURVEYED_DISTANCE_M` beyond its ends, the error is `strip_error`.  Over the next
    `_SURVEY_BLEND_DISTANCE_M` it changes linearly to `error`.
    error: error of the elevation file, m.
    strip_error: error of the strip's survey, m; None if the strip was not surveyed.
    """
    if strip is None or strip_error is None:
        return replace(terrain, heights=terrain.heights + np.float32(error)) if error else terrain
    # Invert the columns and rows per metre near the strip to metres on the map per column and row.
    centre = np.array(terrain.to_pixel(strip.east, strip.north)).ravel()
    probes = ((strip.east + _PROBE_DISTANCE_M, strip.north), (strip.east, strip.north + _PROBE_DISTANCE_M))
    steps = [np.array(terrain.to_pixel(*probe)).ravel() - centre for probe in probes]
    metres_per_pixel = np.linalg.inv(np.column_stack(steps) / _PROBE_DISTANCE_M)
    rows, columns = np.indices(terrain.heights.shape)
    offsets = np.stack([columns - centre[0], rows - centre[1]])
    distances = np.hypot(*np.tensordot(metres_per_pixel, offsets, axes=1))
    surveyed_distance = 0.5 * strip.length + _SURVEYED_DISTANCE_M
    blend_factors = np.clip((distances - surveyed_distance) / _SURVEY_BLEND_DISTANCE_M, 0.0, 1.0)
    errors = strip_error + blend_factors * (error - strip_error)
    return replace(terrain, heights=(terrain.heights + errors).astype(np.float32))


def _terrain_error_at_home(base: CampaignBase, varied_terrain: Terrain) -> float:
    """Return the height error of a flight's terrain at home, relative to the campaign's terrain, m.

    The result is 0 if home is off the terrain.
    varied_terrain: terrain of the flight.
    """
    terrain, home = base.scenario.terrain, base.placed.itinerary.home
    if terrain is None or varied_terrain is terrain:
        return 0.0
    east, north = to_map(base.scenario.origin, home.lat_deg, home.lon_deg)
    error = float(varied_terrain.height(east, north)) - float(terrain.height(east, north))
    return 0.0 if math.isnan(error) else error
