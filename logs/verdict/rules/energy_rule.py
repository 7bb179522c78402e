"""The energy rule: compare the energy from battery or tank, predicted and flown, with the usable energy."""

import math

from logs.verdict.findings import UNKNOWN_AIRCRAFT, Finding, Message, make_finding, message, reason_of
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
    usable = (1.0 - ENERGY_RESERVE_FRACTION) * setup.battery
    predicted, peak = predicted_energy(requirements)
    faults = [_endless_jump_message(requirements, usable)] if setup.route.endless >= 0 else []
    is_guessed = setup.envelope.battery_guessed and setup.scenario.flight.battery_wh is None
    used, current = (predicted, peak) if geometric else _flown_energy(requirements, aligned)
    is_measured = setup.source is not None and not geometric
    failsafe_messages, failsafe_text = _battery_failsafe_messages(requirements, used)
    faults += failsafe_messages
    # Power is log-normal; this is the upper end of 95 %.
    max_used = used * math.exp(0.0 if is_measured else UNDECIDED_FRACTION * setup.envelope.power_sd)
    is_uncertain = not faults and not is_guessed and used <= usable < max_used
    if used == 0.0 and predicted == 0.0:
        # A model without a reading of power reads as 0 W.
        used, predicted = math.nan, math.nan
        reason = "the aircraft's model states no power, so the energy is not known"
    elif math.isnan(used):
        reason = "the aircraft's power is not known at these speeds" if geometric else "nothing was flown"
    else:
        reason = _used_text(requirements, used, current) + (" by prediction" if geometric else "")
        if not geometric and math.isfinite(predicted):
            reason += f"; {predicted:.1f} Wh by prediction"
        if is_guessed:
            reason = (
                f"the battery is guessed: state --battery with the aircraft, or the scenario's battery_wh; {reason}"
            )
        elif used > usable:
            reason += f"; {ENERGY_RESERVE_FRACTION:.0%} must be left"
        elif max_used > used:
            reason += f"; at most {max_used:.1f} Wh with 95 % probability, as the power is from {setup.envelope.source}"
        reason += failsafe_text
    return [
        make_finding(
            "energy",
            FLIGHT,
            ok=False if faults else None if is_guessed or is_uncertain or math.isnan(used) else used <= usable,
            reason=reason_of(faults, [reason]),
            faults=faults,
            planned=predicted,
            flown=None if geometric else used,
            limit=usable,
            source="aircraft" if setup.scenario.flight.battery_wh is None else "scenario",
            tolerance=0.0,
            margin=math.nan if is_guessed else usable - used,
            unit="Wh",
            check=UNKNOWN_AIRCRAFT if is_uncertain else "",
            method="power of steady flight on each leg over its time" if geometric else "power over time",
        )
    ]


def _endless_jump_message(requirements: RouteRequirements, usable: float) -> Message:
    """Report an endless jump, and the number of rounds after which the usable energy (Wh) is used up."""
    route = requirements.setup.route
    last = len(route.items) - 1
    begin = last
    while begin > 0 and route.items[begin] == route.items[last]:
        begin -= 1
    # Find where the round that ends the route began: at the item where the route ends.
    while begin > 0 and route.items[begin] != route.items[last]:
        begin -= 1
    round_energy = sum(leg_energies(requirements)[0][begin:]) if route.items[begin] == route.items[last] else math.nan
    duration_text = f": the energy lasts for {usable / round_energy:.0f} rounds" if round_energy > 0.0 else ""
    return message(f"the jump of item {route.endless} has no end{duration_text}")


def _flown_energy(requirements: RouteRequirements, aligned: AlignedTrack | None) -> tuple[float, float]:
    """Return energy (Wh) and peak current (A) of a flight, its take-off and landing included; NaN without a flight."""
    track = None if aligned is None else aligned.track
    if requirements.ground is not None:
        track = requirements.ground.track
    if track is None:
        return math.nan, math.nan
    return float(track.energy.max()), float(track.current.max())


def _battery_failsafe_messages(requirements: RouteRequirements, used: float) -> tuple[list[Message], str]:
    """Return messages on battery failsafes that leave the mission, and a clause on voltages that are not judged.

    used: energy of the flight, Wh.  A log of an imported flight shows what its failsafes did.
    """
    volts = requirements.setup.envelope.volts
    messages, unjudged = [], []
    if requirements.setup.source is not None or math.isnan(used):
        return [], ""
    for failsafe in requirements.setup.autopilot.battery_failsafes:
        if math.isnan(failsafe.used_charge):
            unjudged.append(f"{failsafe.parameter} {failsafe.threshold:g}")
        elif volts and used / volts * _MAH_PER_AH > failsafe.used_charge:
            messages.append(
                message(
                    f"{failsafe.parameter} {failsafe.threshold:g} leaves the mission after"
                    f" {max(0.0, failsafe.used_charge):.0f} mAh, and it needs {used / volts * _MAH_PER_AH:.0f} mAh"
                )
            )
    clause = f"; whether the voltage falls below {' or '.join(unjudged)}, which leaves the mission, is not judged"
    return messages, clause if unjudged else ""


def _used_text(requirements: RouteRequirements, used: float, current: float) -> str:
    """Describe the energy used (Wh) and the peak current (A), or the fuel used by an aircraft without a battery."""
    capacity = requirements.setup.battery
    if requirements.setup.envelope.power_level.size and not requirements.setup.envelope.volts:
        fraction = used / capacity
        return (
            f"{used:.0f} Wh of {capacity:.0f} Wh of fuel heat used, {fraction:.1%} of the fuel;"
            " no battery, so no current"
        )
    peak = f", peak current {current:.1f} A" if math.isfinite(current) else ""
    return f"{used:.1f} Wh of {capacity:.0f} Wh used{peak}"


RULE = Rule(
    name="energy",
    tolerances=("ENERGY_RESERVE_FRACTION", "UNDECIDED_FRACTION"),
    judge=energy_findings,
    whole=True,
    suggest=suggest_using_less_energy,
    log=LogNeeds(("battery",), aircraft=True),
)
