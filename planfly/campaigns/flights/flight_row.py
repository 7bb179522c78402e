"""One flight of a campaign, flown and judged as `planfly fly` does it, and what the campaign's table keeps of it."""

import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from logs.verdict.findings import Finding, Verdict
from logs.verdict.places import Place
from planfly.campaigns.flights.campaign_base import CampaignBase
from planfly.campaigns.flights.margin_scales import COUNTS, SCALES
from planfly.campaigns.flights.narrow_passes import NarrowPass, narrow_passes
from planfly.campaigns.flights.track_shape import clearance_profile, waypoint_crossings
from planfly.campaigns.flights.varied_flight import GivenWind, vary
from planfly.campaigns.spread.draws import Draw, draw_flight
from planfly.pipeline import fly_and_judge

# A lost flight could not be flown: its workers died on it.
Outcome = Literal["flyable", "not flyable", "lost"]


@dataclass(frozen=True, slots=True)
class LeastMargin:
    """The least margin of a rule in a flight: how much, in which unit, where; value is None where none has a number."""

    value: float | None
    unit: str
    place: Place


@dataclass(frozen=True, slots=True)
class FlightRow:
    """A flight in the campaign's table.

    ended: how, "completed" or why not.
    failed: rule and place of each finding that failed, in the verdict's order.
    margins: by rule, of those that were judged.
    energy_left: Wh; None where nothing was flown.
    duration: s.
    clearance, crossings: bytes of `planfly.campaigns.flights.track_shape`'s arrays; empty where nothing was flown.
    narrow: where it passed narrowly, and with how much room; the table of a campaign does not keep it.
    seconds: that it took.  worker: who flew it.  Both are no part of what is the same for any number of workers.
    """

    draw: Draw
    outcome: Outcome
    ended: str
    failed: tuple[tuple[str, Place], ...] = ()
    margins: tuple[tuple[str, LeastMargin], ...] = ()
    energy_left: float | None = None
    duration: float = 0.0
    clearance: bytes = b""
    crossings: bytes = b""
    narrow: tuple[NarrowPass, ...] = ()
    seconds: float = 0.0
    worker: str = ""

    @property
    def closeness(self) -> float:
        """Least of all margins over their tolerable scale: what orders the closest calls; inf where none is known."""
        known = [margin.value / SCALES[rule] for rule, margin in self.margins if margin.value is not None]
        return min((value for value in known if math.isfinite(value)), default=math.inf)


def fly_one(base: CampaignBase, index: int, wind: GivenWind | None = None, log: Path | None = None) -> FlightRow:
    """Fly a flight of a campaign by its index alone.

    wind: mean wind in the scenario's place.  log: where to record it, None for nowhere.
    """
    started = time.perf_counter()
    draw = draw_flight(base.spread, base.seed, index)
    varied = vary(base, draw, wind)
    flown = fly_and_judge(varied.setup, varied.airframe, log, off_nominal=varied.off_nominal, beside=False)
    track, route = flown.track, varied.setup.route
    some = len(track) > 0
    return FlightRow(
        draw=draw,
        outcome="flyable" if flown.verdict.flyable else "not flyable",
        ended=flown.ended,
        failed=failed_findings(flown.verdict),
        margins=least_margins(flown.verdict.findings),
        energy_left=varied.setup.battery - float(track.energy[-1]) if some else None,
        duration=float(track.time[-1]) if some else 0.0,
        clearance=clearance_profile(route, track).tobytes() if some else b"",
        crossings=waypoint_crossings(route, track).tobytes() if some else b"",
        narrow=narrow_passes(flown.verdict.findings, varied.setup.scenario, track),
        seconds=time.perf_counter() - started,
    )


def failed_findings(verdict: Verdict) -> tuple[tuple[str, Place], ...]:
    """Rule and place of each finding that failed; where none did and the flight is not whole, completion's."""
    failed = tuple((item.rule, item.place) for item in verdict.findings if item.ok is False)
    if failed or verdict.flyable:
        return failed
    return (("completion", Place("flight")),)


def least_margins(findings: tuple[Finding, ...]) -> tuple[tuple[str, LeastMargin], ...]:
    """Of each rule that was judged the finding with the least margin, in the verdict's order.

    >>> from logs.verdict.findings import make_finding
    >>> wide, close = (make_finding("slope", Place("leg", 1), ok=True, reason="", margin=m) for m in (9.0, 4.0))
    >>> least_margins((wide, close))[0][1].value
    4.0
    """
    least: dict[str, Finding] = {}
    for item in findings:
        if item.ok is None or item.margin is None or item.rule in COUNTS:
            continue
        known = least.get(item.rule)
        if known is None or known.margin is None or item.margin < known.margin:
            least[item.rule] = item
    return tuple((rule, LeastMargin(item.margin, item.unit, item.place)) for rule, item in least.items())


def lost_row(base: CampaignBase, index: int, reason: str) -> FlightRow:
    """The row of a flight that could not be flown."""
    return FlightRow(draw_flight(base.spread, base.seed, index), "lost", reason)
