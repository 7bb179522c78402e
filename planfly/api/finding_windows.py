"""Find the times of take-off at which a mission is flyable in a weather forecast."""

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Unpack

from planfly.api.api_function import api_function
from planfly.api.campaigns import answer_command_line, make_workers, open_sample
from planfly.arguments import check_arguments
from planfly.campaigns.campaign_base import CampaignBase
from planfly.campaigns.find_window import (
    DEFAULT_PROBABILITY,
    DEFAULT_SPAN,
    MAX_DEPARTURES,
    WindowGoal,
    WindowResult,
    departure_times,
    find_window,
    last_departure,
)
from planfly.flight_options import WindowOptions
from planfly.kernel_units.unit_kernels import PLANNING_AND_FLYING
from planfly.runtime.stages import stage
from planfly.workflow.output_paths import check_output_folder, replace_files
from planner.plan import Plan
from world.errors import ArgumentError, ForecastError
from world.extras import requires_extra

_STEP = re.compile(r"(\d+(?:\.\d+)?)\s*(min|h)")
_MIN_STEP = timedelta(minutes=1)
_MAX_STEP = timedelta(hours=24)


@requires_extra("campaigns")
@api_function(*PLANNING_AND_FLYING)
def window(
    target: Plan | str | Path,
    *,
    earliest: str | None = None,
    latest: str | None = None,
    every: str = "1h",
    probability: float = DEFAULT_PROBABILITY,
    out: str | Path | None = None,
    overwrite: bool = True,
    **options: Unpack[WindowOptions],
) -> WindowResult:
    """Find the times of take-off at which a mission is flyable in a weather forecast.

    For each time a small campaign is flown, whose flights vary as in `planfly.campaign`.

    target: a built-in scenario's name, a scenario's TOML file, a `Plan`, or a plan.json, .waypoints or .plan file.
    forecast: file of the forecast; None for the forecast of the scenario.
    at: intended time of take-off, in ISO 8601 with its offset from UTC; None if there is no intended time.
    earliest: first time of take-off; None for the intended time.
    latest: last time of take-off; None for 24 hours later, or the last time from which the forecast covers the flight.
    every: time between two departures, such as "30min" or "1h".
    probability: lowest probability of a flyable flight at which a departure is open.
    out: folder for ``window.png`` and ``report.html``; None writes no files.  overwrite: True replaces existing files.
    flights: number of flights of each departure.
    spread, seed, workers, scheduler: see `planfly.campaign`.  For the other options, see `planfly.fly`.
    A script must call this function under ``if __name__ == "__main__":``, because workers import the script.
    Raises a `planfly.PlanflyError` for bad input, which is also a ValueError for a number out of its range.

    >>> window("paper-07", earliest="2026-05-01T06:00Z", every="now")
    Traceback (most recent call last):
    ...
    world.errors.ArgumentError: every now: expected a time such as 30min or 1h, from 1min to 24h
    """
    check_arguments(probability=probability, window_flights=options["flights"])
    match, step = _STEP.fullmatch(every.strip()), timedelta(0)
    if match is not None:
        number = float(match.group(1))
        step = timedelta(minutes=number) if match.group(2) == "min" else timedelta(hours=number)
    if not _MIN_STEP <= step <= _MAX_STEP:
        raise ArgumentError.of_argument("every", every, "expected a time such as 30min or 1h, from 1min to 24h")
    times: list[datetime | None] = []
    for name, text in (("at", options["at"]), ("earliest", earliest), ("latest", latest)):
        time = None
        with suppress(ValueError):
            time = None if text is None else datetime.fromisoformat(text)
        if text is not None and (time is None or time.tzinfo is None):
            allowed = "expected a time in ISO 8601 format with its offset from UTC, such as 2026-05-01T10:00+02:00"
            raise ArgumentError.of_argument(name, text, allowed)
        times.append(None if time is None else time.astimezone(UTC))
    departure, first, last = times[0], times[1] or times[0], times[2]
    if out is not None:
        check_output_folder(Path(out), overwrite)
    workers = make_workers(options["workers"], options["scheduler"], options["seed"])
    if first is None:
        allowed = "missing; state the first time of take-off, or `at` TIME"
        raise ArgumentError.of_argument("earliest", None, allowed, shown="")
    if last is not None and last < first:
        raise ArgumentError.of_argument("latest", latest, f"expected a time after {first.isoformat()}")
    base = _open_base(target, options, departure_times(first, last or first + DEFAULT_SPAN, step))
    end = last or last_departure(base, first)
    if (end - first) / step > MAX_DEPARTURES:
        raise ArgumentError.of_argument("every", every, f"expected at most {MAX_DEPARTURES} departures")
    zone = datetime.fromisoformat(options["at"] or earliest or "").tzinfo or UTC
    goal = WindowGoal(departure_times(first, end, step, departure), departure, probability, options["flights"], zone)
    with stage("flying", f"flying {len(goal.departures)} departures") as advance:
        result = find_window(base, goal, workers, advance)
    search_options = {"from": earliest, "to": latest, "every": every, "probability": probability}
    command = answer_command_line("window", target, base, options, search_options)
    if out is None:
        return result
    # Imported here: only pictures need matplotlib.
    from logs.views.drawing import png_bytes
    from planfly.campaigns.answer_pages import window_page
    from planfly.campaigns.window_chart import draw_window

    with stage("drawing", "drawing the departures"):
        figure = draw_window(result)
        contents = {"window.png": png_bytes(figure), "report.html": window_page(result, figure, command).render()}
    return replace(result, files=replace_files(Path(out), contents, overwrite=overwrite))


def _open_base(target: Plan | str | Path, options: WindowOptions, departures: Sequence[datetime]) -> CampaignBase:
    """Open the mission at the first departure (of at most `MAX_DEPARTURES`) that the forecast covers.

    Raises ArgumentError if no forecast is named.  If the forecast covers no departure, raises the ForecastError of the
    first departure.
    """
    errors: list[ForecastError] = []
    for departure in departures[:MAX_DEPARTURES]:
        try:
            base = open_sample(target, {**options, "at": departure.isoformat()})
        except ForecastError as error:
            errors.append(error)
            # Only these errors depend on the departure.
            if error.field in ("time", "wind at the start"):
                continue
            break
        if base.scenario.wind.forecast is None:
            allowed = "missing; a window needs a forecast: name its file here, or in [wind] of the scenario"
            raise ArgumentError.of_argument("forecast", None, allowed, shown="")
        return base
    raise errors[0]
