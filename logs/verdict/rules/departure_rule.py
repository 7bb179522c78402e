"""The departure rule: numbers that are none, extreme bank, too slow to fly, or ground contact."""

import math

import numpy as np
from numpy.typing import NDArray

from flight.simulation.track import ROLL
from logs.verdict.findings import Finding, make_finding, message, reason_of
from logs.verdict.measures.route_demands import RouteDemands
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.places import FLIGHT
from logs.verdict.tolerances import MOST_BANK, SLOWEST, SLOWEST_SHARE

Floats = NDArray[np.float64]


def departure_findings(demands: RouteDemands, aligned: AlignedTrack | None) -> list[Finding]:
    """One finding: numbers that are none, extreme bank, too slow to fly, or ground contact."""
    if aligned is None:
        return [make_finding("departure", FLIGHT, ok=None, reason="no usable rows", unit="deg")]
    track = aligned.track
    bank = np.abs(track.attitude[:, ROLL].astype(np.float64))
    slowest = _slowest(demands, track.position[:, 2])
    faults = []
    if aligned.bad_rows:
        faults.append(
            message(f"{aligned.bad_rows} rows without usable numbers, the first {_time_text(aligned.first_bad)}")
        )
    if (bank > MOST_BANK).any():
        k = int(np.argmax(bank > MOST_BANK))
        faults.append(message(f"bank {math.degrees(bank[k]):.0f}° at {track.time[k]:.1f} s"))
    if (track.airspeed < slowest).any():
        k = int(np.argmax(track.airspeed < slowest))
        faults.append(
            message(f"airspeed {track.airspeed[k]:.1f} m/s at {track.time[k]:.1f} s, below {slowest[k]:.1f} m/s")
        )
    if (aligned.low <= 0.0).any():
        faults.append(message(f"ground contact at {track.time[int(np.argmax(aligned.low <= 0.0))]:.1f} s"))
    steady = f"bank at most {math.degrees(bank.max()):.0f}°, airspeed at least {float(track.airspeed.min()):.1f} m/s"
    return [
        make_finding(
            "departure",
            FLIGHT,
            ok=not faults,
            reason=reason_of(faults) if faults else steady,
            faults=faults,
            flown=math.degrees(bank.max()),
            limit=math.degrees(MOST_BANK),
            source="check",
            tolerance=0.0,
            margin=math.degrees(MOST_BANK - bank.max()),
            unit="deg",
            method="every row",
        )
    ]


def _time_text(time: float) -> str:
    return f"at {time:.1f} s" if math.isfinite(time) else "without a time"


def _slowest(demands: RouteDemands, up: Floats) -> Floats:
    """Airspeed below which the aircraft is taken to have stopped flying, at each height."""
    if demands.setup.aircraft == "aerosonde":
        return np.full(up.shape, SLOWEST)
    envelope = demands.setup.envelope
    return np.asarray(SLOWEST_SHARE * np.interp(up, envelope.amsl, envelope.level_speed_min))
