"""Choose the autopilot that a flight's files were written for, or check a named autopilot against the files."""

from dataclasses import replace
from pathlib import Path

from flight.autopilots.parameter_origin import ARDUPILOT, PX4, TITLES, other_autopilot_error, read_origin
from flight.mission.items import Mission
from world.errors import MissionError, ParameterError
from world.scenario import Scenario, with_flight
from world.scenario_tables import OWN_GUIDANCE


def with_file_autopilot(scenario: Scenario, mission: Mission | None = None) -> Scenario:
    """Return the scenario with the autopilot for which its parameter file or its mission was written.

    An autopilot named by the user is kept, and so is planfly's own guidance.  If no file names an autopilot, the
    scenario is not changed.  Raises ParameterError or MissionError if a file was not written for the named autopilot,
    if two files were written for different autopilots, and if a parameter file has parameters of both autopilots.

    >>> from world.scenario import load_scenario
    >>> made = with_file_autopilot(load_scenario("paper-07"), Mission(None, (), autopilot="px4", source="field.plan"))
    >>> made.flight.autopilot, made.flight.autopilot_from
    ('px4', 'field.plan')
    """
    table = scenario.flight
    steering = table.steering.autopilot
    if steering == OWN_GUIDANCE:
        return scenario
    mission_autopilot = "" if mission is None else mission.autopilot
    is_named_by_user = table.autopilot is not None and table.autopilot_from is None
    if not is_named_by_user and table.params is not None and table.autopilot is None:
        scenario = _with_autopilot_from_parameters(scenario, table.params)
        table = scenario.flight
    if mission is None or not mission_autopilot:
        return scenario
    if table.autopilot is None:
        return _with_autopilot(scenario, mission_autopilot, mission.source)
    if mission_autopilot != table.autopilot and table.autopilot in TITLES:
        if table.autopilot_from is None:
            raise MissionError.from_error(
                other_autopilot_error(
                    mission.source, mission_autopilot, _FIRMWARE_TEXTS[mission_autopilot], table.autopilot
                )
            )
        other_file = f"{table.autopilot_from} for {TITLES[table.autopilot]}"
        allowed = "expected files of one autopilot"
        message = (
            f"{mission.source}: written for {TITLES[mission_autopilot]} ({_FIRMWARE_TEXTS[mission_autopilot]}),"
            f" but {other_file}; {allowed}"
        )
        raise MissionError(message, file=mission.source, field="autopilot", value=mission_autopilot, allowed=allowed)
    return scenario


# Text by which a .plan file states its autopilot.
_FIRMWARE_TEXTS = {ARDUPILOT: "firmwareType 3", PX4: "firmwareType 12"}


def _with_autopilot_from_parameters(scenario: Scenario, params_path: str) -> Scenario:
    """Return the scenario with the autopilot of its parameter file.

    The scenario is unchanged if the file does not identify an autopilot.

    Raises ParameterError for a file with parameters of both autopilots.
    """
    origin = read_origin(Path(params_path))
    if origin.mixed:
        remedy = "--autopilot names the autopilot that is to fly"
        message = f"{params_path}: {origin.evidence}: {remedy}"
        raise ParameterError(message, file=params_path, field="autopilot", value=origin.evidence, allowed=remedy)
    return _with_autopilot(scenario, origin.autopilot, params_path) if origin.autopilot else scenario


def _with_autopilot(scenario: Scenario, autopilot: str, file: str) -> Scenario:
    """Return the scenario with `autopilot`, and record `file` as the file that names this autopilot.

    The autopilot is set even if it is the default autopilot.
    """
    params = scenario.flight.params
    new_scenario = with_flight(scenario, autopilot=autopilot, params=params)
    table = new_scenario.flight.model_copy(update={"autopilot_from": file})
    return replace(new_scenario, spec=new_scenario.spec.model_copy(update={"flight": table}), flight=table)
