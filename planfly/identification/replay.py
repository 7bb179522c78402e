"""Check a model by flying an unused log again in JSBSim, five seconds at a time.

Each window starts in the logged state and uses the logged controls; the motion of the air is computed from logged
airspeed, accelerometers and velocity.  The simulated motion is compared with the logged motion.
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
from aircraft.identification.level import level_signals
from aircraft.identification.parameters import PARAMETERS, prior_means
from flight.dynamics.fdm import Fdm
from planfly.identification.folder import Identified
from world.arrays import Floats
from world.files import temporary_folder

# Duration of a window, s.
WINDOW_S = 5.0
# Maximum number of windows of a log.
MAX_WINDOWS = 40
# Rate of JSBSim steps, Hz.
_JSBSIM_RATE_HZ = 100.0
# Highest frequency of gusts that is replayed, Hz.
_GUST_BANDWIDTH_HZ = 2.0
# Compared quantities.
QUANTITIES = ("roll rate", "pitch rate", "yaw rate", "roll", "pitch", "airspeed")
# Units of the compared quantities.
UNITS = ("deg/s", "deg/s", "deg/s", "deg", "deg", "m/s")


@dataclass(frozen=True, slots=True)
class Replay:
    """A log replayed by one model.

    model: displayed name of the model, which is the name of the base, or "identified".
    rms: root mean square of replayed minus logged value over all windows, for each of `QUANTITIES`, in `UNITS`.
    windows: number of windows.
    shown: logged and replayed values of some windows, one after the other, (2, k, 6).
    """

    model: str
    rms: Mapping[str, float]
    windows: int
    shown: Floats


def replay_log(
    identified: Identified, files: Mapping[str, str], name: str, records: Sequence[FlightRecord]
) -> tuple[Replay, ...]:
    """Replay a log with the base, scaled to the aircraft, and with the identified model.

    files: texts of the aircraft's folder by file name.
    """
    clock = identified.estimate.clocks[-1]
    signals = level_signals(align(records, [Clocks(clock.lag, clock.delay, 0.0)] * len(records), 0.0))
    signals = replace(signals, airspeed=signals.airspeed * identified.estimate.airspeed[0])
    flow = vane(signals, identified.numbers, identified.estimate.values)
    with temporary_folder("planfly-replay-") as parent:
        folder = parent / name
        folder.mkdir()
        for file, text in files.items():
            (folder / file).write_text(text, encoding="utf-8")
        aircraft = read_aircraft(folder)
        base_replay = _replay_model(identified.base.name, aircraft, prior_means(), signals, flow, folder)
        identified_replay = _replay_model("identified", aircraft, identified.estimate.values, signals, flow, folder)
    return base_replay, identified_replay


def _replay_model(model: str, aircraft: Aircraft, values: Floats, signals: Signals, flow: Flow, folder: Path) -> Replay:
    fdm = Fdm(aircraft, rate_hz=_JSBSIM_RATE_HZ)
    for parameter, value in zip(PARAMETERS, values.tolist(), strict=True):
        fdm.properties.set(parameter.property_name, value)
    del folder
    wind = _wind_velocity(signals, flow)
    rows = round(WINDOW_S * GRID_HZ)
    starts = [
        start
        for first, last in zip(signals.edges[:-1], signals.edges[1:], strict=True)
        for start in range(first, last - rows, rows)
    ]
    window_starts = [starts[k] for k in np.unique(np.linspace(0, len(starts) - 1, MAX_WINDOWS).astype(int))]
    replayed = np.array([_fly_window(fdm, signals, wind, start, rows) for start in window_starts])
    logged = np.array([_logged_quantities(signals, start, rows) for start in window_starts])
    errors = replayed - logged
    rms = np.sqrt(np.nanmean(np.square(errors), axis=(0, 1)))
    shown = np.stack([logged[:4].reshape(-1, len(QUANTITIES)), replayed[:4].reshape(-1, len(QUANTITIES))])
    return Replay(model, dict(zip(QUANTITIES, rms.tolist(), strict=True)), len(window_starts), shown)


def _logged_quantities(signals: Signals, start: int, rows: int) -> Floats:
    part = slice(start, start + rows)
    angles = np.degrees(np.column_stack([signals.rates[part], signals.attitude[part, :2]]))
    return np.column_stack([angles, signals.airspeed[part]])


def _wind_velocity(signals: Signals, flow: Flow) -> Floats:
    """Return the wind velocity north, east, down, which is ground velocity minus air velocity, m/s, (n, 3)."""
    roll, pitch, yaw = signals.attitude.T
    alpha, beta, speed = flow.alpha, flow.beta, signals.airspeed
    u, v, w = speed * np.cos(alpha) * np.cos(beta), speed * np.sin(beta), speed * np.sin(alpha) * np.cos(beta)
    air_right, air_below = v * np.cos(roll) - w * np.sin(roll), v * np.sin(roll) + w * np.cos(roll)
    air_ahead, air_down = u * np.cos(pitch) + air_below * np.sin(pitch), air_below * np.cos(pitch) - u * np.sin(pitch)
    air_north, air_east = (
        air_ahead * np.cos(yaw) - air_right * np.sin(yaw),
        air_ahead * np.sin(yaw) + air_right * np.cos(yaw),
    )
    return signals.smooth(signals.velocity - np.column_stack([air_north, air_east, air_down]), _GUST_BANDWIDTH_HZ)


def _fly_window(fdm: Fdm, signals: Signals, wind: Floats, start: int, rows: int) -> Floats:
    """Fly a window with the model, and return `QUANTITIES` at each row, (rows, 6)."""
    first_row = slice(start, start + 1)
    fdm.begin_at(
        attitude=signals.attitude[first_row][0],
        velocity=signals.velocity[first_row][0],
        rates=signals.rates[first_row][0],
        wind=wind[start],
        amsl=_density_altitude(float(signals.density[start])),
        commands=[*signals.surfaces[start], float(signals.throttle[start])],
    )
    quantities = np.full((rows, len(QUANTITIES)), np.nan)
    steps = round(_JSBSIM_RATE_HZ / GRID_HZ)
    for k in range(rows):
        state = fdm.read()
        quantities[k] = (
            *np.degrees([state.roll_rate, state.pitch_rate, state.yaw_rate]),
            *np.degrees([_unwrap_near(state.roll, signals.attitude[start + k, 0]), state.pitch]),
            state.airspeed,
        )
        fdm.set_wind(*wind[start + k])
        fdm.write([*signals.surfaces[start + k], float(signals.throttle[start + k])])
        fdm.step(steps)
    return quantities


def _unwrap_near(angle: float, reference: float) -> float:
    """Return an angle shifted by whole turns to be as near as possible to another angle, rad."""
    return angle + 2.0 * math.pi * round((reference - angle) / (2.0 * math.pi))


def _density_altitude(density: float) -> float:
    """Return the altitude at which the standard atmosphere has a density, m.  density: kg/m^3."""
    return float((1.0 - (density / 1.225) ** (1.0 / 4.25588)) / 2.25577e-5)
