"""Answer of ``planfly survey`` with ``--json``."""

import math
from typing import Literal

from pydantic.dataclasses import dataclass

from flight.mission.surveys import PhotoLine
from flight.simulation.setup import FlightSetup
from logs.verdict.conditions import Conditions
from logs.verdict.measures.photo_lines import LineMeasure, OverlapMeasure
from planfly.surveys.survey_remedies import NearMiss, SurveyRemedy
from planfly.terminal.verdict_answers import STRICT


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class PhotoLineEntry:
    """A photo line as flown; if it was not flown, all fields except its items are null.

    Shares are fractions of the line's length.
    """

    first_item: int
    last_item: int
    length_m: float | None
    usable: float | None
    away: float | None
    """Share that was not flown, or flown too far off the line."""
    banked: float | None
    """Share flown on the line, but banked too much."""
    high: float | None
    """Share without these faults, but at a wrong height above ground."""
    dark: float | None
    """Share without these faults, but with the camera off."""
    unknown: float | None
    """Share without these faults, but over ground outside the terrain data, so that it is not judged."""
    lost_m: list[tuple[float, float]]
    """Segments that cannot be used, m from the start of the line; segments over unknown ground are not included."""
    photos: int | None
    missed: int | None


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class SurveyRemedyEntry:
    """A change that made all photo lines usable when the survey was flown with it."""

    kind: str
    """Kind of the change: trigger, side, turn-around, gates, every, course, parameter or airspeed."""
    name: str
    """Name of the parameter."""
    current: float
    value: float
    unit: str
    turn_around_m: float | None
    """Turn-around distance of another layout, m."""
    lead_in_m: float
    """Lead-in before the first line, m, if it is longer than the turn-around distance."""
    length_m: float
    """Length of the whole path, m."""
    has_gates: bool
    """True for another airspeed together with gates at the ends of the lines."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class OverlapEntry:
    """The least overlap of the usable photos of a survey, as shares of a photo; null if unknown."""

    front: float | None
    """Overlap of a photo and the next photo on its line."""
    front_asked: float | None
    front_line: int | None
    """Number of the line, from 1."""
    side: float | None
    """Overlap of photos on neighbouring lines."""
    side_asked: float | None
    side_lines: tuple[int, int] | None
    side_judged: bool
    """False if the side overlap is large enough, but the crab angle makes the common area too small."""
    crab_angle_deg: float
    """Largest angle between the nose and the line at the usable photos, in wind or where the aircraft still turns onto
    the line; 0 without a flight."""
    side_common_area: float | None
    """Common area of the two photos with the least side overlap, turned by their crab angles."""
    ground_sampling_cm: tuple[float, float] | None
    """Smallest and largest distance on the ground between two pixels; null if the pixels are not known."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class NearMissEntry:
    """The trial that came closest to passing."""

    what: str
    usable: int
    lines: int
    headline: str
    """Headline of the verdict on the flight of this trial."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class SurveyAnswer:
    """planfly survey: each survey's photo lines, in flying order."""

    schema: Literal["planfly.survey/1"] = "planfly.survey/1"
    exit_code: int
    what: str
    headline: str
    usable: bool
    conditions: Conditions
    surveys: list[list[PhotoLineEntry]]
    photos: int
    """Number of photos taken over the whole flight while the camera is on; 0 if no item states their distance."""
    line_photos: int
    """Number of those photos taken on the lines."""
    overlaps: list[OverlapEntry | None]
    """Overlaps of each survey; null if its camera is not known."""
    remedies: list[SurveyRemedyEntry]
    """Remedies found with --suggest."""
    nearest: NearMissEntry | None
    """Trial that came closest, if no remedy was found."""
    files: list[str]


def photo_line_entry(setup: FlightSetup, line: PhotoLine, measure: LineMeasure | None) -> PhotoLineEntry:
    """Return the JSON entry of a photo line.

    measure: measures of the flown line, or None if it was not flown.
    """
    first, last = (int(setup.route.items[i]) for i in (line.first, line.last))

    if measure is None:
        return PhotoLineEntry(
            first_item=first,
            last_item=last,
            length_m=None,
            usable=None,
            away=None,
            banked=None,
            high=None,
            dark=None,
            unknown=None,
            lost_m=[],
            photos=None,
            missed=None,
        )
    return PhotoLineEntry(
        first_item=first,
        last_item=last,
        length_m=round(measure.length, 1),
        usable=round(measure.usable, 4),
        away=round(measure.off_line, 4),
        banked=round(measure.banked, 4),
        high=round(measure.off_height, 4),
        dark=round(measure.camera_off, 4),
        unknown=round(measure.unknown, 4),
        lost_m=[(round(start, 1), round(end, 1)) for start, end in measure.lost_spans],
        photos=measure.planned_photo_count,
        missed=measure.missed_photo_count,
    )


def overlap_entry(overlap: OverlapMeasure) -> OverlapEntry:
    """Return the JSON entry of the photo overlap of a survey."""
    first_line, second_line = sorted(overlap.line_pair)
    sampling = overlap.ground_sampling
    return OverlapEntry(
        front=None if overlap.front is None else round(overlap.front, 4),
        front_asked=overlap.camera.front,
        front_line=None if overlap.front is None else overlap.line + 1,
        side=None if overlap.side is None else round(overlap.side, 4),
        side_asked=overlap.camera.side,
        side_lines=None if overlap.side is None else (first_line + 1, second_line + 1),
        side_judged=not overlap.is_side_unknown,
        crab_angle_deg=round(math.degrees(overlap.max_crab), 1),
        side_common_area=None if overlap.side is None else round(overlap.side_area, 4),
        ground_sampling_cm=None if sampling is None else (round(100.0 * sampling[0], 2), round(100.0 * sampling[1], 2)),
    )


def near_miss_entry(near_miss: NearMiss) -> NearMissEntry:
    """Return the JSON entry of the trial that came closest to passing."""
    return NearMissEntry(
        what=near_miss.what, usable=near_miss.usable, lines=near_miss.lines, headline=near_miss.verdict.headline
    )


def survey_remedy_entry(remedy: SurveyRemedy) -> SurveyRemedyEntry:
    """Return the JSON entry of a remedy: a change that makes all photo lines of a survey usable."""
    return SurveyRemedyEntry(
        kind=remedy.kind,
        name=remedy.name,
        current=round(remedy.current, 3),
        value=round(remedy.value, 3),
        unit=remedy.unit,
        turn_around_m=None if math.isnan(remedy.turn_around) else round(remedy.turn_around, 1),
        lead_in_m=remedy.lead_in,
        length_m=round(remedy.length, 1),
        has_gates=remedy.has_gates,
    )
