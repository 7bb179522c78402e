"""Define the options of a flight.

They have the same names in keywords, the command line and a scenario.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal, TypedDict, cast, get_type_hints

from aircraft.catalog import find_aircraft, model_hash
from flight.autopilots.catalog import find_program_class
from flight.autopilots.parameter_origin import ARDUPILOT, PX4, TITLES, other_autopilot_error, read_origin
from flight.mission.fences import fence_zones, number_items
from flight.mission.items import Mission, MissionItem
from flight.mission_files.formats import read_fence
from flight.simulation.setup import EngineChoice, VerticalDatum
from planfly.arguments import check_arguments, is_valid_wind
from world.airspace.zone_files import FileZones, is_zone_file, read_zone_file
from world.errors import ArgumentError, FlightError, MissionError, ParameterError
from world.files import absolute_path
from world.frames import GeoOrigin
from world.scenario import (
    Scenario,
    load_scenario,
    with_flight,
    with_flight_time,
    with_forecast,
    with_terrain,
    with_wind,
    with_zones,
    without_forecast,
)
from world.scenario_tables import OWN_GUIDANCE, Guidance, LinkUse, Navigation
from world.wording import count_text

# Wind speed, m/s, and the direction from which the wind blows, degrees.
Wind = tuple[float, float]
# One file of fences, or several.
FencePaths = str | Path | Sequence[str | Path]

# Default limit of a simulated flight, h, which is longer than the endurance of planfly's aircraft.
MAX_HOURS = 6.0
# Default limit of the size of a log, MB; a log of 60 rows per second grows by some 20 MB per hour.
MAX_MEGABYTES = 256.0

# ----------------------------------------------------------------------
# Options by group.  `Annotated` states the default of an option; without it the default is None.


class FlightOptions(TypedDict, total=False):
    """Options of a flight.

    A missing option, or None, keeps the value of the scenario.

    terrain: an elevation file that replaces the terrain of the scenario.
    wind: speed, m/s, and the direction from which the wind blows, degrees.
    turbulence: "none", "light" or "moderate".
    forecast: a file of a weather forecast (NetCDF, GRIB, or the JSON of Open-Meteo), which states the wind in time,
    height and place instead of `wind`; `at` states the take-off.
    at: time of the flight, "START" or "START/END", in ISO 8601 with offsets from UTC; zones that are inactive at this
    time are ignored.  None keeps all zones.
    aircraft: a name, or a folder.
    airspeed: cruise airspeed, m/s.
    params: a file of the autopilot's parameters.
    guidance: planfly's own guidance ("path", "l1", "vector-field") instead of the simulated ArduPlane.
    autopilot: the simulated autopilot: "ardupilot" (in the release that saved the parameter file, or else the newest),
    "ardupilot-4.6", "ardupilot-4.7", "px4" (its release likewise), "px4-1.16", "px4-1.17" or "planfly".
    nav: "perfect", "rtk" or "gnss".
    """

    terrain: str | Path | None
    wind: Wind | None
    turbulence: str | None
    forecast: str | Path | None
    at: str | None
    aircraft: str | Path | None
    airspeed: float | None
    params: str | Path | None
    guidance: Guidance | None
    autopilot: str | None
    nav: Navigation | None


class MissionOptions(FlightOptions, total=False):
    """Options of the flight of a mission file or a plan, and of its world.

    scenario: a name, a TOML file or a `Scenario`; None for the plan's own, or one made around the mission.
    fence: files of fences and zones in addition to those of the mission.
    seed: seed of the turbulence; None takes the seed of the plan or of the scenario, or 1.
    """

    scenario: Scenario | str | Path | None
    fence: Annotated[FencePaths, ()]
    seed: int | None


class PlanOptions(FlightOptions, total=False):
    """Options of the search for a path, and of the flight to plan for.

    seed: seed of the search; None takes the seed of the scenario, or 1.
    algorithm: a name of ``planfly plan --help``; None for the default.
    budget: maximum number of evaluations.
    seconds: time limit, after which the best path found is returned.
    stop: called between generations; once it returns True, the best path found is returned.
    """

    seed: int | None
    algorithm: str | None
    budget: int | None
    seconds: float | None
    stop: Callable[[], bool] | None


class LogOptions(MissionOptions, total=False):
    """Options for the log of another program, for information that it may lack.

    plan: the planned mission; None for the mission in the log.
    flight: number of the flight in the log, from 1.
    datum: datum of the log's altitudes.
    """

    plan: str | Path | None
    flight: int | None
    datum: VerticalDatum | None


class LinkOptions(LogOptions, total=False):
    """Options of a radio link.

    A missing option, or None, keeps the entry of the scenario's [link].

    frequency: MHz.
    power: output power of the transmitter, dBm.
    sensitivity: power at which the receiver still works, dBm.
    station: latitude and longitude of the station's antenna, degrees; by default the antenna stands at the mission's
    home.
    antenna: height of the station's antenna above ground, m.
    station_gain, aircraft_gain: antenna gains, dBi.
    cable_loss: losses of cables and connectors at both ends, dB.
    fade_margin: required power above the sensitivity, dB.
    max_outage: longest accepted time below the fade margin, s.
    use: "telemetry" for the ground station's link, "control" for the pilot's remote control.
    """

    frequency: float | None
    power: float | None
    sensitivity: float | None
    station: tuple[float, float] | None
    antenna: float | None
    station_gain: float | None
    aircraft_gain: float | None
    cable_loss: float | None
    fade_margin: float | None
    max_outage: float | None
    use: LinkUse | None


# Options with one range or list of words wherever they are given; the other options have a range in scenarios.
RANGED_OPTIONS = ("seed", "budget", "seconds", "flight", "datum", "engine", "log_hz", "max_hours", "max_log")
# Options that apply only to the log of another program.
LOG_OPTIONS = ("plan", "flight", "datum")


class SimulationOptions(TypedDict, total=False):
    """Autopilot of a simulated flight, its recording, and its limits.

    sitl: the program of ArduPlane or PX4 built for software in the loop, which then flies the mission.
    engine: "auto" flies the compiled flight model if it equals JSBSim in every bit, "jsbsim" flies JSBSim.
    log_hz: rows per second in the log.
    max_hours: simulated hours after which the flight is stopped.
    max_log: size of the log at which the flight is stopped, MB.
    levels: True also flies a mission that passes with planfly's guidance, and compares the two flights; a mission that
    fails is always flown again.
    """

    sitl: str | Path | None
    engine: Annotated[EngineChoice, "auto"]
    log_hz: Annotated[Literal[10, 20, 30, 60], 60]
    max_hours: Annotated[float, MAX_HOURS]
    max_log: Annotated[float, MAX_MEGABYTES]
    levels: Annotated[bool, False]


class CampaignOptions(MissionOptions, total=False):
    """Options of the flights of a campaign, and of its goal.

    spread: a TOML file of the quantities that vary; None takes planfly's default.
    flights: number of flights.
    prove: a probability that the flights show to be reached or missed.
    at_least: a probability to judge after all flights.
    confidence: confidence level of each bound.
    """

    spread: str | Path | None
    flights: int | None
    prove: float | None
    at_least: float | None
    confidence: float | None


class WindsOptions(MissionOptions, total=False):
    """Options of the flights of a search for the strongest winds, and of the search itself.

    spread: a TOML file of the quantities that vary; None takes planfly's default.
    flights: maximum number of flights for all directions together.
    confidence: confidence level of each interval.
    workers: number of processes on this machine; None for one per core.
    scheduler: address of a running dask scheduler.
    """

    spread: str | Path | None
    flights: int | None
    confidence: float | None
    workers: int | None
    scheduler: str | None


class SampleOptions(MissionOptions, total=False):
    """Options of a fixed number of varied flights.

    spread: a TOML file of the quantities that vary; None takes planfly's default.
    flights: number of flights.
    workers: number of processes on this machine; None for one per core.
    scheduler: address of a running dask scheduler.
    """

    spread: str | Path | None
    flights: Annotated[int, 100]
    workers: int | None
    scheduler: str | None


class WindowOptions(MissionOptions, total=False):
    """Options of the flights of a search for a departure window.

    spread: a TOML file of the quantities that vary; None takes planfly's default.
    flights: number of flights of each departure.
    workers: number of processes on this machine; None for one per core.
    scheduler: address of a running dask scheduler.
    """

    spread: str | Path | None
    flights: Annotated[int, 40]
    workers: int | None
    scheduler: str | None


class BatteryOptions(SampleOptions, total=False):
    """Options of the flights of a search for a battery.

    confidence: confidence of the capacity's interval.
    """

    confidence: Annotated[float, 0.95]


class FlyOptions(MissionOptions, SimulationOptions, total=False):
    """Options of `planfly.fly`."""


class RunOptions(FlightOptions, SimulationOptions, total=False):
    """Options of `planfly.run`."""


def option_defaults(options: type) -> dict[str, object]:
    """Return the default of each option of a group of options, such as `SimulationOptions`, by name.

    >>> option_defaults(SimulationOptions)["log_hz"]
    60
    """
    hints = get_type_hints(options, include_extras=True)
    return {name: getattr(hint, "__metadata__", (None,))[0] for name, hint in hints.items()}


def select_log_options(options: LogOptions) -> dict[str, object]:
    """Return the options that apply only to the log of another program."""
    return {name: value for name, value in options.items() if name in LOG_OPTIONS}


def select_mission_options(options: MissionOptions) -> MissionOptions:
    """Return only the options of `MissionOptions`, without those of a log or a campaign."""
    return cast(
        MissionOptions, {name: value for name, value in options.items() if name in MissionOptions.__annotations__}
    )


def select_log_and_mission_options(options: LogOptions) -> LogOptions:
    """Return only the options of `LogOptions`, without those of a radio link, for `planfly.judge`."""
    return cast(LogOptions, {name: value for name, value in options.items() if name in LogOptions.__annotations__})


def fence_file_names(options: MissionOptions) -> list[str]:
    """Return the names of the files that the option `fence` names."""
    fence = options.get("fence") or ()
    return [str(file) for file in ([fence] if isinstance(fence, str | Path) else fence)]


# ----------------------------------------------------------------------
# Files of fences, zones and rally points, which the option `fence` names.


@dataclass(frozen=True, slots=True)
class NamedFences:
    """Content of the named files of fences, zones and rally points.

    items: fence items of all files.
    zones: name and zones of each zone file.
    rally: rally points of all files.
    """

    items: tuple[MissionItem, ...] = ()
    zones: tuple[tuple[str, FileZones], ...] = ()
    rally: tuple[MissionItem, ...] = ()

    def add_to_mission(self, mission: Mission) -> Mission:
        """Return the mission with the named fences and rally points added to its own.

        Warnings state that the fences and rally points of the mission still apply.
        """
        if not self.items and not self.rally:
            return mission
        warnings = mission.warnings
        if mission.fences and self.items:
            mission_fence_text = f"the mission's own fence of {count_text(len(mission.fences), 'item')}"
            warnings = (*warnings, f"{mission_fence_text} applies in addition to the named fence")
        if mission.rally and self.rally:
            mission_rally_text = count_text(len(mission.rally), "rally point")
            warnings = (*warnings, f"the mission's own {mission_rally_text} may be used in addition to the named ones")
        fences = (*mission.fences, *self.items)
        if len({item.seq for item in fences}) < len(fences):
            # Fence items of several files are numbered together.
            fences = number_items(fences)
        rally = number_items([*mission.rally, *self.rally])
        return replace(mission, fences=fences, rally=rally, warnings=warnings)

    def add_to_scenario(self, scenario: Scenario) -> Scenario:
        """Return the scenario with the zones of all files added.

        Raises ScenarioError for an invalid zone.
        """
        for source, file_zones in self.zones:
            scenario = with_zones(scenario, file_zones.zones, source, file_zones.notes)
        return scenario


def read_named_fences(files: FencePaths) -> NamedFences:
    """Read files of fences, zones or rally points; the suffix of each file determines its format.

    Raises MissionError or ScenarioError for a file that cannot be read, for a file without a fence or a rally point,
    and for invalid shapes.

    >>> read_named_fences([])
    NamedFences(items=(), zones=(), rally=())
    """
    all_items: list[MissionItem] = []
    rally: list[MissionItem] = []
    zones = []
    for file in [files] if isinstance(files, str | Path) else files:
        path = Path(file)
        if is_zone_file(path):
            zones.append((str(file), read_zone_file(path, str(file))))
            continue
        contents = read_fence(path)
        rally += contents.rally
        # Check the shapes here, because the file they are from is known only here.
        for first in contents.fences[:1]:
            fence_zones(contents.fences, GeoOrigin(first.lat_deg, first.lon_deg), str(file))
        all_items += contents.fences
    return NamedFences(tuple(all_items), tuple(zones), tuple(rally))


# ----------------------------------------------------------------------
# Scenarios changed by options.


def load_scenario_with_options(
    scenario: Scenario | str | Path,
    options: FlightOptions,
    program: Path | None = None,
    mission: Mission | None = None,
) -> Scenario:
    """Return a scenario, given as an object, a name or a TOML file, with options applied.

    program, mission: see `apply_options`.
    Raises ScenarioError, TerrainError, ParameterError or MissionError.
    """
    terrain = options.get("terrain")
    terrain_path = None if terrain is None else str(terrain)
    if not isinstance(scenario, Scenario):
        scenario = load_scenario(str(scenario), terrain_path)
    elif terrain_path is not None:
        scenario = with_terrain(scenario, terrain_path)
    return apply_options(scenario, options, program, mission)


def apply_options(
    scenario: Scenario, options: FlightOptions, program: Path | None = None, mission: Mission | None = None
) -> Scenario:
    """Return a scenario with options of weather, time and flight applied; the terrain is not changed.

    program: executable of the autopilot that flies; None for a simulated autopilot.
    mission: the mission that is flown; None without a mission.
    If no autopilot is named, the parameter file and the mission determine it, see `with_file_autopilot`.
    Raises ScenarioError for values that a scenario file must not have, ArgumentError for an aircraft that is unknown
    and an airspeed at which it does not fly, ParameterError for the file of another autopilot, and ForecastError for a
    forecast that cannot be used or that does not cover the flight.

    >>> changed = apply_options(load_scenario("tight"), {"wind": (8.0, 270.0), "airspeed": 28.0})
    >>> changed.wind.speed, changed.flight.airspeed_mps
    (8.0, 28.0)
    """
    wind, forecast = options.get("wind"), options.get("forecast")
    speed: float | None = None
    from_course: float | None = None
    if wind is not None:
        if forecast is not None:
            allowed = "not allowed with a forecast, which states the wind"
            raise ArgumentError.of_argument("wind", wind, allowed, shown="")
        direction_text = "the direction that the wind blows from, degrees from north"
        try:
            speed, from_deg = wind
            if isinstance(wind, str | bytes):
                raise TypeError
            speed, from_deg = float(speed), float(from_deg)
        except (TypeError, ValueError):
            allowed = f"expected a speed, m/s, and {direction_text}, such as (8, 270)"
            raise ArgumentError.of_argument("wind", wind, allowed, shown=repr(wind)) from None
        if not is_valid_wind(0.0, from_deg):
            raise ArgumentError.of_argument("wind", wind, f"expected {direction_text}, -360..360")
        from_course = math.radians(from_deg)
    if forecast is not None:
        # With the time of flight first, so that the file is read once, for this time.
        scenario = without_forecast(scenario)
    if options.get("aircraft") is not None or options.get("airspeed") is not None:
        _check_aircraft_options(scenario, options)
    new_scenario = with_flight_time(scenario, options.get("at"))
    entries = flight_entries(options, program)
    if any(value is not None for value in entries.values()):
        new_scenario = with_flight(new_scenario, **entries)
    if forecast is not None:
        new_scenario = with_forecast(new_scenario, str(forecast))
    if new_scenario.flight.params is not None or (mission is not None and mission.autopilot):
        new_scenario = with_file_autopilot(new_scenario, mission)
    if wind is not None or options.get("turbulence") is not None:
        new_scenario = with_wind(new_scenario, speed, from_course, options.get("turbulence"))
    table = new_scenario.spec.wind
    if table.forecast is not None and new_scenario.spec.at is None:
        raise ArgumentError.of_argument(
            "at", None, "missing; a forecast needs the time of take-off, such as 2026-05-01T10:00+02:00", shown=""
        )
    return new_scenario


def _check_aircraft_options(scenario: Scenario, options: FlightOptions) -> None:
    """Raise ArgumentError for an unknown aircraft, or an airspeed that the aircraft cannot fly.

    Raises FlightError for a wrong value in a named aircraft's own file.  An aircraft that only the scenario names is
    not checked, if it cannot be loaded.
    """
    stated_aircraft, airspeed = flight_entries(options)["aircraft"], options.get("airspeed")
    name = str(stated_aircraft or scenario.flight.aircraft)
    try:
        aircraft = find_aircraft(name)
        model_hash(aircraft)
    except FlightError as error:
        if stated_aircraft is None:
            # The scenario names it, which the load of its UAV reports.
            return
        if error.field:
            # A wrong value in the aircraft's own file.
            raise
        raise ArgumentError.of_argument("aircraft", name, str(error)) from error
    # Scenarios refuse what is not a number.
    if isinstance(airspeed, float | int) and not aircraft.airspeed_min <= airspeed <= aircraft.airspeed_max:
        allowed = f"allowed {aircraft.airspeed_min:g}..{aircraft.airspeed_max:g} m/s for {aircraft.name}"
        raise ArgumentError.of_argument("airspeed", airspeed, allowed, shown=f"{airspeed:g}")


def flight_entries(options: FlightOptions, program: Path | None = None) -> dict[str, str | float | None]:
    """Return the entries of a scenario's [flight] table for the options.

    The entry of an option that is not given is None.

    program: executable of a real autopilot (SITL) that flies; None for a simulated autopilot.
    Raises ArgumentError for an unknown autopilot, and if both an autopilot and a program are given.

    >>> entries = flight_entries({"autopilot": "px4-1.16"})
    >>> entries["autopilot"], entries["px4_version"]
    ('px4', '1.16')
    >>> flight_entries({"autopilot": "ardupilot-4.6"})["arduplane_version"]
    '4.6'
    """
    aircraft = options.get("aircraft")
    params = options.get("params")
    autopilot = options.get("autopilot")
    check_arguments(autopilot=autopilot)
    if program is not None and autopilot is not None:
        allowed = "cannot be combined with `sitl`: a real autopilot flies by its own control laws"
        raise ArgumentError.of_argument("autopilot", autopilot, allowed)
    autopilot_name, _, version = (autopilot or "").partition("-")
    program_name = None if program is None else find_program_class(program).name
    return {
        # A `Path` is a folder; its absolute path marks it as a folder instead of a name.
        "aircraft": str(aircraft.resolve()) if isinstance(aircraft, Path) else aircraft,
        "airspeed_mps": options.get("airspeed"),
        "autopilot": program_name or autopilot_name or None,
        "arduplane_version": version if autopilot_name == "ardupilot" and version else None,
        "px4_version": version if autopilot_name == "px4" and version else None,
        "guidance": options.get("guidance"),
        "nav": options.get("nav"),
        # Absolute, so that it does not depend on the folder of the scenario.
        "params": None if params is None else absolute_path(Path(params)),
    }


# ----------------------------------------------------------------------
# The autopilot that a flight's files were written for.


def with_file_autopilot(scenario: Scenario, mission: Mission | None = None) -> Scenario:
    """Return the scenario with the autopilot for which its parameter file or its mission was written.

    An autopilot named by the user is kept, and so is planfly's own guidance.  If no file names an autopilot, the
    scenario is not changed.  Raises ParameterError or MissionError if a file was not written for the named autopilot,
    if two files were written for different autopilots, and if a parameter file has parameters of both autopilots.

    >>> from world.scenario import load_scenario
    >>> made = with_file_autopilot(load_scenario("paper-07"), Mission(None, (), autopilot="px4", source="field.plan"))
    >>> made.flight.autopilot, made.flight.autopilot_from
    ('px4', 'field.plan')
    """
    table = scenario.flight
    steering = table.steering.autopilot
    if steering == OWN_GUIDANCE:
        return scenario
    mission_autopilot = "" if mission is None else mission.autopilot
    is_named_by_user = table.autopilot is not None and table.autopilot_from is None
    if not is_named_by_user and table.params is not None and table.autopilot is None:
        origin = read_origin(Path(table.params))
        if origin.mixed:
            remedy = "--autopilot names the autopilot that is to fly"
            message = f"{table.params}: {origin.evidence}: {remedy}"
            raise ParameterError(message, file=table.params, field="autopilot", value=origin.evidence, allowed=remedy)
        if origin.autopilot:
            scenario = _with_autopilot(scenario, origin.autopilot, table.params)
            table = scenario.flight
    if mission is None or not mission_autopilot:
        return scenario
    if table.autopilot is None:
        return _with_autopilot(scenario, mission_autopilot, mission.source)
    if mission_autopilot != table.autopilot and table.autopilot in TITLES:
        if table.autopilot_from is None:
            raise MissionError.from_error(
                other_autopilot_error(
                    mission.source, mission_autopilot, _FIRMWARE_TEXTS[mission_autopilot], table.autopilot
                )
            )
        other_file = f"{table.autopilot_from} for {TITLES[table.autopilot]}"
        allowed = "expected files of one autopilot"
        message = (
            f"{mission.source}: written for {TITLES[mission_autopilot]} ({_FIRMWARE_TEXTS[mission_autopilot]}),"
            f" but {other_file}; {allowed}"
        )
        raise MissionError(message, file=mission.source, field="autopilot", value=mission_autopilot, allowed=allowed)
    return scenario


# Text by which a .plan file states its autopilot.
_FIRMWARE_TEXTS = {ARDUPILOT: "firmwareType 3", PX4: "firmwareType 12"}


def _with_autopilot(scenario: Scenario, autopilot: str, file: str) -> Scenario:
    """Return the scenario with an autopilot, and with the file that names it as the source.

    autopilot: name of the autopilot, which is stated even if it is the default.
    file: name of the file, for messages.
    """
    params = scenario.flight.params
    new_scenario = with_flight(scenario, autopilot=autopilot, params=params)
    table = new_scenario.flight.model_copy(update={"autopilot_from": file})
    return replace(new_scenario, spec=new_scenario.spec.model_copy(update={"flight": table}), flight=table)
