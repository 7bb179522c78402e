"""The files of a go/no-go chart: data, picture and page."""

import json
import math
from collections import Counter
from pathlib import Path

from logs.figures.elements.style import png_bytes
from planfly.campaigns.find_winds import ACCURACY, FEWEST, WindsFound
from planfly.campaigns.flights.campaign_base import CampaignBase
from planfly.campaigns.pictures.go_no_go import Spoke, draw_go_no_go
from planfly.campaigns.report.page import winds_page
from planfly.campaigns.statistics.proportions import Tally, lower_bound
from planfly.campaigns.statistics.wind_boundary import needs_more
from world.atomic_files import write_whole

SCHEMA = "planfly.winds/1"


def spokes(found: WindsFound) -> list[Spoke]:
    """The chart's data."""
    out = []
    for number, boundary in enumerate(found.boundaries):
        counts: dict[float, list[bool]] = {}
        for direction, speed, flyable in found.flights:
            if direction == number:
                counts.setdefault(speed, []).append(flyable)
        marks = tuple((speed, len(all_), sum(all_)) for speed, all_ in sorted(counts.items()))
        out.append(
            Spoke(found.from_deg(number), boundary.estimate, boundary.low, boundary.high, boundary.beyond, marks)
        )
    return out


def write_winds(folder: Path, base: CampaignBase, found: WindsFound, command: str) -> None:
    """Write ``winds.json``, ``winds.png`` and ``winds.html``."""
    goal, chart = found.goal, spokes(found)
    wind = base.scenario.wind
    own = (wind.speed, math.degrees(wind.from_course)) if wind.speed else None
    figure = draw_go_no_go(chart, goal.most, goal.target, goal.confidence, base.name, own)
    rows = [
        (f"{one.from_deg:g}°", _speed_text(one.boundary, goal.most), _interval_text(one.low, one.high, goal.most),
         str(sum(count for _, count, _ in one.flights)))
        for one in chart
    ]  # fmt: skip
    data = {
        "schema": SCHEMA,
        "name": base.name,
        "seed": base.seed,
        "target": goal.target,
        "confidence": goal.confidence,
        "most": goal.most,
        "flights": len(found.flights),
        "lost": list(found.lost),
        "directions": [
            {
                "from_deg": one.from_deg,
                "boundary_mps": round(one.boundary, 3),
                "interval_mps": [round(one.low, 3), round(one.high, 3)],
                "beyond": one.reaches,
                "flown": [
                    {"speed_mps": round(v, 3), "flights": count, "flyable": good} for v, count, good in one.flights
                ],
            }
            for one in chart
        ],
        "spread": base.spread.to_json(),
    }
    page = winds_page(base.name, figure, wind_lines(found), rows, command)
    write_whole(folder / "winds.json", json.dumps(data, indent=1, allow_nan=False) + "\n")
    write_whole(folder / "winds.png", png_bytes(figure))
    write_whole(folder / "winds.html", page)


def _speed_text(speed: float, most: float) -> str:
    return f"over {most:g} m/s" if speed >= most - 1e-9 else f"{speed:.1f} m/s"


def _interval_text(low: float, high: float, most: float) -> str:
    """An interval, m/s, of which what lies beyond all that was looked at is not known."""
    if low >= most - 1e-9:
        return f"over {most:g}"
    return f"{low:.1f} to {f'over {most:g}' if high >= most - 1e-9 else f'{high:.1f}'}"


def _open_lines(found: WindsFound) -> list[str]:
    """That the flights did not last for all directions, where they did not."""
    counts = Counter(direction for direction, _, _ in found.flights)
    wanting = [k for k, one in enumerate(found.boundaries) if needs_more(one, counts[k], ACCURACY, FEWEST)]
    if not wanting:
        return []
    return [
        f"not settled: {len(wanting)} of {len(found.boundaries)} directions, for want of flights: each takes"
        f" {FEWEST} at least, and an interval of {2.0 * ACCURACY:g} m/s; with fewer the interval is mostly assumption"
    ]


def _lost_lines(found: WindsFound) -> list[str]:
    """Which flights could not be flown, where some could not."""
    if not found.lost:
        return []
    named = ", ".join(
        f"{number} ({found.flights[number][1]:.1f} m/s from {found.from_deg(found.flights[number][0]):g}°)"
        for number in found.lost[:10]
    )
    return [f"lost      {len(found.lost)} could not be flown, their workers died, and count as not flyable: {named}"]


def _none_failed_lines(found: WindsFound) -> list[str]:
    """What the flights of directions in which none failed show by themselves."""
    most, confidence = found.goal.most, found.goal.confidence
    at_most = Counter(direction for direction, speed, _ in found.flights if speed == most)
    failed = {direction for direction, _, flyable in found.flights if not flyable}
    counts = [at_most[k] for k in range(len(found.boundaries)) if k not in failed and at_most[k]]
    if not counts:
        return []
    fewest, shown = min(counts), f"{lower_bound(Tally(min(counts), 0), confidence):.3g}"
    return [
        f"none failed from {len(counts)} of {len(found.boundaries)} directions: {fewest} flights in {most:g} m/s from"
        f" each show P >= {shown} by themselves"
    ]


def wind_lines(found: WindsFound) -> list[str]:
    """What was found, in a few lines."""
    chart = spokes(found)
    least, largest = (pick(chart, key=lambda one: one.boundary) for pick in (min, max))
    most, percent = found.goal.most, f"{100 * found.goal.confidence:g} %"
    return [
        f"flies with P >= {found.goal.target:g}, by best estimate, in wind up to {_speed_text(least.boundary, most)}"
        f" from {least.from_deg:g}° (the least; {_interval_text(least.low, least.high, most)} m/s at {percent}),"
        f" {_speed_text(largest.boundary, most)} from {largest.from_deg:g}°",
        *_none_failed_lines(found),
        *_open_lines(found),
        *_lost_lines(found),
        f"{len(found.flights)} flights; intervals at {percent}, by the flights of each direction",
    ]
