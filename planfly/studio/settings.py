"""How a mission under edit is flown: aircraft, autopilot with its parameters, weather and limits, and changes of them.

Values are checked where a scenario's and a file's of parameters are, and refused with the same words.
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from flight.autopilots.autopilot import Parameters
from flight.autopilots.catalog import load_autopilot
from flight.autopilots.parameter_files import parameters_text, parse_parameters
from planfly.airframe import Airframe, find_airframe, load_airframe
from planfly.flight_options import FlightOptions, apply_options
from planfly.studio.messages import LIMITS, Settings
from world.errors import PlanflyError
from world.files import did_you_mean, temporary_folder
from world.scenario import Scenario, from_spec, with_flight

# What a file of parameters may be called.
PARAMETER_FILES = (".parm", ".param", ".params")
# Names that are listed of what a file states in vain.
_NAMED = 8


@dataclass(frozen=True, slots=True)
class SetParameters:
    """Parameters of the autopilot that were set in the studio.

    values: by the autopilot's names and in its units.
    file: the one that was read last, "" for none; unused: its names of which the law makes nothing.
    """

    values: dict[str, float] = field(default_factory=dict)
    file: str = ""
    unused: tuple[str, ...] = ()

    def text(self, title: str) -> str:
        """As a file that ground stations read."""
        return parameters_text(self.values, title)

    def airframe(self, scenario: Scenario) -> Airframe:
        """The airframe of a scenario that flies with them, and says so.  Raises PlanflyError."""
        made = load_airframe(scenario, self.values)
        stored = made.autopilot.store()
        if not self.values or stored.parameters is None:
            return made
        whose = stored.parameters._replace(source=self.file or stored.parameters.source or "the studio")
        return replace(made, autopilot=made.autopilot.restore(stored._replace(parameters=whose)))


def changed_world(scenario: Scenario, asked: Settings) -> Scenario:
    """A scenario with other settings.  Raises PlanflyError for a value that it may not have."""
    wind = None
    if asked.wind_speed is not None or asked.wind_from is not None:
        speed = scenario.wind.speed if asked.wind_speed is None else asked.wind_speed
        from_deg = float(np.degrees(scenario.wind.from_course)) if asked.wind_from is None else asked.wind_from
        wind = (float(speed), from_deg)
    if asked.aircraft is not None and ("/" in asked.aircraft or "\\" in asked.aircraft):
        raise PlanflyError("aircraft: a name that planfly aircraft lists is expected", field="aircraft")
    options: FlightOptions = {
        "wind": wind, "turbulence": asked.turbulence, "aircraft": asked.aircraft, "airspeed": asked.airspeed,
        "autopilot_law": asked.autopilot,
    }  # fmt: skip
    changed = apply_options(scenario, options)
    if asked.limits is None and asked.ceiling is None:
        return changed
    spec = changed.to_json()
    limits = spec.get("limits", {}) | (asked.limits or {})
    spec["limits"] = {name: value for name, value in limits.items() if value is not None}
    if asked.ceiling is not None:
        if scenario.external:
            raise PlanflyError("ceiling: a mission without a scenario has no area with a ceiling", field="ceiling")
        spec["area"]["ceiling_amsl_m"] = asked.ceiling
    return from_spec(spec, changed.name, ground=changed.terrain, external=changed.external)


def changed_parameters(old: SetParameters, scenario: Scenario, asked: Settings) -> SetParameters:
    """The parameters that are set after a change, of the autopilot that a scenario names.

    Another autopilot has others: none is kept.  A file takes the place of all, a single one of its own.
    Raises PlanflyError for a name that the law does not have, and for a value that is not allowed.
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
            name, known = found.unused[0], [one.name for one in _parameters(scenario).values]
            allowed = f"one that the law of this autopilot has is expected{did_you_mean(name, known)}"
            raise PlanflyError(f"parameter: {name}: {allowed}", field="parameter", value=name, allowed=allowed)
        made = SetParameters(values | found.values, made.file, made.unused)
    return made


def read_parameters(scenario: Scenario, text: str, name: str) -> SetParameters:
    """What a file's text states for the autopilot that a scenario names.  Raises PlanflyError, with the file's name."""
    asked = _parameters(scenario).by_origin("file")
    with temporary_folder("planfly-studio-") as folder:
        file = folder / "set.parm"
        file.write_text(text, encoding="utf-8")
        try:
            made = _parameters(with_flight(scenario, params=str(file)))
        except PlanflyError as error:
            raise PlanflyError(str(error).replace(str(file), name), file=name) from None
    stated = made.by_origin("file")
    # What the scenario asks for by itself, and the text does not state, is the scenario's.
    own = {one: value for one, value in stated.items() if one not in asked or one in parse_parameters(text, name)}
    return SetParameters(own, name, made.unused)


def _parameters(scenario: Scenario) -> Parameters:
    """Those that the autopilot of a scenario flies with.  Raises PlanflyError for one that has none."""
    made = load_autopilot(scenario, find_airframe(scenario)[0])
    if made.parameters is None:
        raise PlanflyError(f"{made.title} has no parameters: choose another autopilot", field="parameter")
    return made.parameters


def settings_json(scenario: Scenario, frame: Airframe, own: SetParameters) -> dict[str, Any]:
    """The settings as they are, for a page."""
    limits, parameters = scenario.to_json().get("limits", {}), frame.autopilot.parameters
    more = f" and {len(own.unused) - _NAMED} more" if len(own.unused) > _NAMED else ""
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
        "unused": ", ".join(own.unused[:_NAMED]) + more,
        "known": {} if parameters is None else {name: value for name, value, _ in parameters.values},
    }
