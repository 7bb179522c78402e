"""The energy rule: compare the energy used, predicted and flown, with the usable energy."""

import math
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from flight.mission.items import Command
from flight.mission.route import make_route
from logs.verdict.findings import (
    NOT_FLOWN,
    UNKNOWN_AIRCRAFT,
    Finding,
    Message,
    finding_reason,
    make_finding,
    message,
)
from logs.verdict.measures.return_time import longest_return_time, remaining_battery_time
from logs.verdict.measures.route_requirements import (
    RouteRequirements,
    leg_energies,
    predicted_energy,
    route_requirements,
)
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.places import FLIGHT
from logs.verdict.rule import LogNeeds, Rule
from logs.verdict.suggestions import suggest_using_less_energy
from logs.verdict.tolerances import (
    EMPTY_CELL_VOLTAGE_V,
    ENERGY_RESERVE_FRACTION,
    NOMINAL_CELL_VOLTAGE_V,
    UNDECIDED_FRACTION,
)
from logs.verdict.wording import compared_texts, count_text, quantity_text
from world.errors import PlanflyError

_MAH_PER_AH = 1000.0
# Rounding of a cell's voltage threshold, V: the threshold is stated for the whole battery.
_VOLTAGE_ROUNDING_V = 0.005


GUESSED_BATTERY_TEXT = (
    "the battery's capacity is a guess: give --battery when the aircraft is made, or battery_wh in the scenario"
)


def energy_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, *, geometric: bool = False
) -> list[Finding]:
    """Judge with one finding whether battery or tank contains the energy used and the reserve.

    If a battery failsafe acts earlier, it sets the limit.  A mission with an endless jump fails.  The finding is not
    judged if the capacity is a guess, if the power is unknown or too uncertain, or if a failsafe may act.

    geometric: True to judge the energy predicted for the planned path, False to judge the flight.
    """
    setup, envelope = requirements.setup, requirements.setup.envelope
    limit, source, failsafe_text = _energy_limit(requirements)
    planned_energy, peak_current = predicted_energy(requirements)
    is_guessed = envelope.battery_guessed and setup.scenario.flight.battery_wh is None
    energy, max_current = (planned_energy, peak_current) if geometric else (math.nan, math.nan)
    # A flight with take-off or landing has one track for all of it.
    phases, track = requirements.ground_phases, None if aligned is None else aligned.track
    track = track if phases is None else phases.track
    if track is not None and not geometric:
        energy, max_current = float(track.energy.max()), float(track.current.max())
    is_flown = aligned is not None and bool(aligned.passed[-1]) and energy > 0.0 and planned_energy > 0.0
    is_measured = setup.imported_log is not None and not geometric
    failsafes = _judge_battery_failsafes(requirements, energy)
    faults = _endless_jump_faults(requirements, limit, energy / planned_energy if is_flown else 1.0) + failsafes.faults
    # A flight that ends early, or with an empty battery, does not show the energy that it needs; the prediction does.
    is_empty = not geometric and not is_measured and energy >= setup.battery
    is_cut_short = not geometric and not is_measured and aligned is not None and not aligned.passed[-1]
    needed_energy = float(np.fmax(energy, planned_energy)) if is_empty or is_cut_short else energy
    # Power is log-normal; this is the upper end of 95 %.
    max_energy = needed_energy * math.exp(0.0 if is_measured else UNDECIDED_FRACTION * envelope.power_sd)
    is_uncertain = not faults and not is_guessed and energy <= limit < max_energy
    if energy == planned_energy == 0.0:  # the model has no power data
        energy = planned_energy = math.nan
        reason = "the aircraft's model states no power, so the energy is unknown"
    elif math.isnan(energy):
        reason = "the aircraft's power is unknown at these speeds" if geometric else "nothing was flown"
    else:
        reason = _used_text(requirements, energy, max_current, is_empty=is_empty)
        if geometric or math.isfinite(planned_energy):
            mission_text = " for the whole mission" if is_cut_short else ""
            reason += " (predicted)" if geometric else f"; predicted: {planned_energy:.1f} Wh{mission_text}"
        if is_guessed:
            reason = f"{GUESSED_BATTERY_TEXT}; {reason}"
        elif energy > limit and not failsafe_text:
            reason += f"; a reserve of {ENERGY_RESERVE_FRACTION:.0%} must be left"
        if not is_guessed and max_energy > needed_energy:
            reason += f"; at most {max_energy:.1f} Wh with 95 % probability, because the power is uncertain"
            reason += f" (from {envelope.source})"
        reason += failsafes.unjudged_text if failsafes.faults else f"{failsafe_text}{failsafes.unjudged_text}"
    undecided_faults = failsafes.undecided if not faults and (is_guessed or energy <= limit) else []
    is_undecided = is_guessed or is_uncertain or bool(undecided_faults) or math.isnan(energy)
    return [
        make_finding(
            "energy",
            FLIGHT,
            ok=False if faults else None if is_undecided else energy <= limit,
            reason=finding_reason(faults or undecided_faults, [reason]),
            faults=faults or undecided_faults,
            planned=planned_energy,
            flown=None if geometric else energy,
            limit=limit,
            source=source,
            tolerance=0.0,
            margin=math.nan if is_guessed else limit - energy,
            unit="Wh",
            check=NOT_FLOWN if undecided_faults else UNKNOWN_AIRCRAFT if is_uncertain else "",
            method="power of steady flight on each leg times its duration" if geometric else "power times duration",
        )
    ]


def _energy_limit(requirements: RouteRequirements) -> tuple[float, str, str]:
    """Return the usable energy (Wh), the source of this limit, and a clause on a battery failsafe.

    The usable energy is the energy without the reserve, or less if a failsafe acts before the reserve is reached; the
    clause describes this failsafe and is "" otherwise.  The failsafes of several batteries set no limit, because the
    charge drawn from each battery is unknown.
    """
    setup, volts = requirements.setup, requirements.setup.envelope.volts
    limit = (1.0 - ENERGY_RESERVE_FRACTION) * setup.battery
    source = "aircraft" if setup.scenario.flight.battery_wh is None else "scenario"
    failsafes = [
        failsafe
        for failsafe in setup.autopilot.checks.battery_failsafes
        if setup.imported_log is None
        and not failsafe.shares_charge
        and failsafe.used_charge / _MAH_PER_AH * volts < limit
    ]
    if not failsafes:
        return limit, source, ""
    first = min(failsafes, key=lambda failsafe: failsafe.used_charge)
    charge = max(0.0, first.used_charge)
    energy = charge / _MAH_PER_AH * volts
    clause = f"; the failsafe {first.parameter} {first.threshold:g} acts after {energy:.1f} Wh ({charge:.0f} mAh)"
    return energy, "autopilot", clause


def _endless_jump_faults(requirements: RouteRequirements, usable_energy: float, energy_ratio: float) -> list[Message]:
    """Return a fault with the number of rounds of an endless jump that the energy permits.

    Return [] without such a jump.

    A round is one repetition of the items between the jump and its destination.
    usable_energy: energy without the reserve, Wh.
    energy_ratio: ratio of the flown energy to the predicted energy; 1 if it is unknown.
    """
    setup, route = requirements.setup, requirements.setup.route
    if route.endless_jump is None:
        return []
    last_waypoint = len(route.items) - 1
    start = last_waypoint
    while start > 0 and route.items[start] == route.items[last_waypoint]:
        start -= 1
    # The last round starts at the previous waypoint of the item with which the route ends.
    while start > 0 and route.items[start] != route.items[last_waypoint]:
        start -= 1
    energies = leg_energies(requirements)[0]
    round_energy = sum(energies[start:]) if route.items[start] == route.items[last_waypoint] else math.nan
    fault = f"the jump at item {route.endless_jump} repeats indefinitely"
    if not round_energy > 0.0:
        return [message(fault)]
    # Energy of the mission flown once through: path to the first round, that round, and the items after the jump.
    first_energy = math.nan
    items = tuple(
        replace(item, params=(item.params[0], 0.0, *item.params[2:]))
        if item.seq == route.endless_jump and item.command in (Command.DO_JUMP, Command.DO_JUMP_TAG)
        else item
        for item in setup.mission.items
    )
    if items != setup.mission.items:
        mission, scenario = replace(setup.mission, items=items), setup.scenario
        with suppress(PlanflyError):
            single_route = make_route(
                *(mission, scenario.origin, scenario.terrain, setup.airspeed, scenario.flight.fly_over, setup.limits),
                setup.autopilot.route_rules,
            )
            single_setup = replace(setup, mission=mission, route=single_route)
            first_energy = predicted_energy(route_requirements(single_setup))[0]
    if not math.isfinite(first_energy):
        first_energy = sum(energies[:start])
    repeats = math.floor((usable_energy / energy_ratio - first_energy) / round_energy)
    if repeats < 0:
        return [message(f"{fault}, but the usable energy of {usable_energy:.0f} Wh does not last for one round")]
    rounds_text = count_text(repeats + 1, "round")
    fault = f"{fault}. Each round uses {round_energy:.1f} of {usable_energy:.0f} usable Wh, enough for {rounds_text}"
    return [message(f"{fault}. Set its repeat count to {repeats}")]


class _FailsafeMessages(NamedTuple):
    """Messages on the battery failsafes that abort the mission.

    faults: messages on failsafes that will abort it.
    undecided: messages on failsafes that may abort it.
    unjudged_text: clause on voltage failsafes that a healthy battery does not trigger; the voltage is not simulated.
    """

    faults: list[Message]
    undecided: list[Message]
    unjudged_text: str = ""


def _judge_battery_failsafes(requirements: RouteRequirements, energy_used: float) -> _FailsafeMessages:
    """Judge whether a battery failsafe aborts the mission; return no messages for an imported flight.

    energy_used: energy that the flight uses, Wh; NaN if unknown, and then no failsafe is judged.
    """
    setup, volts = requirements.setup, requirements.setup.envelope.volts
    messages, unjudged = _FailsafeMessages([], []), []
    if setup.imported_log is not None or math.isnan(energy_used):
        return messages
    charge_used = energy_used / volts * _MAH_PER_AH if volts else math.nan
    # The voltage of a battery under load is not simulated.  While the reserve is left, a healthy battery has more than
    # `EMPTY_CELL_VOLTAGE_V` in each cell.
    cells = 0 if setup.envelope.battery_guessed else round(volts / NOMINAL_CELL_VOLTAGE_V)
    for failsafe in setup.autopilot.checks.battery_failsafes:
        name = f"{failsafe.parameter} {failsafe.threshold:g}"
        if math.isnan(failsafe.used_charge):
            voltage_text, cell_voltage = "", failsafe.threshold / cells if cells else 0.0
            if math.isfinite(failsafe.remaining_fraction):
                remaining_fraction = 1.0 - energy_used / setup.battery
                if remaining_fraction < failsafe.remaining_fraction:
                    voltage_text = f"{remaining_fraction:.0%} of the battery is left"
            elif cell_voltage > EMPTY_CELL_VOLTAGE_V + _VOLTAGE_ROUNDING_V:
                voltage_text = (
                    f"{cell_voltage:.2f} V in each of {cells} cells ({volts:g} V), more than the"
                    f" {EMPTY_CELL_VOLTAGE_V:g} V of an empty cell; the voltage is not simulated"
                )
            if voltage_text:
                messages.undecided.append(message(f"the failsafe {name} may end the mission", f": {voltage_text}"))
            else:
                unjudged.append(name)
        elif charge_used > failsafe.used_charge:
            used_text, charge_text = compared_texts(max(0.0, failsafe.used_charge), charge_used, "mAh", 0)
            limit_text = f"the failsafe {name} acts after {used_text}"
            if failsafe.shares_charge:
                share_text = f" from one battery; the flight needs {charge_text} from several batteries"
                messages.undecided.append(message(f"{limit_text}{share_text}"))
            else:
                messages.faults.append(message(f"{limit_text}, but the flight needs {charge_text}"))
    return_failsafe = setup.autopilot.checks.return_time_failsafe
    if return_failsafe is not None:
        # The battery's remaining time may trigger an early return.  It is shortest at the end of the mission, and is
        # compared with the time of the longest return, so that the result holds at all times of the mission.
        factor = math.exp(UNDECIDED_FRACTION * setup.envelope.power_sd)
        remaining = remaining_battery_time(requirements, return_failsafe, factor * energy_used, factor)
        return_time = longest_return_time(requirements, return_failsafe)
        needed = return_failsafe.time_factor * return_time + return_failsafe.time_margin
        reason = (
            f"at the mission's end PX4 estimates {max(0.0, remaining) / 60.0:.1f} min of battery, but requires"
            f" {needed / 60.0:.1f} min for a return of up to {return_time / 60.0:.1f} min"
        )
        if math.isnan(remaining) or math.isinf(return_time):
            reason = "the time left in the battery, or the duration of a return, is unknown"
        if not remaining > needed:
            brief = f"the failsafe {return_failsafe.parameter} may start a return before the mission ends"
            messages.undecided.append(message(brief, f": {reason}; {return_failsafe.remedy}"))
    clause = f"; the voltage is not simulated, so it is not judged whether {' or '.join(unjudged)} ends the mission"
    return messages._replace(unjudged_text=clause if unjudged else "")


def _used_text(requirements: RouteRequirements, energy_used: float, max_current: float, *, is_empty: bool) -> str:
    """Describe the energy used and the peak current, or the fuel used by an engine.

    energy_used: Wh.
    max_current: A; NaN if unknown.
    is_empty: True if the battery or the tank is empty at the end of the flight.
    """
    capacity, envelope = requirements.setup.battery, requirements.setup.envelope
    if envelope.power_level.size and not envelope.volts:
        fraction = energy_used / capacity
        return (
            f"{fraction:.1%} of the fuel used ({energy_used:.0f} Wh of {capacity:.0f} Wh of heat)"
            f"{': the tank is empty' if is_empty else ''}; without a battery, no current is judged"
        )
    jump_text = "" if requirements.setup.route.endless_jump is None else " with one repetition of the jump"
    current_text = f", peak current {max_current:.1f} A" if math.isfinite(max_current) else ""
    capacity_text = quantity_text(capacity, "Wh")
    return (
        f"{energy_used:.1f} Wh of {capacity_text}"
        f" used{jump_text}{current_text}{': the battery is empty' if is_empty else ''}"
    )


RULE = Rule(
    name="energy",
    tolerances=(*("ENERGY_RESERVE_FRACTION", "UNDECIDED_FRACTION", "NOMINAL_CELL_VOLTAGE_V", "EMPTY_CELL_VOLTAGE_V"),),
    judge=energy_findings,
    judges_whole_flight=True,
    suggest=suggest_using_less_energy,
    log=LogNeeds(("battery",), needs_aircraft=True),
)
