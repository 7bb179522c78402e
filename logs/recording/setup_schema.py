"""The parts of a `FlightSetup` that are tables of `setup.json`: mission, route, envelope.

Names carry their units.  Numbers are written as Python's repr, which reads back to the same float.
"""

import math
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from aircraft.envelope import Envelope
from flight.autopilots.arduplane.parameters import ArduPilotParameters, Origin, stored_parameters
from flight.mission.items import Home, Mission, MissionItem
from flight.mission.route import Route
from flight.simulation.setup import AutopilotProgram
from world.errors import LogError, ParameterError
from world.geometry import leg_runs

Floats = NDArray[np.float64]

Finite = Annotated[float, Field(allow_inf_nan=False)]
Column = list[float]
Table = list[list[float]]  # by airspeed, then by height


class SetupModel(BaseModel):
    """A table of `setup.json`: unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)


class _Item(SetupModel):
    seq: int
    command: int
    frame: int
    params: Annotated[list[float], Field(min_length=4, max_length=4)]
    lat_deg: float
    lon_deg: float
    alt_m: float
    autocontinue: bool


class _Home(SetupModel):
    lat_deg: float
    lon_deg: float
    amsl_m: float


class MissionFile(SetupModel):
    """A `Mission` as a table."""

    home: _Home | None
    items: list[_Item]
    fences: list[_Item]
    rally: list[_Item]
    cruise_speed_mps: float | None
    warnings: list[str]
    source: str


class RouteFile(SetupModel):
    """A `Route` as a table: a value a waypoint, and a value a leg for airspeed."""

    waypoints_east_north_amsl_m: Annotated[
        list[Annotated[list[Finite], Field(min_length=3, max_length=3)]], Field(min_length=2)
    ]
    airspeed_mps: list[Finite]
    acceptance_m: Column
    fly_over: list[bool]
    items: list[int]
    started: str
    notes: list[str]
    arcs_m: Column = []
    endless_jump: int = -1
    takeoff_ground_m: Finite | None = None
    landing_ground_m: Finite | None = None


class EnvelopeFile(SetupModel):
    """An `Envelope` as a table; its power is empty where it is not known."""

    aircraft: str
    model_hash: str
    motor_braking: bool
    airspeed_mps: Annotated[list[Finite], Field(min_length=1)]
    amsl_m: Annotated[list[Finite], Field(min_length=1)]
    climb_rad: Table
    descent_rad: Table
    level_speed_min_mps: Column
    level_speed_max_mps: Column
    max_bank_rad: Finite
    power_idle_w: Table = []
    power_level_w: Table = []
    power_full_w: Table = []
    battery_v: Finite = 0.0


class ParametersFile(SetupModel):
    """ArduPlane's parameters as a table, in its units: each value, and who states it."""

    values: dict[str, Finite]
    origins: dict[str, Origin]
    unused: list[str]
    source: str


class ProgramFile(SetupModel):
    """An `AutopilotProgram` as a table."""

    version: str
    sha256: str
    parameters: dict[str, Finite]
    changed: dict[str, Finite]
    unused: list[str]


def _item_file(item: MissionItem) -> _Item:
    return _Item(
        seq=item.seq,
        command=item.command,
        frame=item.frame,
        params=list(item.params),
        lat_deg=item.lat_deg,
        lon_deg=item.lon_deg,
        alt_m=item.alt,
        autocontinue=item.autocontinue,
    )


def _item(file: _Item) -> MissionItem:
    p1, p2, p3, p4 = file.params
    return MissionItem(
        file.seq, file.command, file.frame, (p1, p2, p3, p4), file.lat_deg, file.lon_deg, file.alt_m, file.autocontinue
    )


def mission_file(mission: Mission) -> MissionFile:
    """Write a mission as a table."""
    home = mission.home
    return MissionFile(
        home=None if home is None else _Home(lat_deg=home.lat_deg, lon_deg=home.lon_deg, amsl_m=home.alt),
        items=[_item_file(item) for item in mission.items],
        fences=[_item_file(item) for item in mission.fences],
        rally=[_item_file(item) for item in mission.rally],
        cruise_speed_mps=mission.cruise_speed,
        warnings=list(mission.warnings),
        source=mission.source,
    )


def read_mission_table(file: MissionFile) -> Mission:
    """Read the mission of a table."""
    return Mission(
        home=None if file.home is None else Home(file.home.lat_deg, file.home.lon_deg, file.home.amsl_m),
        items=tuple(_item(item) for item in file.items),
        fences=tuple(_item(item) for item in file.fences),
        rally=tuple(_item(item) for item in file.rally),
        cruise_speed=file.cruise_speed_mps,
        warnings=tuple(file.warnings),
        source=file.source,
    )


def route_file(route: Route) -> RouteFile:
    """Write a route as a table."""
    return RouteFile(
        waypoints_east_north_amsl_m=route.waypoints.tolist(),
        airspeed_mps=route.airspeed.tolist(),
        acceptance_m=route.acceptance.tolist(),
        fly_over=route.fly_over.tolist(),
        items=route.items.tolist(),
        started=route.started,
        notes=list(route.notes),
        arcs_m=route.arcs.tolist(),
        endless_jump=route.endless,
        takeoff_ground_m=None if math.isnan(route.takeoff_ground) else route.takeoff_ground,
        landing_ground_m=None if math.isnan(route.landing_ground) else route.landing_ground,
    )


def read_route(file: RouteFile, source: str) -> Route:
    """Read the route of a table.  Raises LogError for arrays that do not fit each other, and legs without length."""
    waypoints = np.array(file.waypoints_east_north_amsl_m, dtype=np.float64)
    if not (leg_runs(waypoints) > 0.0).all():
        raise LogError(
            f"{source}: route.waypoints_east_north_amsl_m: a leg without horizontal length",
            file=source,
            field="route.waypoints_east_north_amsl_m",
        )
    count = len(waypoints)
    wanted = {"airspeed_mps": count - 1, "acceptance_m": count, "fly_over": count, "items": count}
    if file.arcs_m:
        wanted["arcs_m"] = count
    for name, length in wanted.items():
        if len(getattr(file, name)) != length:
            raise LogError(
                f"{source}: route.{name}: {len(getattr(file, name))} values: {length} are expected",
                file=source,
                field=f"route.{name}",
            )
    return Route(
        waypoints=waypoints,
        airspeed=np.array(file.airspeed_mps, dtype=np.float64),
        acceptance=np.array(file.acceptance_m, dtype=np.float64),
        fly_over=np.array(file.fly_over, dtype=np.bool_),
        items=np.array(file.items, dtype=np.int64),
        started=file.started,
        notes=tuple(file.notes),
        arcs=np.array(file.arcs_m, dtype=np.float64),
        endless=file.endless_jump,
        takeoff_ground=math.nan if file.takeoff_ground_m is None else file.takeoff_ground_m,
        landing_ground=math.nan if file.landing_ground_m is None else file.landing_ground_m,
    )


def envelope_file(envelope: Envelope) -> EnvelopeFile:
    """Write an envelope as a table."""
    return EnvelopeFile(
        aircraft=envelope.aircraft,
        model_hash=envelope.model_hash,
        motor_braking=envelope.motor_braking,
        airspeed_mps=envelope.airspeed.tolist(),
        amsl_m=envelope.amsl.tolist(),
        climb_rad=envelope.climb.tolist(),
        descent_rad=envelope.descent.tolist(),
        level_speed_min_mps=envelope.level_speed_min.tolist(),
        level_speed_max_mps=envelope.level_speed_max.tolist(),
        max_bank_rad=envelope.max_bank,
        power_idle_w=envelope.power_idle.tolist(),
        power_level_w=envelope.power_level.tolist(),
        power_full_w=envelope.power_full.tolist(),
        battery_v=envelope.volts,
    )


def read_envelope(file: EnvelopeFile, source: str) -> Envelope:
    """Read the envelope of a table.  Raises LogError for arrays that do not fit each other, or axes out of order."""
    speeds, heights = len(file.airspeed_mps), len(file.amsl_m)

    def table(name: str, shape: tuple[int, ...]) -> Floats:
        values = getattr(file, name)
        lengths = [len(values), *({len(row) for row in values} if len(shape) == 2 else ())]
        if lengths != list(shape):
            raise LogError(
                f"{source}: envelope.{name}: shape {lengths}: {list(shape)} is expected",
                file=source,
                field=f"envelope.{name}",
            )
        return np.array(values, dtype=np.float64)

    def power(name: str) -> Floats:
        # A log of before there was any has none.
        return table(name, (speeds, heights)) if file.power_level_w else np.zeros((0, 0))

    for name in ("airspeed_mps", "amsl_m"):
        if (np.diff(getattr(file, name)) <= 0.0).any():
            raise LogError(f"{source}: envelope.{name}: not increasing", file=source, field=f"envelope.{name}")
    return Envelope(
        aircraft=file.aircraft,
        model_hash=file.model_hash,
        motor_braking=file.motor_braking,
        airspeed=table("airspeed_mps", (speeds,)),
        amsl=table("amsl_m", (heights,)),
        climb=table("climb_rad", (speeds, heights)),
        descent=table("descent_rad", (speeds, heights)),
        level_speed_min=table("level_speed_min_mps", (heights,)),
        level_speed_max=table("level_speed_max_mps", (heights,)),
        max_bank=file.max_bank_rad,
        power_idle=power("power_idle_w"),
        power_level=power("power_level_w"),
        power_full=power("power_full_w"),
        volts=file.battery_v,
    )


def parameters_file(parameters: ArduPilotParameters) -> ParametersFile:
    """Write ArduPlane's parameters as a table."""
    return ParametersFile(
        values={name: value for name, value, _ in parameters.values},
        origins={name: origin for name, _, origin in parameters.values},
        unused=list(parameters.unused),
        source=parameters.source,
    )


def read_parameters(file: ParametersFile, source: str) -> ArduPilotParameters:
    """Read the parameters of a table.  Raises LogError for a value that is not allowed."""
    values = [(name, value, file.origins.get(name, "default")) for name, value in file.values.items()]
    try:
        return stored_parameters(values, tuple(file.unused), file.source)
    except ParameterError as error:
        raise LogError(f"{source}: parameters.values: {error}", file=source, field="parameters.values") from error


def program_file(program: AutopilotProgram) -> ProgramFile:
    """Write which autopilot flew as a table."""
    return ProgramFile(
        version=program.version,
        sha256=program.sha256,
        parameters=dict(program.parameters),
        changed=dict(program.changed),
        unused=list(program.unused),
    )


def read_program(file: ProgramFile) -> AutopilotProgram:
    """Read which autopilot flew."""
    return AutopilotProgram(file.version, file.sha256, file.parameters, file.changed, tuple(file.unused))
