"""Define the tables of `setup.json`: mission, route, envelope and parameters of a `FlightSetup`.

A table has the fields of its dataclass under keys with units.  pydantic writes it from the attributes of the dataclass,
and the dataclass is made from its values.  Numbers are written as Python's repr, which reads back to the same float.

cattrs 26 needs as many lines to rename fields, but reads 1.7 as the integer 1, "12" as a number, and NaN as any number.
"""

from dataclasses import fields
from typing import Annotated, Any, ClassVar, Self, TypeVar

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PlainSerializer, model_validator

from aircraft.envelope import Envelope
from flight.autopilots.autopilot import AutopilotProgram, Origin, ParameterValue, StoredParameters
from flight.mission.items import Camera, Home, Mission, MissionItem, SurveyPlan
from flight.mission.itinerary import NO_ITEM, OpenItem
from flight.mission.loiter_circles import UnjoinedStop
from flight.mission.return_path import ReturnCircle
from flight.mission.route import NOT_STATED, ROUTE_POINT, Route, route_points
from world.errors import LogError
from world.geometry import leg_runs
from world.kernels import field_names

Data = TypeVar("Data")

Finite = Annotated[float, Field(allow_inf_nan=False)]
# Columns and tables are arrays in the dataclass and lists in the file.
_LISTED = BeforeValidator(lambda value: value.tolist() if isinstance(value, np.ndarray) else value)
_Finites = Annotated[list[Finite], _LISTED]
_Column = Annotated[list[float], _LISTED]
_Table = Annotated[list[list[float]], _LISTED]  # by airspeed, then by height
_Position = Annotated[list[Finite], Field(min_length=3, max_length=3)]
# A height or another value that may be unknown: NaN in the dataclass, null in the file.
_Height = Annotated[Finite | None, BeforeValidator(lambda value: None if value != value else value)]

# Number in the file for a waypoint or an item that is None in the dataclass.
_NO_NUMBER = -1
_Number = Annotated[
    Annotated[int, Field(ge=0)] | None,
    BeforeValidator(lambda value: None if value == _NO_NUMBER else value),
    PlainSerializer(lambda value: _NO_NUMBER if value is None else value),
]


class SetupModel(BaseModel):
    """A table of `setup.json`; unknown keys are refused.

    name: key of the table in the file.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)
    name: ClassVar[str] = ""

    @classmethod
    def from_dataclass(cls, value: object) -> Self:
        """Make a table from an object of the dataclass whose fields it stores."""
        return cls.model_validate(value, from_attributes=True, by_alias=False, by_name=True)

    def field_error(self, file: str, field: str, message: str) -> LogError:
        """Make the error for an invalid field; its message names the field by its key in the file.

        file: name of the log for the message.
        field: name of the field in the dataclass.
        """
        key = f"{self.name}.{type(self).model_fields[field].alias or field}"
        return LogError(f"{file}: {key}: {message}", file=file, field=key)


def _make_from_table(data_class: type[Data], table: SetupModel, **replacements: Any) -> Data:
    """Convert a table to an object of a dataclass.

    replacements: values of fields, by name, that replace the table's values.
    """
    return data_class(**(dict(table) | replacements))


class _Item(SetupModel):
    """Table of a mission item."""

    seq: int
    command: int
    frame: int
    params: tuple[float, float, float, float]
    lat_deg: float
    lon_deg: float
    alt: Annotated[float, Field(alias="alt_m")]
    autocontinue: bool


class _Home(SetupModel):
    """Table of a mission's home."""

    lat_deg: float
    lon_deg: float
    alt: Annotated[float, Field(alias="amsl_m")]


class _Camera(SetupModel):
    """Table of a survey's camera."""

    across: Annotated[Finite, Field(gt=0.0, alias="across_m_per_m")]
    along: Annotated[Finite, Field(gt=0.0, alias="along_m_per_m")]
    front: Annotated[Finite, Field(ge=0.0, lt=1.0)] | None
    side: Annotated[Finite, Field(ge=0.0, lt=1.0)] | None
    interval: Annotated[Finite, Field(ge=0.0, alias="interval_s")]
    pixels_across: Annotated[Finite, Field(ge=0.0)] = 0.0
    focal_length_mm: Annotated[Finite, Field(gt=0.0)] = 10.0


class _SurveyPlan(SetupModel):
    """Table of the plan of a survey."""

    photo: Annotated[Annotated[Finite, Field(ge=0.0)] | None, Field(alias="photo_m")]
    turn_around: Annotated[Finite, Field(ge=0.0, alias="turn_around_m")]
    camera: _Camera | None
    stated_photo: Annotated[Finite, Field(ge=0.0, alias="stated_photo_m")] = 0.0
    height: Annotated[Finite, Field(ge=0.0, alias="height_m")] = 0.0

    def to_plan(self) -> SurveyPlan:
        """Convert the table to a `SurveyPlan`."""
        return _make_from_table(
            SurveyPlan, self, camera=None if self.camera is None else _make_from_table(Camera, self.camera)
        )


class MissionTable(SetupModel):
    """A `Mission` as a table."""

    home: _Home | None
    items: tuple[_Item, ...]
    fences: tuple[_Item, ...]
    rally: tuple[_Item, ...]
    cruise_speed: Annotated[float | None, Field(alias="cruise_speed_mps")]
    warnings: tuple[str, ...]
    source: str
    survey_plans: tuple[_SurveyPlan, ...] = ()

    def to_mission(self) -> Mission:
        """Convert the table to a `Mission`."""
        lists = {"items": self.items, "fences": self.fences, "rally": self.rally}
        items = {name: tuple(_make_from_table(MissionItem, item) for item in table) for name, table in lists.items()}
        plans = tuple(plan.to_plan() for plan in self.survey_plans)
        home = None if self.home is None else _make_from_table(Home, self.home)
        return _make_from_table(Mission, self, home=home, survey_plans=plans, **items)


class RouteTable(SetupModel):
    """A `Route` as a table, with a column for each field of its points."""

    name = "route"
    position: Annotated[list[_Position], Field(min_length=2, alias="waypoints_east_north_amsl_m"), _LISTED]
    airspeed: Annotated[_Finites, Field(alias="airspeed_mps")]
    acceptance_radius: Annotated[_Column, Field(alias="acceptance_m")]
    fly_over: Annotated[list[bool], _LISTED]
    item: Annotated[list[Annotated[int, Field(ge=NO_ITEM, lt=2**31)]], Field(alias="items"), _LISTED]
    started: str
    notes: tuple[str, ...]
    arc_radius: Annotated[_Column, Field(alias="arcs_m")] = []
    stop: Annotated[list[Annotated[int, Field(ge=0, lt=2**31)]], Field(alias="stops"), _LISTED] = []
    endless_jump: _Number = None
    takeoff_ground: Annotated[_Height, Field(alias="takeoff_ground_m")] = None
    landing_ground: Annotated[_Height, Field(alias="landing_ground_m")] = None
    rtl_start: Annotated[_Number, Field(alias="return_from_waypoint")] = None
    rtl_loiter: Annotated[
        tuple[Finite, Finite, Finite, Finite, Finite] | None,
        Field(alias="return_to_east_north_amsl_radius_slope_base_m"),
    ] = None
    direct_landing_start: Annotated[_Number, Field(alias="straight_to_waypoint")] = None
    unjoined_stops: Annotated[tuple[UnjoinedStop, ...], Field(alias="unjoined_item_circle_is_circle")] = ()
    above_ground: Annotated[list[_Height], Field(alias="above_ground_m"), _LISTED] = []
    home_up: Annotated[list[_Height], Field(alias="home_amsl_m"), _LISTED] = []
    min_ground_speed: Annotated[list[_Height], Field(alias="min_ground_speed_mps"), _LISTED] = []
    open_items: Annotated[tuple[OpenItem, ...], Field(alias="open_items_item_text")] = ()

    @model_validator(mode="before")
    @classmethod
    def _route_to_columns(cls, value: Any) -> Any:
        """Convert a `Route` to a dictionary with its points as columns; return other values unchanged."""
        if not isinstance(value, Route):
            return value
        columns = {name: value.points[name] for name in field_names(ROUTE_POINT)} | {"airspeed": value.leg_airspeeds}
        return columns | {field.name: getattr(value, field.name) for field in fields(value) if field.name != "points"}

    def to_route(self, file: str) -> Route:
        """Convert the table to a `Route`.

        Raises LogError for inconsistent columns, and for a leg without horizontal length.

        file: name of the log for the message.
        """
        if not (leg_runs(np.array(self.position)) > 0.0).all():
            raise self.field_error(file, "position", "a leg without horizontal length")
        columns, count = {}, len(self.position)
        for name in field_names(ROUTE_POINT):
            values, expected = getattr(self, name), count - (name == "airspeed")
            # A log of an earlier version may lack a column.
            if not values and not type(self).model_fields[name].is_required():
                continue
            if len(values) != expected:
                raise self.field_error(file, name, f"{len(values)} values: expected {expected}")
            columns[name] = [NOT_STATED if value is None else value for value in values]
        start = self.rtl_start
        if (start is None) != (self.rtl_loiter is None) or (start is not None and start >= count - 1):
            text = f"{_NO_NUMBER if start is None else start}: expected a waypoint before the last, and a target"
            raise self.field_error(file, "rtl_start", text)
        if self.direct_landing_start is not None and self.direct_landing_start >= count:
            raise self.field_error(
                file, "direct_landing_start", f"{self.direct_landing_start}: expected a waypoint, or {_NO_NUMBER}"
            )
        other_fields = {name: value for name, value in self if name not in field_names(ROUTE_POINT)}
        circle = None if self.rtl_loiter is None else ReturnCircle(*self.rtl_loiter)
        return Route(**(other_fields | {"points": route_points(**columns), "rtl_loiter": circle}))


class EnvelopeTable(SetupModel):
    """An `Envelope` as a table; the tables of power are empty if the power is unknown."""

    name = "envelope"
    aircraft: str
    model_hash: str
    motor_braking: bool
    airspeed: Annotated[_Finites, Field(min_length=1, alias="airspeed_mps")]
    amsl: Annotated[_Finites, Field(min_length=1, alias="amsl_m")]
    climb: Annotated[_Table, Field(alias="climb_rad")]
    descent: Annotated[_Table, Field(alias="descent_rad")]
    level_speed_min: Annotated[_Column, Field(alias="level_speed_min_mps")]
    level_speed_max: Annotated[_Column, Field(alias="level_speed_max_mps")]
    max_bank: Annotated[Finite, Field(alias="max_bank_rad")]
    power_idle: Annotated[_Table, Field(alias="power_idle_w")] = []
    power_level: Annotated[_Table, Field(alias="power_level_w")] = []
    power_full: Annotated[_Table, Field(alias="power_full_w")] = []
    volts: Annotated[Finite, Field(alias="battery_v")] = 0.0
    source: str = ""
    climb_sd: Annotated[Finite, Field(alias="climb_sd_rad", ge=0.0)] = 0.0
    descent_sd: Annotated[Finite, Field(alias="descent_sd_rad", ge=0.0)] = 0.0
    fastest_sd: Annotated[Finite, Field(alias="fastest_sd_mps", ge=0.0)] = 0.0
    power_sd: Annotated[Finite, Field(ge=0.0)] = 0.0
    battery_guessed: bool = False
    climb_guessed: bool = False
    bank_guessed: bool = False
    climb_shortfall: Annotated[Finite, Field(alias="climb_shortfall_rad", ge=0.0)] = 0.0

    def to_envelope(self, file: str) -> Envelope:
        """Convert the table to an `Envelope`.

        Raises LogError for tables of inconsistent shape, and for an axis that does not increase.

        file: name of the log for the message.
        """
        for field in ("airspeed", "amsl"):
            if (np.diff(getattr(self, field)) <= 0.0).any():
                raise self.field_error(file, field, "not increasing")
        speeds, heights = len(self.airspeed), len(self.amsl)
        shapes = {field: [speeds, heights] for field in ("climb", "descent")}
        shapes |= {field: [heights] for field in ("level_speed_min", "level_speed_max")}
        powers = ("power_idle", "power_level", "power_full")
        # Logs from before power was recorded have none.
        empty_powers = {} if self.power_level else {field: np.zeros((0, 0)) for field in powers}
        shapes |= {field: [speeds, heights] for field in powers if not empty_powers}
        for field, shape in shapes.items():
            values = getattr(self, field)
            found_shape = [len(values), *({len(row) for row in values} if len(shape) == 2 else ())]
            if found_shape != shape:
                raise self.field_error(file, field, f"shape {found_shape}: expected {shape}")
        return _make_from_table(Envelope, self, **empty_powers)


class ParametersTable(SetupModel):
    """Parameters of an autopilot as a table, in its units: each value with its source."""

    values: dict[str, Finite]
    origins: dict[str, Origin]
    unused: tuple[str, ...]
    source: str


def parameters_table(parameters: StoredParameters) -> ParametersTable:
    """Convert an autopilot's parameters to a table."""
    return ParametersTable(
        values={name: value for name, value, _ in parameters.values},
        origins={name: origin for name, _, origin in parameters.values},
        unused=parameters.unused,
        source=parameters.source,
    )


def read_parameters(table: ParametersTable) -> StoredParameters:
    """Convert a table to an autopilot's parameters; the values are not checked here."""
    values = (ParameterValue(name, value, table.origins.get(name, "default")) for name, value in table.values.items())
    return StoredParameters(tuple(values), table.unused, table.source)


class ProgramTable(SetupModel):
    """An `AutopilotProgram` as a table."""

    version: str
    sha256: str
    parameters: dict[str, Finite]
    changed: dict[str, Finite]
    unused: tuple[str, ...]

    def to_program(self) -> AutopilotProgram:
        """Convert the table to an `AutopilotProgram`."""
        return _make_from_table(AutopilotProgram, self)
