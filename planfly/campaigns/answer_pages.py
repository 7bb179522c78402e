"""Make the pages of a departure window, a battery and a ground risk."""

from datetime import UTC, timedelta

from markupsafe import Markup
from matplotlib.figure import Figure

from logs.verdict.conditions import flown_condition_lines
from planfly.campaigns import battery_text, ground_risk_text, window_text
from planfly.campaigns.find_battery import BatteryResult
from planfly.campaigns.find_ground_risk import GroundRiskResult
from planfly.campaigns.find_window import WindowResult
from planfly.campaigns.page import STYLES, AnswerPage, ColumnStyle, PageTable
from world.wording import count_text


def window_page(result: WindowResult, figure: Figure, command: str) -> AnswerPage:
    """Return the page of a take-off window: the chart, and a table of all departures.

    figure: chart of the departures.
    command: command line that repeats the search; "" without one.
    """
    local = result.goal.zone
    zones = (UTC,) if local.utcoffset(None) == timedelta(0) else (UTC, local)
    times: list[tuple[str, ColumnStyle]] = [(f"take-off, {zone.tzname(None)}", "u") for zone in zones]
    styles: tuple[ColumnStyle, ...] = ("n", "n", "u", "n", "")
    rows = [
        (
            *(f"{departure.time.astimezone(zone):{window_text.TIME_FORMAT}}" for zone in zones),
            *window_text.departure_cells(departure),
        )
        for departure in result.departures
    ]
    goal = result.goal
    return AnswerPage(
        command_name="window",
        name=result.base.name,
        heading="when it can take off",
        style=STYLES[result.is_go],
        lines=[
            window_text.answer_line(result),
            *window_text.unjudged_lines(result),
            *flown_condition_lines(result.base.conditions()),
        ],
        figures=[(figure, "Chart of the departures: flyable flights, wind and least energy")],
        tables=[PageTable([*times, *zip(window_text.DEPARTURE_COLUMNS, styles, strict=True)], rows)],
        explanation=[
            f"Each departure is flown {count_text(goal.flights, 'time')} with varied wind, aircraft, terrain and start."
            f" It is open if at least {goal.probability:.0%} of these flights are flyable. The interval is the"
            " Clopper-Pearson interval. A departure is decided by the rules that fail the most of its flights."
        ],
        command=command,
    )


def battery_page(result: BatteryResult, figure: Figure, command: str) -> AnswerPage:
    """Return the page of a battery search.

    It has the chart, a table of what decides the capacity, and the energy by leg.

    The capacity of a flight is decided by the end of the mission or by the simulated return to launch that has used
    more energy.

    figure: chart of the capacities.
    command: command line that repeats the search; "" without one.
    """
    goal = result.goal
    return AnswerPage(
        command_name="battery",
        name=result.base.name,
        heading="how large a battery it needs",
        style=STYLES[result.is_enough],
        lines=[
            battery_text.answer_line(result),
            *flown_condition_lines(result.base.conditions()),
            *battery_text.battery_lines(result),
        ],
        figures=[(figure, "Share of the flights that keep the reserve, by the capacity of the battery")],
        tables=[
            PageTable(
                [("decided by", ""), ("flights", "n"), ("share", "n")],
                battery_text.decision_rows(result),
                "What decides the battery",
            ),
            PageTable(
                [("leg", ""), ("energy, median", "n"), ("share", "n")], battery_text.leg_rows(result), "Energy by leg"
            ),
        ],
        explanation=[
            "A flight has used one energy at the end of its mission, and another at the end of its most expensive"
            " return to launch. The capacity that it needs is the larger of these two energies, divided by the usable"
            " fraction of the battery and by the drawn factor on its capacity. The found capacity is enough for"
            f" {goal.probability:.0%} of the flights."
        ],
        command=command,
    )


def ground_risk_page(result: GroundRiskResult, figure: Figure, command: str) -> AnswerPage:
    """Return the page of a ground risk: the map of the volumes, and the table for an application.

    figure: map of the volumes.
    command: command line that repeats the search; "" without one.
    """
    rows = [
        [Markup("<strong>{}</strong>").format(cell.strip("*")) if cell.startswith("**") else cell for cell in row]
        for row in ground_risk_text.table_rows(result)
    ]
    return AnswerPage(
        command_name="ground-risk",
        name=result.base.name,
        heading="its ground risk by SORA 2.5",
        style="reached" if result.is_judged else "undecided",
        lines=[
            ground_risk_text.answer_line(result),
            *flown_condition_lines(result.base.conditions()),
            *ground_risk_text.risk_lines(result),
        ],
        figures=[(figure, "Map of the ground risk: flight geography, operational volume and ground risk buffer")],
        tables=[PageTable([("quantity", ""), ("value", ""), ("source", "")], rows)],
        explanation=[ground_risk_text.TABLE_EXPLANATION],
        command=command,
    )
