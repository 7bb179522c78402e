"""Describe the result of a search for a departure window in lines."""

import math
from datetime import datetime

from logs.verdict.rule_words import RULE_WORDS
from planfly.campaigns.find_window import Departure, WindowResult

# Format of a time of take-off.
TIME_FORMAT = "%Y-%m-%d %H:%M"


def answer_line(result: WindowResult) -> str:
    """Return the answer in one line: the asked departure, or the windows."""
    goal, asked = result.goal, result.asked
    windows = ", ".join(_window_text(*window) for window in result.windows)
    open_text = f"open {windows} UTC" if windows else "no departure is open"
    if asked is None:
        return f"{open_text}{_best_text(result)}"
    subject = f"take-off at {asked.time:{TIME_FORMAT}} UTC"
    if result.is_open(asked) is None:
        return f"{subject}: not judged: {asked.not_judged}"
    counts = f"{asked.flyable} of {len(asked.rows)} flights are flyable"
    if result.is_open(asked):
        return f"{subject}: go: {counts}; {open_text}"
    return f"{subject}: no go: {counts}, {goal.probability:g} is asked for; {open_text}{_best_text(result)}"


def _window_text(first: datetime, last: datetime) -> str:
    """Return a window as text; the last time without its date if it is the same day."""
    if first == last:
        return f"{first:{TIME_FORMAT}}"
    return f"{first:{TIME_FORMAT}} to {last:{'%H:%M' if first.date() == last.date() else TIME_FORMAT}}"


def _best_text(result: WindowResult) -> str:
    """Return a clause that names the best departure if none is open; "" otherwise."""
    best = result.best
    if result.windows or best is None or not best.flyable:
        return ""
    return f"; the best is {best.time:{TIME_FORMAT}} UTC with {best.flyable} of {len(best.rows)}"


def window_lines(result: WindowResult) -> list[str]:
    """Return a table with a line for each departure."""
    lines = ["take-off, UTC     flyable   95 % interval  wind at the start   least energy  decided by"]
    return [*lines, *(_departure_line(departure) for departure in result.departures)]


def _departure_line(departure: Departure) -> str:
    """Return the line of a departure."""
    start = f"{departure.time:{TIME_FORMAT}}"
    if not departure.rows:
        return f"{start}  not judged: {departure.not_judged}"
    speed, from_deg = departure.wind
    energy = "not known" if math.isnan(departure.energy_left) else f"{max(0.0, departure.energy_left):.0f} Wh left"
    low, high = departure.interval
    rule = RULE_WORDS[departure.rule].title.lower() if departure.rule else ""
    count = f"{departure.flyable}/{len(departure.rows)}"
    wind = f"{speed:.1f} m/s from {from_deg:.0f}"
    return f"{start}  {count:>8}  {low:5.0%} to {high:4.0%}   {wind:<18}  {energy:>12}  {rule}".rstrip()
