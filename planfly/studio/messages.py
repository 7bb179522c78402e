"""Define the messages from the page to the server, which are strict and bounded.

Each message is one JSON object whose ``kind`` names its type. Only `Open` and `Settings` name files, in the served
folder. An invalid value is answered with a fault; text that is not a message closes the connection.
"""

from typing import Annotated, Any, Literal, get_args

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from world.scenario_file import JSON_OBJECT, expected_values

# Maximum length of a message, characters.
MAX_MESSAGE_CHARACTERS = 256 * 1024
# Maximum length of a message with a dropped file, which is sent as text, characters.
MAX_DROPPED_MESSAGE_CHARACTERS = 24 * 2**20
# Maximum length of the first message, whose sender is still unknown, characters.
MAX_FIRST_MESSAGE_CHARACTERS = 1024


class _Message(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


_Metres = Annotated[float, Field(ge=-600_000.0, le=600_000.0)]
_Up = Annotated[float, Field(ge=-500.0, le=9_000.0)]
_Index = Annotated[int, Field(ge=0, le=20_000)]
_Rev = Annotated[int, Field(ge=0, le=2**53)]
_Name = Annotated[str, Field(min_length=1, max_length=200)]
# Keys of the [limits] table of a scenario.
LimitName = Literal[
    "min_clearance_m", "max_height_m", "corridor_m", "max_turn_deg", "max_climb_deg", "max_dive_deg", "surveys"
]
LIMITS: tuple[str, ...] = get_args(LimitName)


class Hello(_Message):
    """First message of a page: the token from its address, and true for a page with dark colours."""

    kind: Literal["hello"]
    token: Annotated[str, Field(min_length=1, max_length=100)]
    dark: bool = False


class Look(_Message):
    """Change between light and dark colours, for which the page needs a new picture of the terrain."""

    kind: Literal["look"]
    dark: bool


class Drag(_Message):
    """Position of an item during a drag, which changes nothing yet.

    rev: revision of the mission that is dragged.
    n: number of the message, which increases.
    k: index of the item.
    whole: true to judge the whole mission.
    """

    kind: Literal["drag"]
    rev: _Rev
    n: _Rev
    k: _Index
    east: _Metres
    north: _Metres
    up: _Up | None = None
    whole: bool = False


class Move(_Message):
    """Move of an item to a position on the map, to an altitude AMSL, or both.

    k: index of the item.
    """

    kind: Literal["move"]
    rev: _Rev
    k: _Index
    east: _Metres | None = None
    north: _Metres | None = None
    up: _Up | None = None


class Insert(_Message):
    """Insertion of a waypoint after an item, at the mean altitude of this item and the next.

    The altitude is that of this item if the altitude frames of the two items differ.

    after: index of the item.
    """

    kind: Literal["insert"]
    rev: _Rev
    after: _Index
    east: _Metres
    north: _Metres


class Delete(_Message):
    """Deletion of items.

    ks: indices of the items.
    """

    kind: Literal["delete"]
    rev: _Rev
    ks: Annotated[list[_Index], Field(min_length=1, max_length=2_000)]


class Raise(_Message):
    """Change of the altitude of items.

    by: change, m, positive upwards.
    ks: indices of the items; null for all items.
    """

    kind: Literal["raise"]
    rev: _Rev
    by: Annotated[float, Field(ge=-9_000.0, le=9_000.0)]
    ks: Annotated[list[_Index], Field(max_length=2_000)] | None = None


class Step(_Message):
    """Undo, redo, or revert to the mission file."""

    kind: Literal["undo", "redo", "revert"]


class Apply(_Message):
    """Application of a finding's suggestion.

    finding: number of the finding in the verdict.
    which: number of the suggestion in the finding.
    flown: true for a finding of the flight, false for a finding of the geometric verdict.
    """

    kind: Literal["apply"]
    rev: _Rev
    finding: _Index
    which: Annotated[int, Field(ge=0, le=20)]
    flown: bool = False


class Settings(_Message):
    """Change of settings; fields that are not given stay unchanged.

    Values are checked like the values of a scenario.

    limits: entries of [limits]; null removes an entry.
    ceiling: m AMSL.
    parameter: one autopilot parameter, as NAME=VALUE.
    without: names of the parameters to reset.
    parameter_file: name of a parameter file, whose text is parameter_text.
    """

    kind: Literal["settings"]
    aircraft: _Name | None = None
    autopilot: _Name | None = None
    airspeed: float | None = None
    wind_speed: float | None = None
    wind_from: float | None = None
    turbulence: Literal["none", "light", "moderate"] | None = None
    limits: dict[LimitName, float | Annotated[str, Field(max_length=20)] | None] | None = None
    ceiling: float | None = None
    parameter: Annotated[str, Field(min_length=1, max_length=100)] | None = None
    without: Annotated[list[_Name], Field(max_length=2_000)] | None = None
    parameter_file: _Name | None = None
    parameter_text: str | None = None


class Plan(_Message):
    """Request for a path: between the ends of the scenario, or between two items.

    first, last: indices of the two items.
    ways: number of paths to choose from, found in one search by the default algorithm.
    """

    kind: Literal["plan"]
    seed: Annotated[int, Field(ge=0, le=2**31 - 1)] = 1
    algorithm: _Name | None = None
    first: _Index | None = None
    last: _Index | None = None
    ways: Annotated[int, Field(ge=1, le=20)] = 1


class Choose(_Message):
    """Choice of one of the planned paths.

    rev: revision of the mission for which they were planned.
    which: number of the path in the message "ways".
    """

    kind: Literal["choose"]
    rev: _Rev
    which: Annotated[int, Field(ge=0, le=20)]


class Ask(_Message):
    """Request to fly, to start a long task, or to stop all tasks in progress."""

    kind: Literal["fly", "returns", "campaign", "battery", "ground_risk", "window", "stop"]


class Save(_Message):
    """Request to save the mission: as a download of the page, or over the file that the command named."""

    kind: Literal["save"]
    form: Literal["waypoints", "plan", "plan.json", "kml", "parm"]
    over: bool = False


class Open(_Message):
    """Request to open a file.

    name: name of a file that was dropped on the page, or path of a file in the server's folder.
    data: content of the dropped file in base 64; null for a file in the folder.
    """

    kind: Literal["open"]
    name: Annotated[str, Field(min_length=1, max_length=1_000)]
    data: Annotated[str, Field(max_length=MAX_DROPPED_MESSAGE_CHARACTERS)] | None = None


Message = (
    Hello | Look | Drag | Move | Insert | Delete | Raise | Step | Apply | Settings | Plan | Choose | Ask | Save | Open
)
_ADAPTER: TypeAdapter[Message] = TypeAdapter(Annotated[Message, Field(discriminator="kind")])


def read_message(text: str | bytes) -> Message:
    """Parse a message from a page.

    Raises ValueError for a message longer than `MAX_MESSAGE_CHARACTERS`, and ValidationError, a ValueError, for an
    invalid message.  A message that opens a file may be longer.

    >>> read_message('{"kind": "undo"}').kind
    'undo'
    >>> read_message('{"kind": "undo", "path": "/etc/passwd"}')
    Traceback (most recent call last):
        ...
    pydantic_core._pydantic_core.ValidationError: ...
    """
    size = len(text)
    # The kind of a message is among its first 200 characters.
    if size > MAX_MESSAGE_CHARACTERS and '"open"' not in str(text[:200]):
        raise ValueError("a message that is too long")
    return _ADAPTER.validate_json(text)


def describe_error(error: ValidationError) -> str:
    """Return a line that describes the first invalid field of a message.

    Returns "" if the kind of message is unknown.

    >>> try:
    ...     read_message('{"kind": "raise", "rev": 1, "by": 1e9}')
    ... except ValidationError as error:
    ...     describe_error(error)
    'raise: by: expected at most 9000.0'
    """
    first = error.errors(include_url=False, include_input=False)[0]
    return (
        f"{': '.join(map(str, first['loc']))}: {expected_values(first, JSON_OBJECT)}" if len(first["loc"]) > 1 else ""
    )


def message_schema() -> dict[str, Any]:
    """Return the JSON schema of all messages, for tests that generate messages."""
    return _ADAPTER.json_schema()
