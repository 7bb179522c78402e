"""Fly a mission, and judge one, or a flight."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from flight.autopilots.arduplane_sitl.process import check_binary
from flight.mission.items import Mission
from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.recording.reader import FlightLog, LogEvent, read_log
from logs.verdict.findings import Verdict
from logs.verdict.judge_flight import judge_flight, judge_geometry
from planfly.api.planning import Wind, changed_scenario
from planfly.crash_safe_log import MAX_HOURS, MAX_MEGABYTES, FlightLimits
from planfly.first_start import with_warm_up
from planfly.kernel_units.unit_kernels import FLYING
from planfly.open_mission import (
    NamedFences,
    OpenedMission,
    ScenarioChange,
    is_log,
    open_mission,
    open_planned,
    read_named_fences,
)
from planfly.pipeline import fly_and_judge
from planfly.terminal.results import judge_log
from planner.plan import Plan
from world.errors import ScenarioError
from world.html_table import html_table
from world.scenario import over_terrain
from world.scenario_tables import Guidance, Navigation

# ----------------------------------------------------------------------
# What the verbs give: frozen data, short to print, a table in a notebook.


@dataclass(frozen=True, slots=True, repr=False)
class FlownMission:
    """What `planfly.fly` returns.

    setup: everything that decided the flight.
    track: its rows; none of a flight that could not begin.
    verdict: whether it flies, with a finding for every rule and place.
    ended: how it ended, "completed" or the reason why not.
    events: what the log holds beside the rows.
    log: the file that it is recorded in; None where none was asked for, or nothing flown.
    """

    setup: FlightSetup
    track: Track
    verdict: Verdict
    ended: str
    events: tuple[LogEvent, ...] = ()
    log: Path | None = None

    @property
    def mission(self) -> Mission:
        """Its items, as read or made of a plan."""
        return self.setup.mission

    @property
    def plan(self) -> Plan | None:
        """The plan that it is of; None for a mission that a person brought."""
        return self.setup.plan

    @property
    def flyable(self) -> bool:
        """The verdict's answer."""
        return self.verdict.flyable

    def __repr__(self) -> str:
        return f"<FlownMission {self.setup.scenario.name}: {self.ended}; {self.track!r}, {self.verdict!r}>"

    def _repr_html_(self) -> str:
        """How a notebook shows it."""
        return self.verdict._repr_html_() + self.track._repr_html_()


@dataclass(frozen=True, slots=True)
class WrittenReport:
    """What `planfly.report` and `planfly.compare` wrote.

    page: the HTML page, which needs no other file.  files: it and the pictures beside it.
    """

    page: Path
    files: tuple[Path, ...]

    def _repr_html_(self) -> str:
        """How a notebook shows it."""
        return html_table(f"Report {self.page}", [(file.name,) for file in self.files])


@dataclass(frozen=True, slots=True)
class ExportedFiles:
    """What `planfly.export` wrote.

    files: in the order asked for.  notes: what of the source they do not hold, a line each.
    """

    files: tuple[Path, ...]
    notes: tuple[str, ...] = ()


FencePaths = str | Path | Sequence[str | Path]


@with_warm_up(*FLYING)
def fly(
    mission: Plan | str | Path,
    *,
    log: str | Path | None = None,
    scenario: str | Path | None = None,
    terrain: str | Path | None = None,
    fence: FencePaths = (),
    seed: int | None = None,
    wind: Wind | None = None,
    turbulence: str | None = None,
    aircraft: str | Path | None = None,
    airspeed: float | None = None,
    params: str | Path | None = None,
    guidance: Guidance | None = None,
    nav: Navigation | None = None,
    autopilot: str | Path | None = None,
    log_hz: Literal[10, 20, 30, 60] = 60,
    max_hours: float = MAX_HOURS,
    max_log: float = MAX_MEGABYTES,
) -> FlownMission:
    """Fly a plan or a mission file in JSBSim, and judge the flight.

    mission: a `Plan`, or the path of a plan.json, .waypoints or .plan file.
    log: where to write the flight as MCAP, replaced if it exists; None writes none.
    scenario: to fly it in, a name or a TOML file; None for the plan's own, or one made around the mission.
    terrain: an elevation file in place of the scenario's.  fence: files of fences and zones beside its own.
    seed: of the turbulence; None takes the plan's, the scenario's, or 1.
    wind, turbulence, aircraft, airspeed, params, guidance, nav: as of `planfly.plan`.
    autopilot: the program of a real ArduPlane, which then flies.
    log_hz: rows a second in the log.  max_hours, max_log: where a flight ends that would go on, h and MB.

    A plan that cannot be flown is a verdict, not an error; bad input raises a `planfly.PlanflyError`.

    >>> import planfly
    >>> flown = planfly.fly(planfly.plan("paper-07", seed=1), wind=(4, 270))
    >>> flown.ended, flown.verdict.flyable, flown.setup.scenario.wind.speed
    ('completed', True, 4.0)
    """
    opened = _opened(
        mission, scenario, terrain, seed, fence,
        lambda world: changed_scenario(
            world, wind=wind, turbulence=turbulence, aircraft=aircraft, airspeed=airspeed, params=params,
            guidance=guidance, nav=nav,
        ),
    )  # fmt: skip
    program = None if autopilot is None else Path(autopilot)
    if program is not None:
        check_binary(program)
    target = None if log is None else Path(log)
    most = FlightLimits(max_hours, max_log)
    flown = fly_and_judge(opened.setup, opened.airframe, target, every=60 // log_hz, autopilot=program, limits=most)
    kept = target if len(flown.track) else None
    return FlownMission(flown.setup, flown.track, flown.verdict, flown.ended, flown.events, kept)


@with_warm_up()
def check(
    what: FlightLog | FlownMission | Plan | str | Path,
    *,
    scenario: str | Path | None = None,
    terrain: str | Path | None = None,
    fence: FencePaths = (),
    wind: Wind | None = None,
    turbulence: str | None = None,
    aircraft: str | Path | None = None,
    airspeed: float | None = None,
    params: str | Path | None = None,
) -> Verdict:
    """Judge without flying: a flight by its log, or a plan or mission by its geometry alone.

    what: a flight log or its path, what `planfly.fly` gave, a `Plan`, or the path of a plan.json, .waypoints or .plan.
    scenario, wind, turbulence, aircraft, airspeed, params: of a plan or mission, as of `planfly.fly`; a flight is
    judged as it was flown.
    terrain, fence: in place of the ground, and beside the fences, that it carries.

    Raises a `planfly.PlanflyError` for bad input.

    >>> import planfly
    >>> verdict = planfly.check(planfly.plan("tight", seed=1))
    >>> verdict.level, verdict.flyable
    ('geometric', False)
    """
    given = {
        "scenario": scenario, "wind": wind, "turbulence": turbulence, "aircraft": aircraft, "airspeed": airspeed,
        "params": params,
    }  # fmt: skip
    if isinstance(what, str | Path) and is_log(Path(what)):
        what = read_log(what)
    if isinstance(what, FlightLog | FlownMission):
        source = what.source if isinstance(what, FlightLog) else what.setup.mission.source
        for name, value in given.items():
            if value is not None:
                allowed = "a flight is judged in the world, and with the aircraft, that it was flown with"
                raise ScenarioError(
                    f"{source}: {name}: {allowed}", file=source, field=name, value=value, allowed=allowed
                )
        return _check_flight(what, terrain, _fences(fence))
    opened = _opened(
        what, scenario, terrain, None, fence,
        lambda world: changed_scenario(
            world, wind=wind, turbulence=turbulence, aircraft=aircraft, airspeed=airspeed, params=params
        ),
    )  # fmt: skip
    return judge_geometry(opened.setup)


def _check_flight(flight: FlightLog | FlownMission, terrain: str | Path | None, fences: NamedFences) -> Verdict:
    setup = flight.setup
    if terrain is not None:
        setup = setup.in_scenario(over_terrain(setup.scenario, str(terrain)))
    if fences.items or fences.zones:
        setup = replace(setup.in_scenario(fences.on_scenario(setup.scenario)), mission=fences.on_mission(setup.mission))
    if isinstance(flight, FlightLog):
        return judge_log(replace(flight, setup=setup))
    return flight.verdict if setup is flight.setup else judge_flight(setup, flight.track, flight.ended)


def _opened(
    mission: Plan | str | Path,
    scenario: str | Path | None,
    terrain: str | Path | None,
    seed: int | None,
    fence: FencePaths,
    change: ScenarioChange,
) -> OpenedMission:
    world, ground = (None if name is None else str(name) for name in (scenario, terrain))
    fences = _fences(fence)
    if isinstance(mission, Plan):
        return open_planned(mission, world, ground, seed=seed, change=change, fences=fences)
    return open_mission(Path(mission), world, ground, seed=seed, change=change, fences=fences)


def _fences(files: FencePaths) -> NamedFences:
    given = [files] if isinstance(files, str | Path) else files
    return read_named_fences([str(file) for file in given])
