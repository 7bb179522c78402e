"""Chart the photo lines of a survey from above: usable parts, lost parts, and the track."""

import numpy as np

from flight.mission.surveys import Survey
from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.measures.photo_lines import LineMeasure, measure_line
from logs.verdict.measures.route_requirements import RouteRequirements, route_requirements, surveys_of
from logs.verdict.measures.track_alignment import align_track
from logs.views.charts import Chart, Label, Layer, Panel, parted
from world.arrays import Floats

# Largest number of lines that are all numbered; of more lines every second, third, ... is numbered.
_MAX_NUMBERED_LINES = 24
# Largest number of drawn points of a track.
_POINTS = 8000


def survey_chart(setup: FlightSetup, track: Track) -> Chart | None:
    """Return a panel for each survey, rotated so that its lines are horizontal.

    Return None without a flown survey.
    """
    if not surveys_of(setup):
        return None
    requirements = route_requirements(setup)
    aligned = align_track(requirements, track)
    if aligned is None:
        return None
    panels = []
    for number, survey in enumerate(requirements.surveys, 1):
        measured = [measure_line(requirements, aligned, survey, line) for line in survey.lines]
        rows = slice(int(aligned.rows[survey.first]), int(aligned.rows[survey.last]) + 1)
        name = "survey" if len(requirements.surveys) == 1 else f"survey {number}"
        panels.append(_panel(requirements, survey, measured, aligned.track.position[rows], name))
    return Chart(
        f"{setup.scenario.name}: photo lines",
        "along the first line",
        "m",
        tuple(panels),
        tall=360,
        inches=4.6,
        legend="below",
    )


def _panel(
    requirements: RouteRequirements, survey: Survey, measured: list[LineMeasure | None], position: Floats, name: str
) -> Panel:
    origin = requirements.points[survey.first, :2]
    unit = np.array([np.sin(survey.course), np.cos(survey.course)])
    axes = np.stack([unit, [-unit[1], unit[0]]], axis=1)

    def laid(places: Floats) -> Floats:
        return (places[:, :2] - origin) @ axes

    used, lost = [np.zeros((0, 2))], [np.zeros((0, 2))]
    labels = []
    step = -(-len(survey.lines) // _MAX_NUMBERED_LINES)
    for number, (line, measure) in enumerate(zip(survey.lines, measured, strict=True), 1):
        corners = laid(requirements.points[line.first : line.last + 1])
        for to, stretches in ((lost, _lost_stretches(measure)), (used, _used(measure))):
            for low, high in stretches:
                to.append(_part(corners, low, high))
        if (number - 1) % step == 0:
            labels.append(Label(str(number), float(corners[0, 0]), float(corners[0, 1]), "number"))
    thin = laid(position[:: max(1, len(position) // _POINTS)])
    layers = (
        Layer("line", "usable part of a photo line", "planned", *parted(used), quiet=True),
        Layer("line", "photo line, lost", "fail", *parted(lost), quiet=True),
        Layer("line", "flown track", "flown", thin[:, 0], thin[:, 1], quiet=True),
    )
    return Panel(f"{name}: to the left of its first line", "m", layers, labels=tuple(labels))


def _lost_stretches(measure: LineMeasure | None) -> tuple[tuple[float, float], ...]:
    """Return the lost stretches of a line, m; a line that was not flown is lost as a whole."""
    return ((0.0, np.inf),) if measure is None else measure.lost


def _used(measure: LineMeasure | None) -> list[tuple[float, float]]:
    """Return the usable stretches of a line, m."""
    if measure is None:
        return []
    edges = [0.0, *(metres for stretch in measure.lost for metres in stretch), measure.length]
    return [(low, high) for low, high in zip(edges[::2], edges[1::2], strict=True) if high > low]


def _part(corners: Floats, low: float, high: float) -> Floats:
    """Return the part of a line (n, 2) between two distances along it, m."""
    run = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
    at = np.concatenate([[low], run[(run > low) & (run < high)], [min(high, run[-1])]])
    return np.stack([np.interp(at, run, corners[:, axis]) for axis in range(2)], axis=1)
