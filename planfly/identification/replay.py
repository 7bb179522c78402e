"""The check: a log that was not used, flown again in JSBSim, five seconds at a time, from its own controls and air.

Each window begins in the logged state.  The controls are the logged ones, and the air is what airspeed, accelerometers
and velocity say it was.  What the models then do is compared with what the log says.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from aircraft.catalog import Aircraft, read_aircraft
from aircraft.identification.alignment import Clocks, Signals, align
from aircraft.identification.flight_record import GRID_HZ, FlightRecord
from aircraft.identification.flow import Flow, vane
from aircraft.identification.level import levelled
from aircraft.identification.parameters import PARAMETERS, prior_means
from flight.dynamics.fdm import Fdm
from planfly.identification.folder import Identified
from world.arrays import Floats
from world.files import temporary_folder

# Seconds of a window, how many of a log, and steps a second of JSBSim.
WINDOW = 5.0
COUNT = 40
_HZ = 100.0
# Gusts are taken below this, Hz.
_GUST_BAND = 2.0
QUANTITIES = ("roll rate", "pitch rate", "yaw rate", "roll", "pitch", "airspeed")
UNITS = ("deg/s", "deg/s", "deg/s", "deg", "deg", "m/s")


@dataclass(frozen=True, slots=True)
class Replay:
    """A log replayed by one model.

    model: which, for people: the base's name, or "identified".
    rms: by quantity of `QUANTITIES`, in `UNITS`: root mean square of replayed less logged, over all windows.
    windows: how many.  shown: (2, k, 6) logged and replayed values over the time of some windows, behind each other.
    """

    model: str
    rms: Mapping[str, float]
    windows: int
    shown: Floats


def replay_log(
    found: Identified, files: Mapping[str, str], name: str, records: Sequence[FlightRecord]
) -> tuple[Replay, ...]:
    """Replays by the base, scaled to the aircraft, and by the identified model; files: of the aircraft's folder."""
    clock = found.estimate.clocks[-1]
    signals = levelled(align(records, [Clocks(clock.lag, clock.delay, 0.0)] * len(records), 0.0))
    signals = replace(signals, airspeed=signals.airspeed * found.estimate.airspeed[0])
    flow = vane(signals, found.numbers, found.estimate.values)
    with temporary_folder("planfly-replay-") as place:
        folder = place / name
        folder.mkdir()
        for file, text in files.items():
            (folder / file).write_text(text, encoding="utf-8")
        aircraft = read_aircraft(folder)
        before = _replayed(found.base.name, aircraft, prior_means(), signals, flow, folder)
        after = _replayed("identified", aircraft, found.estimate.values, signals, flow, folder)
    return before, after


def _replayed(model: str, aircraft: Aircraft, values: Floats, signals: Signals, flow: Flow, folder: Path) -> Replay:
    fdm = Fdm(aircraft, rate_hz=_HZ)
    for parameter, value in zip(PARAMETERS, values.tolist(), strict=True):
        fdm.properties.set(parameter.property_name, value)
    del folder
    air = _air(signals, flow)
    rows = round(WINDOW * GRID_HZ)
    starts = [
        start
        for first, last in zip(signals.edges[:-1], signals.edges[1:], strict=True)
        for start in range(first, last - rows, rows)
    ]
    chosen = [starts[k] for k in np.unique(np.linspace(0, len(starts) - 1, COUNT).astype(int))]
    flown = np.array([_window(fdm, signals, air, start, rows) for start in chosen])
    logged = np.array([_logged(signals, start, rows) for start in chosen])
    off = flown - logged
    rms = np.sqrt(np.nanmean(np.square(off), axis=(0, 1)))
    shown = np.stack([logged[:4].reshape(-1, len(QUANTITIES)), flown[:4].reshape(-1, len(QUANTITIES))])
    return Replay(model, dict(zip(QUANTITIES, rms.tolist(), strict=True)), len(chosen), shown)


def _logged(signals: Signals, start: int, rows: int) -> Floats:
    part = slice(start, start + rows)
    angles = np.degrees(np.column_stack([signals.rates[part], signals.attitude[part, :2]]))
    return np.column_stack([angles, signals.airspeed[part]])


def _air(signals: Signals, flow: Flow) -> Floats:
    """(n, 3) how the air moved, north, east, down, m/s: velocity over the ground less that through the air."""
    roll, pitch, yaw = signals.attitude.T
    alpha, beta, speed = flow.alpha, flow.beta, signals.airspeed
    u, v, w = speed * np.cos(alpha) * np.cos(beta), speed * np.sin(beta), speed * np.sin(alpha) * np.cos(beta)
    right, below = v * np.cos(roll) - w * np.sin(roll), v * np.sin(roll) + w * np.cos(roll)
    ahead, down = u * np.cos(pitch) + below * np.sin(pitch), below * np.cos(pitch) - u * np.sin(pitch)
    north, east = ahead * np.cos(yaw) - right * np.sin(yaw), ahead * np.sin(yaw) + right * np.cos(yaw)
    return signals.smooth(signals.velocity - np.column_stack([north, east, down]), _GUST_BAND)


def _window(fdm: Fdm, signals: Signals, air: Floats, start: int, rows: int) -> Floats:
    """(rows, 6) of `QUANTITIES` as the model flies the window."""
    begin = slice(start, start + 1)
    fdm.begin_at(
        attitude=signals.attitude[begin][0],
        velocity=signals.velocity[begin][0],
        rates=signals.rates[begin][0],
        wind=air[start],
        amsl=_height_of(float(signals.density[start])),
        commands=[*signals.surfaces[start], float(signals.throttle[start])],
    )
    made = np.full((rows, len(QUANTITIES)), np.nan)
    steps = round(_HZ / GRID_HZ)
    for k in range(rows):
        state = fdm.read()
        made[k] = (
            *np.degrees([state.roll_rate, state.pitch_rate, state.yaw_rate]),
            *np.degrees([_near(state.roll, signals.attitude[start + k, 0]), state.pitch]),
            state.airspeed,
        )
        fdm.set_wind(*air[start + k])
        fdm.write([*signals.surfaces[start + k], float(signals.throttle[start + k])])
        fdm.step(steps)
    return made


def _near(angle: float, other: float) -> float:
    """Return the angle, whole turns nearer to another."""
    return angle + 2.0 * math.pi * round((other - angle) / (2.0 * math.pi))


def _height_of(density: float) -> float:
    """Return height of the standard atmosphere with a density (kg/m^3), m."""
    return float((1.0 - (density / 1.225) ** (1.0 / 4.25588)) / 2.25577e-5)
