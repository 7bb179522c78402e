"""The energy rule: compare the energy from battery or tank, predicted and flown, with the usable energy."""

import math

from logs.verdict.findings import UNKNOWN_AIRCRAFT, Finding, Message, finding_reason, make_finding, message
from logs.verdict.measures.energy import leg_energies, predicted_energy
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.places import FLIGHT
from logs.verdict.rule import LogNeeds, Rule
from logs.verdict.suggestions import suggest_using_less_energy
from logs.verdict.tolerances import ENERGY_RESERVE_FRACTION, UNDECIDED_FRACTION

_MAH_PER_AH = 1000.0


def energy_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, *, geometric: bool = False
) -> list[Finding]:
    """Compare the energy used with the battery's energy without its reserve.

    An endless jump exceeds any battery.  A guessed battery is not judged.  If the aircraft's power is uncertain, energy
    that may exceed the limit is undecided, except in an imported log, which contains measured energy.
    """
    setup = requirements.setup
    limit = (1.0 - ENERGY_RESERVE_FRACTION) * setup.battery
    planned_energy, peak_current = predicted_energy(requirements)
    faults = [_endless_jump_message(requirements, limit)] if setup.route.endless >= 0 else []
    is_guessed = setup.envelope.battery_guessed and setup.scenario.flight.battery_wh is None
    energy, max_current = (planned_energy, peak_current) if geometric else _flown_energy(requirements, aligned)
    is_measured = setup.source is not None and not geometric
    failsafe_messages, failsafe_text = _battery_failsafe_messages(requirements, energy)
    faults += failsafe_messages
    # Power is log-normal; this is the upper end of 95 %.
    max_energy = energy * math.exp(0.0 if is_measured else UNDECIDED_FRACTION * setup.envelope.power_sd)
    is_uncertain = not faults and not is_guessed and energy <= limit < max_energy
    if energy == 0.0 and planned_energy == 0.0:
        # A model without a reading of power reads as 0 W.
        energy, planned_energy = math.nan, math.nan
        reason = "the aircraft's model states no power, so the energy is unknown"
    elif math.isnan(energy):
        reason = "the aircraft's power is unknown at these speeds" if geometric else "nothing was flown"
    else:
        reason = _used_text(requirements, energy, max_current) + (" by prediction" if geometric else "")
        if not geometric and math.isfinite(planned_energy):
            reason += f"; {planned_energy:.1f} Wh by prediction"
        if is_guessed:
            reason = (
                f"the battery is guessed: state --battery with the aircraft, or the scenario's battery_wh; {reason}"
            )
        elif energy > limit:
            reason += f"; {ENERGY_RESERVE_FRACTION:.0%} must be left"
        elif max_energy > energy:
            source = setup.envelope.source
            reason += f"; at most {max_energy:.1f} Wh with 95 % probability, because the power is from {source}"
        reason += failsafe_text
    return [
        make_finding(
            "energy",
            FLIGHT,
            ok=False if faults else None if is_guessed or is_uncertain or math.isnan(energy) else energy <= limit,
            reason=finding_reason(faults, [reason]),
            faults=faults,
            planned=planned_energy,
            flown=None if geometric else energy,
            limit=limit,
            source="aircraft" if setup.scenario.flight.battery_wh is None else "scenario",
            tolerance=0.0,
            margin=math.nan if is_guessed else limit - energy,
            unit="Wh",
            check=UNKNOWN_AIRCRAFT if is_uncertain else "",
            method="power of steady flight on each leg over its time" if geometric else "power over time",
        )
    ]


def _endless_jump_message(requirements: RouteRequirements, usable_energy: float) -> Message:
    """Report an endless jump and the number of rounds for which the usable energy (Wh) lasts."""
    route = requirements.setup.route
    last_waypoint = len(route.items) - 1
    start = last_waypoint
    while start > 0 and route.items[start] == route.items[last_waypoint]:
        start -= 1
    # Find the start of the last round, at the item with which the route ends.
    while start > 0 and route.items[start] != route.items[last_waypoint]:
        start -= 1
    round_energy = (
        sum(leg_energies(requirements)[0][start:]) if route.items[start] == route.items[last_waypoint] else math.nan
    )
    duration_text = f": the energy lasts for {usable_energy / round_energy:.0f} rounds" if round_energy > 0.0 else ""
    return message(f"the jump of item {route.endless} has no end{duration_text}")


def _flown_energy(requirements: RouteRequirements, aligned: AlignedTrack | None) -> tuple[float, float]:
    """Return energy (Wh) and peak current (A) of a flight, its take-off and landing included; NaN without a flight."""
    track = None if aligned is None else aligned.track
    if requirements.ground_phases is not None:
        track = requirements.ground_phases.track
    if track is None:
        return math.nan, math.nan
    return float(track.energy.max()), float(track.current.max())


def _battery_failsafe_messages(requirements: RouteRequirements, energy_used: float) -> tuple[list[Message], str]:
    """Return messages on battery failsafes that leave the mission, and a clause on voltages that are not judged.

    energy_used: energy of the flight, Wh.  A log of an imported flight shows what its failsafes did.
    """
    volts = requirements.setup.envelope.volts
    messages, unjudged = [], []
    if requirements.setup.source is not None or math.isnan(energy_used):
        return [], ""
    for failsafe in requirements.setup.autopilot.checks.battery_failsafes:
        if math.isnan(failsafe.used_charge):
            unjudged.append(f"{failsafe.parameter} {failsafe.threshold:g}")
        elif volts and energy_used / volts * _MAH_PER_AH > failsafe.used_charge:
            messages.append(
                message(
                    f"{failsafe.parameter} {failsafe.threshold:g} leaves the mission after"
                    f" {max(0.0, failsafe.used_charge):.0f} mAh, and it needs"
                    f" {energy_used / volts * _MAH_PER_AH:.0f} mAh"
                )
            )
    clause = f"; whether the battery falls below {' or '.join(unjudged)}, which leaves the mission, is not judged"
    return messages, clause if unjudged else ""


def _used_text(requirements: RouteRequirements, energy_used: float, max_current: float) -> str:
    """Describe the energy used (Wh) and the peak current (A), or the fuel used by an aircraft without a battery."""
    capacity = requirements.setup.battery
    if requirements.setup.envelope.power_level.size and not requirements.setup.envelope.volts:
        fraction = energy_used / capacity
        return (
            f"{energy_used:.0f} Wh of {capacity:.0f} Wh of fuel heat used, {fraction:.1%} of the fuel;"
            " no battery, so no current"
        )
    current_text = f", peak current {max_current:.1f} A" if math.isfinite(max_current) else ""
    return f"{energy_used:.1f} Wh of {capacity:.0f} Wh used{current_text}"


RULE = Rule(
    name="energy",
    tolerances=("ENERGY_RESERVE_FRACTION", "UNDECIDED_FRACTION"),
    judge=energy_findings,
    judges_whole_flight=True,
    suggest=suggest_using_less_energy,
    log=LogNeeds(("battery",), needs_aircraft=True),
)
