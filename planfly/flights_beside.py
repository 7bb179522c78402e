"""The flights beside an autopilot's: of the aircraft by planfly's guidance, and with other parameters."""

import contextlib
from collections.abc import Callable
from dataclasses import replace

from aircraft.catalog import Aircraft
from flight.ardupilot.parameters import ArduPilotParameters
from flight.simulation.flight_setup import FlightSetup
from flight.simulation.simulate import Progress, simulate
from flight.simulation.track import Track
from logs.verdict.findings import Verdict
from logs.verdict.judge_flight import judge_flight
from logs.verdict.levels import AirframeAnswer, DecidingParameter, FlownBeside
from logs.verdict.measures.route_demands import true_route
from logs.verdict.places import FLIGHT
from planfly.deciding_parameter import deciding_parameter
from world.errors import StartError


class _GivenUp(Exception):
    """There is no time for flights beside."""


def airframe_answer(setup: FlightSetup, aircraft: Aircraft, progress: Progress | None = None) -> AirframeAnswer:
    """Fly a setup by planfly's guidance, which knows exactly where it is, and judge that flight.

    It flies the same true airspeeds: those that ArduPlane takes for equivalent ones are higher the higher it flies.
    progress: as of `flight.simulation.simulate.simulate`.
    """
    same = true_route(setup)
    ideal = replace(setup, parameters=None, program=None, guidance="path", nav="perfect", route=same)
    try:
        flown = simulate(ideal, aircraft, progress=progress)
    except StartError as error:
        return AirframeAnswer(False, f"not flyable: not started: {error.reason}", (("completion", FLIGHT),))
    verdict = judge_flight(ideal, flown.track, flown.ended)
    failed = tuple((item.rule, item.place) for item in verdict.findings if item.ok is False)
    return AirframeAnswer(verdict.flyable, verdict.headline, failed)


def find_deciding_parameter(
    setup: FlightSetup, aircraft: Aircraft, verdict: Verdict, progress: Progress | None = None
) -> DecidingParameter | None:
    """The parameter with another value of which a flight that failed passes; None where there is none.

    verdict: on the flight with the setup's own parameters.  progress: of each flight.  Takes about ten flights, by
    ArduPlane's law: of a real autopilot's flight they say something where the law's own flight fails as well, and
    nothing where it passes.
    """
    if setup.parameters is None or verdict.flyable:
        return None
    findings = verdict.findings
    if setup.program is not None:
        own = _flown_by_law(setup, aircraft, progress)
        if own.flyable:
            return None
        findings = own.findings
    # The corridor is as wide as it was, whatever radius is tried.
    scenario = setup.scenario
    limits = scenario.limits.model_copy(update={"corridor_m": setup.corridor})
    spec = scenario.spec.model_copy(update={"limits": limits})
    same = setup.in_scenario(replace(scenario, spec=spec, limits=limits))

    def passes(parameters: ArduPilotParameters) -> bool:
        return _flown_by_law(replace(same, parameters=parameters), aircraft, progress).flyable

    return deciding_parameter(setup.parameters, findings, passes)


def judge_with_flights_beside(
    setup: FlightSetup, aircraft: Aircraft, track: Track, ended: str, hurry: Callable[[], bool] | None = None
) -> tuple[Verdict, FlownBeside | None]:
    """Judge an autopilot's flight beside the aircraft's own, and look for the parameter that decides where they differ.

    track, ended: of the flight with the setup.  A flight of planfly's own guidance has none beside it.
    hurry: asked all the time while others fly; once it says yes they are given up, and the verdict holds what was
    known by then.  Whether the flight is flyable does not depend on them.
    """

    def watch(_done: float, _whole: float) -> None:
        if hurry is not None and hurry():
            raise _GivenUp

    if setup.parameters is None:
        return judge_flight(setup, track, ended), None
    try:
        beside = FlownBeside(airframe_answer(setup, aircraft, watch))
    except _GivenUp:
        return judge_flight(setup, track, ended), None
    verdict = judge_flight(setup, track, ended, beside=beside)
    if beside.airframe is not None and beside.airframe.flyable and not verdict.flyable:
        with contextlib.suppress(_GivenUp):
            beside = replace(beside, deciding=find_deciding_parameter(setup, aircraft, verdict, watch))
            verdict = judge_flight(setup, track, ended, beside=beside)
    return verdict, beside


def _flown_by_law(setup: FlightSetup, aircraft: Aircraft, progress: Progress | None = None) -> Verdict:
    """Fly a setup by ArduPlane's law, whoever flew it before, and judge that flight."""
    by_law = replace(setup, program=None)
    flown = simulate(by_law, aircraft, progress=progress)
    return judge_flight(by_law, flown.track, flown.ended)
