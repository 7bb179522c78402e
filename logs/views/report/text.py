"""Format the comparison of an imported flight with its simulation, and other tables of text."""

import math
from collections.abc import Sequence

from flight.simulation.setup import MissionStretch
from logs.verdict.imported.model_comparison import Reflight
from world.wording import format_number

_QUANTITY_NAMES = {
    "cross_track": "cross-track",
    "height_error": "height",
    "ground_speed": "ground speed",
    "bank": "bank",
}
_HEAD = ("", "cross-track (m)", "height (m)", "ground speed (m/s)", "bank (deg)", "energy (Wh)")


def refly_lines(reflight: Reflight) -> list[str]:
    """Return tables of legs and turns, as flown and as simulated, and the fit of the model, as lines.

    >>> from flight.simulation.setup import MissionStretch
    >>> from logs.recording.example_log import example_log
    >>> from logs.verdict.imported.flown_legs import flown_legs
    >>> from logs.verdict.imported.model_comparison import compare_with_model
    >>> log = example_log()
    >>> flown = flown_legs(log.setup, log.track, MissionStretch(0.0, 36.5, "AUTO", "log"))
    >>> again = compare_with_model(log.setup, flown, log.track, "completed")
    >>> refly_lines(again)[0]
    'AUTO from 0.0 s to 36.5 s, legs 0 to 1: flown / simulated'
    """
    route = reflight.setup.route
    leg_numbers, stops = route.leg_numbers.tolist(), route.stops.tolist()
    leg_table: list[tuple[str, ...]] = [_HEAD]
    for pair in reflight.legs:
        numbers = (pair.cross_track, pair.height_error, pair.ground_speed, pair.bank, pair.energy)
        leg_table.append((f"leg {leg_numbers[pair.leg - reflight.first]}", *map(_format_pair, numbers)))
    turn_table: list[tuple[str, ...]] = [("", "overshoot (m)", "bank (deg)", "nearest pass (m)")]
    for turn in reflight.turns:
        name = f"waypoint {stops[turn.waypoint - reflight.first]} ({turn.turn:+.1f}°)"
        turn_table.append((name, *map(_format_pair, (turn.overshoot, turn.bank, turn.passed))))
    stretch = reflight.stretch
    stretch_text = f"{stretch.mode or 'the flight'} from {stretch.start:.1f} s to {stretch.end:.1f} s"
    legs_text = f", legs {leg_numbers[0]} to {leg_numbers[len(reflight.legs) - 1]}"
    lines = [f"{stretch_text}{legs_text}: flown / simulated", *format_columns(leg_table)]
    if reflight.turns:
        lines += ["", *format_columns(turn_table)]
    return [*lines, "", describe_model_trust(reflight)]


def describe_model_trust(reflight: Reflight) -> str:
    """Return a line on how far an imported flight differs from its simulation by a model."""
    model = reflight.setup.aircraft
    model_text = f"{model}, used because no aircraft was named," if reflight.stands_in else model
    if not reflight.spreads:
        return f"Model and flight have no part in common: it is unknown how far {model_text} can be trusted"
    spread_texts = [
        f"{_QUANTITY_NAMES[spread.name]} {format_number(spread.median)} {spread.unit}"
        f" ({format_number(spread.percentile_95)} {spread.unit})"
        for spread in reflight.spreads
    ]
    end_text = "" if reflight.ended == "completed" else f"; the simulated flight ended early: {reflight.ended}"
    wind = reflight.setup.scenario.wind
    gust_text = "no gusts" if wind.turbulence == "none" else f"{wind.turbulence} turbulence"
    wind_text = f" in {wind.speed:.1f} m/s of wind, {gust_text}"
    head = f"Median difference (95 %) between the flight and model {model_text}{wind_text}"
    return f"{head}: {', '.join(spread_texts)}{end_text}"


def list_not_reflown(reflights: Sequence[Reflight], stretches: Sequence[MissionStretch], max_count: int) -> list[str]:
    """Return a line for each stretch of an imported flight that was not simulated, with the reason.

    A stretch is a period in which the flight followed its mission.

    reflights: simulations, each of one stretch.
    stretches: all stretches of the imported flight.
    max_count: largest number of stretches that are simulated.

    >>> list_not_reflown((), (MissionStretch(50.0, 60.0, "AUTO", "log"),), 9)
    ['Not flown again: AUTO from 50.0 s to 60.0 s: it did not pass two waypoints in order']
    """
    compared_starts = {reflight.stretch.start for reflight in reflights}
    lines = []
    for stretch in stretches:
        if stretch.start not in compared_starts:
            reason = "it did not pass two waypoints in order"
            if len(reflights) >= max_count:
                reason += f", or {max_count} longer stretches were flown again"
            name = stretch.mode or "the flight"
            lines.append(f"Not flown again: {name} from {stretch.start:.1f} s to {stretch.end:.1f} s: {reason}")
    return lines


def _format_pair(pair: tuple[float, float]) -> str:
    """Format a flown and a simulated value as "flown / simulated", with "-" for NaN."""
    return " / ".join("-" if math.isnan(value) else f"{value:.1f}" for value in pair)


def format_columns(rows: Sequence[tuple[str, ...]]) -> list[str]:
    """Return a line for each row of a table, with the first column aligned left and all others right.

    rows: cells of each row; all rows have the same number of cells.
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for first_cell, *cells in rows:
        right_cells = [cell.rjust(width) for cell, width in zip(cells, widths[1:], strict=True)]
        lines.append("  ".join([first_cell.ljust(widths[0]), *right_cells]))
    return lines
