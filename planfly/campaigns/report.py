"""Write the files of a campaign's folder.

These are summary, report page, logs of the worst flights, and go/no-go chart.
"""

import json
import math
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from itertools import groupby
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from logs.verdict.conditions import flown_condition_lines
from logs.verdict.junit import JunitCase, JunitSuite, answer_case
from logs.verdict.rule_words import RULE_WORDS
from logs.verdict.wording import place_text
from logs.views.drawing import png_bytes
from planfly.campaigns.campaign_base import CampaignBase
from planfly.campaigns.dispersions import QUANTITY_BY_NAME
from planfly.campaigns.failure_counts import deciding_rule, failure_lines, failures_document
from planfly.campaigns.find_winds import (
    BOUNDARY_ACCURACY_MPS,
    CALM_MPS,
    MIN_FLIGHTS_PER_DIRECTION,
    WindsAnswer,
    WindsResult,
)
from planfly.campaigns.flight_row import STATION_COUNT, FlightRow, fly_one
from planfly.campaigns.fly_campaign import open_store
from planfly.campaigns.page import AnswerPage, AnswerStyle, PageTable, draw_both_widths, render_page
from planfly.campaigns.pictures import (
    Bar,
    ChartDirection,
    draw_clearance_fan,
    draw_crossings,
    draw_failures,
    draw_go_no_go,
    draw_probability,
    draw_tornado,
    group_by_speed,
)
from planfly.campaigns.statistics.decision import Estimate, Goal, Tally, lower_bound
from planfly.campaigns.summary import (
    CampaignSummary,
    campaign_lines,
    closest_text,
    summarise_campaign,
    summary_json,
    worst_flight_logs,
)
from planfly.campaigns.tables import CAMPAIGN_DATABASE, WINDS_DATABASE, Store, check_not_locked, differing_columns
from planfly.workflow.make_plan import Advance
from planfly.workflow.open_flight import make_setup
from planner.plan import plan_json
from world.errors import ArgumentError, PlanflyError
from world.files import write_atomically
from world.wording import count_range_text, count_text

# Maximum number of flights drawn in the pictures of tracks; more flights do not change the pictures visibly.
_MAX_DRAWN_FLIGHTS = 3000


def campaign_page(base: CampaignBase, summary: CampaignSummary, store: Store, command: str) -> bytes:
    """Return the HTML page of a campaign's report as UTF-8.

    command: command line that repeats the campaign.
    """
    lines = campaign_lines(summary)
    failure_rows = [
        (RULE_WORDS[failures.rule].title, place_text(place), count)
        for failures in summary.by_rule
        for place, count in failures.places
    ]
    outcomes = np.array(list(store.outcomes().values()))
    speed = np.maximum(0.0, base.scenario.wind.speed + store.column("wind_speed"))
    is_decided = outcomes != "undecided"
    bins = group_by_speed(speed[is_decided], (outcomes == "flyable")[is_decided], summary.goal.confidence)
    caption = "Share of flyable flights against mean wind speed"
    if summary.estimate.tally.undecided:
        caption += f", without the {summary.estimate.tally.undecided} that are not judged in full"
    figures = [(draw_probability(bins, summary.goal.target), caption)] if bins else []
    for deciding in summary.deciding:
        if deciding.drivers:
            bars = [Bar(entry.title, entry.index, entry.slope) for entry in deciding.drivers]
            tornado = draw_tornado(bars, RULE_WORDS[deciding.rule].title)
            figures.append((tornado, "What the smallest margin depends on"))
    if failure_rows:
        failures_figure = draw_failures(failure_rows, summary.estimate.tally.flown)
        figures.append((failures_figure, "Number of flights that failed each rule, by place"))
    figures += _draw_tracks(base, store)
    pictures = [draw_both_widths(figure, caption) for figure, caption in figures]
    worst_rows = []
    for row, log in zip(summary.worst, worst_flight_logs(summary.worst), strict=True):
        failures_text = "; ".join(
            f"{RULE_WORDS[rule].title} at {place_text(place)}" for rule, place in row.failures[:4]
        )
        reason = failures_text or row.undecided_text or row.ended
        worst_rows.append((row.draw.index, row.outcome, reason, closest_text(row), log))
    dispersion_rows = []
    for name, table in summary.dispersions.items():
        if name in QUANTITY_BY_NAME:
            quantity = QUANTITY_BY_NAME[name]
            unit = quantity.combine if quantity.combine == "factor" else quantity.unit
            parameters = {key: value for key, value in table.items() if key not in ("distribution", "source")}
            parameters_text = ", ".join(f"{key} {value:g}" for key, value in parameters.items())
            dispersion_rows.append((quantity.title, unit, parameters_text, table["distribution"], table["source"]))
    text = render_page(
        "campaign.html",
        command_name="campaign",
        name=summary.name,
        heading="how likely is a flight to succeed",
        answer=summary.estimate.answer,
        lines=lines,
        failures=failure_rows,
        flights=summary.estimate.tally.flown,
        worst=worst_rows,
        drawn=summary.dispersions.get("aircraft"),
        dispersions=dispersion_rows,
        pictures=pictures,
        command=command,
        made_of=summary.made_of,
        seed=summary.seed,
    )
    return text.encode("utf-8")


def _draw_tracks(base: CampaignBase, store: Store) -> list[tuple[Figure, str]]:
    """Draw the fan of clearances along the path and the crossings of waypoints.

    Return each figure and its title.

    Return [] if no flight has path data.  There is no fan without terrain.
    """
    setup = make_setup(base.scenario, base.uav, base.mission, base.seed, plan=base.plan, placed=base.placed)
    points = setup.route.positions
    clearances = [np.frombuffer(data, np.float32) for data in store.blobs("clearance", _MAX_DRAWN_FLIGHTS)]
    if not clearances:
        return []
    outcomes = [
        outcome in ("not flyable", "lost")
        for outcome, has_track in zip(store.texts("outcome"), store.has_track(), strict=True)
        if has_track
    ]
    has_failed = np.array(outcomes[: len(clearances)])
    figures = []
    if base.scenario.terrain is not None:
        lengths = np.hypot(*np.diff(points[:, :2], axis=0).T)
        leg_starts = np.concatenate([[0.0], np.cumsum(lengths)])
        distances = (np.arange(STATION_COUNT) + 0.5) / STATION_COUNT * leg_starts[-1]
        east, north = (np.interp(distances, leg_starts, points[:, axis]) for axis in range(2))
        terrain_altitudes = base.scenario.terrain.height(east, north)
        min_clearance = base.scenario.limits.min_clearance_m
        figure = draw_clearance_fan(
            np.array(clearances, dtype=np.float64), has_failed, terrain_altitudes, float(leg_starts[-1]), min_clearance
        )
        figures.append((figure, "Height above ground along the path, over all flights, and the ground itself"))
    crossings = [
        np.frombuffer(data, np.float32).reshape(-1, 2) for data in store.blobs("crossings", _MAX_DRAWN_FLIGHTS)
    ]
    # The number of stops on a return depends on the wind; flights with fewer stops have NaN for the others.
    all_crossings = np.full((len(crossings), max(map(len, crossings)), 2), np.nan)
    for row, flight_crossings in zip(all_crossings, crossings, strict=True):
        row[: len(flight_crossings)] = flight_crossings
    figures.append((draw_crossings(all_crossings, has_failed), "Where flights crossed each waypoint"))
    return figures


# ----------------------------------------------------------------------
# Open and clear a campaign's folder, and write its summary, report and logs of the worst flights.

# Scenario of a campaign that was not given as a file.
SCENARIO_FILE = "scenario.toml"
# Files that a campaign or a search for winds writes into its folder, and removes when it is replaced.
CAMPAIGN_FILES = (
    *(f"{table}{ending}" for table in (CAMPAIGN_DATABASE, WINDS_DATABASE) for ending in ("", "-wal", "-shm")),
    "summary.json",
    "report.html",
    "winds.json",
    "winds.png",
    "winds.html",
    "plan.json",
    SCENARIO_FILE,
)


@dataclass(frozen=True)
class OutputDirectory:
    """Folder of a campaign, and the permission to resume or replace its contents.

    table: name of the file with the table of flights.
    resume: True resumes the campaign in the folder.
    overwrite: True permits to replace the contents of the folder.
    """

    folder: Path
    table: str
    resume: bool
    overwrite: bool

    def check_contents(self) -> None:
        """Raise PlanflyError if the folder cannot be resumed or must not be replaced.

        A campaign to resume needs its table; a new campaign needs an empty or missing folder, or `overwrite`.
        """
        folder = self.folder
        if self.resume:
            if not (folder / self.table).is_file():
                message = f"{folder / self.table}: there is no campaign to continue"
                raise PlanflyError(message, file=folder / self.table)
            return
        if folder.exists() and not folder.is_dir():
            raise PlanflyError(f"{folder}: is a file; expected a folder", file=folder)
        if self.overwrite or not folder.is_dir() or not any(folder.iterdir()):
            return
        if (folder / self.table).exists():
            raise PlanflyError(
                f"{folder}: contains a campaign; resume=True continues it, overwrite=True replaces it", file=folder
            )
        if any((folder / name).exists() for name in CAMPAIGN_FILES):
            raise PlanflyError(f"{folder}: contains another campaign; overwrite=True replaces it", file=folder)
        raise PlanflyError(f"{folder}: exists and is not empty; overwrite=True replaces its results", file=folder)

    def open_base_and_clear(self, open_base: Callable[[Path | None], CampaignBase]) -> CampaignBase:
        """Open the campaign base, and clear the folder unless the campaign is resumed.

        The plan of a scenario is stored in the folder, so that the campaign can be resumed later.

        open_base: function that opens the base from the plan file of a resumed campaign, or from None.
        Raises PlanflyError, before the folder is changed, as `check_contents` or `open_base`.
        """
        self.check_contents()
        plan_file = self.folder / "plan.json"
        base = open_base(plan_file if self.resume else None)
        if not self.resume:
            clear_campaign(self.folder)
        if base.plan is not None and not plan_file.exists():
            write_atomically(plan_file, plan_json(base.plan))
        return base


@contextmanager
def campaign_folder(out: Path | str | None, table: str, *, resume: bool, overwrite: bool) -> Iterator[OutputDirectory]:
    """Yield the output directory of a campaign.

    out: path of the folder, or None for a temporary folder, which is removed at the end.
    table, resume, overwrite: as for `OutputDirectory`.

    Raises ArgumentError if a campaign is to be resumed, but `out` is None.
    """
    if out is not None:
        yield OutputDirectory(Path(out), table, resume, overwrite)
        return
    if resume:
        allowed = "`out` is missing: it names the folder of the campaign to continue"
        raise ArgumentError.of_argument("resume", resume, allowed, shown="")
    with tempfile.TemporaryDirectory() as name:
        yield OutputDirectory(Path(name), table, resume=False, overwrite=False)


def clear_campaign(folder: Path) -> None:
    """Make a folder, and remove the files of an earlier campaign or search from it, but no other files.

    Raises StoreError, and removes nothing, if another process has locked the table.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for table_name in (CAMPAIGN_DATABASE, WINDS_DATABASE):
        check_not_locked(folder / table_name)
    for path in (*(folder / name for name in CAMPAIGN_FILES), *_worst_flight_logs(folder)):
        path.unlink(missing_ok=True)


def _worst_flight_logs(folder: Path) -> list[Path]:
    """Return the logs of the worst flights in a campaign's folder, sorted by name."""
    return sorted((folder / "worst").glob("flight-[0-9]*.mcap"))


def write_files(
    folder: Path,
    base: CampaignBase,
    summary: CampaignSummary,
    store: Store,
    command: str,
    advance: Advance | None = None,
) -> None:
    """Write ``summary.json``, ``report.html`` and the logs of the three worst flights.

    A log that exists is kept.  Logs of flights that no longer belong to the worst are removed.

    command: the command line that repeats the campaign, for the report.
    advance: called after each log with the number of logs done, their total and a text.
    """
    (folder / "worst").mkdir(exist_ok=True)
    logged_flights = [
        (row, folder / log) for row, log in zip(summary.worst, worst_flight_logs(summary.worst), strict=True) if log
    ]
    for path in set(_worst_flight_logs(folder)) - {log for _, log in logged_flights}:
        path.unlink()
    for count, (row, log) in enumerate(logged_flights):
        if not log.exists():
            fly_row_again(base, row, log)
        if advance is not None:
            advance(count + 1.0, float(len(logged_flights)), f"flight {row.draw.index}")
    write_atomically(folder / "summary.json", summary_json(summary))
    write_atomically(folder / "report.html", campaign_page(base, summary, store, command))


# Maximum number of differing columns that the message on a repeated flight names.
_MAX_NAMED_COLUMNS = 5


def fly_row_again(base: CampaignBase, row: FlightRow, log: Path) -> FlightRow:
    """Repeat a flight of the table, record it in a log, and return the new row.

    Raises PlanflyError if the rows differ, because another machine or other code computed the stored row.
    """
    new_row = fly_one(base, row.draw.index, log=log)
    if columns := differing_columns(row, new_row):
        names = ", ".join(columns[:_MAX_NAMED_COLUMNS]) + (", ..." if len(columns) > _MAX_NAMED_COLUMNS else "")
        message = (
            f"{log}: flight {row.draw.index} differs from the stored flight, which another machine or code computed;"
            f" differing columns: {names}"
        )
        raise PlanflyError(message, file=log, field="flight", value=row.draw.index)
    return new_row


# ----------------------------------------------------------------------
# Write the data, picture and page of a go/no-go chart.

# Schema of ``winds.json``.
WINDS_SCHEMA = "planfly.winds/2"
# Style of the page's answer, by the answer.
_ANSWER_STYLES: dict[WindsAnswer, AnswerStyle] = {
    "judged": "",
    "not flyable": "missed",
    "not judged in full": "undecided",
    "not judged": "undecided",
}
# Explanation of the boundary on the page.
_BOUNDARY_EXPLANATION = (
    "The boundary is the wind in which the mission is flyable with the requested probability. For each direction, a"
    " regression on the wind and on the drawn quantities is fitted to every failure mode (a rule at a place). Two"
    " models of the residuals have the same prior probability: a normal distribution, and a Gumbel distribution with a"
    " longer tail. The regressions give the fraction of all draws that fails in a wind. If no flight failed, one such"
    " distribution is fitted to the wind alone. The interval is taken from the posterior distribution of the boundary."
)


def chart_directions(winds: WindsResult) -> list[ChartDirection]:
    """Return the directions of the go/no-go chart, each with its boundary and its flights."""
    directions, reasons = [], winds.reasons
    for number, boundary in enumerate(winds.boundaries):
        counts: dict[float, list[bool]] = {}
        for direction, speed, flyable in winds.flights:
            if direction == number:
                counts.setdefault(speed, []).append(flyable)
        marks = tuple((speed, len(outcomes), sum(outcomes)) for speed, outcomes in sorted(counts.items()))
        directions.append(
            ChartDirection(
                winds.from_deg(number),
                boundary.estimate,
                boundary.low,
                boundary.high,
                boundary.is_beyond_search,
                marks,
                is_judged=not reasons[number],
            )
        )
    return directions


def write_winds(folder: Path, base: CampaignBase, winds: WindsResult, command: str) -> None:
    """Write the files of a search for winds: ``winds.json``, ``winds.png`` and ``winds.html``.

    command: the command line that repeats the search, for the page.
    """
    goal, directions, reasons = winds.goal, chart_directions(winds), winds.reasons
    wind = base.scenario.wind
    scenario_wind = (wind.speed, math.degrees(wind.from_course)) if wind.speed else None
    figure = draw_go_no_go(directions, goal.most, goal.target, goal.confidence, base.name, scenario_wind)
    rows = [
        (
            f"{direction.from_deg:g}°",
            _speed_text(direction.boundary, goal.most) if is_estimated else "not judged",
            _interval_text(direction.low, direction.high, goal.most) if is_estimated else "",
            str(direction.flight_count),
            RULE_WORDS[rule].title if rule else "",
            f"no: {reason}" if reason else "yes",
        )
        for direction, rule, reason, is_estimated in zip(
            directions, _deciding_rules(winds), reasons, winds.estimated, strict=True
        )
    ]
    # Failures in the weakest wind.
    calm_data = None
    if (calm := winds.calm) is not None:
        calm_data = {
            "speed_mps": round(calm.speed, 3),
            "flights": calm.flights,
            "not_flyable": calm.failed_count,
            "failed_by_rule": failures_document(calm.by_rule),
        }
    data = {
        "schema": WINDS_SCHEMA,
        "name": base.name,
        "seed": base.seed,
        "target": goal.target,
        "answer": winds.answer,
        "reason": next(iter(_unjudged_lines(winds)), ""),
        "confidence": goal.confidence,
        "most": goal.most,
        "flights": len(winds.flights),
        "lost": list(winds.lost),
        "directions": [
            {
                "from_deg": direction.from_deg,
                "boundary_mps": round(direction.boundary, 3),
                "interval_mps": [round(direction.low, 3), round(direction.high, 3)],
                "beyond": direction.is_beyond_search,
                "flown_bounds_mps": [None if speed is None else round(speed, 3) for speed in winds.flown_bounds[k]],
                "judged": winds.judged[k],
                "reason": reasons[k],
                "flown": [
                    {"speed_mps": round(speed, 3), "flights": count, "flyable": flyable}
                    for speed, count, flyable in direction.flights
                ],
                "failed_by_rule": failures_document(winds.failures[k]) if winds.failures else [],
            }
            for k, direction in enumerate(directions)
        ],
        "calm": calm_data,
        "spread": base.dispersions.to_json(),
        "conditions": None if winds.conditions is None else asdict(winds.conditions),
    }
    picture = png_bytes(figure)
    titles = ("wind from", "boundary", "interval", "flights", "fails most often", "judged")
    page = AnswerPage(
        command_name="winds",
        name=base.name,
        heading="wind in which it is flyable",
        style=_ANSWER_STYLES[winds.answer],
        lines=wind_lines(winds),
        figures=[(figure, "Go/no-go chart: wind from each direction")],
        tables=[PageTable([(title, "n") for title in titles], rows)],
        explanation=[_BOUNDARY_EXPLANATION],
        command=command,
    ).render()
    write_atomically(folder / "winds.json", json.dumps(data, indent=1, allow_nan=False) + "\n")
    write_atomically(folder / "winds.png", picture)
    write_atomically(folder / "winds.html", page)


def _speed_text(speed: float, max_speed: float) -> str:
    """Return a boundary as text, such as "9.5 m/s", or "over 20 m/s" at the maximum wind of the search.

    speed, max_speed: boundary and maximum wind, m/s.
    """
    return f"over {max_speed:g} m/s" if speed >= max_speed - 1e-9 else f"{speed:.1f} m/s"


def _interval_text(lower: float, upper: float, max_speed: float) -> str:
    """Return an interval of the boundary as text, such as "9.1 to 9.9".

    At the maximum wind it is "9.1 to over 20".

    lower, upper, max_speed: m/s.
    """
    if lower >= max_speed - 1e-9:
        return f"over {max_speed:g}"
    return f"{lower:.1f} to {f'over {max_speed:g}' if upper >= max_speed - 1e-9 else f'{upper:.1f}'}"


def _unjudged_lines(winds: WindsResult) -> list[str]:
    """Return lines on the directions of a search that are not judged, and on the reasons.

    Return [] if all are judged.
    """
    reasons = winds.reasons
    word, total = "not judged" if all(reasons) else "not judged in full", len(reasons)
    lines = []
    if winds.undecided and any(reasons):
        _, first_text = winds.undecided[0]
        lines.append(
            f"{word}: {len(winds.undecided)} of {count_text(len(winds.flights), 'flight')} are not judged in full;"
            f" first reason: {first_text}"
        )
    all_counts = zip(winds.flight_counts(), winds.undecided_counts(), reasons, strict=True)
    counts = [count for count, undecided_count, reason in all_counts if reason and not undecided_count]
    if not counts or winds.is_only_calm:
        return lines
    unsettled_count = len(counts)
    directions_text = f"{count_text(total, 'direction')} {'has' if unsettled_count == 1 else 'have'}"
    flights_text = count_range_text(counts, "flight")
    max_width = 2.0 * BOUNDARY_ACCURACY_MPS
    return [
        *lines,
        f"{word}: {unsettled_count} of {directions_text} too few flights ({flights_text}); each direction requires"
        f" {MIN_FLIGHTS_PER_DIRECTION} flights and an interval of at most {max_width:g} m/s. With fewer flights,"
        " the interval depends mostly on assumptions",
    ]


def _deciding_rules(winds: WindsResult) -> list[str]:
    """Return, for each direction, the rule that fails the most flights up to its boundary; "" for none."""
    return [deciding_rule(by_rule) for by_rule in winds.failures] or [""] * len(winds.boundaries)


def _flown_bound_lines(winds: WindsResult) -> list[str]:
    """Return lines on the directions without a stated boundary.

    They state the strongest wind without and the weakest wind with a failure.

    Neighbouring directions with the same text share a line.  Returns [] if all boundaries are stated, or if only calm
    air was flown.
    """
    if winds.is_only_calm or all(winds.estimated):
        return []
    texts: list[str | None] = []
    # Strongest wind without a failure up to it, and weakest wind with a failure; None without one.
    for is_estimated, (flyable, failed) in zip(winds.estimated, winds.flown_bounds, strict=True):
        if is_estimated:
            texts.append(None)
        else:
            parts = [] if flyable is None else [f"no failure up to {flyable:.1f} m/s"]
            parts += [] if failed is None else [f"weakest failure at {failed:.1f} m/s"]
            texts.append(", ".join(parts) or "not enough flights")
    counts = winds.flight_counts()
    left_out = {*winds.lost, *(number for number, _ in winds.undecided)}
    failed_counts = Counter(
        direction
        for number, (direction, _, is_flyable) in enumerate(winds.flights)
        if not is_flyable and number not in left_out
    )
    lines = ["directions in which the boundary is not proven, with their own flights:"]
    for text, group in groupby(range(len(texts)), key=lambda number: texts[number]):
        if text is not None:
            numbers = list(group)
            last = f" to {winds.from_deg(numbers[-1]):g}°" if len(numbers) > 1 else ""
            flights = count_text(sum(counts[number] for number in numbers), "flight")
            failed_count = sum(failed_counts[number] for number in numbers)
            lines.append(f"  from {winds.from_deg(numbers[0]):g}°{last}: {text} ({failed_count} of {flights} failed)")
    return lines


def _boundary_lines(winds: WindsResult) -> list[str]:
    """Return a list with one line on the lowest and the highest boundary of a search.

    Return [] if no boundary is stated.
    """
    directions = [
        direction
        for direction, is_estimated in zip(chart_directions(winds), winds.estimated, strict=True)
        if is_estimated
    ]
    if not directions:
        return []
    lowest = min(directions, key=lambda direction: (direction.boundary, direction.low))
    highest = max(directions, key=lambda direction: direction.boundary)
    target, max_speed, percent = winds.goal.target, winds.goal.most, f"{100 * winds.goal.confidence:g} %"
    lowest_text, highest_text = (_speed_text(direction.boundary, max_speed) for direction in (lowest, highest))
    if lowest.boundary >= CALM_MPS:
        best_text = ""
        if highest_text != lowest_text:
            best_text = f"; highest: {highest_text} from {highest.from_deg:g}°"
        return [
            f"by the best estimate, flyable with a probability of at least {target:g} in wind up to"
            f" {lowest_text} from the worst direction,"
            f" {lowest.from_deg:g}° ({_interval_text(lowest.low, lowest.high, max_speed)} m/s at {percent}){best_text}"
        ]
    if highest.boundary < CALM_MPS:
        basis = "" if winds.fails_in_calm_air else "by the best estimate, "
        return [f"{basis}not flyable with a probability of at least {target:g} even in calm air"]
    return [
        f"by the best estimate, not flyable with a probability of at least {target:g} even in light wind from"
        f" {lowest.from_deg:g}°;"
        f" from {highest.from_deg:g}°, flyable in wind up to {highest_text}"
    ]


def wind_lines(winds: WindsResult) -> list[str]:
    """Return the result of a search for winds as a few lines of text."""
    percent = f"{100 * winds.goal.confidence:g} %"
    answer_lines = [*_unjudged_lines(winds), *_boundary_lines(winds)]
    if winds.answer == "not flyable":
        # Failures in calm air answer the question, whatever the directions show.
        answer_lines.reverse()
    flights_text = count_text(len(winds.flights), "flight")
    if winds.is_only_calm:
        flights_text += " in calm air only, because none of them is flyable"
    elif any(winds.estimated):
        flights_text += f"; intervals at {percent}, from the flights in each direction"
    calm = winds.calm
    calm_lines = []
    if calm is not None and calm.failed_count:
        wind = "calm air" if calm.speed < CALM_MPS else f"{calm.speed:.1f} m/s, the weakest wind flown"
        calm_lines = [
            f"in {wind}, {calm.failed_count} of {count_text(calm.flights, 'flight')} fail",
            *failure_lines(calm.by_rule),
        ]
    directions_by_rule: dict[str, list[str]] = {}
    first = 0
    for rule, group in groupby(_deciding_rules(winds)):
        last = first + len(list(group)) - 1
        text = f"{winds.from_deg(first):g}°" + (f" to {winds.from_deg(last):g}°" if last > first else "")
        directions_by_rule.setdefault(rule, []).append(text)
        first = last + 1
    directions_by_rule.pop("", None)
    deciding_lines = []
    if directions_by_rule:
        texts = (f"{RULE_WORDS[rule].title} from {', '.join(texts)}" for rule, texts in directions_by_rule.items())
        deciding_lines = [f"most frequent failure in winds up to the boundary: {'; '.join(texts)}"]
    # The probability of success that is proven by the flights in the maximum wind of the directions in which no flight
    # failed.
    max_speed = winds.goal.most
    counts_at_max = Counter(direction for direction, speed, _ in winds.flights if speed == max_speed)
    failed_directions = {direction for direction, _, flyable in winds.flights if not flyable}
    counts = [counts_at_max[k] for k in range(len(winds.boundaries)) if k not in failed_directions and counts_at_max[k]]
    lines_without_failures = []
    if counts:
        probability_text = f"{lower_bound(Tally(min(counts), 0), winds.goal.confidence):.3g}"
        lines_without_failures = [
            f"in {len(counts)} of {count_text(len(winds.boundaries), 'direction')} no flight failed: at least"
            f" {count_text(min(counts), 'flight')} in {max_speed:g} m/s from each of them show a probability of at"
            f" least {probability_text}"
        ]
    lost_lines = []
    if winds.lost:
        flight_texts = ", ".join(
            f"{number} ({winds.flights[number][1]:.1f} m/s from {winds.from_deg(winds.flights[number][0]):g}°)"
            for number in winds.lost[:10]
        )
        lost_lines = [
            f"lost      {count_text(len(winds.lost), 'flight')} could not be flown, because their workers died, and"
            f" count as not flyable: {flight_texts}"
        ]
    return [
        *answer_lines,
        *calm_lines,
        *_flown_bound_lines(winds),
        *(() if winds.conditions is None else flown_condition_lines(winds.conditions)),
        *deciding_lines,
        *lines_without_failures,
        *lost_lines,
        flights_text,
    ]


def winds_suite(name: str, winds: WindsResult) -> JunitSuite:
    """Return the JUnit suite of a search for winds: a case for its answer, and one for each direction.

    name: mission of the search.

    The answer fails unless it is "judged".  A direction that is not judged is skipped.  A direction fails if the
    mission is not flyable there even in calm air.
    """
    lines, reasons = wind_lines(winds), winds.reasons
    cases = [answer_case("" if winds.answer == "judged" else lines[0])]
    for direction, reason in zip(chart_directions(winds), reasons, strict=True):
        case = JunitCase("planfly.winds", f"from {direction.from_deg:g}°")
        if reason:
            case = case._replace(result="skipped", message=f"not judged: {reason}")
        elif direction.boundary < CALM_MPS:
            message = f"not flyable with a probability of at least {winds.goal.target:g} even in calm air"
            case = case._replace(result="failure", message=message)
        else:
            case = case._replace(text=f"wind up to {_speed_text(direction.boundary, winds.goal.most)}")
        cases.append(case)
    return JunitSuite(name, cases, "\n".join(lines))


# ----------------------------------------------------------------------
# Finish a campaign.


def finish_campaign(
    base: CampaignBase, goal: Goal, estimate: Estimate, folder: Path, command: str, advance: Advance | None = None
) -> CampaignSummary:
    """Summarise a campaign from the table in its folder, and write its files.

    The table must not be locked.

    command: the command line that repeats the campaign, for the report.
    Raises a `world.errors.PlanflyError`, or OSError for a full disk.
    """
    with open_store(base, goal, folder, resume=True) as store:
        summary = summarise_campaign(base, goal, estimate, store)
        write_files(folder, base, summary, store, command, advance)
    return summary
