"""Change the aircraft, the autopilot and its parameters, the weather and the limits of a flight.

Values are checked by the same code as in scenarios and parameter files, and refused with the same messages.
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from flight.autopilots.autopilot import Parameters
from flight.autopilots.catalog import load_autopilot
from flight.autopilots.parameter_files import parameters_text, parse_parameters
from planfly.flight_options import FlightOptions, apply_options
from planfly.studio.messages import LIMITS, Settings
from planfly.workflow.airframe import Airframe, find_airframe, load_airframe
from world.errors import PlanflyError
from world.files import did_you_mean, temporary_folder
from world.scenario import Scenario, from_spec, with_flight

# Suffixes of parameter files.
PARAMETER_FILES = (".parm", ".param", ".params")
# Maximum number of unused names of a file that are listed.
_MAX_LISTED_NAMES = 8


@dataclass(frozen=True, slots=True)
class SetParameters:
    """Parameters of the autopilot that were set in the studio.

    values: values by the names and in the units of the autopilot.
    file: name of the file that was read last, or "".
    unused: names in this file that the simulated autopilot does not use.
    """

    values: dict[str, float] = field(default_factory=dict)
    file: str = ""
    unused: tuple[str, ...] = ()

    def text(self, title: str) -> str:
        """Return the text of a parameter file for ground stations."""
        return parameters_text(self.values, title)

    def airframe(self, scenario: Scenario) -> Airframe:
        """Return the airframe of a scenario with these parameters and their source.  Raises PlanflyError."""
        made = load_airframe(scenario, self.values)
        stored = made.autopilot.store()
        if not self.values or stored.parameters is None:
            return made
        labelled = stored.parameters._replace(source=self.file or stored.parameters.source or "the studio")
        return replace(made, autopilot=made.autopilot.restore(stored._replace(parameters=labelled)))


def changed_world(scenario: Scenario, asked: Settings) -> Scenario:
    """Return a scenario with the requested settings.  Raises PlanflyError for an invalid value."""
    wind = None
    if asked.wind_speed is not None or asked.wind_from is not None:
        speed = scenario.wind.speed if asked.wind_speed is None else asked.wind_speed
        from_deg = float(np.degrees(scenario.wind.from_course)) if asked.wind_from is None else asked.wind_from
        wind = (float(speed), from_deg)
    if asked.aircraft is not None and ("/" in asked.aircraft or "\\" in asked.aircraft):
        raise PlanflyError("aircraft: expected an aircraft listed by 'planfly aircraft'", field="aircraft")
    options: FlightOptions = {
        "wind": wind,
        "turbulence": asked.turbulence,
        "aircraft": asked.aircraft,
        "airspeed": asked.airspeed,
        "autopilot": asked.autopilot,
    }
    changed = apply_options(scenario, options)
    if asked.limits is None and asked.ceiling is None:
        return changed
    spec = changed.to_json()
    limits = spec.get("limits", {}) | (asked.limits or {})
    spec["limits"] = {name: value for name, value in limits.items() if value is not None}
    if asked.ceiling is not None:
        if scenario.external:
            raise PlanflyError("ceiling: only a scenario has an area with a ceiling", field="ceiling")
        spec["area"]["ceiling_amsl_m"] = asked.ceiling
    return from_spec(spec, changed.name, ground=changed.terrain, external=changed.external)


def changed_parameters(old: SetParameters, scenario: Scenario, asked: Settings) -> SetParameters:
    """Return the parameters after a change of settings, for the autopilot of a scenario.

    If the autopilot changes, no parameter is kept.  A file replaces all parameters, a single parameter only itself.
    Raises PlanflyError for a name that the simulated autopilot does not have, and for a value that is not allowed.
    """
    if asked.autopilot is not None:
        old = SetParameters()
    values = {name: value for name, value in old.values.items() if name not in (asked.without or ())}
    made = SetParameters(values, old.file if values else "", old.unused if values else ())
    if asked.parameter_file is not None:
        return read_parameters(scenario, asked.parameter_text or "", asked.parameter_file)
    if asked.parameter is not None:
        found = read_parameters(scenario, asked.parameter, "parameter")
        if found.unused:
            name, known = found.unused[0], [one.name for one in _autopilot_parameters(scenario).values]
            allowed = f"expected a parameter of the simulated autopilot{did_you_mean(name, known)}"
            raise PlanflyError(f"parameter: {name}: {allowed}", field="parameter", value=name, allowed=allowed)
        made = SetParameters(values | found.values, made.file, made.unused)
    return made


def read_parameters(scenario: Scenario, text: str, name: str) -> SetParameters:
    """Read autopilot parameters from the text of a file.  Raises PlanflyError, which names the file."""
    asked = _autopilot_parameters(scenario).by_origin("file")
    with temporary_folder("planfly-studio-") as folder:
        file = folder / "set.parm"
        file.write_text(text, encoding="utf-8")
        try:
            made = _autopilot_parameters(with_flight(scenario, params=str(file)))
        except PlanflyError as error:
            raise PlanflyError(str(error).replace(str(file), name), file=name) from None
    stated = made.by_origin("file")
    # Leave out parameters that only the scenario sets, because they belong to the scenario.
    own = {one: value for one, value in stated.items() if one not in asked or one in parse_parameters(text, name)}
    return SetParameters(own, name, made.unused)


def _autopilot_parameters(scenario: Scenario) -> Parameters:
    """Return the autopilot parameters of a scenario.  Raises PlanflyError if its autopilot has none."""
    made = load_autopilot(scenario, find_airframe(scenario)[0])
    if made.parameters is None:
        raise PlanflyError(f"{made.title} has no parameters: choose another autopilot", field="parameter")
    return made.parameters


def settings_json(scenario: Scenario, frame: Airframe, own: SetParameters) -> dict[str, Any]:
    """Return the current settings as page data."""
    limits, parameters = scenario.to_json().get("limits", {}), frame.autopilot.parameters
    more = f" and {len(own.unused) - _MAX_LISTED_NAMES} more" if len(own.unused) > _MAX_LISTED_NAMES else ""
    return {
        "aircraft": frame.aircraft.name,
        "autopilot": frame.autopilot.name,
        "autopilot_title": frame.autopilot.title,
        "airspeed": round(frame.airspeed, 1),
        "wind_speed": float(scenario.wind.speed),
        "wind_from": round(float(np.degrees(scenario.wind.from_course)), 1),
        "turbulence": scenario.wind.turbulence,
        "limits": {name: limits.get(name) for name in LIMITS} | {"min_clearance_m": scenario.limits.min_clearance_m},
        "ceiling": None if scenario.external else float(scenario.ceiling),
        "parameters": dict(own.values),
        "parameter_file": own.file,
        "unused": ", ".join(own.unused[:_MAX_LISTED_NAMES]) + more,
        "known": {} if parameters is None else {name: value for name, value, _ in parameters.values},
    }
