"""A flight of the field against the model's, in words: legs, turns, and how far the model can be trusted."""

import math
from collections.abc import Sequence

from flight.simulation.field_source import MissionStretch
from logs.report.text import number
from logs.verdict.field.model_comparison import Reflight

_CALLED = {"cross_track": "cross-track", "height_error": "height", "ground_speed": "ground speed", "bank": "bank"}
_HEAD = ("", "cross-track (m)", "height (m)", "ground speed (m/s)", "bank (deg)", "energy (Wh)")


def refly_lines(again: Reflight) -> list[str]:
    """Tables of legs and turns, each number as flown and as simulated, and how far the model can be trusted.

    >>> from flight.simulation.field_source import MissionStretch
    >>> from logs.recording.example_log import example_log
    >>> from logs.verdict.field.flown_legs import flown_legs
    >>> from logs.verdict.field.model_comparison import compare_with_model
    >>> log = example_log()
    >>> flown = flown_legs(log.setup, log.track, MissionStretch(0.0, 36.5, "AUTO", "log"))
    >>> again = compare_with_model(log.setup, flown, log.track, "completed")
    >>> refly_lines(again)[0]
    'AUTO from 0.0 s to 36.5 s, legs 0 to 1: flown / simulated'
    """
    legs: list[tuple[str, ...]] = [_HEAD]
    for one in again.legs:
        numbers = (one.cross_track, one.height_error, one.ground_speed, one.bank, one.energy)
        legs.append((f"leg {one.leg}", *map(_both, numbers)))
    turns: list[tuple[str, ...]] = [("", "overshoot (m)", "bank (deg)", "nearest pass (m)")]
    for turn in again.turns:
        name = f"waypoint {turn.waypoint} ({turn.turn:+.1f}°)"
        turns.append((name, *map(_both, (turn.overshoot, turn.bank, turn.passed))))
    stretch = again.stretch
    named = f"{stretch.mode or 'the flight'} from {stretch.start:.1f} s to {stretch.end:.1f} s"
    of = f", legs {again.first} to {again.first + len(again.legs) - 1}"
    lines = [f"{named}{of}: flown / simulated", *_in_columns(legs)]
    if again.turns:
        lines += ["", *_in_columns(turns)]
    return [*lines, "", trust_line(again)]


def trust_line(again: Reflight) -> str:
    """How far the model can be trusted on this aircraft, in a line."""
    model = again.setup.aircraft
    whose = f"{model}, which stands in for an aircraft that is not named," if again.stands_in else model
    if not again.spreads:
        return f"Model and flight have no place in common: nothing is known of how far {whose} can be trusted"
    words = [
        f"{_CALLED[one.name]} {number(one.median)} {one.unit} ({number(one.most)} {one.unit})" for one in again.spreads
    ]
    ended = "" if again.ended == "completed" else f"; the simulated flight ended early: {again.ended}"
    wind = again.setup.scenario.wind
    gusts = "no gusts" if wind.turbulence == "none" else f"{wind.turbulence} turbulence"
    blown = f" in {wind.speed:.1f} m/s of wind, {gusts}"
    return f"Model {whose}{blown}, against the flight, median (95 %): {', '.join(words)}{ended}"


def left_lines(agains: Sequence[Reflight], stretches: Sequence[MissionStretch], flown_again: int) -> list[str]:
    """Which stretches were not flown again, and why.

    stretches: of the flight of the field.  flown_again: the most that are.

    >>> left_lines((), (MissionStretch(50.0, 60.0, "AUTO", "log"),), 9)
    ['Not flown again: AUTO from 50.0 s to 60.0 s: it passed no two waypoints in order']
    """
    compared = {again.stretch.start for again in agains}
    lines = []
    for stretch in stretches:
        if stretch.start not in compared:
            why = "it passed no two waypoints in order"
            if len(agains) >= flown_again:
                why += f", or {flown_again} longer ones were"
            name = stretch.mode or "the flight"
            lines.append(f"Not flown again: {name} from {stretch.start:.1f} s to {stretch.end:.1f} s: {why}")
    return lines


def _both(pair: tuple[float, float]) -> str:
    return " / ".join("-" if math.isnan(value) else f"{value:.1f}" for value in pair)


def _in_columns(rows: Sequence[tuple[str, ...]]) -> list[str]:
    wide = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return [
        "  ".join([row[0].ljust(wide[0]), *(cell.rjust(size) for cell, size in zip(row[1:], wide[1:], strict=True))])
        for row in rows
    ]
