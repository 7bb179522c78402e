"""Chart a verdict's findings by turn and leg: planned value, flown value and limit."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from logs.verdict.findings import Finding
from logs.verdict.verdict import Verdict
from logs.views.charts import Chart, Layer, Panel, shorten

# Margin of a panel above and below its values, as a fraction of their span.
_MARGIN = 0.12
# Limits of turns and corridor above the largest value times this ratio are not drawn.
_MAX_LIMIT_RATIO = 4.0
# Panels of the chart: rule, kind of place on the horizontal axis, title and unit.
PLACE_PANELS = (
    ("turn", "waypoint", "turn", "°"),
    ("slope", "leg", "slope", "°"),
    ("clearance", "leg", "lowest height above ground", "m"),
    ("waypoint", "waypoint", "passed at", "m"),
    ("corridor", "leg", "farthest from the legs", "m"),
)


@dataclass(frozen=True, slots=True)
class PlaceValue:
    """The values of a finding at one waypoint or leg.

    number: number of the waypoint or leg in messages.
    planned, flown, limit: planned value, flown value and limit, in the unit of the finding; NaN if unknown.
    ok: True if the finding passed, False if it failed, None if it is undecided.
    """

    number: int
    planned: float
    flown: float
    limit: float
    ok: bool | None


def list_place_values(findings: Sequence[Finding], rule: str) -> list[PlaceValue]:
    """Return the values of a rule's findings on waypoints and legs, sorted by their number."""
    place_rows = []
    for finding in findings:
        place = finding.place
        if finding.rule == rule and place.kind in ("leg", "waypoint") and place.index is not None:
            planned_value, flown_value, limit_value = (
                math.nan if value is None else value
                for value in (finding.planned, finding.flown, finding.effective_limit)
            )
            number = place.index if place.number is None else place.number
            place_rows.append(PlaceValue(number, planned_value, flown_value, limit_value, finding.ok))
    return sorted(place_rows, key=lambda value: value.number)


def turn_chart(name: str, verdict: Verdict) -> Chart:
    """Chart turns, slopes, clearances, waypoint distances and corridor.

    Each has a panel if the verdict judged it.  Bars are planned values, dots flown values, dashes limits; rings mark
    failures.  Limits of turns and of the corridor that are far above all values are not drawn; a note states the lowest
    of them.

    name: name of the scenario.

    >>> turn_chart("a plan", Verdict((), flyable=False, complete=False, lines=(), level="plan")).panels
    ()
    """
    panels = []
    for rule, place, panel_title, unit in PLACE_PANELS:
        values = list_place_values(verdict.findings, rule)
        if not values:
            continue
        numbers = np.array([value.number for value in values], dtype=np.float64)
        planned_values, flown_values, limit_values = (
            np.array([getattr(value, field) for value in values]) for field in ("planned", "flown", "limit")
        )
        failed = np.array([value.ok is False for value in values])
        layers = [
            Layer("bars", "planned", "planned", numbers, planned_values),
            Layer("dashes", "limit", "limit", numbers, limit_values),
            Layer("dots", "flown", "flown", numbers, flown_values),
        ]
        if failed.any():
            marked_values = np.where(np.isfinite(flown_values), flown_values, planned_values)
            layers.append(Layer("rings", "fails", "fail", numbers[failed], marked_values[failed], quiet=True))
        known_values = np.concatenate([[0.0], planned_values, flown_values])
        known_values = known_values[np.isfinite(known_values)]
        limits = limit_values[np.isfinite(limit_values)]
        # A limit of a turn or corridor far above the largest value is hidden, because it would flatten the values.
        max_known = max(float(np.abs(known_values).max()), 1e-9)
        max_limit = _MAX_LIMIT_RATIO * max_known if rule in ("turn", "corridor") else math.inf
        shown_limits, hidden_limits = limits[limits <= max_limit], limits[limits > max_limit]
        min_value = float(min([*known_values, *shown_limits]))
        max_value = float(max([*known_values, *shown_limits]))
        margin = _MARGIN * ((max_value - min_value) or 1.0)
        note = ""
        if hidden_limits.size:
            unit_text = unit if unit == "°" else f" {unit}"
            note = f"{'other ' if shown_limits.size else ''}limits from {hidden_limits.min():.0f}{unit_text}"
        bottom = min_value - margin if failed.any() or min_value < 0.0 else 0.0
        span = (bottom, max_value + margin)
        panels.append(Panel(panel_title, unit, tuple(layers), span=span, along=place, note=note))
    title = f"{shorten(name, 60)}: turn by turn, leg by leg"
    return Chart(title, "", "", tuple(panels), shared=False, page_height=170, print_height=1.55, legend="below")
