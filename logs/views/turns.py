"""Turn by turn and leg by leg: planned, flown and limit of each finding that has a place on the route."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from logs.verdict.findings import Finding, Verdict
from logs.views import drawing
from logs.views.map import draw_legend

_LEFT, _RIGHT, _TOP, _BOTTOM, _PANEL, _GAP = 0.85, 0.25, 0.6, 0.85, 1.55, 0.62
_NUMBERED = 45
# Room above and below what a panel shows, of its span: half a ring, and some air.
_ROOM = 0.12


@dataclass(frozen=True, slots=True)
class PlaceValue:
    """What a finding says of one waypoint or leg, in its unit; NaN for what it does not say."""

    number: int
    planned: float
    flown: float
    limit: float
    ok: bool | None


# Rule, kind of place, and the title with the unit.
PLACE_PANELS = (
    ("turn", "waypoint", "turn\n(°)"),
    ("slope", "leg", "slope\n(°)"),
    ("clearance", "leg", "least height above\nground (m)"),
    ("waypoint", "waypoint", "passed at\n(m)"),
    ("corridor", "leg", "farthest from\nthe legs (m)"),
)


def place_values(findings: Sequence[Finding], rule: str) -> list[PlaceValue]:
    """List a rule's findings by the number of their waypoint or leg; those of the whole flight are left out."""
    found = []
    for finding in findings:
        place = finding.place
        if finding.rule == rule and place.kind in ("leg", "waypoint") and place.index is not None:
            planned, flown, limit = (
                math.nan if value is None else value for value in (finding.planned, finding.flown, finding.limit)
            )
            found.append(PlaceValue(place.index, planned, flown, limit, finding.ok))
    return sorted(found, key=lambda value: value.number)


def draw_turns(name: str, verdict: Verdict) -> Figure:
    """Panels of turns, slopes, clearances, waypoints and corridor.

    Bars stand for the plan, dots for the flight, dashes for limits.
    What fails is ringed and its number is written in the same colour.
    """
    shown = [(*panel, values) for panel in PLACE_PANELS if (values := place_values(verdict.findings, panel[0]))]
    total = _TOP + _BOTTOM + max(1, len(shown)) * _PANEL + max(0, len(shown) - 1) * _GAP
    with drawing.clean_style():
        figure = drawing.new_figure(total)
        for row, (rule, place, title, values) in enumerate(shown):
            base = _BOTTOM + (len(shown) - 1 - row) * (_PANEL + _GAP)
            frame = (_LEFT / drawing.WIDTH, base / total, 1 - (_LEFT + _RIGHT) / drawing.WIDTH, _PANEL / total)
            axes = figure.add_axes(frame)
            _bars(axes, values, rule)
            axes.set_ylabel(title)
            axes.set_xlabel(place, labelpad=1.0)
        heading = f"{drawing.shorten(name, 60)}: turn by turn, leg by leg"
        figure.text(_LEFT / drawing.WIDTH, 1 - 0.28 / total, heading, fontsize=11, fontweight="bold", va="center")
        draw_legend(figure, _handles(any(v.ok is False for *_, values in shown for v in values)), _LEFT, 0.3 / total)
    return figure


def _bars(axes: Any, values: list[PlaceValue], rule: str) -> None:
    numbers = [value.number for value in values]
    small = 3.0 if len(values) > _NUMBERED else 5.5
    axes.bar(numbers, [value.planned for value in values], width=0.62, color=drawing.PLANNED, zorder=2)
    axes.plot(numbers, [value.flown for value in values], "o", color=drawing.FLOWN, markersize=small, zorder=4)
    axes.hlines(
        [value.limit for value in values],
        [number - 0.42 for number in numbers],
        [number + 0.42 for number in numbers],
        color=drawing.MISSILE, linewidth=2.0, zorder=3,
    )  # fmt: skip
    failed = [value for value in values if value.ok is False]
    tops = [value.flown if math.isfinite(value.flown) else value.planned for value in failed]
    ring: dict[str, Any] = {"mfc": "none", "mec": drawing.FAIL, "mew": 2.0, "markersize": small + 7.0, "zorder": 5}
    axes.plot([value.number for value in failed], tops, "o", **ring)
    axes.axhline(0.0, color="#777777", linewidth=0.7, zorder=1)
    step = -(-len(values) // _NUMBERED)
    ticks = sorted({*numbers[::step], *(value.number for value in failed[:_NUMBERED])})
    axes.set_xticks(ticks)
    for label, number in zip(axes.get_xticklabels(), ticks, strict=True):
        if any(value.number == number for value in failed):
            label.set(color=drawing.FAIL, fontweight="bold")
    axes.set_xlim(numbers[0] - 0.8, numbers[-1] + 0.8)
    axes.grid(axis="y", color="#e4e4e4", linewidth=0.5)
    axes.set_axisbelow(True)
    _frame_values(axes, values, rule)


def _frame_values(axes: Any, values: list[PlaceValue], rule: str) -> None:
    """Show every bar, dot and ring whole; of turns and corridors, limits far above them all are cut off, and named."""
    shown = [v for value in values for v in (value.planned, value.flown) if math.isfinite(v)]
    limits = [value.limit for value in values if math.isfinite(value.limit)]
    far = 4.0 * max((abs(v) for v in shown), default=math.inf) if rule in ("turn", "corridor") else math.inf
    cut = [limit for limit in limits if limit > far]
    seen = [0.0, *shown, *(limit for limit in limits if limit <= far)]
    low, high = min(seen), max(seen)
    room = _ROOM * ((high - low) or 1.0)
    ringed = any(value.ok is False for value in values)
    axes.set_ylim(low - room if ringed or low < 0.0 else 0.0, high + room)
    if cut:
        unit = "°" if rule == "turn" else " m"
        text = f"{'limits' if len(cut) == len(limits) else 'other limits'} from {min(cut):.0f}{unit}"
        axes.annotate(
            text, (1.0, 1.0), (0, 3), xycoords="axes fraction", textcoords="offset points", ha="right", fontsize=7,
            color=drawing.MISSILE,
        )  # fmt: skip


def _handles(failing: bool) -> list[Any]:
    ring: dict[str, Any] = {"marker": "o", "linestyle": "", "markersize": 9, "mfc": "none", "markeredgewidth": 2.0}
    handles: list[Any] = [
        Patch(color=drawing.PLANNED, label="planned"),
        Line2D([], [], marker="o", linestyle="", color=drawing.FLOWN, markersize=5.5, label="flown"),
        Line2D([], [], color=drawing.MISSILE, linewidth=2.0, label="limit"),
    ]
    return [*handles, Line2D([], [], color=drawing.FAIL, label="fails", **ring)] if failing else handles
