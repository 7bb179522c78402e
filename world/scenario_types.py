"""The numbers, names and choices that a scenario file holds, with their ranges, and what its tables share."""

from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

# Positions lie within this distance of the map's origin, east or west and north or south, m.
MAP_EXTENT = 500_000.0


def no_line_break(text: str) -> str:
    """The text, if it is one line."""
    if not text.isprintable():
        raise ValueError("control characters are not allowed")
    return text


def within(low: float, high: float, *, above: bool = False, below: bool = False, also: str = "") -> AfterValidator:
    """Allow ``low``..``high``, without ``low`` if ``above`` and without ``high`` if ``below``; the error says so.

    also: what else the field takes, for the message.
    """

    def check(value: float) -> float:
        # Written so that NaN fails.
        if (low < value if above else low <= value) and (value < high if below else value <= high):
            return value
        first, last = ("above " if above else ""), ("below " if below else "")
        least, most = (x if isinstance(x, int) else f"{x:.12g}" for x in (low, high))
        raise ValueError(f"allowed {first}{least}..{last}{most}{also}")

    return AfterValidator(check)


Metres = Annotated[float, within(-MAP_EXTENT, MAP_EXTENT)]
Amsl = Annotated[float, within(-500.0, 9000.0)]
Height = Annotated[float, within(0.0, 9000.0)]
Latitude = Annotated[float, within(-89.0, 89.0)]
Longitude = Annotated[float, within(-180.0, 180.0)]
Course = Annotated[float, within(-360.0, 360.0)]
Radius = Annotated[float, within(0.0, 200_000.0, above=True)]
Name = Annotated[str, Field(min_length=1, max_length=100), AfterValidator(no_line_break)]
FilePath = Annotated[str, Field(min_length=1, max_length=4096), AfterValidator(no_line_break)]
Autopilot = Literal["ardupilot", "ideal"]
Guidance = Literal["path", "l1", "vector-field"]
Navigation = Literal["perfect", "rtk", "gnss"]
Seed = Annotated[int, within(0, 2**63 - 1)]
Span = Annotated[list[Metres], Field(min_length=2, max_length=2)]
Angle = Annotated[float, within(0.0, 90.0, above=True, below=True, also=', or "aircraft"')] | Literal["aircraft"]


class ScenarioTable(BaseModel):
    """A table of a scenario file: unknown keys are refused."""

    # Strict: pydantic would otherwise take true, "5" and "yes" for numbers and truths.  Each number states its own
    # range, which NaN and the infinities are outside of.
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)
