"""Chart the findings with a place on the route, by turn and leg: planned value, flown value and limit."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from logs.verdict.findings import Finding
from logs.verdict.verdict import Verdict
from logs.views.charts import Chart, Layer, Panel, shorten
from world.arrays import Floats

# Margin of a panel above and below its values, as a fraction of their span.
_MARGIN = 0.12
# A limit above the largest value times this ratio is omitted.
_MAX_LIMIT_RATIO = 4.0
# Panels of the chart: rule, kind of place, title and unit.
PLACE_PANELS = (
    ("turn", "waypoint", "turn", "°"),
    ("slope", "leg", "slope", "°"),
    ("clearance", "leg", "lowest height above ground", "m"),
    ("waypoint", "waypoint", "passed at", "m"),
    ("corridor", "leg", "farthest from the legs", "m"),
)


@dataclass(frozen=True, slots=True)
class PlaceValue:
    """Values of a finding at one waypoint or leg, in the unit of the finding; NaN if not stated."""

    number: int
    planned: float
    flown: float
    limit: float
    ok: bool | None


def list_place_values(findings: Sequence[Finding], rule: str) -> list[PlaceValue]:
    """Return the values of a rule's findings, sorted by the number of the waypoint or leg."""
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
    """Chart turns, slopes, clearances, waypoints and corridor; each has a panel if the verdict judged it.

    Bars stand for the plan, dots for the flight, dashes for limits; rings mark failures.

    name: name of the scenario.

    >>> turn_chart("a plan", Verdict((), flyable=False, complete=False, lines=(), level="plan")).panels
    ()
    """
    panels = tuple(
        _make_rule_panel(rule, title, unit, place, values)
        for rule, place, title, unit in PLACE_PANELS
        if (values := list_place_values(verdict.findings, rule))
    )
    title = f"{shorten(name, 60)}: turn by turn, leg by leg"
    return Chart(title, "", "", panels, shared=False, page_height=170, print_height=1.55, legend="below")


def _make_rule_panel(rule: str, title: str, unit: str, place: str, values: list[PlaceValue]) -> Panel:
    """Return the panel of a rule with planned and flown values, limits, and marked failures.

    Limits far above all values are not drawn; a note states the lowest of them.

    title, unit: title of the panel, and unit of the values.
    place: title of the horizontal axis.
    """
    numbers = np.array([value.number for value in values], dtype=np.float64)
    planned_values, flown_values, limit_values = (
        np.array([getattr(value, name) for value in values]) for name in ("planned", "flown", "limit")
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
    shown_limits = limits[_find_visible_limits(limits, rule, float(np.abs(known_values).max()))]
    min_value = float(min([*known_values, *shown_limits]))
    max_value = float(max([*known_values, *shown_limits]))
    margin = _MARGIN * ((max_value - min_value) or 1.0)
    note = ""
    if len(shown_limits) < len(limits):
        hidden_limits = limits[~_find_visible_limits(limits, rule, float(np.abs(known_values).max()))]
        note = (
            f"{'other ' if shown_limits.size else ''}limits from {hidden_limits.min():.0f}"
            f"{unit if unit == '°' else ' ' + unit}"
        )
    bottom = min_value - margin if failed.any() or min_value < 0.0 else 0.0
    return Panel(title, unit, tuple(layers), span=(bottom, max_value + margin), along=place, note=note)


def _find_visible_limits(limits: Floats, rule: str, max_value: float) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Return a mask (n,), True for limits to show.

    A limit of a turn or corridor far above the largest value `max_value` is hidden, because it would flatten the
    values.
    """
    max_limit = _MAX_LIMIT_RATIO * max(max_value, 1e-9) if rule in ("turn", "corridor") else math.inf
    return np.asarray(limits <= max_limit, dtype=np.bool_)
