"""Time plots of a flight: speed, bank, tracking errors and clearance; controls and their limits; energy."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from aircraft.envelope import GRAVITY
from flight.simulation.control_limits import control_limits, held_at_limit
from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import Track
from logs.figures.elements import style
from logs.figures.elements.panels import Panel, Series, Stack, doubles, draw_stack, time_axis

# Power is the battery's energy over this long, s: less would show its float32 steps.
_POWER_WINDOW = 2.0


def draw_time_plots(setup: FlightSetup, track: Track) -> Figure:
    """Seven or eight panels over time (s), those of `time_stack`.  Grey lines with numbers part the legs."""
    return draw_stack(time_stack(setup, track))


def time_stack(setup: FlightSetup, track: Track) -> Stack:
    """Airspeed, bank, climb, load factor, wind, cross-track error, height error and clearance over time.

    Clearance is computed from track and terrain, not read from the log; its panel is missing without terrain.
    """
    return Stack(_title(setup, "the flight over time"), _panels(setup, track), time_axis(track), track)


def draw_controls(setup: FlightSetup, track: Track) -> Figure:
    """Four panels over time, those of `control_stack`.  Shaded where a command is at or beyond its control's limit."""
    return draw_stack(control_stack(setup, track))


def control_stack(setup: FlightSetup, track: Track) -> Stack:
    """Elevator, aileron, rudder and throttle over time, as commanded and as they stood.

    Held: the command is at or beyond the control's limit, and the aircraft can give no more.
    """
    commanded: dict[str, Any] = {"color": style.LIMIT, "width": 2.0}
    panels = []
    limits = control_limits(setup.aircraft)
    for k, ((name, limit), asked, stood) in enumerate(zip(limits, track.commands.T, track.controls.T, strict=True)):
        unit, scale = ("%", 100.0) if name == "throttle" else ("°", 180.0 / np.pi)
        series = [
            Series("commanded", scale * doubles(asked), **commanded),
            Series("as it stood", scale * doubles(stood)),
        ]
        low, high = (0.0, 1.0) if name == "throttle" else (-limit, limit)
        known = np.isfinite([low, high]).all()
        edges = [("limits", scale * low), ("", scale * high)] if known else []
        panels.append(Panel(f"{name}\n({unit})", series, edges, held=held_at_limit(track, k, low, high)))
    return Stack(_title(setup, "controls and their limits"), panels, time_axis(track), track)


def draw_energy(setup: FlightSetup, track: Track) -> Figure:
    """Four panels over time, those of `energy_stack`."""
    return draw_stack(energy_stack(setup, track))


def energy_stack(setup: FlightSetup, track: Track) -> Stack:
    """Battery energy used, power, current, and the aircraft's specific energy as a height, over time.

    Of an aircraft that burns fuel, its heat is shown, and no current.
    """
    burns = setup.envelope.power_level.size > 0 and not setup.envelope.volts
    store, unit, power_unit, scale = (
        ("heat of fuel", "kWh", "kW", 1e-3) if burns else ("battery energy", "Wh", "W", 1.0)
    )
    seconds = track.time
    used = doubles(track.energy)
    late = np.searchsorted(seconds, seconds - _POWER_WINDOW)
    span = np.maximum(seconds - seconds[late], 1e-9)
    power = np.where(late < np.arange(len(track)), 3600.0 * (used - used[late]) / span, np.nan)
    height = track.position[:, 2]
    kinetic = doubles(track.airspeed) ** 2 / (2.0 * GRAVITY)
    panels = [
        Panel(f"{store}\nused ({unit})", [Series("used", scale * used, filled=True)]),
        Panel(f"power\n({power_unit})", [Series(f"mean of {_POWER_WINDOW:g} s", scale * power)]),
        *([] if burns else [Panel("battery\ncurrent (A)", [Series("current", doubles(track.current))])]),
        Panel(
            "energy as\nheight (m)",
            [
                Series("height and speed", height + kinetic, color=style.BLUE, width=1.6),
                Series("height alone", height),
            ],
        ),
    ]
    whole = f"{scale * setup.battery:.0f} {unit} {'in full tanks' if burns else 'in a full battery'}"
    return Stack(_title(setup, f"energy, of {whole}"), panels, time_axis(track), track)


def _title(setup: FlightSetup, subject: str) -> str:
    return f"{style.shorten(setup.scenario.name, 60)}: {subject}"


def _panels(setup: FlightSetup, track: Track) -> list[Panel]:
    roll, _, _ = track.attitude.T
    bank = np.degrees(doubles(roll))
    limit = float(np.degrees(min(setup.max_bank, setup.envelope.max_bank)))
    commanded: dict[str, Any] = {"color": style.LIMIT, "width": 1.8}
    panels = [
        Panel(
            "airspeed\n(m/s)",
            [Series("commanded", doubles(track.speed_command), **commanded), Series("flown", doubles(track.airspeed))],
            least_span=4.0,
        ),
        Panel(
            "bank, right +\n(°)",
            [Series("flown", bank)],
            [("limit of planned turns;\ncorrections may pass it", limit), ("", -limit)],
        ),
        Panel("climb rate\n(m/s)", [Series("flown", doubles(_up(track.velocity)))], least_span=1.0),
        Panel("load factor\n(g)", [Series("flown", doubles(track.load_factor))], least_span=0.2),
        Panel("wind, with\ngusts (m/s)", [Series("flown", _wind_speed(track))], least_span=1.0),
        Panel("cross-track,\nright + (m)", [Series("as guidance saw it", doubles(track.cross_track))], least_span=0.1),
        Panel("height error,\nhigh + (m)", [Series("as guidance saw it", doubles(track.height_error))], least_span=0.1),
    ]
    terrain = setup.scenario.terrain
    if terrain is not None:
        ground = terrain.height(track.position[:, 0], track.position[:, 1])
        above = Series("from track and terrain", track.position[:, 2] - ground)
        panels.append(Panel("height above\nground (m)", [above], [("required", setup.scenario.limits.min_clearance_m)]))
    return panels


def _up(vectors: NDArray[np.float32]) -> NDArray[np.float32]:
    up: NDArray[np.float32]
    _, _, up = vectors.T
    return up


def _wind_speed(track: Track) -> NDArray[np.float64]:
    """Speed of the air over the ground, level part, (t,) m/s."""
    east, north, _ = doubles(track.wind).T
    speed: NDArray[np.float64] = np.hypot(east, north)
    return speed
