"""Chart the photo lines of a survey from above: usable parts, lost parts, and the track.

A photo line is a straight part of a survey along which the camera takes pictures.
"""

import numpy as np

from flight.mission.surveys import Survey
from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.measures.photo_lines import LineMeasure, measure_line
from logs.verdict.measures.route_requirements import RouteRequirements, judged_surveys, route_requirements
from logs.verdict.measures.track_alignment import align_track
from logs.views.charts import Chart, Label, Layer, Panel, join_with_gaps
from world.arrays import Floats

# Largest number of lines that are all numbered; of more lines every second, third, ... is numbered.
_MAX_NUMBERED_LINES = 24
# Largest number of drawn points of a track.
_POINTS = 8000


def survey_chart(setup: FlightSetup, track: Track) -> Chart | None:
    """Chart each survey of a flight in its own panel, from above.

    It is rotated so that its lines are horizontal.  Return None if the mission has no survey that is judged, or if the
    track cannot be aligned with the route.
    """
    if not judged_surveys(setup):
        return None
    requirements = route_requirements(setup)
    aligned = align_track(requirements, track)
    if aligned is None:
        return None
    panels = []
    for number, survey in enumerate(requirements.surveys, 1):
        line_measures = [measure_line(requirements, aligned, survey, line) for line in survey.lines]
        rows = slice(int(aligned.rows[survey.first]), int(aligned.rows[survey.last]) + 1)
        name = "survey" if len(requirements.surveys) == 1 else f"survey {number}"
        panels.append(_make_survey_panel(requirements, survey, line_measures, aligned.track.position[rows], name))
    return Chart(
        f"{setup.scenario.name}: photo lines",
        "along the first line",
        "m",
        tuple(panels),
        page_height=360,
        print_height=4.6,
        legend="below",
    )


def _make_survey_panel(
    requirements: RouteRequirements,
    survey: Survey,
    line_measures: list[LineMeasure | None],
    position: Floats,
    name: str,
) -> Panel:
    """Draw one survey in a panel: usable, lost and unjudged parts of its photo lines, and the track.

    line_measures: measurement of each photo line; None for a line that was not flown: all of it is lost.
    position: track positions during the survey, m, (t, 3).
    name: name of the survey in the panel's title.
    """
    origin = requirements.points[survey.first, :2]
    unit = np.array([np.sin(survey.course), np.cos(survey.course)])
    axes = np.stack([unit, [-unit[1], unit[0]]], axis=1)

    def to_line_axes(positions: Floats) -> Floats:
        """Convert positions (n, 3) to distances along and to the left of the first line, m, (n, 2)."""
        return (positions[:, :2] - origin) @ axes

    usable_parts = [np.zeros((0, 2))]
    lost_parts = [np.zeros((0, 2))]
    unknown_parts = [np.zeros((0, 2))]
    labels = []
    step = -(-len(survey.lines) // _MAX_NUMBERED_LINES)
    for number, (line, measure) in enumerate(zip(survey.lines, line_measures, strict=True), 1):
        corners = to_line_axes(requirements.points[line.first : line.last + 1])
        distances = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
        unknown_spans = () if measure is None else measure.unknown_spans
        # A line that was not flown is lost as a whole.
        lost_spans = ((0.0, np.inf),) if measure is None else measure.lost_spans
        usable_spans = []
        if measure is not None:
            gaps = sorted((*measure.lost_spans, *measure.unknown_spans))
            starts = [0.0, *(gap_end for _, gap_end in gaps)]
            ends = [*(gap_start for gap_start, _ in gaps), measure.length]
            usable_spans = [(start, end) for start, end in zip(starts, ends, strict=True) if end > start]
        for parts, spans in (
            (lost_parts, lost_spans),
            (unknown_parts, unknown_spans),
            (usable_parts, usable_spans),
        ):
            for start, end in spans:
                # The part of the line between two distances along it, m.
                is_inside = (distances > start) & (distances < end)
                cuts = np.concatenate([[start], distances[is_inside], [min(end, distances[-1])]])
                parts.append(np.stack([np.interp(cuts, distances, corners[:, axis]) for axis in range(2)], axis=1))
        if (number - 1) % step == 0:
            labels.append(Label(str(number), float(corners[0, 0]), float(corners[0, 1]), "number"))
    track_points = to_line_axes(position[:: max(1, len(position) // _POINTS)])
    layers: tuple[Layer, ...] = (
        Layer("line", "usable part of a photo line", "planned", *join_with_gaps(usable_parts), quiet=True),
        Layer("line", "photo line, lost", "fail", *join_with_gaps(lost_parts), quiet=True),
    )
    if len(unknown_parts) > 1:
        unknown_line = join_with_gaps(unknown_parts)
        layers = (*layers, Layer("line", "outside the terrain data, not judged", "return-unknown", *unknown_line))
    layers = (*layers, Layer("line", "flown track", "flown", track_points[:, 0], track_points[:, 1], quiet=True))
    return Panel(f"{name}: to the left of its first line", "m", layers, labels=tuple(labels))
