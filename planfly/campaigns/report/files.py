"""The files of a campaign and of a go/no-go chart: summaries, pictures, pages, and logs of the worst flights."""

import json
import math
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from logs.views.drawing import png_bytes
from planfly.campaigns.engine.workers import in_own_process
from planfly.campaigns.find_winds import ACCURACY, FEWEST, WindsFound
from planfly.campaigns.flights.campaign_base import CampaignBase
from planfly.campaigns.flights.flight_row import FlightRow, fly_one
from planfly.campaigns.fly_campaign import open_store
from planfly.campaigns.pictures import Spoke, draw_go_no_go
from planfly.campaigns.report.page import winds_page
from planfly.campaigns.report.summary import CampaignSummary, log_name, summarise, summary_json
from planfly.campaigns.statistics.decision import Estimate, Goal, Tally, lower_bound
from planfly.campaigns.statistics.wind_boundary import needs_more
from planfly.campaigns.storage.stores import DATABASE, WINDS_DATABASE, Store
from planfly.campaigns.storage.table import refuse_held, same_flight
from planfly.pipeline import Advance
from planner.plan import plan_json
from world.errors import PlanflyError
from world.files import write_whole

# ----------------------------------------------------------------------
# The files of a campaign's folder: what is cleared there, and summary, report, and the logs of its worst flights.

# What a campaign or a search for winds writes into its folder, and clears where it is replaced.
CAMPAIGN_FILES = (
    *(f"{table}{ending}" for table in (DATABASE, WINDS_DATABASE) for ending in ("", "-wal", "-shm")),
    "summary.json", "report.html", "winds.json", "winds.png", "winds.html", "plan.json",
)  # fmt: skip


@dataclass(frozen=True)
class AskedFolder:
    """A campaign's folder, and what may be done with what lies in it.

    table: name of the file of flights.
    resume: go on with the campaign that is there.  overwrite: replace it.
    asks: how either is asked for, for the lines that refuse.
    """

    folder: Path
    table: str
    resume: bool
    overwrite: bool
    asks: tuple[str, str] = ("resume=True", "overwrite=True")

    def refuse(self) -> None:
        """Refuse a folder that is a file, or has other contents than were asked for.  Raises PlanflyError."""
        folder, (resume, overwrite) = self.folder, self.asks
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
                f"{folder}: holds a campaign; {resume} goes on with it, {overwrite} replaces it", file=folder
            )
        if any((folder / name).exists() for name in CAMPAIGN_FILES):
            raise PlanflyError(f"{folder}: holds another campaign; {overwrite} replaces it", file=folder)
        raise PlanflyError(f"{folder}: exists and is not empty; {overwrite} replaces its results", file=folder)

    def open(self, opened: Callable[[Path | None], CampaignBase]) -> CampaignBase:
        """The mission, and the folder ready for it: cleared, or with what is to be gone on with.

        opened: gives the mission, with its plan from a file where it is gone on with.
        A scenario's plan is kept in the folder, for those that go on.
        Raises PlanflyError; a folder that was not ready is as it was then.
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
def campaign_folder(out: Path | str | None, table: str, *, resume: bool, overwrite: bool) -> Iterator[AskedFolder]:
    """A campaign's folder; out: None for one that is removed at the end.

    Raises ValueError for a campaign to resume without a folder.
    """
    if out is not None:
        yield AskedFolder(Path(out), table, resume, overwrite)
        return
    if resume:
        raise ValueError("resume: out is missing: the folder of what is to be gone on with")
    with tempfile.TemporaryDirectory() as name:
        yield AskedFolder(Path(name), table, resume=False, overwrite=False)


def clear_campaign(folder: Path) -> None:
    """Make a folder, and clear what an earlier campaign or search left there; anything else stays.

    Raises StoreError, and clears nothing, where another process holds it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for table in (DATABASE, WINDS_DATABASE):
        refuse_held(folder / table)
    for path in (*(folder / name for name in CAMPAIGN_FILES), *_logs(folder)):
        path.unlink(missing_ok=True)


def _logs(folder: Path) -> list[Path]:
    return sorted((folder / "worst").glob("flight-[0-9]*.mcap"))


def write_files(
    folder: Path,
    base: CampaignBase,
    summary: CampaignSummary,
    store: Store,
    command: str,
    advance: Advance | None = None,
) -> None:
    """Write ``summary.json``, ``report.html`` and the worst flights' logs; logs of flights that are none stay not."""
    from planfly.campaigns.report.page import campaign_page

    (folder / "worst").mkdir(exist_ok=True)
    kept = {folder / log_name(row) for row in summary.worst}
    for path in _logs(folder):
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
    """Fly a flight of the table once more, into a log.

    Raises PlanflyError where it does not come out as the table has it: the machine that flew it computes otherwise.
    """
    again = fly_one(base, row.draw.index, log=log)
    if not same_flight(row, again):
        message = f"{log}: flight {row.draw.index} comes out otherwise here than where it was flown"
        raise PlanflyError(message, file=log, field="flight", value=row.draw.index)
    return again


# ----------------------------------------------------------------------
# The files of a go/no-go chart: data, picture and page.

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


# ----------------------------------------------------------------------
# The end of a campaign, in a process of its own.


def finish_campaign(
    base: CampaignBase, goal: Goal, estimate: Estimate, folder: Path, command: str, advance: Advance | None = None
) -> CampaignSummary:
    """Sum a campaign up from the table in its folder, which nobody holds, and write its files.

    command: the line that repeats it, for the report.
    Raises what the other process raised: a `world.errors.PlanflyError`, or OSError for a full disk.
    """
    return in_own_process(_finish, base, goal, estimate, folder, command, advance=advance)


def _finish(
    base: CampaignBase, goal: Goal, estimate: Estimate, folder: Path, command: str, advance: Advance
) -> CampaignSummary:
    with open_store(base, goal, folder, resume=True) as store:
        summary = summarise(base, goal, estimate, store)
        write_files(folder, base, summary, store, command, advance)
    return summary
