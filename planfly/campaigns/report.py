"""Write the files of a campaign's folder: summary, report page, logs of the worst flights, and go/no-go chart."""

import json
import math
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure

from logs.theme import css_variables
from logs.verdict.conditions import flown_lines
from logs.verdict.rule_words import RULE_WORDS
from logs.verdict.wording import place_text
from logs.views.drawing import page_svg, png_bytes
from logs.views.report.page import page_template
from planfly.campaigns.campaign_base import CampaignBase
from planfly.campaigns.dispersions import BY_NAME
from planfly.campaigns.failure_counts import failure_lines, failures_document
from planfly.campaigns.find_winds import ACCURACY, CALM_MPS, FEWEST, CalmFailures, WindsFound
from planfly.campaigns.flight_row import STATIONS, FlightRow, fly_one
from planfly.campaigns.fly_campaign import open_store
from planfly.campaigns.pictures import (
    Bar,
    Spoke,
    draw_clearance_fan,
    draw_crossings,
    draw_failures,
    draw_go_no_go,
    draw_probability,
    draw_tornado,
    narrowed,
    speed_bins,
)
from planfly.campaigns.statistics.decision import Estimate, Goal, Tally, lower_bound, wilson
from planfly.campaigns.statistics.wind_boundary import needs_more
from planfly.campaigns.summary import (
    CampaignSummary,
    campaign_lines,
    closest_text,
    log_name,
    summarise,
    summary_json,
)
from planfly.campaigns.tables import DATABASE, WINDS_DATABASE, Store, refuse_held, same_flight
from planfly.workflow.make_plan import Advance
from planfly.workflow.open_flight import make_setup
from planner.plan import plan_json
from world.errors import ArgumentError, PlanflyError
from world.files import write_whole

# Maximum number of flights drawn in the pictures of tracks; more flights do not change the pictures visibly.
_DRAWN = 3000


def campaign_page(base: CampaignBase, summary: CampaignSummary, store: Store, command: str) -> bytes:
    """Return the report page as bytes.  command: the command line that repeats the campaign."""
    pictures = [_draw_both_widths(figure, words) for figure, words in _draw_pictures(base, summary, store)]
    lines = campaign_lines(summary)
    text = _render_page(
        "campaign.html",
        name=summary.name,
        answer=summary.estimate.answer,
        lines=lines,
        failures=[
            (RULE_WORDS[one.rule].title, place_text(place), number)
            for one in summary.by_rule
            for place, number in one.places
        ],
        flights=summary.estimate.tally.flown,
        worst=[
            (
                row.draw.index,
                row.outcome,
                "; ".join(f"{RULE_WORDS[rule].title} at {place_text(place)}" for rule, place in row.failed[:4])
                or row.ended,
                closest_text(row),
                log_name(row) if row.duration > 0.0 else "",
            )
            for row in summary.worst
        ],
        drawn=summary.dispersions.get("aircraft"),
        dispersions=[
            (
                BY_NAME[name].title,
                BY_NAME[name].combine if BY_NAME[name].combine == "factor" else BY_NAME[name].unit,
                ", ".join(f"{key} {value:g}" for key, value in table.items() if key not in ("distribution", "source")),
                table["distribution"],
                table["source"],
            )
            for name, table in summary.dispersions.items()
            if name in BY_NAME
        ],
        pictures=pictures,
        command=command,
        made_of=summary.made_of,
        seed=summary.seed,
    )
    return text.encode("utf-8")


def _render_page(template: str, **values: object) -> str:
    return page_template(template, "planfly.campaigns").render(colours=Markup(css_variables()), **values)


def winds_page(name: str, figure: Figure, found: WindsFound, rows: Sequence[tuple[str, ...]], command: str) -> bytes:
    """Return the page of a go/no-go chart, and change the figure to its narrow layout."""
    picture = _draw_both_widths(figure, "Go/no-go chart: wind from each direction")
    page = _render_page(
        "winds.html",
        name=name,
        picture=picture,
        answer=winds_state(found),
        lines=wind_lines(found),
        rows=rows,
        command=command,
    )
    return page.encode("utf-8")


def _draw_both_widths(figure: Figure, words: str) -> Markup:
    """Return a picture for a page in two widths, for desktops and phones; change the figure to the narrow layout."""
    wide = page_svg(figure, words)
    narrow = page_svg(narrowed(figure), f"{words} (narrow)")
    return Markup(f'<div class="wide">{wide}</div><div class="narrow">{narrow}</div>')


def _draw_pictures(base: CampaignBase, summary: CampaignSummary, store: Store) -> list[tuple[Figure, str]]:
    """Draw the figures of the report, and return them with their captions."""
    flyable = np.array([outcome == "flyable" for outcome in store.outcomes().values()])
    speed = np.maximum(0.0, base.scenario.wind.speed + store.column("wind_speed"))
    bins = speed_bins(speed, flyable, summary.goal.confidence)
    counts = [(RULE_WORDS[one.rule].title, place_text(place), n) for one in summary.by_rule for place, n in one.places]
    out = [
        (draw_probability(bins, summary.goal.target), "Share of flyable flights against the mean wind's speed"),
    ]
    if summary.deciding:
        bars = [Bar(BY_NAME[one.quantity].title, one.index, one.slope) for one in summary.sensitivities]
        out.append((draw_tornado(bars, RULE_WORDS[summary.deciding].title), "What the deciding margin depends on"))
    if counts:
        failures = draw_failures(counts, summary.estimate.tally.flown)
        out.append((failures, "In how many flights each rule failed, and where"))
    return out + _draw_tracks(base, store)


def _draw_tracks(base: CampaignBase, store: Store) -> list[tuple[Figure, str]]:
    """Draw the clearance fan and the crossings of the flights that have a track."""
    setup = make_setup(base.scenario, base.airframe, base.mission, base.seed, plan=base.plan, placed=base.placed)
    points = setup.route.waypoints
    shapes = [np.frombuffer(data, np.float32) for data in store.blobs("clearance", _DRAWN)]
    if not shapes:
        return []
    outcomes = [one != "flyable" for one, there in zip(store.texts("outcome"), store.has_track(), strict=True) if there]
    failed = np.array(outcomes[: len(shapes)])
    out = []
    if base.scenario.terrain is not None:
        lengths = np.hypot(*np.diff(points[:, :2], axis=0).T)
        before = np.concatenate([[0.0], np.cumsum(lengths)])
        at = (np.arange(STATIONS) + 0.5) / STATIONS * before[-1]
        east, north = (np.interp(at, before, points[:, axis]) for axis in range(2))
        ground = base.scenario.terrain.height(east, north)
        least = base.scenario.limits.min_clearance_m
        figure = draw_clearance_fan(np.array(shapes, dtype=np.float64), failed, ground, float(before[-1]), least)
        out.append((figure, "Height above ground along the way, over all flights, and the ground itself"))
    crossings = [np.frombuffer(data, np.float32).reshape(-1, 2) for data in store.blobs("crossings", _DRAWN)]
    # The number of stops on a return depends on the wind, so flights without the further stops have NaN.
    crossed = np.full((len(crossings), max(map(len, crossings)), 2), np.nan)
    for row, known in zip(crossed, crossings, strict=True):
        row[: len(known)] = known
    out.append((draw_crossings(crossed, failed), "Where flights crossed each waypoint"))
    return out


# ----------------------------------------------------------------------
# Open and clear a campaign's folder, and write its summary, report and logs of the worst flights.

# Files that a campaign or a search for winds writes into its folder, and removes when it is replaced.
CAMPAIGN_FILES = (
    *(f"{table}{ending}" for table in (DATABASE, WINDS_DATABASE) for ending in ("", "-wal", "-shm")),
    "summary.json",
    "report.html",
    "winds.json",
    "winds.png",
    "winds.html",
    "plan.json",
)


@dataclass(frozen=True)
class OutputDirectory:
    """Folder of a campaign, and the permission to resume or replace its contents.

    table: name of the file with the table of flights.
    resume: True resumes the campaign in the folder.
    overwrite: True replaces the campaign.
    """

    folder: Path
    table: str
    resume: bool
    overwrite: bool

    def refuse(self) -> None:
        """Raise PlanflyError if the folder is a file, or has contents that may not be resumed or replaced."""
        folder = self.folder
        if self.resume:
            if not (folder / self.table).is_file():
                raise PlanflyError(f"{folder / self.table}: no campaign there to go on with", file=folder / self.table)
            return
        if folder.exists() and not folder.is_dir():
            raise PlanflyError(f"{folder}: is a file; a folder is expected", file=folder)
        if self.overwrite or not folder.is_dir() or not any(folder.iterdir()):
            return
        if (folder / self.table).exists():
            raise PlanflyError(
                f"{folder}: holds a campaign; resume=True goes on with it, overwrite=True replaces it", file=folder
            )
        if any((folder / name).exists() for name in CAMPAIGN_FILES):
            raise PlanflyError(f"{folder}: holds another campaign; overwrite=True replaces it", file=folder)
        raise PlanflyError(f"{folder}: exists and is not empty; overwrite=True replaces its results", file=folder)

    def open(self, opened: Callable[[Path | None], CampaignBase]) -> CampaignBase:
        """Return the opened campaign base, and clear its folder unless the campaign is resumed.

        The plan of a scenario is stored in the folder, from which the campaign can be resumed later.

        opened: returns the base, from the plan file of a resumed campaign, if there is one.
        Raises PlanflyError, without changes to a folder that is refused.
        """
        self.refuse()
        kept = self.folder / "plan.json"
        base = opened(kept if self.resume else None)
        if not self.resume:
            clear_campaign(self.folder)
        if base.plan is not None and not kept.exists():
            write_whole(kept, plan_json(base.plan))
        return base


@contextmanager
def campaign_folder(out: Path | str | None, table: str, *, resume: bool, overwrite: bool) -> Iterator[OutputDirectory]:
    """Yield the folder of a campaign.  out: path of the folder, or None for a folder that is removed at the end.

    Raises ArgumentError if a campaign is to be resumed without a folder.
    """
    if out is not None:
        yield OutputDirectory(Path(out), table, resume, overwrite)
        return
    if resume:
        allowed = "`out` is missing: the folder of what is to be gone on with"
        raise ArgumentError.of_argument("resume", resume, allowed, shown="")
    with tempfile.TemporaryDirectory() as name:
        yield OutputDirectory(Path(name), table, resume=False, overwrite=False)


def clear_campaign(folder: Path) -> None:
    """Make a folder, and remove the files of an earlier campaign or search from it, but no other files.

    Raises StoreError, and removes nothing, if another process has locked the table.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for table in (DATABASE, WINDS_DATABASE):
        refuse_held(folder / table)
    for path in (*(folder / name for name in CAMPAIGN_FILES), *_worst_flight_logs(folder)):
        path.unlink(missing_ok=True)


def _worst_flight_logs(folder: Path) -> list[Path]:
    return sorted((folder / "worst").glob("flight-[0-9]*.mcap"))


def write_files(
    folder: Path,
    base: CampaignBase,
    summary: CampaignSummary,
    store: Store,
    command: str,
    advance: Advance | None = None,
) -> None:
    """Write ``summary.json``, ``report.html`` and the worst flights' logs; remove logs of other flights."""
    (folder / "worst").mkdir(exist_ok=True)
    kept = {folder / log_name(row) for row in summary.worst}
    for path in _worst_flight_logs(folder):
        if path not in kept:
            path.unlink()
    for count, row in enumerate(summary.worst):
        path = folder / log_name(row)
        if row.duration > 0.0 and not path.exists():
            fly_row_again(base, row, path)
        if advance is not None:
            advance(count + 1.0, float(len(summary.worst)), f"flight {row.draw.index}")
    write_whole(folder / "summary.json", summary_json(summary))
    write_whole(folder / "report.html", campaign_page(base, summary, store, command))


def fly_row_again(base: CampaignBase, row: FlightRow, log: Path) -> FlightRow:
    """Repeat a flight of the table, and record it in a log.

    Raises PlanflyError if the result differs from the table, because another machine, which computed differently, flew
    it.
    """
    again = fly_one(base, row.draw.index, log=log)
    if not same_flight(row, again):
        message = f"{log}: flight {row.draw.index} comes out otherwise here than where it was flown"
        raise PlanflyError(message, file=log, field="flight", value=row.draw.index)
    return again


# ----------------------------------------------------------------------
# Write the data, picture and page of a go/no-go chart.

# Schema of ``winds.json``.
SCHEMA = "planfly.winds/1"


def spokes(found: WindsFound) -> list[Spoke]:
    """Return the spokes of the go/no-go chart, one for each direction."""
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
        (
            f"{one.from_deg:g}°",
            _speed_text(one.boundary, goal.most),
            _interval_text(one.low, one.high, goal.most),
            str(sum(count for _, count, _ in one.flights)),
        )
        for one in chart
    ]
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
        "calm": None if found.calm is None else _calm_document(found.calm),
        "spread": base.dispersions.to_json(),
        "conditions": None if found.conditions is None else asdict(found.conditions),
    }
    picture = png_bytes(figure)
    page = winds_page(base.name, figure, found, rows, command)
    write_whole(folder / "winds.json", json.dumps(data, indent=1, allow_nan=False) + "\n")
    write_whole(folder / "winds.png", picture)
    write_whole(folder / "winds.html", page)


def _calm_document(calm: CalmFailures) -> dict[str, Any]:
    return {
        "speed_mps": round(calm.speed, 3),
        "flights": calm.flights,
        "not_flyable": calm.failed,
        "failed_by_rule": failures_document(calm.by_rule),
    }


def _speed_text(speed: float, most: float) -> str:
    return f"over {most:g} m/s" if speed >= most - 1e-9 else f"{speed:.1f} m/s"


def _interval_text(low: float, high: float, most: float) -> str:
    """Describe an interval, m/s; bounds beyond the maximum wind of the search are unknown."""
    if low >= most - 1e-9:
        return f"over {most:g}"
    return f"{low:.1f} to {f'over {most:g}' if high >= most - 1e-9 else f'{high:.1f}'}"


def _unsettled_directions(found: WindsFound) -> list[int]:
    """Return the directions with too few flights."""
    counts = Counter(direction for direction, _, _ in found.flights)
    return [k for k, one in enumerate(found.boundaries) if needs_more(one, counts[k], ACCURACY, FEWEST)]


def winds_state(found: WindsFound) -> str:
    """Return the state of the answer: "missed" in calm air, "undecided" for want of flights, or "" for boundaries."""
    calm = found.calm
    if calm is not None and wilson(calm.flights - calm.failed, calm.flights)[1] < found.goal.target:
        return "missed"
    return "undecided" if calm is not None or _unsettled_directions(found) else ""


def _open_lines(found: WindsFound) -> list[str]:
    """Return a line about directions with too few flights, if there are any."""
    short = _unsettled_directions(found)
    if not short:
        return []
    return [
        f"not settled: {len(short)} of {len(found.boundaries)} directions, for want of flights: each takes"
        f" {FEWEST} at least, and an interval of {2.0 * ACCURACY:g} m/s; with fewer the interval is mostly assumption"
    ]


def _lost_lines(found: WindsFound) -> list[str]:
    """Return a line about flights that could not be flown, if there are any."""
    if not found.lost:
        return []
    named = ", ".join(
        f"{number} ({found.flights[number][1]:.1f} m/s from {found.from_deg(found.flights[number][0]):g}°)"
        for number in found.lost[:10]
    )
    return [f"lost      {len(found.lost)} could not be flown, their workers died, and count as not flyable: {named}"]


def _none_failed_lines(found: WindsFound) -> list[str]:
    """Return a line about directions without a failure, with the probability that their flights alone prove."""
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


def _calm_lines(found: WindsFound) -> list[str]:
    """Return lines about the rules that fail in calm air; empty if the mission flies in calm air."""
    calm = found.calm
    if calm is None:
        return []
    wind = "calm air" if calm.speed < CALM_MPS else f"{calm.speed:.1f} m/s, the weakest wind flown"
    return [f"in {wind}, {calm.failed} of {calm.flights} flights fail", *failure_lines(calm.by_rule)]


def _winds_answer(found: WindsFound) -> str:
    """Return the answer of a search in a line, with the lowest and the highest boundary."""
    chart, target = spokes(found), found.goal.target
    least, largest = (pick(chart, key=lambda one: one.boundary) for pick in (min, max))
    most, percent = found.goal.most, f"{100 * found.goal.confidence:g} %"
    best = f"{_speed_text(largest.boundary, most)} from {largest.from_deg:g}°"
    if found.calm is None:
        return (
            f"flies with P >= {target:g}, by best estimate, in wind up to {_speed_text(least.boundary, most)}"
            f" from {least.from_deg:g}° (the lowest; {_interval_text(least.low, least.high, most)} m/s at {percent}),"
            f" {best}"
        )
    if largest.boundary < CALM_MPS:
        return f"does not fly with P >= {target:g}, by best estimate, even in calm air"
    return (
        f"does not fly with P >= {target:g}, by best estimate, in wind from {least.from_deg:g}° even in calm air;"
        f" it flies in wind up to {best}"
    )


def wind_lines(found: WindsFound) -> list[str]:
    """Summarise the result of a search in a few lines."""
    percent = f"{100 * found.goal.confidence:g} %"
    return [
        _winds_answer(found),
        *_calm_lines(found),
        *(() if found.conditions is None else flown_lines(found.conditions)),
        *_none_failed_lines(found),
        *_open_lines(found),
        *_lost_lines(found),
        f"{len(found.flights)} flights; intervals at {percent}, by the flights of each direction",
    ]


# ----------------------------------------------------------------------
# Finish a campaign.


def finish_campaign(
    base: CampaignBase, goal: Goal, estimate: Estimate, folder: Path, command: str, advance: Advance | None = None
) -> CampaignSummary:
    """Summarise a campaign from the table in its folder, which no process may have locked, and write its files.

    command: the command line that repeats the campaign, for the report.
    Raises a `world.errors.PlanflyError`, or OSError for a full disk.
    """
    with open_store(base, goal, folder, resume=True) as store:
        summary = summarise(base, goal, estimate, store)
        write_files(folder, base, summary, store, command, advance)
    return summary
