"""Run the flight process of ``planfly serve``, which judges and flies missions, and logs the flights."""

import contextlib
import math
import signal
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

from aircraft.catalog import Aircraft
from flight.live.flight_process import (
    DIVERTED_TEXT,
    STILL_LOITERING_TEXT,
    DivertFlight,
    FlightJudged,
    JudgeMission,
    MissionJudged,
    PreparedFlight,
    ProcessReady,
    send_event,
    serve_flights,
)
from flight.live.telemetry import (
    AUTO,
    CRITICAL,
    INFO,
    MODE_NAMES,
    NOTICE,
    RTL,
    WARNING,
    SnapshotMaker,
    StatusText,
)
from flight.mission.items import Command, Frame, Home, Mission, MissionItem, round_to_grid
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import Flight, LocalMap
from flight.simulation.track import Track, as_track, join_tracks
from logs.recording.recorder import Recorder
from logs.verdict.findings import Finding
from logs.verdict.judge_flight import judge_flight, judge_geometry
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.presentation import finding_heading, finding_words
from logs.verdict.verdict import Verdict
from logs.verdict.wording import deciding_text
from planfly.flight_options import MissionOptions, load_scenario_with_options, read_named_fences
from planfly.workflow.open_flight import make_setup, open_flight
from planfly.workflow.reference_flights import explain_verdict
from planfly.workflow.uav import Uav, choose_seed, load_uav, uav_of_setup
from world.arrays import Floats
from world.errors import PlanflyError
from world.frames import to_geo
from world.interruption import end_with_parent
from world.scenario import Scenario, without_ground_phases
from world.wording import count_text

# Duration of a loiter in LOITER and GUIDED in one log, s: each lap of a loiter is laid out, and judged, separately.
LOITER_DURATION_S = 900.0
# Maximum number of texts about one verdict; the log has the others.
_MAX_TEXTS_PER_VERDICT = 4


@dataclass(frozen=True, slots=True)
class ServeOptions:
    """Options of ``planfly serve``.

    The link's process and the flight process both read the files that they name.

    mission: path of a mission file, or "".
    speed: multiple of real time.
    logs: the folder of the flight logs.
    flight_options: options of the flights.  An uploaded fence replaces the items of named fences, but not their zones.
    """

    mission: str
    speed: float
    logs: Path
    flight_options: MissionOptions = field(default_factory=MissionOptions)


@dataclass(frozen=True, slots=True)
class ServedScenario:
    """Scenario in which a vehicle is served.

    seed: seed of the turbulence.
    mission: initial mission; None to wait for an upload.
    fence, rally: items of the named fences and rally points, if there is no initial mission.
    """

    scenario: Scenario
    uav: Uav
    seed: int
    mission: Mission | None
    fence: tuple[MissionItem, ...] = ()
    rally: tuple[MissionItem, ...] = ()


def load_served_scenario(options: ServeOptions) -> ServedScenario:
    """Load the scenario in which a vehicle is served, and its first mission if the options name one.

    Raises PlanflyError for bad input.
    """
    if options.mission:
        setup = open_flight(options.mission, options.flight_options)
        return ServedScenario(setup.scenario, uav_of_setup(setup), setup.seed, setup.mission)
    scenario_name = options.flight_options.get("scenario")
    if scenario_name is None:
        allowed = "expected a mission, or `scenario` NAME, in which to wait for the upload of a mission"
        raise PlanflyError(f"mission: missing; {allowed}", field="scenario", allowed=allowed)
    fences = read_named_fences(options.flight_options.get("fence") or ())
    scenario = load_scenario_with_options(scenario_name, options.flight_options)
    scenario, seed = fences.add_to_scenario(scenario), options.flight_options.get("seed")
    chosen_seed = choose_seed(scenario, seed)
    return ServedScenario(
        scenario, load_uav(scenario), chosen_seed, mission=None, fence=fences.items, rally=fences.rally
    )


def autopilot_parameters(scenario: Scenario, stated_values: Mapping[str, float]) -> dict[str, float]:
    """Return the values of the autopilot's parameters by name, with `stated_values` applied.

    The cruise-airspeed parameter, if the autopilot has one, is overridden by the UAV's airspeed.

    stated_values: values by name, in the units of the autopilot.
    Raises PlanflyError for values that are not allowed.
    """
    uav = load_uav(scenario, stated_values)
    parameters = uav.autopilot.parameters
    values = {} if parameters is None else {parameter.name: parameter.value for parameter in parameters.values}
    cruise = uav.autopilot.speeds.cruise_parameter
    return values | {cruise: uav.airspeed} if cruise in values else values


def run_flight_process(connection: Connection, options: ServeOptions) -> None:
    """Fly missions on request until the connection closes: the main function of a flight process."""
    detects_parent_end = threading.Event()
    end_with_parent(detects_parent_end)
    factory = ServedFlights(options)
    factory.warm_up()
    # A signal to the process group also reaches the link, which orders this process to end after closing its log.
    detects_parent_end.set()
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    send_event(connection, ProcessReady())
    serve_flights(connection, factory)
    # The link waits until here, but not for the shutdown of the interpreter.
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    connection.close()


class ServedFlights:
    """Factory of a flight process.

    It prepares and judges missions in the served scenario, and opens flight logs.
    """

    def __init__(self, options: ServeOptions) -> None:
        """Load the scenario of the options, with its UAV."""
        self._served = load_served_scenario(options)
        self._logs = options.logs
        # Uav with the parameters of the last judged mission.
        self._uav = self._served.uav
        self._parameters: tuple[tuple[str, float], ...] = ()
        self.aircraft = self._uav.aircraft
        self.speed = options.speed

    def warm_up(self) -> None:
        """Fly and judge half a second of flight, to compile all kernels before a station sends a mission."""
        scenario = self._served.scenario
        points = np.linspace(scenario.start, scenario.destination, 3)
        lats, lons = to_geo(scenario.origin, points[:, 0], points[:, 1])
        no_params, amsl = (0.0, 0.0, 0.0, 0.0), float(points[0, 2])
        items = tuple(
            MissionItem(
                number,
                int(Command.NAV_WAYPOINT),
                int(Frame.GLOBAL),
                no_params,
                round_to_grid(lat),
                round_to_grid(lon),
                amsl,
            )
            for number, (lat, lon) in enumerate(zip(lats.tolist(), lons.tolist(), strict=True), 1)
        )
        with contextlib.suppress(PlanflyError):
            setup = make_setup(scenario, self._uav, Mission(home=None, items=items), self._served.seed)
            judge_geometry(setup)
            rows, _ = Flight(setup, self.aircraft).fly_block(30)
            judge_flight(setup, as_track(rows), "warm")

    def prepare(self, request: JudgeMission) -> tuple[PreparedFlight | None, MissionJudged]:
        """Judge the geometry of a mission, and check that its flight can start.

        Returns the prepared flight, and the answer for the vehicle.  For a mission that cannot be flown, the flight is
        None and the answer states the reason.

        request: the mission, with the parameters of the autopilot.
        """
        served_scenario = self._served
        try:
            if request.parameters != self._parameters:
                self._uav = load_uav(served_scenario.scenario, dict(request.parameters))
                self._parameters = request.parameters
            setup = make_setup(served_scenario.scenario, self._uav, request.mission, served_scenario.seed)
            # The first tick shows if the flight can start, and compiles the flight loop.
            flight = Flight(setup, self.aircraft)
            flight.fly_block(1)
        except PlanflyError as error:
            text = StatusText(f"mission cannot be flown: {error}", CRITICAL)
            return None, MissionJudged(request.number, possible=False, flyable=False, texts=(text,))
        verdict = judge_geometry(setup)
        home = request.mission.home
        start = SnapshotMaker(setup, flight.map).start_snapshot(setup)
        if home is None:
            home = Home(start.lat_deg, start.lon_deg, start.amsl - (0.0 if math.isnan(start.height) else start.height))
        items = tuple(int(item) for item in setup.route.items)
        texts = describe_mission(setup, verdict)
        # A mission that is not judged in full is armed with a warning; for example, MAVSDK writes ground speeds.
        can_arm = verdict.flies or verdict.undecided
        mission_judged = MissionJudged(
            request.number, possible=True, flyable=can_arm, texts=texts, home=home, items=items, start=start
        )
        return PreparedFlight(setup, flight.map), mission_judged

    def prepare_diversion(self, request: DivertFlight, position: Floats) -> PreparedFlight:
        """Prepare a flight in another mode, which starts at the current position.

        In AUTO the mission is flown from its first item, in RTL the aircraft returns home, and in other modes it
        loiters for `LOITER_DURATION_S`.

        position: east, north and altitude AMSL, (3,) m.
        """
        served_scenario = self._served
        lat, lon = (
            round_to_grid(float(value)) for value in to_geo(served_scenario.scenario.origin, position[0], position[1])
        )
        no_params = (0.0, 0.0, 0.0, 0.0)
        start_item = MissionItem(
            -1, int(Command.NAV_WAYPOINT), int(Frame.GLOBAL), no_params, lat, lon, float(position[2])
        )
        if request.mode == AUTO:
            items = request.mission.items
        elif request.mode == RTL:
            items = (MissionItem(0, int(Command.NAV_RETURN_TO_LAUNCH), int(Frame.MISSION), no_params, 0.0, 0.0, 0.0),)
        else:
            # A position or an altitude that the center does not state is the current one.
            center, loiter_item = request.center, start_item
            if math.isfinite(center.alt):
                loiter_item = replace(loiter_item, frame=center.frame, alt=center.alt)
            if math.isfinite(center.lat_deg) and math.isfinite(center.lon_deg):
                loiter_item = replace(
                    loiter_item, lat_deg=round_to_grid(center.lat_deg), lon_deg=round_to_grid(center.lon_deg)
                )
            loiter_params = (LOITER_DURATION_S, 0.0, center.radius, 0.0)
            items = (replace(loiter_item, seq=0, command=int(Command.NAV_LOITER_TIME), params=loiter_params),)
        mission = replace(request.mission, items=(start_item, *items), source=MODE_NAMES[request.mode])
        # The aircraft is in the air, so there is no take-off, and it does not land.
        setup = make_setup(without_ground_phases(served_scenario.scenario), self._uav, mission, served_scenario.seed)
        return PreparedFlight(setup, LocalMap.around(setup))

    def open_log(self, setup: FlightSetup, mode: int) -> "ServedLog":
        """Open a log with the next free name ``flight-NNN.mcap``.

        mode: mode of the flight, such as `AUTO`.
        """
        self._logs.mkdir(parents=True, exist_ok=True)
        number = 1
        while True:
            path = self._logs / f"flight-{number:03d}.mcap"
            try:
                path.touch(exist_ok=False)
                break
            except FileExistsError:
                number += 1
        return ServedLog(path, setup, self.aircraft, mode)


class ServedLog:
    """Log of one served flight."""

    def __init__(self, path: Path, setup: FlightSetup, aircraft: Aircraft, mode: int) -> None:
        """Open the log file of a flight in a mode, such as `AUTO`."""
        self._path, self._setup, self._aircraft = path, setup, aircraft
        self._verdict_basis = "flown" if mode == AUTO else f"flown in {MODE_NAMES[mode]}"
        self._recorder = Recorder(path, setup)
        self._track_blocks: list[Track] = []

    def write(self, block: Track) -> None:
        """Append the rows of a block to the log, and flush them to the file."""
        self._track_blocks.append(block)
        self._recorder.write(block)
        self._recorder.flush()

    def finish(self, end_reason: str, should_abort: Callable[[], bool]) -> FlightJudged:
        """Judge the flight and close the log.

        If the aircraft left the path within a second, the log is deleted.  If the process must end, a flight that left
        its path is not judged; `planfly check` can judge its log later.

        end_reason: reason why the flight ended.
        should_abort: see `planfly.workflow.reference_flights.explain_verdict`.
        """
        track = join_tracks(self._track_blocks)
        was_abandoned = end_reason.startswith((DIVERTED_TEXT, STILL_LOITERING_TEXT))
        end_time = float(track.time[-1]) if len(track) else 0.0
        if was_abandoned and end_time < 1.0:
            self._recorder.abandon()
            self._path.unlink()
            return FlightJudged(flyable=False, texts=())
        self._recorder.event(
            end_time, f"flight ended: {end_reason}", "info" if was_abandoned or end_reason == "completed" else "error"
        )
        if was_abandoned and should_abort():
            self._recorder.finish(end_reason)
            return FlightJudged(flyable=False, texts=(StatusText(f"log {self._path}, not judged yet", INFO),))
        requirements = route_requirements(self._setup)
        verdict, reference = judge_flight(self._setup, track, end_reason, requirements=requirements), None
        if end_reason == "completed" and verdict.failed:
            verdict, reference = explain_verdict(requirements, self._aircraft, verdict, should_abort=should_abort)
        self._recorder.finish(end_reason, verdict, reference)
        texts = (
            describe_unfinished_flight(self._verdict_basis, end_reason, verdict)
            if was_abandoned
            else describe_verdict(self._verdict_basis, verdict)
        )
        return FlightJudged(verdict.flyable, (*texts, StatusText(f"log {self._path}", INFO)))

    def abandon(self) -> None:
        """Close the log without a verdict."""
        self._recorder.abandon()


def describe_mission(setup: FlightSetup, verdict: Verdict) -> tuple[StatusText, ...]:
    """Return the texts on a mission for stations: its size, its geometric verdict, and notes on its route."""
    route = setup.route
    length = float(np.linalg.norm(np.diff(route.positions[:, :2], axis=0), axis=1).sum()) / 1000.0
    size_text = StatusText(
        f"mission: {count_text(len(route.points), 'waypoint')}, {length:.1f} km; {route.started}", INFO
    )
    notes = tuple(StatusText(f"note: {note}", NOTICE) for note in route.notes[:_MAX_TEXTS_PER_VERDICT])
    return (size_text, *describe_verdict("geometry", verdict), *notes)


# Rules that fail on a path only because the aircraft left it before its end.
_RULES_OF_UNFINISHED_PATHS = ("completion", "loiter", "waypoint", "turn", "survey")


def describe_unfinished_flight(basis: str, end_reason: str, verdict: Verdict) -> tuple[StatusText, ...]:
    """Return texts with the verdict on the flown part of a path that the aircraft left before its end.

    Findings of `_RULES_OF_UNFINISHED_PATHS` are left out.

    basis: basis of the verdict, such as "flown in GUIDED".
    end_reason: reason why the flight ended.
    """
    failed_findings = [finding for finding in verdict.failed if finding.rule not in _RULES_OF_UNFINISHED_PATHS]
    findings_text = count_text(len(failed_findings), "finding") if failed_findings else "no findings"
    first_text = StatusText(f"verdict ({basis}): {end_reason}; {findings_text} failed until then", INFO)
    return (first_text, *_describe_findings(failed_findings))


def describe_verdict(basis: str, verdict: Verdict) -> tuple[StatusText, ...]:
    """Return texts that describe a verdict: its result, the deciding parameter, and the failed findings.

    basis: basis of the verdict, such as "flown" or "geometry".
    """
    answer = f"verdict ({basis}): {verdict.answer.upper()}"
    if verdict.state == "ok":
        return (StatusText(answer, INFO),)
    if verdict.state == "open":
        return (StatusText(f"{answer}: {verdict.unjudged}", WARNING),)
    deciding_texts = () if verdict.deciding is None else (StatusText(deciding_text(verdict.deciding), WARNING),)
    return (StatusText(answer, WARNING), *deciding_texts, *_describe_findings(verdict.failed))


def _describe_findings(findings: Sequence[Finding]) -> list[StatusText]:
    """Return a text for each of the first `_MAX_TEXTS_PER_VERDICT` findings, then the number of others.

    The place of a finding is left out if its reason names it.
    """
    texts = []
    for finding in findings[:_MAX_TEXTS_PER_VERDICT]:
        heading = finding_words(finding).word if finding.placed else finding_heading(finding)
        texts.append(StatusText(f"{heading}: {finding.reason}", WARNING))
    if len(findings) > _MAX_TEXTS_PER_VERDICT:
        texts.append(StatusText(f"and {count_text(len(findings) - _MAX_TEXTS_PER_VERDICT, 'more finding')}", WARNING))
    return texts
