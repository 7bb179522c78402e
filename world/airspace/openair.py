"""Read zones of an OpenAir file, which has one command per line.

Classes, limits, polygons, arcs, circles and airways are read.

The commands follow WinPilot's original format and Naviter's version 2 (https://github.com/naviter/seeyou_file_formats):
AC begins an airspace, AN names it, AY is its type, AL and AH are its limits, AA its times; DP, DA, DB, DC and DY draw
it, with the variables that V sets.
"""

import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from world.airspace.zone_entries import published_entries
from world.airspace.zone_times import BY_NOTAM, OPEN, parse_period
from world.airspace.zones import band_outline
from world.errors import ScenarioError
from world.frames import GeoOrigin, to_geo, to_map
from world.scenario_tables import MAX_CORNERS

# Length of a nautical mile, m.
NAUTICAL_MILE = 1852.0
# Largest distance between an arc and its chords, m.
ARC_BEND = 1.0
# Largest radius and width, nautical miles: half the circumference of the Earth.
MAX_LENGTH_NMI = 10_800.0
# Classes of airspace that require no clearance.
_OPEN_CLASSES = ("E", "F", "G", "UNC", "W", "GSEC", "FIR", "UIR", "FIS")
# Types of airspace that require no clearance either.
_OPEN_TYPES = ("", "NONE", "FIR", "UIR", "FIS", "GSEC", "ACCSEC", "TRZ", "VFRSEC", "VFRR")

_Position = tuple[float, float]
_COORDINATE = re.compile(r"(?P<lat>[\d:.]+)\s*(?P<ns>[NS])[\s,]*(?P<lon>[\d:.]+)\s*(?P<ew>[EW])", re.IGNORECASE)
_ALTITUDE = re.compile(r"(\d+(?:\.\d+)?)\s*(FT|FEET|F|M|)\s*(AMSL|MSL|ALT|AGL|AAGL|ASFC|GND|SFC|STD|)", re.IGNORECASE)
_LEVEL = re.compile(r"FL\s*(\d+(?:\.\d+)?)", re.IGNORECASE)
_ABOVE_GROUND = ("AGL", "AAGL", "ASFC", "GND", "SFC")
# Texts of a lower limit on the ground, and of an upper limit that does not exist.
_NO_LIMIT = {
    "lowerLimit": ("GND", "SFC", "SURFACE", "0"),
    "upperLimit": ("UNL", "UNLIM", "UNLTD", "UNLIMITED"),
}


@dataclass(slots=True)
class _Block:
    """Airspace that is being read, as stated by its lines so far, in degrees and m.

    line: number of its first line.
    airspace_class, kind: its class (AC) and its type (AY).
    limits: limits in openAIP's form, by the keys "lowerLimit" and "upperLimit".
    times: periods in which it is active (AA), as `world.airspace.zone_times` reads them.
    corners: corners of its outline, latitude and longitude; arcs are included as chords.
    airway, width: points of an airway (latitude and longitude), and its width, m.
    circle: centre and radius, m.
    centre, clockwise: current values of the variables X and D, for the arcs and circles that follow.
    """

    line: int
    airspace_class: str
    name: str = ""
    kind: str = ""
    limits: dict[str, dict[str, Any]] = field(default_factory=dict)
    times: list[str] = field(default_factory=list)
    corners: list[_Position] = field(default_factory=list)
    airway: list[_Position] = field(default_factory=list)
    width: float = 0.0
    circle: tuple[_Position, float] | None = None
    centre: _Position | None = None
    clockwise: bool = True


def is_openair(text: str) -> bool:
    r"""Return True if a text is in OpenAir format: its first command is AC or, in wrong order, AN.

    >>> is_openair("* Slovenia\nAC D\nAN CTR"), is_openair("QGC WPL 110")
    (True, False)
    """
    lines = (line for line in map(_clean_line, text.splitlines()) if line)
    return next(lines, "").upper().startswith(("AC ", "AN "))


def openair_zones(text: str, source: str) -> Iterator[tuple[str, dict[str, Any] | str]]:
    r"""Yield the location of each airspace in a file, and its [[zones]] entries or the reason to skip it.

    Airspace of class E, F or G or without a class restricts no flight and is skipped, unless its type is more
    restrictive. Any other airspace is an exclusion. An arc is approximated by chords within `ARC_BEND` of it. Raises
    ScenarioError for a line that cannot be read.

    >>> text = "AC D\nAN CTR\nAL GND\nAH 2500ft AMSL\nV X=46:00:00N 014:00:00E\nDC 5"
    >>> [(where, entries["radius_m"], entries["ceiling_amsl_m"]) for where, entries in openair_zones(text, "a file")]
    [('line 1 (CTR)', 9260.0, 762.0)]
    """
    block: _Block | None = None
    for number, raw_line in enumerate(text.splitlines(), 1):
        line = _clean_line(raw_line)
        command, _, argument_text = line.partition(" ")
        command, argument_text = command.upper(), argument_text.strip()
        if command == "AC":
            if block is not None:
                yield _finish_block(block, source)
            block = _Block(number, argument_text.upper())
        elif command in _COMMANDS:
            if block is None:
                raise ScenarioError(
                    f"{source}: line {number}: {command}: an airspace must begin with AC before it",
                    file=source,
                )
            try:
                _COMMANDS[command](block, argument_text)
            except ValueError as error:
                allowed = str(error)
                message = f"{source}: line {number}: {command} {argument_text[:40]!r}: {allowed}"
                raise ScenarioError(
                    message, file=source, field=command, value=argument_text, allowed=allowed
                ) from error
        elif command.startswith("D"):
            shape_commands = ", ".join(name for name in _COMMANDS if name.startswith("D"))
            message = f"{source}: line {number}: {command[:10]!r}: unknown; shapes are {shape_commands}"
            raise ScenarioError(message, file=source, field=command, allowed=shape_commands)
    if block is not None:
        yield _finish_block(block, source)


def _clean_line(line: str) -> str:
    """Return a line without its comment, and with a space between V and its variable.

    In drawing commands a semicolon also begins a comment, as in some countries' files; a name may contain one.
    """
    line = line.partition("*")[0].strip()
    if line[:1].upper() in ("D", "V"):
        line = line.partition(";")[0].rstrip()
    return re.sub(r"^V(?=[DXWZ]\s*=)", "V ", line, flags=re.IGNORECASE)


def _finish_block(block: _Block, source: str) -> tuple[str, dict[str, Any] | str]:
    """Return the location of an airspace in its file, and its [[zones]] entries.

    A skipped airspace has the reason in place of the entries.

    It is skipped if it is open to all, or has neither a name nor limits nor a shape.

    Raises ScenarioError if the airspace does not have exactly one shape.
    """
    name = "".join(character for character in block.name if character.isprintable())[:80]
    location = f"line {block.line}" + (f" ({name})" if name else "")
    label = ", ".join(part for part in (block.airspace_class, block.kind) if part)
    if block.airspace_class in _OPEN_CLASSES and block.kind in _OPEN_TYPES:
        return location, f"class {label}, open to all"
    entries: dict[str, Any] = {"name": f"{name or f'line {block.line}'} ({label})"[:100]}
    entries |= published_entries(block.limits, f"{source}: {location}")
    if block.times:
        entries["times"] = block.times
    has_shape = [bool(block.corners), bool(block.airway), block.circle is not None]
    if not any((*has_shape, block.name, block.limits)):
        return location, "without a name, limits or a shape"
    if sum(has_shape) != 1:
        allowed = "expected one shape: corners and arcs, a circle, or an airway"
        raise ScenarioError(f"{source}: {location}: {allowed}", file=source, allowed=allowed)
    if block.circle is not None:
        (lat, lon), radius = block.circle
        return location, entries | {"lat_deg": lat, "lon_deg": lon, "radius_m": radius}
    rings = [block.corners]
    if block.airway:
        # The outline of an airway is a band of its width along its segments.
        place = f"{source}: {location}"
        if len(block.airway) < 2 or not block.width > 0.0:
            message = f"{place}: DY: an airway needs at least two points, and a width (V W=) before them"
            raise ScenarioError(message, file=place)
        origin = GeoOrigin(*block.airway[0])
        east, north = to_map(origin, [lat for lat, _ in block.airway], [lon for _, lon in block.airway])
        try:
            outline = band_outline(list(zip(east.tolist(), north.tolist(), strict=True)), block.width)
        except ValueError as error:
            raise ScenarioError(f"{place}: DY: {error}", file=place, field="DY", allowed=str(error)) from error
        lats, lons = to_geo(origin, [corner[0] for corner in outline], [corner[1] for corner in outline])
        rings = [list(zip(lats.tolist(), lons.tolist(), strict=True))]
    return location, entries | {"rings_deg": [[list(corner) for corner in ring] for ring in rings]}


# ----------------------------------------------------------------------
# Commands.  Each adds its contents to the airspace, and raises ValueError with the allowed values.


def _read_times(block: _Block, text: str) -> None:
    """Add a period in which the airspace is active (AA); the text NONE means by NOTAM.

    Raises ValueError for an invalid period.
    """
    if text.upper() == "NONE":
        block.times.append(BY_NOTAM)
        return
    period = "/".join(OPEN if end.strip().upper() == "NONE" else end.strip() for end in text.split("/"))
    parsed = parse_period(period)
    block.times.append(BY_NOTAM if parsed is None else parsed.text())


def _limit_reader(key: str) -> Callable[[_Block, str], None]:
    """Return a function that reads the text of AL or AH and stores the limit under a key.

    The limit is in openAIP's form.
    """

    def read(block: _Block, text: str) -> None:
        """Store the limit under the key; store nothing for a text that means no limit, such as GND for AL.

        Raises ValueError if it is already stored, and for any other text.
        """
        if key in block.limits:
            raise ValueError("an airspace has one lower limit (AL) and one upper limit (AH)")
        level_match, match = _LEVEL.fullmatch(text), _ALTITUDE.fullmatch(text)
        if text.upper() in _NO_LIMIT[key]:
            return
        if level_match is not None:
            block.limits[key] = {"value": float(level_match[1]), "unit": "FL", "referenceDatum": "STD"}
        elif match is not None:
            unit, datum = match[2].upper(), match[3].upper()
            reference_datum = "GND" if datum in _ABOVE_GROUND else "STD" if datum == "STD" else "MSL"
            unit = "M" if unit == "M" else "FT"
            block.limits[key] = {"value": float(match[1]), "unit": unit, "referenceDatum": reference_datum}
        else:
            raise ValueError("expected a height: 2500ft AMSL, 300m AGL, FL95, GND, UNL")

    return read


def _read_variable(block: _Block, text: str) -> None:
    """Set a variable (V): the centre or direction of arcs and circles, or the width of an airway.

    Other variables are ignored. Raises ValueError for an invalid value.
    """
    name, _, value = (part.strip() for part in text.partition("="))
    if name.upper() == "X":
        block.centre = _parse_position(value)
    elif name.upper() == "D":
        if value not in ("+", "-"):
            raise ValueError("allowed D=+ (clockwise) or D=-")
        block.clockwise = value == "+"
    elif name.upper() == "W":
        block.width = _parse_length(value)


def _read_circle(block: _Block, text: str) -> None:
    """Store a circle about the block's centre (DC).  Raises ValueError for a second circle."""
    if block.circle is not None:
        raise ValueError("an airspace has one circle")
    block.circle = _required_centre(block), _parse_length(text)


def _read_arc_by_bearings(block: _Block, text: str) -> None:
    """Add an arc about the block's centre, given by its radius and two bearings (DA).

    Raises ValueError for an invalid text, or without a centre.
    """
    parts = text.split(",")
    if len(parts) != 3:
        raise ValueError("expected radius, first and last bearing: 5, 270, 290")
    radius, first_bearing, last_bearing = _parse_length(parts[0]), _parse_number(parts[1]), _parse_number(parts[2])
    _add_corners(
        block.corners,
        _arc_positions(_required_centre(block), (radius, radius), first_bearing, last_bearing, block.clockwise),
    )


def _read_arc_by_points(block: _Block, text: str) -> None:
    """Add an arc about the block's centre, given by its two end points (DB).

    Raises ValueError for an invalid text, or without a centre.
    """
    ends = [_parse_position(match[0]) for match in _COORDINATE.finditer(text)]
    if len(ends) != 2:
        raise ValueError("expected two points: 39:36:40N 119:46:10W, 39:29:09N 119:36:10W")
    centre = _required_centre(block)
    from_centre = [to_map(GeoOrigin(*centre), *end) for end in ends]
    first_bearing, last_bearing = (math.degrees(math.atan2(east, north)) for east, north in from_centre)
    radii = [math.hypot(east, north) for east, north in from_centre]
    # The end points are kept as stated, even if they do not agree with the centre.
    arc = _arc_positions(centre, radii, first_bearing, last_bearing, block.clockwise)
    _add_corners(block.corners, [ends[0], *arc[1:-1], ends[1]])


def _corner_reader(name: str) -> Callable[[_Block, str], None]:
    """Return a function that reads the position in DP or DY, and adds it to a list of the airspace.

    name: field of `_Block` with the list.
    """

    def read(block: _Block, text: str) -> None:
        """Add the position to the list of the airspace."""
        _add_corners(getattr(block, name), [_parse_position(text)])

    return read


def _add_corners(corners: list[_Position], added_corners: list[_Position]) -> None:
    """Append corners. Raises ValueError for more corners than a zone may have."""
    if len(corners) + len(added_corners) > MAX_CORNERS:
        raise ValueError(f"more corners than a zone may have: at most {MAX_CORNERS:,}")
    corners += added_corners


def _text_reader(name: str) -> Callable[[_Block, str], None]:
    """Return a function that stores the text of AN or AY in the named field of the airspace."""

    def read(block: _Block, text: str) -> None:
        """Store the text in the field; a text other than a name in capitals."""
        setattr(block, name, text if name == "name" else text.upper())

    return read


_COMMANDS: dict[str, Callable[[_Block, str], None]] = {
    "AN": _text_reader("name"),
    "AY": _text_reader("kind"),
    "AA": _read_times,
    "AL": _limit_reader("lowerLimit"),
    "AH": _limit_reader("upperLimit"),
    "V": _read_variable,
    "DP": _corner_reader("corners"),
    "DA": _read_arc_by_bearings,
    "DB": _read_arc_by_points,
    "DC": _read_circle,
    "DY": _corner_reader("airway"),
}


# ----------------------------------------------------------------------
# Numbers, positions and arcs.


def _parse_number(text: str) -> float:
    """Return a number of at least 0. Raises ValueError for any other text."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 <= value < math.inf:
        raise ValueError("expected a number of at least 0")
    return value


def _parse_length(text: str) -> float:
    """Parse a length in nautical miles; return it in m. Raises ValueError for any other text."""
    length = _parse_number(text)
    if length > MAX_LENGTH_NMI:
        raise ValueError(f"allowed 0..{MAX_LENGTH_NMI:g} nautical miles")
    return length * NAUTICAL_MILE


def _parse_position(text: str) -> _Position:
    """Parse a position; return its latitude and longitude, degrees. Raises ValueError for any other text."""
    match = _COORDINATE.fullmatch(text.strip())
    if match is None:
        raise ValueError("expected a position: 45:40:30N 014:18:20E, or 45:40.500N 014:18.333E")
    lat = _parse_degrees(match["lat"], 90.0) * (-1.0 if match["ns"].upper() == "S" else 1.0)
    lon = _parse_degrees(match["lon"], 180.0) * (-1.0 if match["ew"].upper() == "W" else 1.0)
    return lat, lon


def _parse_degrees(text: str, max_degrees: float) -> float:
    """Parse an angle with optional minutes and seconds, such as 45:40:30; return degrees.

    Raises ValueError for any other text, and for more than ``max_degrees``.
    """
    parts = [_parse_number(part) for part in text.split(":")]
    if len(parts) > 3 or any(part > 60.0 for part in parts[1:]):
        raise ValueError("expected degrees, and minutes and seconds of at most 60")
    angle = sum(part / 60.0**k for k, part in enumerate(parts))
    if angle > max_degrees:
        raise ValueError(f"allowed 0..{max_degrees:g} degrees")
    return angle


def _required_centre(block: _Block) -> _Position:
    """Return the centre of arcs and circles. Raises ValueError if no line has set it."""
    if block.centre is None:
        raise ValueError("a centre (V X=) must come before this line")
    return block.centre


def _arc_positions(
    centre: _Position, radii: Sequence[float], first_bearing: float, last_bearing: float, clockwise: bool
) -> list[_Position]:
    """Return positions along an arc, both ends included, with chords within `ARC_BEND` of the arc.

    centre: latitude and longitude, degrees.
    radii: radius at the first and at the last bearing, m; the radius changes linearly between them.
    first_bearing, last_bearing: degrees; equal bearings mean a full circle.
    """
    turn_angle = (last_bearing - first_bearing) % 360.0 if clockwise else -((first_bearing - last_bearing) % 360.0)
    turn_angle = turn_angle or (360.0 if clockwise else -360.0)
    max_radius = max(*radii, ARC_BEND)
    chord_angle = math.degrees(2.0 * math.acos(1.0 - min(0.3, ARC_BEND / max_radius)))
    chord_count = max(1, math.ceil(abs(turn_angle) / chord_angle))
    fractions = [k / chord_count for k in range(chord_count + 1)]
    # Distances and bearings from the centre are measured on a map with its origin there.
    bearings = [math.radians(first_bearing + fraction * turn_angle) for fraction in fractions]
    distances = [radii[0] + fraction * (radii[1] - radii[0]) for fraction in fractions]
    east = [distance * math.sin(bearing) for distance, bearing in zip(distances, bearings, strict=True)]
    north = [distance * math.cos(bearing) for distance, bearing in zip(distances, bearings, strict=True)]
    lat, lon = to_geo(GeoOrigin(*centre), east, north)
    return list(zip(lat.tolist(), lon.tolist(), strict=True))
