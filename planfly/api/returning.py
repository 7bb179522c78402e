"""Judge returns to launch from points all along a mission, plan or flight, with and without engine."""

import shutil
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple, Unpack

import numpy as np

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.importers.open_log import is_imported_log
from logs.recording.reader import FlightLog, read_log
from logs.recording.recorder import INTERRUPTED, Recorder
from logs.verdict.returns.drawn_returns import collect_drawn_returns
from logs.verdict.returns.glides_text import glide_notes, glide_range_text, glides_headline
from logs.verdict.returns.judge_glides import NO_GLIDES, Glides, judge_glides
from logs.verdict.returns.judge_returns import (
    Returns,
    judge_returns,
    make_return_world,
    unknown_energy_text,
)
from logs.verdict.returns.return_starts import return_starts
from logs.verdict.returns.returns_text import (
    describe_return_causes,
    describe_rtl_ending,
    point_of_no_return_text,
    remedy_text,
    return_range_text,
    returns_headline,
)
from logs.verdict.returns.suggest_returns import Remedy, is_improvement, suggest_parameters, suggest_rally_points
from logs.verdict.suggestions import home_height, home_height_text
from logs.views.exports.map_files import glide_shapes, kml_text, map_zones, plan_line, return_lines, track_line
from planfly.api.api_function import api_function
from planfly.api.flying import check_keywords_not_given, check_program
from planfly.arguments import check_arguments
from planfly.flight_logs import is_log
from planfly.flight_options import LogOptions, select_log_options, select_mission_options
from planfly.kernel_units.unit_kernels import FLYING, GLIDING
from planfly.rtl.jsbsim_returns import fly_return
from planfly.rtl.sitl_returns import (
    ProgramReturns,
    check_is_arduplane,
    check_returns_as_arduplane,
    fly_with_autopilot,
)
from planfly.runtime.stages import stage
from planfly.workflow.open_flight import open_flight
from planfly.workflow.output_paths import RETURN_FILES, check_output_folder, clean_folder
from planfly.workflow.pipeline import FlightTask, FlownMission, fly_and_judge
from planner.plan import Plan
from world.files import write_atomically
from world.scenario import with_terrain
from world.wording import count_text

if TYPE_CHECKING:
    pass


@dataclass(frozen=True, slots=True)
class RemedyTrial:
    """A remedy, and the outcome of all returns simulated with it.

    The returns are flown by the simulated autopilot, those closest to a limit also in JSBSim.
    """

    remedy: Remedy
    returns: Returns


@dataclass(frozen=True, slots=True, repr=False)
class ReturnsResult:
    """Result of `planfly.returns`.

    setup: the flown mission, its aircraft and its autopilot.
    returns: all returns, also grouped in ranges of seconds, the worst first.
    glides: places that can be reached after an engine failure; empty if they were not requested.
    suggested: remedies, the simplest first, each with its returns; empty if none were requested.
    files: files written; empty if no folder was named.
    by_program: the worst returns, flown by the ArduPlane program; None if no program was named.
    """

    setup: FlightSetup
    returns: Returns
    glides: Glides = NO_GLIDES
    suggested: tuple[RemedyTrial, ...] = ()
    files: tuple[Path, ...] = ()
    by_program: ProgramReturns | None = None

    @property
    def safe(self) -> bool:
        """True if every return is safe."""
        return self.returns.safe

    @property
    def undecided(self) -> bool:
        """True if some returns are undecided, and no return is unsafe."""
        return self.returns.undecided

    @property
    def headline(self) -> str:
        """Summary of all returns, in one line."""
        return returns_headline(self.returns)

    @property
    def cause_lines(self) -> tuple[str, ...]:
        """Lines on the events that trigger a return, on the events that do not, and on the end of a return."""
        return (*describe_return_causes(self.returns.causes), *describe_rtl_ending(self.returns))

    @property
    def range_lines(self) -> tuple[str, ...]:
        """One line for each period of the flight whose returns have the same outcome, the worst first."""
        return tuple(
            return_range_text(return_range, self.returns, self.setup.scenario) for return_range in self.returns.ranges
        )

    @property
    def program_lines(self) -> tuple[str, ...]:
        """Lines that compare the worst returns of the ArduPlane program and of the simulated ArduPlane.

        The tuple is empty if no program was named.
        """
        if self.by_program is None:
            return ()
        return (self.by_program.headline(), *self.by_program.lines(self.returns, self.setup.scenario))

    @property
    def no_return_line(self) -> str:
        """Line on the point of no return.

        After this point of the flight the energy is too low for a return.
        """
        return point_of_no_return_text(self.returns)

    @property
    def glide_headline(self) -> str:
        """One line on the places that the aircraft can reach after an engine failure."""
        return glides_headline(self.glides)

    @property
    def glide_lines(self) -> tuple[str, ...]:
        """One line for each range of seconds with the same best glide destination, in order of time."""
        return tuple(glide_range_text(glide_range, self.glides) for glide_range in self.glides.ranges)

    @property
    def suggestion_lines(self) -> tuple[str, ...]:
        """One line for each remedy, with the outcome of the returns flown with it."""
        return tuple(remedy_text(trial.remedy, trial.returns, self.setup.scenario) for trial in self.suggested)

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on how the returns were flown."""
        notes = [
            "returns are simulated in the mean wind, with a point-mass model under"
            f" {self.returns.autopilot}'s control laws"
        ]
        if self.returns.jsbsim_differences:
            max_difference = max(abs(difference) for difference in self.returns.jsbsim_differences)
            reflown_text = count_text(len(self.returns.jsbsim_differences), "return")
            verb = "was" if len(self.returns.jsbsim_differences) == 1 else "were"
            notes.append(
                f"{reflown_text} close to a limit {verb} also flown in JSBSim; the heights of the two simulations"
                f" differ by up to {max_difference:.0f} m"
            )
        home = self.setup.mission.home
        if home is not None and home_height_text(self.setup):
            ground = home.alt - home_height(self.setup)
            notes.append(
                f"for a launch from the ground at home, set home's altitude to {ground:.1f} m AMSL instead of"
                f" {home.alt:.1f} m"
            )
        if self.returns.stands_in:
            notes.append(
                f"the return of {self.setup.autopilot.title} is not simulated; ArduPlane's return is used instead"
            )
        if unknown_text := unknown_energy_text(self.setup):
            notes.append(unknown_text)
        if self.returns.lands:
            notes.append(
                "a return to a landing sequence must keep the required height above ground up to the sequence's first"
                " item; on the approach after that item it must only stay off the ground, and the landing is not judged"
            )
        parameters = self.setup.autopilot.parameters
        if parameters is None or not parameters.source:
            notes.append(
                "no parameter file was given: the settings above are defaults, not the settings of your aircraft; "
                "name its parameter file with --params"
            )
        if self.setup.scenario.terrain is None:
            notes.append("no terrain was given; name an elevation file with --terrain")
        if self.setup.scenario.external:
            notes.append("the mission was given without a scenario: threats are unknown")
        if not self.returns.flown:
            notes.append(
                "nothing was flown: returns start on the planned path, and the energy used before them is predicted"
            )
        return (*notes, *glide_notes(self.glides))

    def __repr__(self) -> str:
        return f"<ReturnsResult {self.setup.scenario.name}: {self.headline}>"


# Reason why the returns of a flight cannot be judged in another world, in messages.
_RETURNS_AS_FLOWN_TEXT = (
    "not allowed with a log, whose returns start in the conditions of its flight; only `terrain` can replace its ground"
)


@api_function(*FLYING, *GLIDING)
def returns(
    what: FlightLog | FlownMission | Plan | str | Path,
    *,
    every: float = 1.0,
    suggest: bool = False,
    sitl: str | Path | None = None,
    points: int = 3,
    out: str | Path | None = None,
    overwrite: bool = True,
    **options: Unpack[LogOptions],
) -> ReturnsResult:
    """Fly and judge returns to launch from points all along a flight, and find places in gliding range.

    what: a `Plan`, or the path of a plan.json, .waypoints or .plan, which is flown first; or a flight, which is a
    result of `planfly.fly`, a flight log or its path, or an autopilot's log.
    every: time between the starts of two returns, s.
    suggest: True looks for remedies that make all returns safe.
    sitl: the ArduPlane program, which then also flies the worst returns, spaced far apart.
    points: number of returns that the program flies.
    out: folder for pictures; None writes no pictures.
    overwrite: True replaces results in the folder.
    options: for a plan or mission, see `planfly.fly`; for a flight, only terrain.
    plan, flight, datum: for an autopilot's log, see `planfly.import_log`.
    Raises a `planfly.PlanflyError` for bad input, and for a mission without a home.

    >>> import planfly
    >>> found = planfly.returns(planfly.plan("jacksboro-air", seed=1), every=20)
    >>> found.safe, found.returns.ranges[0].worst.target.name, found.glides.each[0].reach
    (False, 'home', 'home')
    """
    check_arguments(every=every, points=points)
    path = Path(what) if isinstance(what, str | Path) else None
    program = None if sitl is None else check_program(sitl)
    if program is not None:
        check_is_arduplane(program)
    folder = None if out is None else Path(out)
    if folder is not None:
        check_output_folder(folder, overwrite)
    request = _ReturnsRequest(every, suggest, folder, overwrite, program, points)
    if path is not None and is_imported_log(path):
        check_keywords_not_given(str(path), {"seed": options["seed"], "nav": options["nav"]}, _RETURNS_AS_FLOWN_TEXT)
        # Imported here: only this call needs the libraries that read the logs of other programs.
        from planfly.api.imported import read_imported

        imported = read_imported(path, **options)
        return _judge_flight(imported.setup, imported.track, request, imported.ended)
    check_keywords_not_given(
        str(path or "mission"),
        select_log_options(options),
        "allowed only with the log of another program, such as .BIN",
    )
    what = read_log(path) if path is not None and is_log(path) else what
    flight_options = select_mission_options(options)
    if isinstance(what, FlightLog | FlownMission):
        fixed_options: dict[str, Any] = {**flight_options, "terrain": None, "fence": options["fence"] or None}
        check_keywords_not_given(str(path or "flight"), fixed_options, _RETURNS_AS_FLOWN_TEXT)
        setup, terrain = what.setup, options["terrain"]
        if terrain is not None:
            setup = setup.in_scenario(with_terrain(setup.scenario, str(terrain)))
        return _judge_flight(setup, what.track, request, what.ended or INTERRUPTED)
    setup = open_flight(what, flight_options)
    # Errors are raised before the flight.
    world = make_return_world(setup)
    if request.program is not None:
        check_returns_as_arduplane(world, request.program)
    with stage("flying the mission"):
        flight = fly_and_judge(setup, FlightTask(reference="never"))
    return _judge_flight(flight.setup, flight.track, request, flight.ended)


class _ReturnsRequest(NamedTuple):
    """Checked options of `returns`, other than those of the flight."""

    every: float
    suggest: bool
    folder: Path | None
    overwrite: bool
    program: Path | None
    points: int


def _judge_flight(setup: FlightSetup, track: Track, request: _ReturnsRequest, end_reason: str) -> ReturnsResult:
    """Simulate and judge returns and glides from points of a flight.

    If the request says so, remedies are suggested and files are written into its folder.

    end_reason: reason why the flight ended, for the log of the returns.
    """
    world = make_return_world(setup)
    if request.program is not None:
        check_returns_as_arduplane(world, request.program)
    starts = return_starts(setup, track, request.every)
    with stage(f"flying {count_text(len(starts), 'return')}", "flying returns"):
        judged_returns = judge_returns(world, starts, request.every, fly_return)
    with TemporaryDirectory(prefix="planfly-returns-") as log_folder:
        program_returns = None
        if request.program is not None:
            logs = None if request.folder is None else Path(log_folder)
            program_returns = fly_with_autopilot(world, starts, judged_returns, request.program, request.points, logs)
            judged_returns = program_returns.with_worse_results(judged_returns)
        with stage("gliding without the engine"):
            result = ReturnsResult(setup, judged_returns, judge_glides(world, starts), by_program=program_returns)
        if request.suggest and not result.safe and result.returns.each:
            # Remedies do not help a return that sinks to the ground in a take-off or a landing.
            judged_times = [judged_return.time for judged_return in result.returns.each]
            airborne_starts = starts.subset(np.flatnonzero(np.isin(starts.time, judged_times)))
            with stage("looking for remedies"):
                remedies = suggest_parameters(world, airborne_starts)
                rally = suggest_rally_points(world, airborne_starts)
            remedies += [] if rally is None else [rally]
            with stage(f"flying the returns of {len(remedies)} suggestions", "flying suggested returns"):
                trials = [
                    RemedyTrial(remedy, judge_returns(remedy.apply_to(world), starts, request.every, fly_return))
                    for remedy in remedies
                ]
            helpful_trials = tuple(trial for trial in trials if is_improvement(result.returns, trial.returns))
            result = replace(result, suggested=helpful_trials)
        if request.folder is None or not result.returns.each:
            return result
        with stage("drawing", "drawing returns"):
            drawn_returns_data = collect_drawn_returns(world, starts, judged_returns, result.glides)
            # Imported here: only pictures need matplotlib.
            from logs.views.figures import draw_pictures, return_views

            flown_track = track if len(track) else None
            lines = [plan_line(setup), *([track_line(setup, track)] if len(track) else [])]
            lines += return_lines(setup, drawn_returns_data, flown_track)
            zones = [*map_zones(setup), *glide_shapes(setup, drawn_returns_data)]
            text = kml_text(f"{setup.scenario.name} returns", lines, zones)
            pictures = draw_pictures(return_views(setup, drawn_returns_data, flown_track))
            files = {**pictures, "returns.kml": text.encode("utf-8")}
        folder = clean_folder(request.folder, RETURN_FILES, overwrite=request.overwrite)
        for name, data in files.items():
            write_atomically(folder / name, data)
        names = list(files)
        for log in sorted(Path(log_folder).iterdir()):
            shutil.move(log, folder / log.name)
            names.append(log.name)
    if len(track):
        with Recorder(folder / "returns.mcap", setup) as recorder:
            recorder.write(track)
            recorder.finish(end_reason, returns=drawn_returns_data)
        names.append("returns.mcap")
    return replace(result, files=tuple(folder / name for name in names))
