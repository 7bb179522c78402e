"""Draw an aircraft: its envelope, trims and modes over airspeed, and responses to the controls."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from aircraft.catalog import Aircraft
from aircraft.envelope import Envelope, turn_radius
from flight.dynamics.characteristics import TRIM_AMSL, Mode, StepResponse, TrimRow
from logs import theme
from logs.views.drawing import clean_style, new_figure

# Bank angles of the turns, degrees.
_BANKS_DEG = (15, 20, 30, 40)
# Tailwinds for the slopes over the ground, m/s; negative for headwinds.
_WINDS = (-10.0, -5.0, 0.0, 5.0, 10.0)
# Line styles from solid to dotted, in the order of `theme.SHADES` from dark to light.
_DASHES: tuple[Any, ...] = ("-", (0, (7, 2)), (0, (4, 2)), (0, (2, 2)), (0, (1, 1.5)))
# Marker of each mode.
_MARKS = {"short period": "o", "phugoid": "s", "Dutch roll": "D", "roll-spiral": "P", "roll": "^", "spiral": "v"}
_MODE_COLORS = dict(zip(_MARKS, theme.MODES, strict=True))
# Name, unit and factor of the values of each quantity of a step response.
_QUANTITIES = {
    "pitch": ("pitch", "°", 180.0 / math.pi),
    "roll": ("roll", "°", 180.0 / math.pi),
    "yaw": ("heading", "°", 180.0 / math.pi),
    "alpha": ("angle of attack", "°", 180.0 / math.pi),
    "beta": ("sideslip", "°", 180.0 / math.pi),
    "roll_rate": ("roll rate", "°/s", 180.0 / math.pi),
    "yaw_rate": ("yaw rate", "°/s", 180.0 / math.pi),
    "airspeed": ("airspeed", "m/s", 1.0),
    "amsl": ("height", "m", 1.0),
}


def draw_envelope(aircraft: Aircraft, envelope: Envelope) -> Figure:
    """Draw the steady-flight envelope of an aircraft in four panels.

    The panels show: steepest slopes over airspeed; slowest and fastest level flight over altitude; steepest slopes over
    the ground in headwind and tailwind; turn radius over ground speed.

    >>> from aircraft.catalog import load_aircraft
    >>> from logs.recording.example_log import example_log
    >>> figure = draw_envelope(load_aircraft("aerosonde"), example_log().setup.envelope)
    >>> [axes.get_title(loc="left") for axes in figure.axes]
    ['steepest climb and descent relative to the air', 'level flight',
     'steepest climb and descent over the ground, at 500 m', 'turn radius']
    """
    with clean_style():
        figure = new_figure(8.0)
        (slopes, levels), (ground_slopes, turns) = figure.subplots(2, 2)
        figure.subplots_adjust(left=0.075, right=0.975, top=0.87, bottom=0.065, wspace=0.2, hspace=0.32)
        if aircraft.battery_voltage == 0.0:
            descent_text = "throttle closed"
        else:
            descent_text = (
                "the motor brakes" if envelope.motor_braking else "without current (the motor does not brake)"
            )
        subtitle = (
            f"JSBSim trims; climbs at full throttle, descents: {descent_text}; shaded: the speeds that guidance uses"
        )
        _write_title(figure, f"{aircraft.title}: steady flight envelope", subtitle)
        shades = [{"color": theme.SHADES[k], "linestyle": dashes, "linewidth": 1.3} for k, dashes in enumerate(_DASHES)]
        # Steepest climb and descent over airspeed, a line for each of several altitudes.
        columns = np.linspace(0, envelope.amsl.size - 1, len(theme.SHADES)).round().astype(int)
        for style, column in zip(shades, columns, strict=True):
            climb, descent = np.degrees(envelope.climb[:, column]), np.degrees(envelope.descent[:, column])
            slopes.plot(envelope.airspeed, climb, label=f"{envelope.amsl[column]:.0f} m", **style)
            slopes.plot(envelope.airspeed, -descent, **style)
        slopes.axhline(0.0, color=theme.colour("area"), linewidth=0.8)
        _shade_guidance_speeds(slopes, aircraft)
        slopes_title = "steepest climb and descent relative to the air"
        _set_up_axes(slopes, slopes_title, "airspeed (m/s)", "flight path (°)")
        _add_legend_above(slopes, "altitude (AMSL)", 3)
        # Slowest and fastest speed of level flight over altitude.
        slowest, fastest = envelope.level_speed_min, envelope.level_speed_max
        levels.fill_betweenx(envelope.amsl, slowest, fastest, color=theme.colour("planned"), alpha=0.2, linewidth=0)
        slowest_style: dict[str, Any] = {"color": theme.colour("limit"), "linestyle": "--", "linewidth": 1.3}
        levels.plot(slowest, envelope.amsl, label="slowest: elevator full up", **slowest_style)
        levels.plot(fastest, envelope.amsl, color=theme.colour("second"), linewidth=1.3, label="fastest: full throttle")
        _shade_guidance_speeds(levels, aircraft)
        margin = 0.08 * float(np.nanmax(fastest) - np.nanmin(slowest))
        levels.set_xlim(float(np.nanmin(slowest)) - margin, float(np.nanmax(fastest)) + margin)
        _set_up_axes(levels, "level flight", "airspeed (m/s)", "altitude (m AMSL)")
        _add_legend_above(levels, "", 2)
        # Steepest climb and descent over the ground, a line for each head- or tailwind.
        airspeeds = np.linspace(aircraft.airspeed_min, aircraft.airspeed_max, 60)
        for style, wind in zip(shades, _WINDS, strict=True):
            limits = [envelope.slope_limits(float(airspeed), TRIM_AMSL, wind) for airspeed in airspeeds]
            climb, descent = np.degrees(limits).T
            name = "calm" if wind == 0.0 else f"{abs(wind):.0f} m/s {'tail' if wind > 0.0 else 'head'}wind"
            ground_slopes.plot(airspeeds, climb, label=name, **style)
            ground_slopes.plot(airspeeds, -descent, **style)
        ground_slopes.axhline(0.0, color=theme.colour("area"), linewidth=0.8)
        ground_title = f"steepest climb and descent over the ground, at {TRIM_AMSL:.0f} m"
        _set_up_axes(ground_slopes, ground_title, "airspeed (m/s)", "slope (°)")
        _add_legend_above(ground_slopes, "", 3)
        # Turn radius over ground speed, a line for each bank angle.
        speeds = np.linspace(aircraft.airspeed_min, aircraft.airspeed_max + 10.0, 80)
        for style, bank in zip(shades, _BANKS_DEG, strict=False):
            radii = [turn_radius(float(speed), math.radians(bank)) for speed in speeds]
            turns.plot(speeds, radii, label=f"{bank}° of bank", **style)
        _shade_guidance_speeds(turns, aircraft)
        _set_up_axes(turns, "turn radius", "ground speed (m/s)", "radius (m)")
        turns.set_ylim(0.0, None)
        _add_legend_above(turns, "", 2)
    return figure


def draw_trims(aircraft: Aircraft, trims: Sequence[TrimRow], modes: Mapping[float, Sequence[Mode]]) -> Figure:
    """Draw the trims of level flight, and the modes of motion, in four panels.

    The panels show: angle of attack and control surfaces over airspeed; throttle and power over airspeed; the roots of
    all modes in the complex plane; the roots of the slow modes, enlarged.

    trims: trims in ascending order of airspeed.
    modes: modes of motion at each airspeed, keyed by airspeed, m/s.

    >>> from aircraft.catalog import load_aircraft
    >>> from flight.dynamics.characteristics import level_flight_modes, trim_table
    >>> aircraft = load_aircraft("aerosonde")
    >>> figure = draw_trims(aircraft, trim_table(aircraft, 3), {25.0: level_flight_modes(aircraft, 25.0)})
    >>> figure.axes[0].get_xlabel(), figure.axes[1].get_ylabel()
    ('airspeed (m/s)', 'throttle (%)')
    """
    with clean_style():
        figure = new_figure(8.0)
        axes = figure.subplots(2, 2)
        figure.subplots_adjust(left=0.075, right=0.93, top=0.87, bottom=0.065, wspace=0.28, hspace=0.32)
        _write_title(
            figure, f"{aircraft.title}: level flight and its modes", f"JSBSim trims at {TRIM_AMSL:.0f} m AMSL, calm"
        )
        speeds = np.array([row.trim.airspeed for row in trims])
        for k, name in enumerate(("alpha", "elevator", "aileron", "rudder")):
            values = np.degrees([getattr(row.trim, name) for row in trims])
            label = "angle of attack" if name == "alpha" else name
            axes[0, 0].plot(
                speeds,
                values,
                "o",
                linestyle=_DASHES[k],
                color=theme.SHADES[k],
                markersize=3,
                linewidth=1.2,
                label=label,
            )
        axes[0, 0].axhline(0.0, color=theme.colour("area"), linewidth=0.8)
        _set_up_axes(axes[0, 0], "angle of attack and surfaces", "airspeed (m/s)", "angle (°)")
        _add_legend_above(axes[0, 0], "", 2)
        # Throttle and power over airspeed, with an axis for each.
        throttle_axes = axes[0, 1]
        throttles = [100.0 * row.trim.throttle for row in trims]
        throttle_axes.plot(speeds, throttles, "o-", color=theme.colour("flown"), markersize=3, label="throttle")
        power_name = "battery power" if aircraft.battery_voltage > 0.0 else "heat of the fuel"
        power_axes = throttle_axes.twinx()
        power = np.array([row.power for row in trims]) / 1000.0
        power_style: dict[str, Any] = {"linestyle": "--", "color": theme.colour("second"), "markersize": 3}
        power_axes.plot(speeds, power, "s", label=f"{power_name} (right)", **power_style)
        power_axes.set_ylabel("power (kW)")
        power_axes.set_ylim(0.0, 1.15 * float(power.max(initial=0.1)))
        throttle_axes.set_ylim(0.0, 105.0)
        _set_up_axes(throttle_axes, "throttle and power", "airspeed (m/s)", "throttle (%)")
        lines = [*throttle_axes.get_lines(), *power_axes.get_lines()]
        throttle_axes.legend(lines, [line.get_label() for line in lines], loc="lower right")
        _draw_roots(axes[1, 0], modes, all_modes=True)
        _draw_roots(axes[1, 1], modes, all_modes=False)
    return figure


def _draw_roots(axes: Any, modes: Mapping[float, Sequence[Mode]], *, all_modes: bool) -> None:
    """Draw the roots of the modes of motion at each airspeed in the upper half of the complex plane.

    modes: modes of motion at each airspeed, keyed by airspeed, m/s.
    all_modes: True for all modes, False for only the slow modes, whose roots are near the origin.
    """
    slow_modes = {"phugoid", "spiral", "roll-spiral"}
    labelled_modes: set[str] = set()
    for speed, speed_modes in modes.items():
        is_max_speed = speed == max(modes)
        for mode in speed_modes:
            if not all_modes and mode.name not in slow_modes:
                continue
            # Markers are filled at the highest airspeed, to show the direction of the root locus.
            axes.plot(
                mode.root.real,
                mode.root.imag,
                _MARKS[mode.name],
                color=_MODE_COLORS[mode.name],
                markersize=5,
                markerfacecolor=_MODE_COLORS[mode.name] if is_max_speed else theme.colour("paper"),
                label=None if mode.name in labelled_modes else mode.name,
            )
            labelled_modes.add(mode.name)
    axes.axvline(0.0, color=theme.colour("area"), linewidth=0.8)
    speed_range_text = f"from {min(modes):g} m/s (hollow) to {max(modes):g} m/s (filled)" if modes else ""
    title = f"modes {speed_range_text}" if all_modes else "the slow modes, enlarged"
    _set_up_axes(axes, title, "real part (1/s): right of 0 is unstable", "imaginary part (rad/s)")
    min_x, max_x = axes.get_xlim()
    axes.set_xlim(min_x - 0.05 * (max_x - min_x), max_x + 0.05 * (max_x - min_x))
    axes.xaxis.set_major_locator(MaxNLocator(6))
    axes.set_ylim(-0.04 * axes.get_ylim()[1], None)
    axes.legend(loc="best")


def draw_step_responses(aircraft: Aircraft, steps: Sequence[StepResponse]) -> Figure:
    """Draw the step responses of an aircraft: one column of panels for each step.

    Each panel shows over time (s) how much one quantity differs from its value in level flight.  The time during which
    the control is deflected is shaded.

    >>> from aircraft.catalog import load_aircraft
    >>> from flight.dynamics.characteristics import step_responses
    >>> aircraft = load_aircraft("aerosonde")
    >>> figure = draw_step_responses(aircraft, step_responses(aircraft))
    >>> [axes.get_title(loc="left") for axes in figure.axes[:4]]
    ['change of pitch (°)', 'change of pitch (°)', 'change of roll (°)', 'change of roll (°)']
    """
    panel_count = max(len(step.quantities) for step in steps)
    with clean_style():
        figure = new_figure(1.3 + 1.7 * panel_count)
        axes = figure.subplots(panel_count, len(steps), squeeze=False, sharex="col")
        figure.subplots_adjust(left=0.05, right=0.985, top=0.865, bottom=0.065, wspace=0.24, hspace=0.28)
        start_text = f"level flight at {aircraft.airspeed:g} m/s and {TRIM_AMSL:.0f} m"
        _write_title(
            figure, f"{aircraft.title}: step responses", f"from {start_text}, one control moved at 1 s, no guidance"
        )
        for column, step in enumerate(steps):
            for row in range(panel_count):
                panel = axes[row, column]
                if row >= len(step.quantities):
                    panel.axis("off")
                    continue
                # Change of one quantity after the step; the time for which the step lasts is shaded.
                name, unit, factor = _QUANTITIES[step.quantities[row]]
                values = factor * step.change[:, row]
                panel.axhline(0.0, color=theme.colour("rim"), linewidth=0.6)
                hold_time = min(step.hold_time, float(step.time[-1]) - 1.0)
                panel.axvspan(1.0, 1.0 + hold_time, color=theme.colour("commanded"), alpha=0.12, linewidth=0)
                panel.plot(step.time, values, color=theme.colour("flown"), linewidth=1.1)
                panel.set_xlim(0.0, float(step.time[-1]))
                panel.set_title(f"change of {name} ({unit})", fontsize=8.5, pad=3.0)
                panel.grid(color=theme.colour("grid"), linewidth=0.5)
                panel.set_axisbelow(True)
            column_box = axes[0, column].get_position()
            control = step.control
            if step.control == "throttle":
                size_text = f"{100.0 * step.size:+.0f} %"
            else:
                # Directions of a positive and of a negative step.
                direction_names = {
                    "elevator": ("down", "up"),
                    "aileron": ("to roll right", "to roll left"),
                    "rudder": ("to yaw left", "to yaw right"),
                }
                size_text = f"{abs(math.degrees(step.size)):.1f}° {direction_names[step.control][step.size < 0.0]}"
            title = f"{control} {size_text}" + (
                f", {step.hold_time:.0f} s" if math.isfinite(step.hold_time) else ", held"
            )
            figure.text(column_box.x0, column_box.y1 + 0.035, title, fontsize=9.0, fontweight="bold")
            axes[-1, column].set_xlabel("time (s)")
    return figure


def _add_legend_above(axes: Any, title: str, columns: int) -> None:
    """Draw the legend at the top of a panel, and extend the vertical axis to make space for it."""
    legend = axes.legend(title=title or None, loc="upper right", ncols=columns, columnspacing=1.2, handlelength=1.8)
    renderer = axes.figure.canvas.get_renderer()
    legend_fraction = (axes.bbox.y1 - legend.get_window_extent(renderer).y0) / axes.bbox.height
    min_y, max_y = axes.get_ylim()
    axes.set_ylim(min_y, min_y + (max_y - min_y) / (1.0 - legend_fraction))


def _shade_guidance_speeds(axes: Any, aircraft: Aircraft) -> None:
    """Shade the airspeeds that guidance uses on the horizontal axis, and mark the cruise airspeed."""
    axes.axvspan(aircraft.airspeed_min, aircraft.airspeed_max, color=theme.colour("flown"), alpha=0.05, linewidth=0)
    axes.axvline(aircraft.airspeed, color=theme.colour("quiet"), linewidth=0.8, linestyle=":")


def _set_up_axes(axes: Any, title: str, x_label: str, y_label: str) -> None:
    """Set the title and the axis labels of a panel, and draw its grid."""
    axes.set_title(title, fontsize=9.5)
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)
    axes.grid(color=theme.colour("grid"), linewidth=0.5)
    axes.set_axisbelow(True)


def _write_title(figure: Figure, title: str, subtitle: str) -> None:
    """Write the title and the subtitle at the top of a figure."""
    height = figure.get_figheight()
    figure.text(0.06, 1.0 - 0.28 / height, title, fontsize=12, fontweight="bold", va="center")
    figure.text(0.06, 1.0 - 0.55 / height, subtitle, fontsize=8.5, color=theme.colour("quiet"), va="center")
