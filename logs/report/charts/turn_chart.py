"""The chart of turns and legs: planned, flown and limit of each finding that has a place on the route."""

import numpy as np
from numpy.typing import NDArray

from logs.figures.turns import PLACE_PANELS, PlaceValue, place_values
from logs.report.charts.chart import Chart, ChartPanel, Floats, Layer
from logs.report.charts.stack_chart import parted_unit
from logs.verdict.findings import Verdict

# Room above and below what a panel shows, of its span; and a limit this far above everything else is left out of it.
_ROOM, _FAR = 0.12, 4.0


def turn_chart(verdict: Verdict) -> Chart | None:
    """Panels of turns, slopes, clearances, waypoints and corridor; None where the verdict has none of them.

    >>> turn_chart(Verdict((), flyable=False, complete=False, lines=(), level="plan")) is None
    True
    """
    panels = tuple(
        _panel(title, place, values)
        for rule, place, title in PLACE_PANELS
        if (values := place_values(verdict.findings, rule))
    )
    return Chart("", "", panels, shared=False, tall=170) if panels else None


def _panel(title: str, place: str, values: list[PlaceValue]) -> ChartPanel:
    words, unit = parted_unit(title)
    at = np.array([value.number for value in values], dtype=np.float64)
    planned, flown, limit = (
        np.array([getattr(value, name) for value in values]) for name in ("planned", "flown", "limit")
    )
    failed = np.array([value.ok is False for value in values])
    shown = np.where(np.isfinite(flown), flown, planned)
    layers = [
        Layer("bars", "planned", "planned", at, planned),
        Layer("dashes", "limit", "missile", at, limit),
        Layer("dots", "flown", "flown", at, flown),
    ]
    if failed.any():
        layers.append(Layer("rings", "fails", "fail", at[failed], shown[failed], quiet=True))
    seen = np.concatenate([[0.0], planned, flown])
    seen = seen[np.isfinite(seen)]
    finite = limit[np.isfinite(limit)]
    near, far = (finite[chosen] for chosen in _near_and_far(finite, float(np.abs(seen).max())))
    low, high = float(min(seen.min(), *near)) if near.size else float(seen.min()), float(max(seen.max(), *near, 0.0))
    room = _ROOM * ((high - low) or 1.0)
    note = (
        f"{'other ' if near.size else ''}limits from {far.min():.0f}{unit if unit == '°' else ' ' + unit}"
        if far.size
        else ""
    )
    return ChartPanel(words, unit, tuple(layers), span=(low - room, high + room), along=place, note=note)


def _near_and_far(limits: Floats, largest: float) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which limits are shown, and which stand too far above everything else.  largest: of what is shown."""
    near = limits <= _FAR * max(largest, 1e-9)
    return near, ~near
