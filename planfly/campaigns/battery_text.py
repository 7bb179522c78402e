"""Describe the result of a search for a battery in lines."""

import math

import numpy as np

from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.returns.returns_text import return_law_lines
from logs.verdict.wording import place_text
from planfly.campaigns.find_battery import MIN_MASS_FACTOR, BatteryResult

# Number of parts that decide the battery, and of legs, in the lines.
_MAX_LISTED = 3


def answer_line(result: BatteryResult) -> str:
    """Return a line with the smallest sufficient battery and its confidence interval.

    If no battery suffices, the line gives the reason: returns that do not arrive, or a battery that would need too much
    energy to carry itself. If the battery is not judged, the line gives the reason, too.
    """
    goal = result.goal
    flown_text = "in the mission and in every return" if result.has_returns else "in the mission (without returns)"
    flown_text += " that arrives" if any(row.blocked_returns for row in result.rows) else ""
    keeps_text = f"a reserve of {goal.reserve:.0%} {flown_text} with probability {goal.probability:g}"
    lost_count = sum(math.isinf(row.return_energy) for row in result.rows)
    if math.isinf(result.capacity) and lost_count:
        flights_text = f"{lost_count} of {len(result.rows)} flights"
        return f"no battery keeps {keeps_text}, because a return does not arrive in {flights_text}"
    if math.isinf(result.capacity):
        return (
            f"no battery keeps {keeps_text}: at {goal.specific_energy:g} Wh/kg a larger battery needs too much of its"
            f" energy to carry its own mass (the aircraft would weigh {result.mass * result.mass_factor:.3g} kg)"
        )
    if math.isnan(result.capacity):
        count, completed = len(result.rows), len(result.completed)
        endings = [row.ended for row in result.rows if row.ended != "completed"]
        if unknown_count := completed - len(result.known):
            reason = (
                f"in {unknown_count} of {count} flights a return leaves the known terrain, so its energy is unknown"
            )
        elif not endings:
            reason = "the aircraft's model states no power, so the energy is unknown"
        else:
            most_frequent = max(set(endings), key=endings.count)
            reason = (
                f"{count - completed} of {count} flights do not complete the mission; most frequent reason:"
                f" {most_frequent}"
            )
        return f"not judged: {reason}"
    low, high = result.interval
    confidence_text = f"at {goal.confidence:.0%} confidence"
    interval_text = f"{low:.0f} to {high:.0f} Wh {confidence_text}"
    if not math.isfinite(high):
        interval_text = (
            f"at least {low:.0f} Wh {confidence_text}, {len(result.rows)} flights are too few for an upper bound"
        )
    volts_text = f", {1000.0 * result.capacity / result.volts:.0f} mAh at {result.volts:.1f} V" if result.volts else ""
    return f"a battery of {result.capacity:.0f} Wh ({interval_text}{volts_text}) keeps {keeps_text}"


def battery_lines(result: BatteryResult) -> list[str]:
    """Return the lines below the answer: own battery, what decides the capacity, energies and method.

    Return [] if no flight completed the mission.
    """
    if not result.completed:
        return []
    goal, total = result.goal, len(result.completed)
    if result.is_guessed:
        line = "the aircraft's battery is unknown, so it is not compared; state battery_wh in the scenario"
    elif math.isnan(result.capacity):
        line = (
            f"the aircraft's battery of {result.own_capacity:.0f} Wh is not judged, because the needed one is unknown"
        )
    else:
        unknown_text = (
            "may be enough (more flights would decide)" if result.has_returns else "may not cover the returns"
        )
        verdict = {True: "is enough", False: "is too small", None: unknown_text}
        low, high = result.own_probability
        line = (
            f"the aircraft's battery of {result.own_capacity:.0f} Wh {verdict[result.is_enough]}: it keeps the reserve"
            f" in {result.kept} of {len(result.rows)} flights (probability {low:.2f} to {high:.2f} at 95 % confidence)"
        )
    lines = [line]
    if goal.specific_energy is None:
        lines.append(
            "every capacity is assumed to have the same mass; for a mass that grows with the capacity, add"
            " --specific-energy"
        )
    elif math.isfinite(result.capacity):
        has_min_mass = result.mass_factor == MIN_MASS_FACTOR
        limit_text = f"; the flights assume at least {MIN_MASS_FACTOR:g} times the present mass" if has_min_mass else ""
        lines.append(
            f"at {goal.specific_energy:g} Wh/kg the aircraft weighs {result.mass * result.mass_factor:.2f} kg with this"
            f" battery, instead of {result.mass:.2f} kg{limit_text}"
        )
    if math.isfinite(result.capacity):
        lines += [
            f"in {flights} of {total} flights {part} decides the capacity"
            for part, flights, _ in decision_rows(result)[:_MAX_LISTED]
        ]
    energies = result.leg_energies
    if float(energies.sum()) > 0.0:
        largest = sorted(range(len(energies)), key=lambda leg: -float(energies[leg]))[:_MAX_LISTED]
        names = leg_names(result)
        parts = [f"{energies[leg]:.1f} Wh ({names[leg]})" for leg in largest]
        lines.append(
            f"the mission uses {float(energies.sum()):.1f} Wh (median); the largest parts are {', '.join(parts)}"
        )
    blocked = sum(row.blocked_returns > 0 for row in result.completed)
    if result.base.mission.home is None:
        lines.append("the mission has no home, so no returns were simulated")
    elif blocked:
        lines.append(
            f"in {blocked} of {total} flights, returns hit an obstacle; the capacity does not include these returns"
            " (`planfly returns` shows them)"
        )
    lines.append(
        f"{total} of {len(result.rows)} flights complete the mission. A return starts every {goal.interval:g} s"
        " and is simulated up to its loiter; the reserve has to cover loiter and landing"
    )
    return [*lines, *return_law_lines(result.base.nominal_setup())]


def leg_names(result: BatteryResult) -> list[str]:
    """Return the name of each leg number, as in messages; all legs of one loiter share a number."""
    requirements = route_requirements(result.base.nominal_setup())
    numbers = requirements.setup.route.leg_numbers
    first_legs = np.searchsorted(numbers, np.arange(int(numbers[-1]) + 1)).tolist()
    return [place_text(requirements.leg_place(leg)) for leg in first_legs]


def decision_rows(result: BatteryResult) -> list[tuple[str, str, str]]:
    """Return a row (part, flights, share) for each part that decides the battery in some flights.

    A part decides the battery of a flight if more energy is used at its end than at the end of any other part.  The
    most frequent part comes first.

    part: the mission, or a simulated return to launch, in words.
    flights, share: number and percentage of the flights in which this part decides.
    """
    names, total = leg_names(result), len(result.completed)
    return [
        (
            "the end of the mission"
            if decision.leg < 0
            else f"the return that starts at {decision.time:.0f} s ({names[decision.leg]})",
            str(decision.flights),
            f"{decision.flights / total:.0%}",
        )
        for decision in result.decisions
    ]


def leg_rows(result: BatteryResult) -> list[tuple[str, str, str]]:
    """Return a row for each leg number: name, median energy, and share of the sum of these energies."""
    energies, total = result.leg_energies.tolist(), float(result.leg_energies.sum())
    return [
        (name, f"{energy:.1f} Wh", f"{energy / total:.0%}" if total > 0.0 else "")
        for name, energy in zip(leg_names(result), energies, strict=False)
    ]
