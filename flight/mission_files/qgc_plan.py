"""Read and write missions as `.plan` JSON (QGroundControl's "Plan File Format"), for QGC and MAVSDK.

ComplexItems, such as surveys, are read as the simple items that they stand for.
"""

import json
import math
from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from flight.mission.fences import INCLUSIONS, POLYGONS, fence_shapes
from flight.mission.items import (
    AMSL,
    LANDINGS,
    MAX_ITEMS,
    OVER_HOME,
    PLACES,
    Camera,
    Command,
    Frame,
    Home,
    Mission,
    MissionItem,
    SurveyPlan,
    command_name,
    is_located,
    item_problem,
    position_problem,
    renumber_items,
    round_to_grid,
)
from world.errors import MissionError
from world.files import json_value
from world.scenario_file import JSON_OBJECT, first_fault
from world.wording import count_text

# ----------------------------------------------------------------------
# QGroundControl's ComplexItems as the simple items that they stand for.
#
# Surveys and corridor scans contain their items (TransectStyleComplexItem.Items); a fixed-wing landing pattern is three
# to seven items. Any other kind can be expanded only by its ground station.

# Kinds of ComplexItem that contain their items.
_TRANSECT_KINDS = ("survey", "CorridorScan")
# Kind of ComplexItem of a fixed-wing landing.
_LANDING_KIND = "fwLandingPattern"
# QGC's altitude mode of a height above terrain, which it sends as an altitude AMSL.
_ALTITUDE_ABOVE_TERRAIN_MODE = 3
# Text for a missing coordinate.
_COORDINATE_TEXT = "expected latitude, longitude and altitude"


def expand_items(items: list[Any], source: str, warnings: list[str], plans: list[SurveyPlan]) -> list[Any]:
    """Return the items of a `.plan` with each ComplexItem, such as a survey, replaced by its simple items.

    items: JSON values of the file's items.
    source: name of the file in messages.
    warnings: receives a warning for each replaced item.
    plans: receives the settings of each survey.

    Raises MissionError, naming the kind, if an item cannot be expanded. The contents of an item are checked later.
    """
    simple_items: list[Any] = []
    for index, item in enumerate(items):
        kind = item.get("type", "SimpleItem") if isinstance(item, dict) else "SimpleItem"
        if kind == "SimpleItem":
            simple_items.append(_to_current_form(item, f"{source}: mission.items.{index}", warnings))
            continue
        location = f"mission.items.{index}"
        name = str(item.get("complexItemType", ""))[:40] if kind == "ComplexItem" else ""
        if name in _TRANSECT_KINDS:
            settings = item.get("TransectStyleComplexItem")
            replacements = settings.get("Items") if isinstance(settings, dict) else None
            if not isinstance(replacements, list) or not replacements:
                field, shown = f"{location}.TransectStyleComplexItem.Items", f"{name!r} without its items"
                allowed = "expected a list; save the plan again in the ground station"
                raise MissionError.at(source, field, replacements, allowed, shown=shown)
            plans.append(_survey_plan(settings, replacements, f"{source}: {location}", warnings))
        elif name == _LANDING_KIND:
            # The landing's items continue the numbers of the items before, or their count if the last has no number.
            last_item = simple_items[-1] if simple_items else None
            last_number = last_item.get("doJumpId") if isinstance(last_item, dict) else None
            first_number = (last_number if isinstance(last_number, int) else len(simple_items)) + 1
            replacements = _landing_items(item, source, location, first_number)
        else:
            read_kinds = f"only SimpleItem, {', '.join(_TRANSECT_KINDS)} and {_LANDING_KIND} are read"
            allowed = f"{read_kinds}; convert it to items in the ground station first"
            kind_text = f"{json.dumps(kind)[:40]} {name!r}"
            raise MissionError.at(source, f"{location}.type", name or kind, allowed, shown=kind_text)
        warnings.append(
            f"{source}: {location}: {name} replaced by the {len(replacements)} simple items that it represents"
        )
        simple_items += replacements
    return simple_items


def _to_current_form(item: Any, location: str, warnings: list[str]) -> Any:
    """Convert a simple item of an older version, or without an altitude, to QGroundControl's current form.

    Until 2018 an item had four parameters, and its position in ``coordinate`` (`MissionItem::_convertJsonV2ToV3`).

    An item above terrain has no altitude in its parameters until QGroundControl knows the terrain. Its height above
    ground is then in ``Altitude``. Such an item is converted to a frame above terrain, with a warning.
    """
    if not isinstance(item, dict) or not isinstance(params := item.get("params"), list):
        return item
    old_coordinate = item.get("coordinate")
    if len(params) == 4 and isinstance(old_coordinate, list) and len(old_coordinate) == 3:
        return {**item, "params": [*params, *old_coordinate]}
    height = item.get("Altitude")
    has_height = isinstance(height, int | float) and not isinstance(height, bool)
    if (
        len(params) == 7
        and params[6] is None
        and item.get("AltitudeMode") == _ALTITUDE_ABOVE_TERRAIN_MODE
        and has_height
    ):
        warnings.append(
            f"{location}: QGroundControl has not calculated its altitude: flown {height:g} m above the terrain there"
        )
        return {**item, "frame": int(Frame.GLOBAL_TERRAIN_ALT), "params": [*params[:6], height]}
    return item


class _CameraCalc(BaseModel):
    """QGC's camera of a survey (`CameraCalc.cc`), given by name, by lens and sensor, or only by distances."""

    # QGC writes whole numbers as integers.
    model_config = ConfigDict(extra="ignore", allow_inf_nan=False, frozen=True, defer_build=True)
    SensorWidth: Annotated[float, Field(gt=0.0, le=1000.0)]
    SensorHeight: Annotated[float, Field(gt=0.0, le=1000.0)]
    FocalLength: Annotated[float, Field(gt=0.0, le=10_000.0)]
    ImageWidth: Annotated[float, Field(gt=0.0)] | None = None
    ImageHeight: Annotated[float, Field(gt=0.0)] | None = None
    Landscape: bool = True
    FrontalOverlap: Annotated[float, Field(ge=0.0, lt=100.0)] | None = None
    SideOverlap: Annotated[float, Field(ge=0.0, lt=100.0)] | None = None
    MinTriggerInterval: Annotated[float, Field(ge=0.0, le=3600.0)] | None = None

    def camera(self) -> Camera:
        """Return the camera's footprint on level ground.

        As in QGC, pixels are square, with the size that the longer side gives.
        """
        width_ratio, height_ratio = self.SensorWidth / self.FocalLength, self.SensorHeight / self.FocalLength
        if self.ImageWidth is not None and self.ImageHeight is not None:
            height_ratio = width_ratio * self.ImageHeight / self.ImageWidth
        across, along = (width_ratio, height_ratio) if self.Landscape else (height_ratio, width_ratio)
        front_overlap, side_overlap = (
            None if percent is None else percent / 100.0 for percent in (self.FrontalOverlap, self.SideOverlap)
        )
        pixels = self.ImageWidth if self.Landscape else self.ImageHeight
        interval, focal_length = self.MinTriggerInterval or 0.0, self.FocalLength
        return Camera(across, along, front_overlap, side_overlap, interval, pixels or 0.0, focal_length)


def _survey_plan(settings: dict[str, Any], items: list[Any], location: str, warnings: list[str]) -> SurveyPlan:
    """Return the settings that a survey stores besides its items: line extension, camera and height.

    settings: content of the survey's TransectStyleComplexItem.
    items: simple items of the survey, which state the distance between photos.

    An invalid camera is left out, and a warning is added.
    """

    def read_metres(table: Any, key: str, most: float) -> float:
        """Return the distance under a key, m, or 0 without a distance of 0 to `most`."""
        value = table.get(key) if isinstance(table, dict) else None
        if isinstance(value, bool) or not isinstance(value, int | float):
            return 0.0
        return float(value) if 0.0 <= value <= most else 0.0

    calc, camera = settings.get("CameraCalc"), None
    # A camera that QGC calls manual has only distances.
    if isinstance(calc, dict) and calc.get("FocalLength") is not None:
        try:
            camera = _CameraCalc.model_validate(calc).camera()
        except ValidationError as error:
            fault = error.errors()[0]
            field = ".".join(map(str, fault["loc"]))
            shown = "missing" if fault["type"] == "missing" else json.dumps(fault["input"])[:40]
            warnings.append(f"{location}: CameraCalc.{field}: {shown}: the camera is ignored, and no overlap is judged")
    # The longest distance between photos that the items state, m; 0 if no item states one.
    trigger_distance = 0.0
    for item in items:
        params = item.get("params") if isinstance(item, dict) else None
        if isinstance(params, list) and params and item.get("command") == Command.DO_SET_CAM_TRIGG_DIST:
            metres = params[0]
            if isinstance(metres, int | float) and not isinstance(metres, bool) and 0.0 < metres <= 1e6:
                trigger_distance = max(trigger_distance, float(metres))
    return SurveyPlan(
        trigger_distance,
        read_metres(settings, "TurnAroundDistance", 1e5),
        camera,
        read_metres(calc, "AdjustedFootprintFrontal", 1e6),
        0.0 if settings.get("FollowTerrain") is True else read_metres(calc, "DistanceToSurface", 1e6),
    )


def _landing_items(item: dict[str, Any], source: str, location: str, number: int) -> list[Any]:
    """Return the items of a landing pattern as QGC sends them (`LandingComplexItem::appendMissionItems`).

    They are DO_LAND_START, an optional change of speed, optional commands that stop photos and video, the approach, and
    NAV_LAND. The approach is a descending loiter or a waypoint.

    location: location of the item in the file, for messages.
    number: number of the first returned item.
    """

    def read_position(key: str) -> list[Any] | None:
        """Return the latitude, longitude and altitude under a key of the pattern, or None if missing or null."""
        value = item.get(key)
        if value is not None and (not isinstance(value, list) or len(value) != 3 or None in value):
            raise MissionError.at(source, f"{location}.{key}", value, _COORDINATE_TEXT, shown=json.dumps(value)[:40])
        return value

    approach = read_position("landingApproachCoordinate") or read_position("loiterCoordinate")
    land = read_position("landCoordinate")
    if approach is None or land is None:
        key = "landCoordinate" if land is None else "landingApproachCoordinate"
        raise MissionError.at(source, f"{location}.{key}", None, _COORDINATE_TEXT, shown="missing")
    relative = item.get("altitudesAreRelative")
    if relative is None:
        # The first version of the pattern states the altitudes separately; QGC reads different ones as relative.
        relative = item.get("loiterAltitudeRelative", True) or item.get("landAltitudeRelative", True)
    frame = Frame.GLOBAL_RELATIVE_ALT if relative else Frame.GLOBAL
    radius = item.get("loiterRadius", 0.0)
    if isinstance(radius, bool) or not isinstance(radius, int | float) or not 0.0 <= radius <= 1e5:
        shown = json.dumps(radius)[:40]
        raise MissionError.at(source, f"{location}.loiterRadius", radius, "expected 0..100000 m", shown=shown)
    signed_radius = float(radius) if item.get("loiterClockwise", True) else -float(radius)
    is_spiral = item.get("useLoiterToAlt", True)
    approach_command = (
        (Command.NAV_LOITER_TO_ALT, [1.0, signed_radius, 0.0, 1.0])
        if is_spiral
        else (Command.NAV_WAYPOINT, [0.0, 0.0, 0.0, None])
    )
    # MAV_CMD, MAV_FRAME and seven parameters of each item.
    simple_items: list[tuple[int, int, list[Any]]] = [(Command.DO_LAND_START, Frame.MISSION, [0.0] * 7)]
    if item.get("useDoChangeSpeed") is True:
        speed = item.get("finalApproachSpeed")
        if isinstance(speed, bool) or not isinstance(speed, int | float) or not 0.0 < speed <= _MAX_SPEED_MPS:
            allowed = f"expected more than 0, up to {_MAX_SPEED_MPS:g} m/s"
            field = f"{location}.finalApproachSpeed"
            raise MissionError.at(source, field, speed, allowed, shown=json.dumps(speed)[:40])
        # An airspeed in whole m/s, and the throttle unchanged.
        speed_params = [0.0, float(int(speed)), -1.0, 0.0, 0.0, 0.0, 0.0]
        simple_items.append((Command.DO_CHANGE_SPEED, Frame.MISSION, speed_params))
    if item.get("stopTakingPhotos") is True:
        simple_items.append((Command.DO_SET_CAM_TRIGG_DIST, Frame.MISSION, [0.0] * 7))
        simple_items.append((Command.IMAGE_STOP_CAPTURE, Frame.MISSION, [0.0, *[None] * 6]))
    if item.get("stopVideoPhotos") is True:
        simple_items.append((Command.VIDEO_STOP_CAPTURE, Frame.MISSION, [0.0, *[None] * 6]))
    simple_items += [
        (approach_command[0], frame, [*approach_command[1], *approach]),
        (Command.NAV_LAND, frame, [0.0, 0.0, 0.0, 0.0, *land]),
    ]
    return [
        {
            "type": "SimpleItem",
            "autoContinue": True,
            "command": int(command),
            "doJumpId": number + index,
            "frame": int(item_frame),
            "params": params,
        }
        for index, (command, item_frame, params) in enumerate(simple_items)
    ]


# QGC's default hover speed, m/s; a fixed wing has none.
_HOVER_SPEED_MPS = 5
# QGC's default cruise speed, m/s.
_CRUISE_SPEED_MPS = 15.0
# Largest speed that is read, m/s.
_MAX_SPEED_MPS = 1000.0


class _Table(BaseModel):
    # QGC adds keys from release to release: unknown ones are ignored.
    model_config = ConfigDict(extra="ignore", allow_inf_nan=False, frozen=True, strict=True, defer_build=True)


# A finite number in the range of a float32.
_Number = Annotated[float, Field(ge=-3.5e38, le=3.5e38)]
# A number, or null where unset.
_Unset = _Number | None
# Latitude and longitude.
_Pair = Annotated[list[_Number], Field(min_length=2, max_length=2)]


class _Item(_Table):
    # A ComplexItem has none of a SimpleItem's keys; `_expand_complex_items` replaces it first.
    autoContinue: bool = True
    command: Annotated[int, Field(ge=0, le=65535)]
    doJumpId: Annotated[int, Field(ge=0, le=65535)] | None = None
    frame: Annotated[int, Field(ge=0, le=255)]
    params: Annotated[list[_Unset], Field(min_length=7, max_length=7)]


class _Mission(_Table):
    version: Annotated[int, Field(ge=2, le=2)]
    cruiseSpeed: Annotated[float, Field(ge=0.0, le=_MAX_SPEED_MPS)] | None = None
    firmwareType: int | None = None
    vehicleType: int | None = None
    plannedHomePosition: Annotated[list[_Unset], Field(min_length=3, max_length=3)] | None = None
    items: Annotated[list[_Item], Field(max_length=MAX_ITEMS)]


class _Disc(_Table):
    center: _Pair
    radius: Annotated[float, Field(gt=0.0, le=1e7)]


class _FenceCircle(_Table):
    circle: _Disc
    inclusion: bool


class _FencePolygon(_Table):
    polygon: Annotated[list[_Pair], Field(min_length=3, max_length=1000)]
    inclusion: bool


class _GeoFence(_Table):
    circles: Annotated[list[_FenceCircle], Field(max_length=1000)] = []
    polygons: Annotated[list[_FencePolygon], Field(max_length=1000)] = []


class _Rally(_Table):
    points: Annotated[list[Annotated[list[_Number], Field(min_length=3, max_length=3)]], Field(max_length=1000)] = []


class _File(_Table):
    fileType: Literal["Plan"]
    version: Annotated[int, Field(ge=1, le=1)]
    mission: _Mission
    geoFence: _GeoFence = _GeoFence()
    rallyPoints: _Rally = _Rally()


# Vehicles other than fixed wings, by MAV_TYPE (MAVLink's common.xml).
_OTHER_VEHICLES = (
    ((2, 3, 4, 13, 14, 15, 29, 35, 43), "a multicopter or helicopter"),
    ((7, 8), "a balloon or airship"),
    ((10,), "a rover"),
    ((11, 12), "a boat or submarine"),
    ((19, 20, 21, 22, 23, 24, 25), "a VTOL aircraft"),
)
# MAV_TYPE_GENERIC and MAV_TYPE_FIXED_WING.
_FIXED_WING_TYPES = (0, 1)
# Autopilots by MAV_AUTOPILOT (MAVLink's minimal.xml), with their names in scenarios: ArduPilot and PX4.
_FIRMWARES = {3: "ardupilot", 12: "px4"}
# MAV_AUTOPILOT_GENERIC and MAV_AUTOPILOT_INVALID, which name no autopilot.
_UNNAMED_FIRMWARES = (0, 8)


def parse_plan_file(text: str, source: str) -> Mission:
    """Read the text of a `.plan` file; ``source`` names it in messages.

    Items are numbered from 1 in their order, as in QGroundControl. A jump leads to the item with the doJumpId that it
    names. A null is read as NaN. Raises MissionError with file, field, value and allowed values.
    """
    try:
        data = json_value(text.removeprefix("\ufeff"), parse_constant=_refuse_constant)
    except ValueError as error:
        raise MissionError(f"{source}: not valid JSON: {str(error).splitlines()[0]}", file=source) from error
    warnings, plans = _expand_complex_items(data, source)
    try:
        file = _File.model_validate(data)
    except ValidationError as error:
        raise MissionError(**first_fault(error, data, container=JSON_OBJECT).at(source)) from error
    # Only a plan for a fixed wing, or for no stated vehicle, is flown.
    vehicle_type = file.mission.vehicleType
    for types, name in _OTHER_VEHICLES:
        if vehicle_type in types:
            allowed = f"{name}; planfly flies only fixed-wing aircraft (vehicleType 1)"
            raise MissionError.at(source, "mission.vehicleType", vehicle_type, allowed)
    if vehicle_type is not None and vehicle_type not in _FIXED_WING_TYPES:
        allowed = "not a fixed-wing aircraft; expected 1 (MAV_TYPE_FIXED_WING)"
        raise MissionError.at(source, "mission.vehicleType", vehicle_type, allowed)
    # None or 0: the plan names no autopilot.
    firmware = file.mission.firmwareType or 0
    if firmware not in _UNNAMED_FIRMWARES and firmware not in _FIRMWARES:
        allowed = "not an autopilot that planfly simulates; expected 3 (ArduPilot), 12 (PX4) or 0 (not stated)"
        raise MissionError.at(source, "mission.firmwareType", firmware, allowed)
    autopilot = _FIRMWARES.get(firmware, "")
    items = []
    for index, item in enumerate(file.mission.items):
        p1, p2, p3, p4, lat, lon, alt = (math.nan if value is None else value + 0.0 for value in item.params)
        if is_located(item.command, item.frame) and position_problem(lat, lon) is None:
            lat, lon = round_to_grid(lat), round_to_grid(lon)
        seq = index + 1 if item.doJumpId is None else item.doJumpId
        mission_item = MissionItem(seq, item.command, item.frame, (p1, p2, p3, p4), lat, lon, alt, item.autoContinue)
        items.append(_checked_item(mission_item, source, f"mission.items.{index} (item {seq})"))
    if not (items or file.geoFence.circles or file.geoFence.polygons or file.rallyPoints.points):
        raise MissionError(f"{source}: mission.items: no items", file=source, field="mission.items")
    for index, (previous, following) in enumerate(pairwise(items), 1):
        if following.seq <= previous.seq:
            allowed = f"must be above the doJumpId of the previous item, {previous.seq}"
            raise MissionError.at(source, f"mission.items.{index}.doJumpId", following.seq, allowed)
    numbered_items = enumerate(items, 1)
    unplaced = [
        (index, item) for index, item in numbered_items if item.command in PLACES | LANDINGS and not item.has_position
    ]
    if unplaced:
        number, name = unplaced[0][0], command_name(unplaced[0][1].command)
        warnings.append(
            f"{source}: item {number}: {name} has no position ({count_text(len(unplaced), 'such item')} in all)"
        )
    home = _read_home(file.mission.plannedHomePosition, source)
    if home is None and file.mission.plannedHomePosition is not None:
        warnings.append(f"{source}: plannedHomePosition is not a position: the mission has no home")
    if [item.seq for item in items] != list(range(1, len(items) + 1)):
        warnings.append(
            f"{source}: the values of doJumpId are not 1 to {len(items)}: items are numbered by their order instead"
        )
    fences = _read_fences(file.geoFence, source)
    rally = []
    for number, (lat, lon, alt) in enumerate(file.rallyPoints.points):
        place = (round_to_grid(lat), round_to_grid(lon), alt)
        point = MissionItem(number, int(Command.NAV_RALLY_POINT), Frame.GLOBAL_RELATIVE_ALT, (0.0,) * 4, *place)
        rally.append(_checked_item(point, source, f"rallyPoints.points.{number}"))
    mission = Mission(
        home=home,
        items=tuple(items),
        fences=fences,
        rally=tuple(rally),
        cruise_speed=file.mission.cruiseSpeed,
        warnings=tuple(warnings),
        source=source,
        survey_plans=tuple(plans),
        autopilot=autopilot,
    )
    return renumber_items(mission)


def _expand_complex_items(data: Any, source: str) -> tuple[list[str], list[SurveyPlan]]:
    """Replace the ComplexItems in a plan's JSON data by the simple items that they contain, in place.

    Returns warnings, and the settings of each survey. Raises MissionError if the data is not a plan.
    """
    if not isinstance(data, dict):
        message = f'{source}: expected a JSON object with fileType "Plan", got {type(data).__name__}'
        raise MissionError(message, file=source, field="fileType")
    if (kind := data.get("fileType")) != "Plan":
        raise MissionError.at(source, "fileType", kind, 'expected "Plan"', shown=json.dumps(kind)[:60])
    warnings, plans = list[str](), list[SurveyPlan]()
    mission = data.get("mission")
    if isinstance(mission, dict) and isinstance(mission.get("items"), list):
        mission["items"] = expand_items(mission["items"], source, warnings, plans)
    for key in ("geoFence", "rallyPoints"):
        part = data.get(key)
        if isinstance(part, dict) and part.get("version") != 2:
            warnings.append(f"{source}: {key}: version {json.dumps(part.get('version'))[:20]}: not read; 2 is known")
            data[key] = {}
    return warnings, plans


def _checked_item(item: MissionItem, source: str, location: str) -> MissionItem:
    """Return a mission item unchanged. Raises MissionError if it is invalid.

    location: location of the item in the file, for the message.
    """
    problem = item_problem(item)
    if problem is not None:
        raise MissionError(**problem.error_arguments(source, f"{source}: {location}"))
    return item


def _read_home(values: list[float | None] | None, source: str) -> Home | None:
    """Return the planned home, or None if it is missing or at 0, 0; a missing altitude is NaN.

    values: latitude and longitude, degrees, and altitude, m AMSL, each None where it is null.
    """
    if values is None or values[0] is None or values[1] is None:
        return None
    lat, lon, alt = values[0], values[1], math.nan if values[2] is None else values[2] + 0.0
    known_alt = 0.0 if math.isnan(alt) else alt
    home_item = MissionItem(0, Command.NAV_WAYPOINT, Frame.GLOBAL, (0.0, 0.0, 0.0, 0.0), lat, lon, known_alt)
    _checked_item(home_item, source, "mission.plannedHomePosition")
    return Home(round_to_grid(lat), round_to_grid(lon), alt) if home_item.has_position else None


def _read_fences(fence: _GeoFence, source: str) -> tuple[MissionItem, ...]:
    """Return the fence items of a plan. Raises MissionError for an invalid position."""
    fences: list[MissionItem] = []

    def add(command: Command, p1: float, point: list[float], location: str) -> None:
        """Append a fence item (a corner or a circle). Raises MissionError for an invalid position.

        p1: number of corners, or radius, m.
        point: latitude and longitude, degrees.
        location: location of the shape in the file, for messages.
        """
        lat, lon = round_to_grid(point[0]), round_to_grid(point[1])
        item = MissionItem(len(fences), int(command), Frame.GLOBAL, (p1, 0.0, 0.0, 0.0), lat, lon, 0.0)
        fences.append(_checked_item(item, source, f"geoFence.{location}"))

    for index, shape in enumerate(fence.polygons):
        command = (
            Command.NAV_FENCE_POLYGON_VERTEX_INCLUSION
            if shape.inclusion
            else Command.NAV_FENCE_POLYGON_VERTEX_EXCLUSION
        )
        for point in shape.polygon:
            add(command, float(len(shape.polygon)), point, f"polygons.{index}")
    for index, ring in enumerate(fence.circles):
        command = Command.NAV_FENCE_CIRCLE_INCLUSION if ring.inclusion else Command.NAV_FENCE_CIRCLE_EXCLUSION
        add(command, ring.circle.radius, ring.circle.center, f"circles.{index}")
    return tuple(fences)


def plan_file_text(mission: Mission) -> str:
    """Return a mission as the text of a `.plan` file; equal missions give equal bytes.

    cruiseSpeed is `stated_cruise_speed`, or QGC's default if the mission states none. It is written in whole m/s,
    because Mission Planner's reader refuses "25.0". QGC sends it to no aircraft. firmwareType names the mission's
    autopilot; it is 0 for planfly's guidance, which no ground station knows.
    """
    mission = renumber_items(mission)
    home = mission.home or Home(0.0, 0.0, 0.0)
    modes = {_altitude_mode(item.frame) for item in mission.items if is_located(item.command, item.frame)}
    # The items, as SimpleItems.
    simple_items: list[dict[str, Any]] = []
    for item in mission.items:
        values = (*item.params, item.lat_deg, item.lon_deg, item.alt)
        numbers = [None if math.isnan(value) else value for value in values]
        simple_item: dict[str, Any] = {
            "autoContinue": item.autocontinue,
            "command": int(item.command),
            "doJumpId": item.seq,
            "frame": int(item.frame),
            "params": numbers,
            "type": "SimpleItem",
        }
        if is_located(item.command, item.frame):
            # QGC leaves these out for commands without a position.
            altitude_mode = _altitude_mode(item.frame)
            simple_item |= {"AMSLAltAboveTerrain": None, "Altitude": numbers[6], "AltitudeMode": altitude_mode}
        simple_items.append(simple_item)
    # The fences, as the geoFence.
    circles: list[dict[str, Any]] = []
    polygons: list[dict[str, Any]] = []
    for shape in fence_shapes(mission.fences):
        inclusion = shape[0].command in INCLUSIONS
        if shape[0].command in POLYGONS:
            polygon = [[corner.lat_deg, corner.lon_deg] for corner in shape]
            polygons.append({"inclusion": inclusion, "polygon": polygon, "version": 1})
        else:
            disc = {"center": [shape[0].lat_deg, shape[0].lon_deg], "radius": shape[0].params[0]}
            circles.append({"circle": disc, "inclusion": inclusion, "version": 1})
    data = {
        "fileType": "Plan",
        "geoFence": {"circles": circles, "polygons": polygons, "version": 2},
        "groundStation": "planfly",
        "mission": {
            "cruiseSpeed": round(stated_cruise_speed(mission) or _CRUISE_SPEED_MPS),
            "firmwareType": next((number for number, name in _FIRMWARES.items() if name == mission.autopilot), 0),
            # 0: mixed.
            "globalPlanAltitudeMode": modes.pop() if len(modes) == 1 else 0,
            "hoverSpeed": _HOVER_SPEED_MPS,
            "items": simple_items,
            "plannedHomePosition": [home.lat_deg, home.lon_deg, home.alt],
            "vehicleType": 1,
            "version": 2,
        },
        "rallyPoints": {
            "points": [[p.lat_deg, p.lon_deg, 0.0 if math.isnan(p.alt) else p.alt] for p in mission.rally],
            "version": 2,
        },
        "version": 1,
    }
    return json.dumps(data, indent=4, allow_nan=False) + "\n"


def _altitude_mode(frame: int) -> int:
    """Return QGC's altitude mode of a frame: 1 relative to home, 2 above mean sea level, 4 above terrain."""
    return 1 if frame in OVER_HOME else 2 if frame in AMSL else 4


def stated_cruise_speed(mission: Mission) -> float | None:
    """Return the cruise speed that a mission states, m/s, or None.

    The mission states it as cruiseSpeed of a `.plan`, or in a DO_CHANGE_SPEED before its second position.
    """
    if mission.cruise_speed is not None:
        return mission.cruise_speed
    position_count = 0
    for item in mission.items:
        position_count += is_located(item.command, item.frame)
        if position_count > 1:
            break
        if item.command == Command.DO_CHANGE_SPEED and 0.0 < item.params[1] <= _MAX_SPEED_MPS:
            return item.params[1]
    return None


def _refuse_constant(name: str) -> float:
    """Raise ValueError for NaN or Infinity, which Python's JSON reader accepts."""
    raise ValueError(f"{name} is not a number")
