"""Describe the result of a search for a departure window in lines."""

import math

from logs.verdict.rule_words import RULE_WORDS
from logs.verdict.wording import energy_left_text
from planfly.campaigns.find_window import Departure, WindowResult

# Format of a time of take-off.
TIME_FORMAT = "%Y-%m-%d %H:%M"


def answer_line(result: WindowResult) -> str:
    """Return the answer in one line: go, no go or not judged for a requested departure, and all windows.

    The number of flyable flights is stated for a departure that was flown.
    """
    goal, departure = result.goal, result.asked
    window_texts = []
    for first, last in result.windows:
        # The date is not repeated if the window ends on the same day.
        end_format = "%H:%M" if first.date() == last.date() else TIME_FORMAT
        end_text = " only" if first == last else f" to {last:{end_format}}"
        window_texts.append(f"{first:{TIME_FORMAT}}{end_text}")
    windows = ", ".join(window_texts)
    open_text = f"take-off windows (UTC): {windows}" if windows else "no take-off time is flyable"
    if departure is None:
        unknown_text = ", but not judged in full" if windows and result.is_go is None else ""
        return f"{open_text}{unknown_text}{_best_text(result)}"
    subject = f"take-off at {departure.time:{TIME_FORMAT}} UTC"
    if result.is_open(departure) is None:
        return f"{subject}: not judged: {departure.not_judged}"
    counts = f"{departure.flyable} of {len(departure.rows)} flights are flyable"
    if result.is_go is None:
        return f"{subject}: not judged in full: {counts}, {departure.undecided} are not judged in full; {open_text}"
    if result.is_open(departure):
        return f"{subject}: go, {counts}; {open_text}"
    required_text = f"less than the required {100.0 * goal.probability:g} %"
    return f"{subject}: no go, {counts}, {required_text}; {open_text}{_best_text(result)}"


def _best_text(result: WindowResult) -> str:
    """Return a clause that names the best departure if none is open; "" otherwise."""
    best = result.best
    if result.windows or best is None or not best.flyable:
        return ""
    return f"; the best is {best.time:{TIME_FORMAT}} UTC with {best.flyable} of {len(best.rows)} flights flyable"


def unjudged_lines(result: WindowResult) -> list[str]:
    """Return one line on the rules that are not judged in some flights, each with its first reason.

    Return [] without any.
    """
    texts: dict[str, str] = {}
    for departure in result.departures:
        for row in departure.rows:
            texts = dict(row.unjudged) | texts
    return [f"Not judged: {'; '.join(texts.values())}"] if texts else []


# Columns of the table of departures after the time of take-off.
DEPARTURE_COLUMNS = ("flyable", "95 % interval", "wind at the start", "least energy", "decided by")


def departure_cells(departure: Departure) -> tuple[str, ...]:
    """Return a departure's cells for `DEPARTURE_COLUMNS`; a single cell with the reason if not flown."""
    if not departure.rows:
        return (f"not judged: {departure.not_judged}",)
    speed, from_deg = departure.wind
    low, high = departure.interval
    return (
        f"{departure.flyable}/{len(departure.rows)}",
        f"{low:.0%} to {high:.0%}",
        f"{speed:.1f} m/s from {from_deg:.0f}",
        "not known" if math.isnan(departure.energy_left) else energy_left_text(departure.energy_left),
        rules_text(departure),
    )


def rules_text(departure: Departure) -> str:
    """Return the titles of the rules that fail the most flights of a departure; "" without failures."""
    return ", ".join(RULE_WORDS[rule].title.lower() for rule in departure.rules)


def window_lines(result: WindowResult) -> list[str]:
    """Return a table with a line for each departure."""
    lines = ["take-off, UTC     flyable   95 % interval  wind at the start   least energy  decided by"]
    for departure in result.departures:
        start = f"{departure.time:{TIME_FORMAT}}"
        cells = departure_cells(departure)
        widths = (">8", ">13", "<18", ">12", "") if departure.rows else ("",)
        lines.append(
            "  ".join([start, *(f"{cell:{width}}" for cell, width in zip(cells, widths, strict=True))]).rstrip()
        )
    return lines
