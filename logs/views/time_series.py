"""Chart a flight over time: tracking, controls and their limits, energy, and exposure."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aircraft.envelope import GRAVITY
from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track, control_limits, saturated_rows
from logs.views.charts import Chart, Panel, filled_series, make_leg_marks, make_saturation_band, series, shorten
from world.arrays import Floats
from world.geometry import segment_exposure
from world.kernels import compiled

_GUIDANCE_SERIES = "according to guidance"
# Window for power from battery energy, s: a shorter window would show the float32 steps of the energy.
_POWER_WINDOW_S = 2.0


def to_float64(values: NDArray[np.float32]) -> Floats:
    """Convert float32 values of a track to float64, so that calculations with them add no rounding errors."""
    return values.astype(np.float64)


def chart_over_time(setup: FlightSetup, subject: str, panels: list[Panel], track: Track) -> Chart:
    """Stack panels over the time since the start, with a mark at the start of each leg.

    subject: what the panels show, for the title, e.g. "the flight over time".
    panels: panels whose horizontal axis is time, s.
    """
    title = f"{shorten(setup.scenario.name, 60)}: {subject}"
    marks = make_leg_marks(setup.route.leg_numbers_of(track.leg), track.time)
    return Chart(title, "time since the start", "s", tuple(panels), marks=marks, timed=True)


def time_chart(setup: FlightSetup, track: Track) -> Chart:
    """Chart airspeed, bank, climb rate, load factor, wind, path errors and height above ground over time.

    The height above ground is computed from track and terrain, not read from the log.  Its panel is omitted if the
    scenario has no terrain.
    """
    time = track.time
    roll, _, _ = track.attitude.T
    _, _, climb = track.velocity.T
    east, north, _ = to_float64(track.wind).T
    bank_limit = float(np.degrees(min(setup.max_bank, setup.envelope.max_bank)))
    airspeed = (
        series("commanded", "commanded", time, track.speed_command),
        series("flown", "flown", time, track.airspeed),
    )
    turn_limits = (("limit of planned turns; corrections may bank beyond it", bank_limit), ("", -bank_limit))

    def make_single_line_panel(title: str, unit: str, values: Floats, min_span: float, name: str = "flown") -> Panel:
        """Make a panel with one line; `min_span` is the smallest range that its vertical axis shows."""
        return Panel(title, unit, (series(name, "flown", time, values),), min_span=min_span)

    panels = [
        Panel("airspeed", "m/s", airspeed, min_span=4.0),
        replace(make_single_line_panel("bank, right +", "°", np.degrees(to_float64(roll)), 1.0), limits=turn_limits),
        make_single_line_panel("climb rate", "m/s", to_float64(climb), 1.0),
        make_single_line_panel("load factor", "g", to_float64(track.load_factor), 0.2),
        make_single_line_panel("wind, with gusts", "m/s", np.hypot(east, north), 1.0),
        make_single_line_panel("cross-track, right +", "m", to_float64(track.cross_track), 0.1, _GUIDANCE_SERIES),
        make_single_line_panel("height error, high +", "m", to_float64(track.height_error), 0.1, _GUIDANCE_SERIES),
    ]
    terrain = setup.scenario.terrain
    if terrain is not None:
        height_above_ground = track.position[:, 2] - terrain.height(track.position[:, 0], track.position[:, 1])
        clearance_limit = (("required", setup.scenario.limits.min_clearance_m),)
        panels.append(
            replace(
                make_single_line_panel("height above ground", "m", height_above_ground, 1.0, "from track and terrain"),
                limits=clearance_limit,
            )
        )
    return chart_over_time(setup, "the flight over time", panels, track)


def control_chart(setup: FlightSetup, track: Track) -> Chart:
    """Chart commanded and actual elevator, aileron, rudder and throttle over time.

    Times at which a command is at or beyond the control's limit are shaded.
    """
    panels = []
    limits = control_limits(setup.aircraft)
    for k, ((name, limit), command, position) in enumerate(
        zip(limits, track.commands.T, track.controls.T, strict=True)
    ):
        unit, scale = ("%", 100.0) if name == "throttle" else ("°", 180.0 / np.pi)
        min_value, max_value = (0.0, 1.0) if name == "throttle" else (-limit, limit)
        layers = (
            series("commanded", "commanded", track.time, scale * to_float64(command)),
            series("actual", "flown", track.time, scale * to_float64(position)),
        )
        has_limits = np.isfinite([min_value, max_value]).all()
        panel = Panel(
            name, unit, layers, (("limits", scale * min_value), ("", scale * max_value)) if has_limits else ()
        )
        is_saturated = saturated_rows(track, k, min_value, max_value)
        if is_saturated.any():
            panel = replace(panel, layers=(make_saturation_band(is_saturated, track.time, panel.shown_span()), *layers))
        panels.append(panel)
    return chart_over_time(setup, "controls and their limits", panels, track)


def energy_chart(setup: FlightSetup, track: Track) -> Chart:
    """Chart battery energy used, power, current, and the aircraft's specific energy over time.

    The specific energy is shown as a height, m.  An aircraft that burns fuel has a panel of the fuel's heat instead of
    the battery energy, and no panel of the current.
    """
    burns_fuel = setup.envelope.power_level.size > 0 and not setup.envelope.volts
    store_name, unit, power_unit, scale = (
        ("heat of fuel", "kWh", "kW", 1e-3) if burns_fuel else ("battery energy", "Wh", "W", 1.0)
    )
    time = track.time
    used_energy = to_float64(track.energy)
    window_start = np.searchsorted(time, time - _POWER_WINDOW_S)
    durations = np.maximum(time - time[window_start], 1e-9)
    power = np.where(
        window_start < np.arange(len(track)), 3600.0 * (used_energy - used_energy[window_start]) / durations, np.nan
    )
    height = track.position[:, 2]
    kinetic_height = to_float64(track.airspeed) ** 2 / (2.0 * GRAVITY)
    energy_heights = (
        series("height and speed", "second", time, height + kinetic_height),
        series("height only", "flown", time, height),
    )
    panels = [
        Panel(f"{store_name} used", unit, (filled_series("used", "difference", time, scale * used_energy),)),
        Panel("power", power_unit, (series(f"mean of {_POWER_WINDOW_S:g} s", "flown", time, scale * power),)),
        *([] if burns_fuel else [Panel("battery current", "A", (series("current", "flown", time, track.current),))]),
        Panel("energy as height", "m", energy_heights),
    ]
    capacity_text = f"{scale * setup.battery:.0f} {unit} {'in full tanks' if burns_fuel else 'in a full battery'}"
    return chart_over_time(setup, f"energy, of {capacity_text}", panels, track)


# Exposure along the flown track.

# Largest number of straight segments that replace the track; exposures are summed over these segments.
_MAX_SEGMENTS = 12_000


def compute_exposure_rates(position: Floats, centres: Floats, radii: Floats, scales: Floats) -> Floats:
    """Return the exposure rate on each segment of a track, (t - 1,), summed over all spheres.

    The rate is the mean over the segment of (scale / d)^4, where d is the distance from the sphere's centre; it is 0
    outside the sphere (paper eq. 9, 10).  Segments with an unknown end (NaN) have the rate NaN.

    position: ends of the segments, m, (t, 3).
    centres: centres of the spheres, m, (m, 3).
    radii: radius of each sphere, m, (m,); spheres with radius 0 are ignored.
    scales: distance at which the rate is 1, for each sphere, m, (m,).
    """
    return _sum_exposure_rates(
        np.ascontiguousarray(position), np.ascontiguousarray(centres), np.ascontiguousarray(radii), scales.copy()
    )


@compiled
def _sum_exposure_rates(position: Floats, centres: Floats, radii: Floats, scales: Floats) -> Floats:
    """Compute the result of `compute_exposure_rates` from contiguous arrays."""
    count = position.shape[0] - 1
    rates = np.zeros(max(0, count))
    for k in range(count):
        for m in range(centres.shape[0]):
            if radii[m] > 0.0:
                _, rate = segment_exposure(position[k], position[k + 1], centres[m], radii[m], scales[m])
                rates[k] += rate
    return rates


def exposure_chart(setup: FlightSetup, track: Track) -> Chart | None:
    """Chart the exposure to kill and to detection over the distance flown (km).

    It is shown as a rate and summed over time.  An exposure that was zero throughout has no panels.  Return None if
    both were zero or the track has fewer than two known positions.
    """
    threats = setup.scenario.threats
    if not len(threats) or len(track) < 2:
        return None
    rows = np.unique(np.linspace(0, len(track) - 1, min(len(track), _MAX_SEGMENTS)).astype(np.intp))
    rows = rows[np.isfinite(track.position[rows]).all(axis=1)]
    if rows.size < 2:
        return None
    time, position = track.time[rows], track.position[rows]
    steps = np.hypot(*np.diff(position[:, :2], axis=0).T)
    kilometres = np.concatenate([[0.0], np.cumsum(steps)]) / 1000.0
    panels: list[Panel] = []
    for name, role, radii, scales in (
        ("kill", "missile", threats.kill_radius, threats.kill_scale),
        ("detection", "radar", threats.detection_radius, threats.detection_scale),
    ):
        if not (radii > 0.0).any():
            continue
        rate = compute_exposure_rates(position, threats.position, radii, scales)
        if not np.nansum(rate):
            continue
        exposure = np.concatenate([[0.0], np.cumsum(np.nan_to_num(rate) * np.diff(time))])
        strength_layer = filled_series("strength", role, kilometres, np.append(rate, rate[-1]))
        panels.append(Panel(f"{name} strength", "", (strength_layer,)))
        panels.append(Panel(f"{name} so far", "s", (series("sum over time", role, kilometres, exposure),)))
    if not panels:
        return None
    title = f"{shorten(setup.scenario.name, 60)}: exposure along the flown track"
    marks = make_leg_marks(setup.route.leg_numbers_of(track.leg[rows]), kilometres)
    return Chart(title, "distance flown over the ground", "km", tuple(panels), marks=marks)
