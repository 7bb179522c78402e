"""Make a scenario in Python, from another scenario with other threats and other values in its tables."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from planfly.flight_options import load_scenario_with_options
from planfly.runtime.stages import report_line
from planfly.threat_tables import GivenThreats, threat_tables
from planner.search.algorithms import find_algorithm
from world.argument_types import checks_types
from world.errors import ArgumentError
from world.scenario import Scenario, scenario_from_spec
from world.scenario_tables import OWN_GUIDANCE

# Tables of a position, which replace another position as a whole.
_POSITIONS = ("start", "destination", "home")
# Keys that name the source of a table; with another value of one of them, the table replaces the base's table.
_SOURCE_KEYS = ("kind", "path")
# Keys of [flight] that belong to one autopilot.
_AUTOPILOT_KEYS = ("autopilot", "autopilot_from", "params", "arduplane_version", "px4_version", "guidance")
# Tables from which the terrain is made.
_TERRAIN_TABLES = frozenset(("terrain", "area", "origin"))


@checks_types
def make_scenario(
    base: Scenario | str | Path,
    *,
    threats: GivenThreats | None = None,
    **tables: Any,
) -> Scenario:
    """Make a scenario from another scenario, with other threats and other values.

    The result is a scenario for `planfly.plan`, `planfly.fly` and `planfly.campaign`.  Its method ``to_toml`` writes it
    to a file.

    base: a built-in scenario's name, a TOML file's path, or a `Scenario`.
    threats: threats that replace the base's threats; None keeps the base's threats.  They are a pandas data frame or a
    mapping of columns, named as the keys of [[threats]]; a list of mappings with these keys; or an array (n, 4) of
    east, north, kill radius and detection radius, m.  A radius that is 0 or None means no such zone.  A scale that is
    None is a quarter of the kill radius, or a third of the detection radius.  NaN is refused.
    tables: values of other tables, as mappings with the keys of a scenario file, whose lists may be arrays; also name
    and description.  Keys of a table that are not named keep their values.  A position, and a table of another kind or
    file, are replaced as a whole.
    Another autopilot replaces the base's release, parameter file and guidance law.
    With another elevation file, the center of its latitudes and longitudes becomes the origin, unless an origin is
    named.
    Raises a `planfly.PlanflyError` for values that a scenario file must not have.

    >>> import planfly
    >>> sites = {"east_m": [900.0, 1500.0], "north_m": [90.0, -90.0], "kill_radius_m": [60.0, 60.0]}
    >>> scenario = planfly.make_scenario("tight", threats=sites, wind={"speed_mps": 4.0, "from_deg": 270.0})
    >>> scenario.threats.kill_scale.tolist(), scenario.wind.speed
    ([15.0, 15.0], 4.0)
    """
    given_terrain = tables.get("terrain")
    given_path = given_terrain.get("path") if isinstance(given_terrain, Mapping) else None
    for name, value in (("terrain", given_terrain), ("terrain.path", given_path)):
        if isinstance(value, np.ndarray):
            allowed = (
                'expected {"kind": "dem", "path": FILE}; an array of heights (m, rows from north to south) with edges'
                ' (degrees) is written to FILE by np.savez("hills.npz", elevation=heights, xmin=, xmax=, ymin=, ymax=)'
                " (docs/your-dem.md)"
            )
            raise ArgumentError.of_argument(name, value, allowed, shown=f"array of shape {value.shape}")
    base_scenario = load_scenario_with_options(base, {})
    spec = base_scenario.to_json()
    if isinstance(flight := tables.get("flight"), Mapping):
        autopilot = flight.get("autopilot") or (OWN_GUIDANCE if flight.get("guidance") else None)
        if autopilot not in (None, base_scenario.flight.steering.autopilot):
            # Remove the base's autopilot; the default accuracy of the navigation depends on it.
            dropped_keys = (*_AUTOPILOT_KEYS, *(("nav",) if base_scenario.flight.nav is None else ()))
            spec["flight"] = {key: value for key, value in spec["flight"].items() if key not in dropped_keys}
    for name, values in _convert_to_plain_values(tables).items():
        is_merged = isinstance(values, Mapping) and isinstance(spec.get(name), dict) and name not in _POSITIONS
        if is_merged and any(key in values and values[key] != spec[name].get(key) for key in _SOURCE_KEYS):
            # The other values belong to another kind or file.
            spec[name] = {key: spec[name][key] for key in ("kind",) if key in spec[name]}
        spec[name] = spec[name] | dict(values) if is_merged else values
    terrain_table, base_table = spec["terrain"], base_scenario.to_json()["terrain"]
    # The check of the whole scenario refuses a terrain that is no mapping.
    is_other_file = isinstance(terrain_table, Mapping) and terrain_table.get("path") != base_table.get("path")
    if is_other_file and "origin" not in tables:
        spec.pop("origin", None)
    if threats is not None:
        spec["threats"] = threat_tables(threats)
    terrain = base_scenario.terrain if _TERRAIN_TABLES.isdisjoint(tables) else None
    scenario = scenario_from_spec(spec, "make_scenario", ground=terrain, external=base_scenario.external)
    find_algorithm(scenario.planner.algorithm, "make_scenario")
    for note in scenario.notes:
        if note not in base_scenario.notes:
            report_line(f"{scenario.name}: {note}")
    return scenario


def _convert_to_plain_values(values: Any) -> Any:
    """Return tables in which numpy arrays and numbers, at any depth, are lists and numbers of Python."""
    if isinstance(values, Mapping):
        return {key: _convert_to_plain_values(value) for key, value in values.items()}
    if isinstance(values, list | tuple):
        return [_convert_to_plain_values(value) for value in values]
    return values.tolist() if isinstance(values, np.ndarray | np.generic) else values
