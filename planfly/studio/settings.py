"""Change the aircraft, the autopilot and its parameters, the weather and the limits of a flight.

Values are checked by the same code as in scenarios and parameter files, and refused with the same messages.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from aircraft.catalog import aircraft_names
from flight.autopilots.autopilot import Parameters
from flight.autopilots.catalog import load_autopilot
from flight.autopilots.parameter_files import parameters_text, parse_parameters
from flight.autopilots.parameter_origin import UnusedParametersError
from planfly.arguments import is_valid_wind
from planfly.flight_options import FlightOptions, apply_options
from planfly.studio.messages import LIMITS, Settings
from planfly.workflow.uav import Uav, load_uav, scenario_aircraft
from world.errors import PlanflyError
from world.files import did_you_mean, temporary_folder
from world.scenario import Scenario, scenario_from_spec, with_flight
from world.scenario_tables import names_folder

# Suffixes of parameter files.
PARAMETER_FILES = (".parm", ".param", ".params")
# Maximum number of unused names of a file that are listed.
_MAX_LISTED_NAMES = 8
# Labels of the settings on the page, by their keys in the page data; messages name a setting by its label.
_LABELS = {
    "aircraft": "Aircraft",
    "autopilot": "Autopilot",
    "airspeed": "Airspeed",
    "wind_speed": "Wind",
    "wind_from": "Wind from",
    "turbulence": "Turbulence",
    "min_clearance_m": "Minimum clearance",
    "max_height_m": "Maximum above ground",
    "ceiling": "Ceiling",
    "corridor_m": "Corridor each side",
    "max_turn_deg": "Sharpest turn",
    "max_climb_deg": "Steepest climb",
    "max_dive_deg": "Steepest descent",
    "surveys": "Photo lines",
    "parameter": "Parameter",
}
# Setting under whose label the change of another key is stated.
_CHANGED_WITH = {"autopilot_title": "autopilot", "wind_from": "wind_speed", "forecast": "wind_speed"}
# Names of the settings in scenarios and options, in the patterns of their messages, by the settings' keys.
_NAME_PATTERNS = {
    **{name: rf"(?:\blimits(?:\.|: ))?\b{name}\b" for name in LIMITS},
    "wind_from": r"\bwind_from\b",
    "wind_speed": r"\bwind(?:: |\.)speed_mps\b",
    "airspeed": r"^airspeed(?= )|\bflight\.airspeed_mps\b",
    "ceiling": r"\barea\.ceiling_amsl_m\b|^ceiling\b",
    "aircraft": r"^aircraft\b",
    "autopilot": r"^autopilot\b",
    "parameter": r"^parameter(?::1)?:",
}


@dataclass(frozen=True, slots=True)
class ChangedParameters:
    """Parameters of the autopilot that were changed in the studio.

    values: values by name, in the units of the autopilot.
    file: name of the file that was read last, or "".
    unused: names in this file that the simulated autopilot does not use.
    typed: names of the values that were typed on the page, not read from the file.
    """

    values: dict[str, float] = field(default_factory=dict)
    file: str = ""
    unused: tuple[str, ...] = ()
    typed: tuple[str, ...] = ()

    def text(self, title: str) -> str:
        """Return the text of a parameter file for ground stations.

        title: comment in the first line.
        """
        return parameters_text(self.values, title)

    def with_values(self, values: Mapping[str, float | None]) -> "ChangedParameters":
        """Return the parameters after some values were set by name; a value of None removes a parameter."""
        merged = {name: value for name, value in (self.values | dict(values)).items() if value is not None}
        typed = tuple(name for name in dict.fromkeys((*self.typed, *values)) if name in merged)
        return ChangedParameters(merged, self.file if merged else "", self.unused if merged else (), typed)

    def load_uav(self, scenario: Scenario) -> Uav:
        """Load the UAV of a scenario with these parameters in its autopilot.

        Raises PlanflyError if the UAV cannot be loaded.
        """
        uav = load_uav(scenario, self.values)
        stored_autopilot = uav.autopilot.store()
        if not self.values or stored_autopilot.parameters is None:
            return uav
        file = self.file or stored_autopilot.parameters.source
        names = list(self.values) if not self.file else list(self.typed)
        names_text = ", ".join(names[:_MAX_LISTED_NAMES]) + (", ..." if len(names) > _MAX_LISTED_NAMES else "")
        source = f"{file}, changed in the studio: {names_text}" if file and names else file or "the studio"
        parameters = stored_autopilot.parameters._replace(source=source)
        return replace(uav, autopilot=uav.autopilot.restore(stored_autopilot._replace(parameters=parameters)))


def own_aircraft(scenario: Scenario) -> dict[str, str]:
    """Return {name: folder} of a scenario's aircraft if it has its own folder; {} if it is built in."""
    folder = scenario.flight.aircraft
    return {Path(folder).name: folder} if names_folder(folder) else {}


def autopilot_parameters(scenario: Scenario, uav: Uav) -> dict[str, dict[str, str]]:
    """Return {name of the autopilot: [flight] entries} of a scenario with a parameter file.

    Return {} without such a file.

    The entries are those that name the parameter file, the autopilot and its version.
    """
    table = scenario.flight.model_dump(include={"autopilot", "params", "arduplane_version", "px4_version"})
    entries = {key: str(value) for key, value in table.items() if value is not None}
    return {uav.autopilot.name: entries} if "params" in entries else {}


def error_in_page_words(error: PlanflyError, settings: Settings, scenario_name: str) -> PlanflyError:
    """Return an error about changed settings in the words of the page.

    The settings have their labels on the page.

    The scenario's name, which may be the name of the mission file, is omitted.

    >>> error = PlanflyError("m.waypoints: limits: max_height_m: 20: must be above min_clearance_m 30")
    >>> str(error_in_page_words(error, Settings(kind="settings"), "m.waypoints"))
    'Maximum above ground: 20: must be above Minimum clearance 30'
    """
    text = str(error).removeprefix(f"{scenario_name}: ").removeprefix(": ")
    if settings.parameter is not None and error.file != "parameter":
        # The value was typed, and is in no file.
        text = text.removeprefix(f"{error.file}: ")
    for key, pattern in _NAME_PATTERNS.items():
        text = re.sub(pattern, _LABELS[key], text)
    requested = settings.model_dump(exclude_none=True)
    requested |= requested.get("limits", {})
    changed = [key for key in _LABELS if key in requested]
    # An error at another place of the scenario is a consequence of the changed setting.
    if len(changed) == 1 and not any(label in text for label in _LABELS.values()):
        value = "" if changed[0] == "parameter" else f": {requested[changed[0]]}:"
        text = f"{_LABELS[changed[0]]}{value} {text}"
    return PlanflyError(re.sub(r"(?<=: )(-?\d+)\.0(?=: )", r"\1", text), field=error.field, value=error.value)


def apply_scenario_settings(scenario: Scenario, settings: Settings, folders: Mapping[str, str]) -> Scenario:
    """Return a scenario with the requested settings of aircraft, autopilot, weather and limits.

    folders: folders of the user's own aircraft, by name.
    Raises PlanflyError for an invalid value.
    """
    wind = None
    if settings.wind_speed is not None or settings.wind_from is not None:
        speed = scenario.wind.speed if settings.wind_speed is None else settings.wind_speed
        from_deg = float(np.degrees(scenario.wind.from_course)) if settings.wind_from is None else settings.wind_from
        if not is_valid_wind(0.0, from_deg):
            raise PlanflyError(f"wind_from: {from_deg:g}: allowed -360..360", field="wind_from", value=from_deg)
        wind = (float(speed), from_deg % 360.0)
    if settings.aircraft is not None and ("/" in settings.aircraft or "\\" in settings.aircraft):
        raise PlanflyError("aircraft: expected an aircraft listed by 'planfly aircraft'", field="aircraft")
    options: FlightOptions = {
        "wind": wind,
        "turbulence": settings.turbulence,
        "aircraft": folders.get(settings.aircraft, settings.aircraft) if settings.aircraft is not None else None,
        "airspeed": settings.airspeed,
        "autopilot": settings.autopilot,
    }
    new_scenario = apply_options(scenario, options)
    if settings.limits is None and settings.ceiling is None:
        return new_scenario
    spec = new_scenario.to_json()
    limits = spec.get("limits", {}) | (settings.limits or {})
    spec["limits"] = {name: value for name, value in limits.items() if value is not None}
    if settings.ceiling is not None:
        if scenario.external:
            raise PlanflyError("ceiling: only a scenario has an area with a ceiling", field="ceiling")
        spec["area"]["ceiling_amsl_m"] = settings.ceiling
    return scenario_from_spec(spec, new_scenario.name, ground=new_scenario.terrain, external=new_scenario.external)


def apply_parameter_settings(current: ChangedParameters, scenario: Scenario, settings: Settings) -> ChangedParameters:
    """Return the changed parameters after a change of settings.

    They are checked against the autopilot of a scenario.

    A change of the autopilot discards all parameters. A file replaces all parameters; a single parameter replaces only
    its own value.
    Raises PlanflyError for a name that the simulated autopilot does not have, and for a value that is not allowed.
    """
    if settings.autopilot is not None:
        current = ChangedParameters()
    result = current.with_values(dict.fromkeys(settings.without or ()))
    if settings.parameter_file is not None:
        return read_parameters(scenario, settings.parameter_text or "", settings.parameter_file)
    if settings.parameter is not None:
        try:
            single = read_parameters(scenario, settings.parameter, "parameter")
        except UnusedParametersError as error:
            text = f"parameter: {error.value}: not a parameter of the simulated {error.model}"
            raise PlanflyError(text, file="parameter", value=error.value) from None
        if single.unused:
            name = single.unused[0]
            known_names = [parameter.name for parameter in _load_autopilot_parameters(scenario).values]
            allowed = f"expected a parameter of the simulated autopilot{did_you_mean(name, known_names)}"
            raise PlanflyError(f"parameter: {name}: {allowed}", field="parameter", value=name, allowed=allowed)
        result = result.with_values(single.values)
    return result


def read_parameters(scenario: Scenario, text: str, name: str) -> ChangedParameters:
    """Parse the text of a parameter file for the autopilot of a scenario.

    Values that only the scenario's parameter file sets are left out.

    name: file name for messages.

    Raises PlanflyError for an invalid file.
    """
    scenario_values = _load_autopilot_parameters(scenario).by_origin("file")
    with temporary_folder("planfly-studio-") as folder:
        file = folder / "set.parm"
        file.write_text(text, encoding="utf-8")
        try:
            parameters = _load_autopilot_parameters(with_flight(scenario, params=str(file)))
        except PlanflyError as error:
            error.args, error.file = (str(error).replace(str(file), name),), name
            raise
    file_values = parameters.by_origin("file")
    # Leave out parameters that only the scenario sets, because they belong to the scenario.
    own_values = {
        parameter: value
        for parameter, value in file_values.items()
        if parameter not in scenario_values or parameter in parse_parameters(text, name)
    }
    return ChangedParameters(own_values, name, parameters.unused)


def _load_autopilot_parameters(scenario: Scenario) -> Parameters:
    """Return the autopilot parameters of a scenario. Raises PlanflyError if its autopilot has none."""
    autopilot = load_autopilot(scenario, scenario_aircraft(scenario))
    if autopilot.parameters is None:
        raise PlanflyError(f"{autopilot.title} has no parameters: choose another autopilot", field="parameter")
    return autopilot.parameters


def settings_json(
    scenario: Scenario, uav: Uav, changed_parameters: ChangedParameters, folders: Mapping[str, str]
) -> dict[str, Any]:
    """Return the current settings, and the values to choose from, as page data.

    folders: folders of the user's own aircraft, by name.
    """
    limits, parameters = scenario.to_json().get("limits", {}), uav.autopilot.parameters
    remainder_text = (
        f" and {len(changed_parameters.unused) - _MAX_LISTED_NAMES} more"
        if len(changed_parameters.unused) > _MAX_LISTED_NAMES
        else ""
    )
    return {
        "aircraft": uav.aircraft.name,
        "aircraft_names": list(dict.fromkeys((*folders, *aircraft_names()))),
        "autopilot": uav.autopilot.name,
        "autopilot_title": uav.autopilot.title,
        "airspeed": round(uav.airspeed, 1),
        "airspeed_kind": "equivalent" if uav.autopilot.speeds.equivalent else "true",
        "wind_speed": float(scenario.wind.speed),
        "wind_from": round(float(np.degrees(scenario.wind.from_course)), 1) % 360.0,
        "turbulence": scenario.wind.turbulence,
        "forecast": "" if scenario.wind.forecast is None else scenario.wind.forecast.describe(),
        "limits": {name: limits.get(name) for name in LIMITS} | {"min_clearance_m": scenario.limits.min_clearance_m},
        "ceiling": None if scenario.external else float(scenario.ceiling),
        "parameters": dict(changed_parameters.values),
        "parameter_file": changed_parameters.file,
        "scenario_parameter_file": Path(scenario.flight.params or "").name,
        "unused": ", ".join(changed_parameters.unused[:_MAX_LISTED_NAMES]) + remainder_text,
        "labels": _LABELS,
        "known": {} if parameters is None else {name: value for name, value, _ in parameters.values},
    }


def changed_settings(opened: Mapping[str, Any], current: Mapping[str, Any]) -> list[str]:
    """Return the labels, in lower case, of the settings whose values differ.

    The autopilot's parameters are left out.

    opened, current: settings as page data (`settings_json`).
    """
    opened, current = ({**settings, **settings["limits"]} for settings in (opened, current))
    keys = (key for key in (*_LABELS, *_CHANGED_WITH) if key in opened and opened[key] != current[key])
    return list(dict.fromkeys(_LABELS[_CHANGED_WITH.get(key, key)].lower() for key in keys))
