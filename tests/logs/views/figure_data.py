"""A right angle and a climb in round numbers, a track along it and verdicts on it, to draw."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from flight.simulation.track import COLUMNS, Track
from logs.verdict.findings import Finding
from logs.verdict.places import Place
from logs.verdict.verdict import Verdict
from logs.views.draw_map import draw_map
from logs.views.drawing import draw_chart
from logs.views.failures import route_distance
from logs.views.map import flight_map
from logs.views.profile import profile_chart
from world.scenario import Scenario, scenario_from_spec

# A right angle and a climb, in round numbers: legs of 1,000, 800 and 600 m.
ROUTE = np.array([[-900.0, -400.0, 300.0], [100.0, -400.0, 340.0], [100.0, 400.0, 380.0], [700.0, 400.0, 360.0]])


def make_scenario(**changes: Any) -> Scenario:
    spec: dict[str, Any] = {
        "name": "small",
        "terrain": {"kind": "peaks", "peak": [{"east_m": 0, "north_m": 0, "height_m": 250, "sigma_m": 400}]},
        "area": {"east_m": [-1200, 1200], "north_m": [-800, 800], "ceiling_amsl_m": 500},
        "start": {"east_m": -900, "north_m": -400, "amsl_m": 300},
        "destination": {"east_m": 700, "north_m": 400, "amsl_m": 360},
        "threats": [
            {"name": "M one", "east_m": 300, "north_m": 0, "kill_radius_m": 250, "kill_scale_m": 50},
            {"name": "R one", "east_m": -500, "north_m": 200, "detection_radius_m": 700, "detection_scale_m": 90},
        ],
        "wind": {"speed_mps": 5, "from_deg": 250, "turbulence": "light"},
    }
    external = changes.pop("external", False)
    return scenario_from_spec(spec | changes, "test", external=external)


def make_track(route: np.ndarray = ROUTE, rate: float = 2.0) -> Track:
    at = route_distance(route)
    count = int(at[-1] / 25.0 * rate)
    along = np.linspace(0.0, at[-1], count)
    position = np.column_stack([np.interp(along, at, route[:, axis]) for axis in range(3)])
    values: dict[str, np.ndarray] = {
        name: np.zeros((count, width)) if width > 1 else np.zeros(count) for name, width in COLUMNS.items()
    }
    values |= {"time": np.arange(count) / rate, "position": position, "airspeed": np.full(count, 25.0)}
    values["leg"] = np.clip(np.searchsorted(at, along, side="right") - 1, 0, len(route) - 2)
    return Track(**values)  # type: ignore[arg-type]  # the track gives each column its type


def make_verdict(*bad: tuple[str, Place]) -> Verdict:
    findings = [Finding("slope", Place("leg", 0), 2.0, 2.0, 8.0, "aircraft", 0.1, 6.0, "deg", "fit", True, "")]
    findings += [
        Finding(rule, place, 9.0, 9.0, 8.0, "aircraft", 0.1, -1.0, "deg", "fit", False, "") for rule, place in bad
    ]
    return Verdict(tuple(findings), not bad, True, ("flyable" if not bad else "not flyable",), "flown")


ALL = {"plan_waypoints": ROUTE, "route_waypoints": ROUTE}
NONE_TERRAIN = {"terrain": {"kind": "none"}, "threats": []}
FAILED = make_verdict(("slope", Place("leg", 1)), ("turn", Place("waypoint", 2, 3)))


def drawn_map(scenario: Scenario, **of: Any) -> Figure:
    return draw_map(flight_map(scenario, **of))


def drawn_profile(scenario: Scenario, **of: Any) -> Figure:
    return draw_chart(profile_chart(scenario, **of))
