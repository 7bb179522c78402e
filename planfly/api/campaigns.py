"""Find by many flights if a mission is flyable.

The answer is its probability, its strongest winds or its smallest battery.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Unpack, cast

from logs.verdict.tolerances import ENERGY_RESERVE_FRACTION
from planfly.api.api_function import api_function
from planfly.arguments import check_arguments
from planfly.campaigns.campaign_base import CampaignBase, is_mission_file, open_campaign
from planfly.campaigns.campaign_result import (
    CampaignResult,
    campaign_command_line,
    command_line,
    make_goal,
    winds_command_line,
)
from planfly.campaigns.compare_campaigns import CampaignComparison, campaign_table, compare_tables
from planfly.campaigns.dispersions import Dispersions, default_dispersions, read_dispersions
from planfly.campaigns.find_battery import BatteryGoal, BatteryResult, find_battery
from planfly.campaigns.find_winds import (
    SEARCHED_QUANTITIES,
    WindsResult,
    find_winds,
    make_winds_goal,
    open_winds_store,
)
from planfly.campaigns.flight_row import FlightRow
from planfly.campaigns.fly_campaign import fly_campaign, open_store, resumed_goal
from planfly.campaigns.report import (
    SCENARIO_FILE,
    OutputDirectory,
    campaign_folder,
    finish_campaign,
    fly_row_again,
    write_winds,
)
from planfly.campaigns.statistics.decision import MAX_DECIDING_FLIGHTS, Estimator, Goal, Tally
from planfly.campaigns.summary import summarise_campaign
from planfly.campaigns.tables import CAMPAIGN_DATABASE, WINDS_DATABASE, read_stored_settings, read_table
from planfly.campaigns.worker_pool import Workers, check_scheduler_address
from planfly.flight_options import (
    BatteryOptions,
    CampaignOptions,
    MissionOptions,
    SampleOptions,
    WindowOptions,
    WindsOptions,
    fence_file_names,
    select_mission_options,
)
from planfly.kernel_units.unit_kernels import PLANNING_AND_FLYING
from planfly.runtime.process_setup import end_repeated_call
from planfly.runtime.stages import report_line, stage
from planfly.workflow.output_paths import check_output_folder, replace_files
from planner.plan import Plan
from world.argument_types import checks_types
from world.errors import ArgumentError, PlanflyError
from world.extras import require_extra, requires_extra
from world.scenario import Scenario
from world.wording import count_text


@dataclass(frozen=True, slots=True)
class CampaignFlight:
    """Result of `planfly.campaign_flight`: a flight of a campaign, flown again with the same outcome.

    row: outcome, reason for the end, and failed rules.
    log: the file of the flight log.
    """

    row: FlightRow
    log: Path


def _with_stored_options(options: CampaignOptions | WindsOptions, directory: OutputDirectory) -> CampaignOptions:
    """Return the given options, completed by the stored options of a campaign that is resumed.

    A given option replaces the stored option. If no campaign is resumed, the options are returned unchanged.
    """
    stored = read_stored_settings(directory.folder / directory.table).get("options", {}) if directory.resume else {}
    # A wind is stored as a list.
    values = {name: tuple(value) if name == "wind" and value else value for name, value in stored.items()}
    given = {name: value for name, value in options.items() if value is not None and value != ()}
    return cast(CampaignOptions, {**options, **values, **given})


def _open_base(
    target: Plan | Scenario | str | Path, options: MissionOptions, dispersions: Dispersions, folder: OutputDirectory
) -> CampaignBase:
    """Open the mission of a campaign, and prepare the campaign's folder.

    A path is planned for a scenario, unless the folder of a resumed campaign contains the plan.  Raises PlanflyError
    for bad input; then the folder is not changed.
    """
    campaign_target, flight_options = (
        str(target) if isinstance(target, str | Path) else target,
        select_mission_options(options),
    )
    is_planned = isinstance(campaign_target, Plan) or is_mission_file(campaign_target)

    def open_with_plan(plan_file: Path | None) -> CampaignBase:
        """Open the campaign base; if the plan file does not exist, plan a path with a progress report."""
        make_base = partial(open_campaign, campaign_target, dispersions, flight_options, plan_file=plan_file)
        if is_planned or (plan_file is not None and plan_file.is_file()):
            return make_base()
        with stage("planning") as advance:
            return make_base(advance=advance)

    base = folder.open_base_and_clear(open_with_plan)
    for warning in base.mission.warnings:
        report_line(f"note: {warning}")
    return base


def _name_command_line_target(target: Plan | Scenario | str | Path, folder: Path) -> str:
    """Return the text that names a campaign's target in the command line that repeats the campaign.

    For a `Plan`, it is the path of the plan's file in `folder`.  A `Scenario` is written to a file there.
    """
    if isinstance(target, Plan):
        return str(folder / "plan.json")
    return _write_scenario_file(target, folder) if isinstance(target, Scenario) else str(target)


def _write_scenario_file(scenario: Scenario, folder: Path) -> str:
    """Write a scenario into a campaign's folder, and return its path.

    The path is for the command line that repeats the campaign.

    A scenario made around a mission cannot be written; its name is returned.
    """
    if scenario.external:
        return scenario.name
    scenario.to_toml(folder / SCENARIO_FILE)
    return str(folder / SCENARIO_FILE)


def _list_command_line_options(
    base: CampaignBase, options: MissionOptions, spread: str | Path | None, folder: Path
) -> dict[str, object]:
    """Return the options of the command line that repeats a campaign, by name.

    A `Scenario` is named by a file that is written into `folder`.
    """
    named_scenario = options.get("scenario")
    return {"seed": base.seed, "spread": spread} | {
        **select_mission_options(options),
        "scenario": _write_scenario_file(named_scenario, folder)
        if isinstance(named_scenario, Scenario)
        else named_scenario,
        "fence": fence_file_names(options),
    }


def answer_command_line(
    command: str,
    target: Plan | Scenario | str | Path,
    base: CampaignBase,
    options: SampleOptions | WindowOptions,
    search_options: Mapping[str, object],
) -> str:
    """Return the command line that repeats a search for a window, a battery or a ground risk class.

    Returns "" if the target or the scenario is a Python object, which a command line cannot name.

    command: name of the command, such as "battery".
    search_options: options of this command only, by name.
    """
    if not isinstance(target, str | Path) or isinstance(options.get("scenario"), Scenario):
        return ""
    mission = {**select_mission_options(options), "fence": fence_file_names(options), "seed": base.seed}
    return command_line(
        command,
        str(target),
        {**search_options, "flights": options.get("flights"), "spread": options.get("spread"), **mission},
    )


def make_workers(count: int | None, scheduler: str | None, seed: int | None) -> Workers:
    """Check the arguments that concern worker processes, and return the workers.

    count: number of processes on this machine; None for one per core.
    scheduler: address of a dask scheduler; None to fly on this machine.
    seed: seed of the campaign, which is only checked.

    Raises PlanflyError for invalid arguments, and MissingExtraError if dask is not installed.
    """
    end_repeated_call()
    check_arguments(workers=count, seed=seed)
    if scheduler is not None:
        check_scheduler_address(scheduler)
        require_extra("cluster", "--scheduler needs")
    return Workers(count, scheduler)


def _read_spread(file: str | Path | None) -> Dispersions:
    """Read a dispersions file; for None, return planfly's default dispersions."""
    return default_dispersions() if file is None else read_dispersions(Path(file))


# ----------------------------------------------------------------------
# Find the probability that a mission is flyable.


def continued_goal(
    folder: Path, flights: int | None, prove: float | None, at_least: float | None, confidence: float | None
) -> Goal:
    """Return the goal of a resumed campaign; an argument that is None keeps its earlier value.

    flights: number of flights.
    prove, at_least: target probability, see `campaign`.
    confidence: confidence level.
    Raises PlanflyError for numbers outside their ranges, and for a folder without a campaign.
    """
    requested_goal = make_goal(flights, prove, at_least, confidence)
    return resumed_goal(
        requested_goal,
        folder,
        confidence,
        keeps_target=prove is None and at_least is None,
        keeps_flights=flights is None,
    )


def _warn_of_too_few_flights(goal: Goal) -> None:
    """Print a warning if a campaign has too few flights to show its target even if all are flyable."""
    estimator, best = Estimator(goal), Tally(goal.flights, 0)
    if estimator.estimate(best).answer == "undecided":
        needed_text = count_text(estimator.deciding_flights(best) or MAX_DECIDING_FLIGHTS, "flight")
        report_line(
            f"warning: {count_text(goal.flights, 'flight')} cannot show a probability of at least {goal.target},"
            " even if all are flyable;"
            f" that needs {needed_text} without a failure"
        )


@requires_extra("campaigns")
@api_function(*PLANNING_AND_FLYING)
def campaign(
    target: Plan | Scenario | str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    out: Path | str | None = None,
    resume: bool = False,
    overwrite: bool = False,
    **options: Unpack[CampaignOptions],
) -> CampaignResult:
    """Fly a mission many times, like `planfly.fly`, with variations of wind, aircraft, terrain and start.

    target: a built-in scenario's name, a scenario's TOML file, a `Scenario`, a `Plan`, or a plan.json, .waypoints or
    .plan file.
    spread: a TOML file of the quantities that vary; None takes planfly's default.
    flights: number of flights; None takes 300, or at most 5,000 with ``prove``.
    prove: a probability; flights are flown until they show whether the mission reaches it.
    at_least: a probability to judge after all flights.  Only one of the two may be given.
    confidence: confidence level of each bound; None takes 0.95.
    seed: seed of plan and draws.  For the other options, see `planfly.fly`.
    workers: number of processes on this machine; None for one per core.
    scheduler: address of a running dask scheduler, whose workers then fly.
    out: folder of the campaign's files; None keeps no files.
    resume: True continues the campaign in the folder; arguments that are not given keep their earlier values,
        except workers and scheduler.
    overwrite: True replaces the campaign in the folder.
    A script must call this function under ``if __name__ == "__main__":``, because workers import the script.
    Raises a `planfly.PlanflyError` for bad input, which is also a ValueError for a number out of its range.

    >>> campaign("paper-07", prove=1.5)
    Traceback (most recent call last):
    ...
    world.errors.ArgumentError: prove 1.5: expected at least 0.5 and below 1
    """
    workers_used = make_workers(workers, scheduler, options["seed"])
    requested = (options["flights"], options["prove"], options["at_least"], options["confidence"])
    goal = make_goal(*requested)
    with campaign_folder(out, CAMPAIGN_DATABASE, resume=resume, overwrite=overwrite) as directory:
        if resume:
            goal = continued_goal(directory.folder, *requested)
            if options["flights"] is None:
                stored_count = read_stored_settings(directory.folder / CAMPAIGN_DATABASE).get("flights")
                origin = "as in the resumed campaign" if goal.flights == stored_count else "the default"
                report_line(f"number of flights: {'at most ' if goal.stops else ''}{goal.flights:,}, {origin}")
        _warn_of_too_few_flights(goal)
        options = _with_stored_options(options, directory)
        base = _open_base(target, options, _read_spread(options["spread"]), directory)
        stated = _list_command_line_options(base, options, options["spread"], directory.folder)
        repeated = campaign_command_line(_name_command_line_target(target, directory.folder), goal, stated)
        table_path = directory.folder / CAMPAIGN_DATABASE
        with open_store(base, goal, directory.folder, resume=directory.resume, options=stated) as store:
            with stage("flying", "flying a campaign") as advance:
                estimate = fly_campaign(base, goal, workers_used, store, advance)
            short_summary = summarise_campaign(base, goal, estimate, store) if out is None else None
        # The open store locks its table.
        if short_summary is not None:
            return CampaignResult(short_summary, read_table(table_path))
        with stage("reporting") as advance:
            summary = finish_campaign(base, goal, estimate, directory.folder, repeated, advance)
        return CampaignResult(summary, read_table(table_path), table_path)


@requires_extra("campaigns")
@api_function(*PLANNING_AND_FLYING)
def campaign_flight(
    target: Plan | Scenario | str | Path,
    index: int,
    out: str | Path,
    **options: Unpack[CampaignOptions],
) -> CampaignFlight:
    """Fly one flight of a campaign again, into a log in the campaign's folder.

    target: the campaign's target; all other keywords must also have the same values as for the campaign.
    index: number of the flight, from 0.  out: the campaign's folder.
    Raises a `planfly.PlanflyError` for bad input, and if the result of the flight differs from the table.
    """
    check_arguments(index=index)
    folder = Path(out)
    goal = continued_goal(folder, options["flights"], options["prove"], options["at_least"], options["confidence"])
    directory = OutputDirectory(folder, CAMPAIGN_DATABASE, resume=True, overwrite=False)
    options = _with_stored_options(options, directory)
    base = _open_base(target, options, _read_spread(options["spread"]), directory)
    with open_store(base, goal, folder, resume=True) as store:
        row = store.flight(index)
        if row is None:
            allowed = f"no such flight: the campaign has {count_text(store.tally().flown, 'flight')}, numbered from 0"
            raise PlanflyError.of_argument("index", index, allowed, file=store.path)
    log = folder / "flights" / f"flight-{index:06d}.mcap"
    log.parent.mkdir(exist_ok=True)
    return CampaignFlight(fly_row_again(base, row, log), log)


@requires_extra("campaigns")
@checks_types
def compare_campaigns(first: str | Path, second: str | Path) -> CampaignComparison:
    """Compare two campaigns: their probabilities, the flights that fail each rule, and their options.

    If the flights of both have the same draws (the same seed, dispersions and numbers of flights), they are compared in
    pairs.

    first, second: folders of the campaigns, or their files ``campaign.sqlite``.
    Raises a `planfly.PlanflyError` for bad input.

    >>> compare_campaigns("nowhere", "nowhere")
    Traceback (most recent call last):
    ...
    world.errors.PlanflyError: nowhere: no campaign; expected a folder with a campaign.sqlite
    """
    tables = []
    for path in (Path(first), Path(second)):
        table = campaign_table(path)
        if table is None:
            allowed = f"no campaign; expected a folder with a {CAMPAIGN_DATABASE}"
            raise PlanflyError(f"{path}: {allowed}", file=path)
        tables.append(table)
    return compare_tables(*tables)


# ----------------------------------------------------------------------
# Find the strongest wind from each direction in which a mission is flyable.


@requires_extra("campaigns")
@api_function(*PLANNING_AND_FLYING)
def winds(
    target: Plan | Scenario | str | Path,
    *,
    prove: float | None = None,
    directions: int | None = None,
    most: float | None = None,
    out: str | Path | None = None,
    resume: bool = False,
    overwrite: bool = False,
    **options: Unpack[WindsOptions],
) -> WindsResult:
    """Find the strongest wind from each direction in which a mission is flyable with a given probability.

    In the result, ``boundaries`` has the strongest wind of each direction, ``judged`` is True if enough flights decide
    it, ``reasons`` states why it is undecided, and ``answer`` is the answer of the whole search.

    target: a built-in scenario's name, a scenario's TOML file, a `Scenario`, a `Plan`, or a plan.json, .waypoints or
    .plan file.
    prove: required probability of a flyable flight; None takes 0.99.
    directions: number of wind directions, 4 to 72; None takes 16.
    most: strongest wind that is searched, m/s; None takes 20.
    flights: maximum number of flights for all directions together; None takes 5,000.
    confidence: confidence level of each interval; None takes 0.95.  A resumed search keeps its values for None.
    spread, seed, workers, scheduler: see `planfly.campaign`.  For the other options, see `planfly.fly`.
    out: a folder for ``winds.html``, ``winds.png``, ``winds.json`` and the flights; None keeps no files.
    resume: True continues the search in the folder.  overwrite: True replaces the search.
    A script must call this function under ``if __name__ == "__main__":``, because workers import the script.
    Raises a `planfly.PlanflyError` for bad input, which is also a ValueError for a number out of its range.

    >>> winds("paper-07", directions=3)
    Traceback (most recent call last):
    ...
    world.errors.ArgumentError: directions 3: expected a whole number from 4 to 72
    """
    confidence, flights = options["confidence"], options["flights"]
    check_arguments(prove=prove, confidence=confidence, directions=directions, most=most, flights=flights)
    workers_used = make_workers(options["workers"], options["scheduler"], options["seed"])
    with campaign_folder(out, WINDS_DATABASE, resume=resume, overwrite=overwrite) as directory:
        folder = directory.folder
        numbers = {"target": prove, "confidence": confidence, "directions": directions, "most": most}
        goal = make_winds_goal({**numbers, "flights": flights}, folder, resume=resume)
        goal.check_flights()
        if goal.flights < goal.judging_flights:
            report_line(
                f"warning: {count_text(goal.flights, 'flight')} cannot judge all {goal.directions} directions; that"
                f" needs at least {count_text(goal.judging_flights, 'flight')}"
            )
        mission_options = _with_stored_options(options, directory)
        spread = mission_options["spread"]
        base = _open_base(target, mission_options, _read_spread(spread).without(SEARCHED_QUANTITIES), directory)
        if base.scenario.wind.forecast is not None:
            allowed = (
                "not allowed, because this search sets the wind itself; planfly window finds take-off"
                " times in a forecast"
            )
            raise ArgumentError.of_argument("forecast", mission_options["forecast"], allowed, shown="")
        stated = _list_command_line_options(base, mission_options, spread, folder)
        with (
            open_winds_store(base, goal, folder, resume=resume, options=stated) as store,
            stage("flying", "winds") as advance,
        ):
            winds_found = find_winds(base, goal, workers_used, store, advance)
        if out is not None:
            repeated = winds_command_line(_name_command_line_target(target, folder), goal, stated)
            write_winds(folder, base, winds_found, repeated)
    return winds_found


# ----------------------------------------------------------------------
# Find the smallest battery for a mission and its returns.


def open_sample(target: Plan | Scenario | str | Path, options: SampleOptions) -> CampaignBase:
    """Open the mission for a search whose flights are not stored on disk.

    For a scenario, plan a path first.

    Raises PlanflyError for bad input.
    """
    dispersions, mission_options = _read_spread(options["spread"]), select_mission_options(options)
    campaign_target = str(target) if isinstance(target, str | Path) else target
    if isinstance(campaign_target, Plan) or is_mission_file(campaign_target):
        return open_campaign(campaign_target, dispersions, mission_options)
    with stage("planning") as advance:
        return open_campaign(campaign_target, dispersions, mission_options, advance=advance)


@requires_extra("campaigns")
@api_function(*PLANNING_AND_FLYING)
def battery(
    target: Plan | Scenario | str | Path,
    *,
    probability: float = 0.95,
    reserve: float = ENERGY_RESERVE_FRACTION,
    specific_energy: float | None = None,
    every: float = 10.0,
    out: str | Path | None = None,
    overwrite: bool = True,
    **options: Unpack[BatteryOptions],
) -> BatteryResult:
    """Find the smallest battery that keeps its reserve in mission and returns with a given probability.

    The flights vary as in `planfly.campaign`.  From each flight, returns to launch are simulated as in
    `planfly.returns`.

    target: a built-in scenario's name, a scenario's TOML file, a `Scenario`, a `Plan`, or a plan.json, .waypoints or
    .plan file.
    probability: required probability that the reserve is kept.
    reserve: fraction of the battery that must remain.
    specific_energy: energy per battery mass, Wh/kg, with which the aircraft's mass changes with the battery; None
    keeps the mass.
    every: time between the starts of two returns, s.
    out: folder for ``battery.png`` and ``report.html``; None writes no files.  overwrite: True replaces existing files.
    flights: number of flights.  confidence: confidence of the capacity's interval.
    spread, seed, workers, scheduler: see `planfly.campaign`.  For the other options, see `planfly.fly`.
    A script must call this function under ``if __name__ == "__main__":``, because workers import the script.
    Raises a `planfly.PlanflyError` for bad input, which is also a ValueError for a number out of its range.

    >>> battery("paper-07", reserve=1.5)
    Traceback (most recent call last):
    ...
    world.errors.ArgumentError: reserve 1.5: expected a fraction of the battery from 0 to 0.9
    """
    check_arguments(
        probability=probability,
        reserve=reserve,
        specific_energy=specific_energy,
        every=every,
        sample_flights=options["flights"],
        confidence=options["confidence"],
    )
    workers_used = make_workers(options["workers"], options["scheduler"], options["seed"])
    if out is not None:
        check_output_folder(Path(out), overwrite)
    base = open_sample(target, options)
    goal = BatteryGoal(probability, options["confidence"], options["flights"], every, reserve, specific_energy)
    with stage("flying", "flying for a battery") as advance:
        result = find_battery(base, goal, workers_used, advance)
    if out is None:
        return result
    search_options = {
        "probability": probability,
        "reserve": reserve,
        "specific_energy": specific_energy,
        "every": every,
        "confidence": options["confidence"],
    }
    command = answer_command_line("battery", target, base, options, search_options)
    # Imported here: only pictures need matplotlib.
    from logs.views.drawing import png_bytes
    from planfly.campaigns.answer_pages import battery_page
    from planfly.campaigns.battery_chart import draw_battery

    with stage("drawing", "drawing the battery"):
        figure = draw_battery(result)
        contents = {"battery.png": png_bytes(figure), "report.html": battery_page(result, figure, command).render()}
    return replace(result, files=replace_files(Path(out), contents, overwrite=overwrite))
