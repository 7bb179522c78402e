"""What the page's map shows beside the scene that it shares with the 3-D view."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from flight.simulation.flight_setup import FlightSetup
from flight.simulation.track import Track
from logs.figures.elements.failures import Failures, paths_differ
from logs.figures.elements.scene_data import scene_bounds
from logs.figures.elements.threats import kill_radius_at_path
from logs.report.charts.flight_moments import position_text, waypoint_names

# Rim about what is shown, of its longer side.
_RIM = 0.015


def map_chart(setup: FlightSetup, tracks: Sequence[Track], failed: Failures) -> dict[str, Any]:
    """Reach of missiles at the path's height, names of waypoints, ends, and how far the map reaches; lengths in m.

    entered: numbers of threats whose rule fails.  searched: the plan where it differs from the mission's route.

    >>> from logs.recording.example_log import example_log
    >>> log = example_log()
    >>> sorted(map_chart(log.setup, [log.track], Failures({}, {})))[:4]
    ['area', 'destination', 'entered', 'origin']
    """
    scenario, route = setup.scenario, setup.route.waypoints
    missiles = np.flatnonzero(scenario.threats.kill_radius > 0.0)
    reach = np.zeros(len(scenario.threats))
    if missiles.size:
        reach[missiles] = kill_radius_at_path(scenario.threats, missiles, route)
    bounds = np.stack([scene_bounds(setup, None), *(scene_bounds(setup, track) for track in tracks)])
    low, high = bounds[..., 0].min(axis=0), bounds[..., 1].max(axis=0)
    rim = _RIM * float((high - low).max())
    plan = setup.plan.waypoints if setup.plan is not None else None
    differs = plan is not None and paths_differ(plan, route, 1.0)
    return {
        "origin": position_text(scenario.origin.lat_deg, scenario.origin.lon_deg),
        "shown": np.round(np.stack([low - rim, high + rim], axis=1), 1).tolist(),
        "area": None if scenario.external else np.round(scenario.bounds, 1).tolist(),
        "reach": np.round(reach, 1).tolist(),
        "entered": sorted({place.index for place in failed.threats if place.index is not None}),
        "waypoints": waypoint_names(setup),
        "routeName": "route of the mission" if plan is None or differs else "planned path",
        "searched": np.round(plan[:, :2], 1).tolist() if plan is not None and differs else None,
        "start": np.round(scenario.start[:2], 1).tolist(),
        "destination": np.round(scenario.destination[:2], 1).tolist(),
    }
