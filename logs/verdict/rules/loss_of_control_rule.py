"""The `departure` rule: judge loss of control.

Its signs are unusable rows, extreme bank, low airspeed and ground contact.
"""

import math

import numpy as np

from flight.simulation.track import ROLL
from logs.verdict.findings import Finding, finding_reason, make_finding, message
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.places import FLIGHT
from logs.verdict.rule import Rule
from logs.verdict.tolerances import (
    MAX_CONTROLLED_BANK_RAD,
    MAX_GEAR_HEIGHT_M,
    MIN_CONTROLLED_AIRSPEED_MPS,
    MIN_CONTROLLED_STALL_RATIO,
)
from logs.verdict.wording import place_text
from world.arrays import Floats
from world.wording import count_text


def departure_findings(
    requirements: RouteRequirements, aligned: AlignedTrack | None, *, geometric: bool = False
) -> list[Finding]:
    """Judge with one finding whether control was lost in the flight.

    Signs of a loss are unusable rows, extreme bank, low airspeed and ground contact.

    Return [] if ``geometric``, because nothing was flown.  Without usable rows, the finding is not judged.
    """
    if geometric:
        return []
    if aligned is None:
        return [make_finding("departure", FLIGHT, ok=None, reason="the log has no usable rows", unit="deg")]
    track = aligned.track
    bank = np.abs(track.attitude[:, ROLL].astype(np.float64))
    max_bank, faults = _max_finite(bank), []
    if aligned.bad_rows:
        time_text = f"at {aligned.first_bad:.1f} s" if math.isfinite(aligned.first_bad) else "without a time"
        faults.append(
            message(f"no usable numbers in {count_text(aligned.bad_rows, 'row')} of the log, the first {time_text}")
        )
    if (bank > MAX_CONTROLLED_BANK_RAD).any():
        row = int(np.argmax(bank > MAX_CONTROLLED_BANK_RAD))
        limit_text = f", more than the limit of {math.degrees(MAX_CONTROLLED_BANK_RAD):.0f}°"
        faults.append(message(f"bank {math.degrees(bank[row]):.0f}° at {track.time[row]:.1f} s", limit_text))
    # The minimum airspeed of the Aerosonde is a constant; that of other aircraft is a multiple of the minimum level
    # speed.  An imported flight of an unknown aircraft has none.
    imported_log, envelope = requirements.setup.imported_log, requirements.setup.envelope
    if imported_log is None or imported_log.aircraft_known:
        min_airspeeds = np.full(len(track), MIN_CONTROLLED_AIRSPEED_MPS)
        if requirements.setup.aircraft != "aerosonde":
            level_speeds = np.interp(track.position[:, 2], envelope.amsl, envelope.level_speed_min)
            min_airspeeds = MIN_CONTROLLED_STALL_RATIO * level_speeds
        slow_rows = np.flatnonzero(track.airspeed < min_airspeeds)
        if slow_rows.size:
            row = int(slow_rows[0])
            speed_text = f"airspeed {track.airspeed[row]:.1f} m/s at {track.time[row]:.1f} s"
            faults.append(message(f"{speed_text}, below {min_airspeeds[row]:.1f} m/s"))
    is_contact = aligned.clearance <= 0.0
    if requirements.ground_phases is not None and not aligned.passed[-1]:
        is_contact[-1] |= aligned.clearance[-1] <= MAX_GEAR_HEIGHT_M
    if is_contact.any():
        k = int(np.argmax(is_contact))
        time = track.time[k] + aligned.clearance_fraction[k] * (track.time[k + 1] - track.time[k])
        faults.append(
            message(
                f"ground contact at {time:.1f} s on {place_text(requirements.leg_place(aligned.leg_at(k)))}",
                f", {aligned.position_text(k, float(aligned.clearance_fraction[k]))}",
            )
        )
    min_airspeed = -_max_finite(-track.airspeed.astype(np.float64))
    notes = [] if math.isnan(max_bank) else [f"bank at most {math.degrees(max_bank):.0f}°"]
    notes += [] if math.isnan(min_airspeed) else [f"airspeed at least {min_airspeed:.1f} m/s"]
    notes_text = ", ".join(notes) or "no ground contact; neither bank nor airspeed is known"
    return [
        make_finding(
            "departure",
            FLIGHT,
            ok=not faults,
            reason=finding_reason(faults) if faults else notes_text,
            faults=faults,
            flown=math.degrees(max_bank),
            limit=math.degrees(MAX_CONTROLLED_BANK_RAD),
            source="check",
            tolerance=0.0,
            margin=math.degrees(MAX_CONTROLLED_BANK_RAD - max_bank),
            unit="deg",
            method="every row",
        )
    ]


def _max_finite(values: Floats) -> float:
    """Return the largest finite value, or NaN if there is none."""
    finite = values[np.isfinite(values)]
    return float(finite.max()) if finite.size else math.nan


RULE = Rule(
    name="departure",
    tolerances=(
        "MAX_CONTROLLED_BANK_RAD",
        "MIN_CONTROLLED_AIRSPEED_MPS",
        "MIN_CONTROLLED_STALL_RATIO",
        "MAX_GEAR_HEIGHT_M",
        "MAX_PLAUSIBLE_POSITION_M",
        "MAX_PLAUSIBLE_SPEED_MPS",
        "MAX_PLAUSIBLE_VALUE",
    ),
    judge=departure_findings,
)
