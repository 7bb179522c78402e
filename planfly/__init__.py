"""Find out if a plan will really fly: plan a path, fly it in JSBSim, and judge the flight.

Paths are for fixed-wing aircraft, over terrain and among threats.

    import planfly

    path = planfly.plan("jacksboro", seed=1)
    flown = planfly.fly(path, wind=(8, 270), turbulence="light", log="flight.mcap")
    print(flown.verdict.summary)
    planfly.figures(flown)["map"].savefig("map.png")
    planfly.export(path, "mission.waypoints")
    planfly.report(flown, "report")

plan, replan, what_blocks            make a path; plan again in flight; why there is no feasible path
what_may_fail                        why flights of a safe plan may fail
plan_front                           a choice of paths: short, little exposed to radar, high above ground, low energy
fly, plan_then_fly, run              fly a plan or a mission file; both at once; the whole chain into a folder
fly_by_each                          fly it by several simulated autopilots
check, judge, read_log               judge a log, a plan or a mission; read a log, its track as a table
figures, report, compare             matplotlib figures; a page of a flight; two flights compared
export, foxglove_layout              files for ground stations, maps and other programs
replay, timeline, instruments, movie a flight again, from its log
play_to_foxglove, play_to_stations   the same in other programs
import_log, refly, recover           another program's log; its mission flown in JSBSim; a damaged log
guess_columns                        a table of columns, by which CSV, MAT, Parquet and HDF5 files are logs
returns                              whether the aircraft would come home from each point of its route
link                                 the radio link to the ground station along a flight
survey                               how much of each photo line of a survey can be used, and what would help
campaign, campaign_flight, winds     how likely success is; the largest wind from each direction
battery                              the smallest battery with which a mission and its returns keep the reserve
window                               the times of take-off at which a mission is flyable in a weather forecast
compare_campaigns                    whether flights of one campaign are more likely to be flyable than another's
ground_risk                          the volumes and the ground risk class of a mission by SORA 2.5
serve                                a MAVLink vehicle for ground stations
open_studio                          a page on which a mission is dragged, judged, flown and saved
scenarios, aircraft                  the built-in scenarios and aircraft
terrain                              the ground of an area as a file, from tiles or from the Copernicus DEM's server
new_scenario                         a commented scenario of your own, between two positions over a terrain
make_scenario                        a scenario with other threats (arrays, a data frame) and other values, in Python
describe_aircraft, new_aircraft      trims, modes and envelope; a folder for an aircraft of your own
identify_aircraft                    such a folder from flight logs, with the uncertainty of each estimate
predict                              a logged flight that a model has not seen, as bands of 95 %
paper_tables, optimise               the paper's section V; the planner's optimisers alone, by ask and tell
progress                             report the progress of calls to a function
PlanflyError                         the error for bad input, with file, field, value and allowed range; its subclasses

Paths are `str` or `pathlib.Path`.  The command line is ``planfly --help``.
"""

from typing import TYPE_CHECKING, Any

from planfly._version import __version__ as __version__
from planfly.own_packages import check_hidden_packages
from planfly.runtime.process_setup import prepare_child

check_hidden_packages()
prepare_child()

if TYPE_CHECKING:
    from flight.simulation.track import Track as Track
    from logs.recording.reader import FlightLog as FlightLog
    from logs.recording.reader import read_log as read_log
    from logs.verdict.verdict import Verdict as Verdict
    from logs.views.replay.instruments import Instruments as Instruments
    from logs.views.replay.timeline import TimelineEntry as TimelineEntry
    from logs.views.report.compare import Comparison as Comparison
    from planfly.api.aircraft import AircraftNumbers as AircraftNumbers
    from planfly.api.aircraft import aircraft as aircraft
    from planfly.api.aircraft import describe_aircraft as describe_aircraft
    from planfly.api.aircraft import new_aircraft as new_aircraft
    from planfly.api.campaigns import CampaignFlight as CampaignFlight
    from planfly.api.campaigns import battery as battery
    from planfly.api.campaigns import campaign as campaign
    from planfly.api.campaigns import campaign_flight as campaign_flight
    from planfly.api.campaigns import compare_campaigns as compare_campaigns
    from planfly.api.campaigns import winds as winds
    from planfly.api.cutting_terrain import terrain as terrain
    from planfly.api.drafting import new_scenario as new_scenario
    from planfly.api.exporting import ExportedFiles as ExportedFiles
    from planfly.api.exporting import export as export
    from planfly.api.finding_windows import window as window
    from planfly.api.flying import Judged as Judged
    from planfly.api.flying import check as check
    from planfly.api.flying import fly as fly
    from planfly.api.flying import fly_by_each as fly_by_each
    from planfly.api.flying import judge as judge
    from planfly.api.flying import plan_then_fly as plan_then_fly
    from planfly.api.fronts import plan_front as plan_front
    from planfly.api.ground_risk import ground_risk as ground_risk
    from planfly.api.identifying import IdentifiedAircraft as IdentifiedAircraft
    from planfly.api.identifying import identify_aircraft as identify_aircraft
    from planfly.api.imported import ColumnGuesses as ColumnGuesses
    from planfly.api.imported import Reflown as Reflown
    from planfly.api.imported import guess_columns as guess_columns
    from planfly.api.imported import import_log as import_log
    from planfly.api.imported import recover as recover
    from planfly.api.imported import refly as refly
    from planfly.api.linking import LinkResult as LinkResult
    from planfly.api.linking import link as link
    from planfly.api.making_scenarios import make_scenario as make_scenario
    from planfly.api.optimising import BestFound as BestFound
    from planfly.api.optimising import Optimiser as Optimiser
    from planfly.api.optimising import optimise as optimise
    from planfly.api.planning import plan as plan
    from planfly.api.planning import replan as replan
    from planfly.api.planning import scenarios as scenarios
    from planfly.api.planning import what_blocks as what_blocks
    from planfly.api.planning import what_may_fail as what_may_fail
    from planfly.api.predicting import Predicted as Predicted
    from planfly.api.predicting import predict as predict
    from planfly.api.replaying import instruments as instruments
    from planfly.api.replaying import movie as movie
    from planfly.api.replaying import play_to_foxglove as play_to_foxglove
    from planfly.api.replaying import play_to_stations as play_to_stations
    from planfly.api.replaying import replay as replay
    from planfly.api.replaying import timeline as timeline
    from planfly.api.reporting import WrittenReport as WrittenReport
    from planfly.api.reporting import compare as compare
    from planfly.api.reporting import figures as figures
    from planfly.api.reporting import foxglove_layout as foxglove_layout
    from planfly.api.reporting import report as report
    from planfly.api.returning import ReturnsResult as ReturnsResult
    from planfly.api.returning import returns as returns
    from planfly.api.running import Round as Round
    from planfly.api.running import RunResult as RunResult
    from planfly.api.running import run as run
    from planfly.api.serving import serve as serve
    from planfly.api.surveying import SurveyResult as SurveyResult
    from planfly.api.surveying import survey as survey
    from planfly.campaigns.campaign_result import CampaignResult as CampaignResult
    from planfly.campaigns.compare_campaigns import CampaignComparison as CampaignComparison
    from planfly.campaigns.dispersions import SpreadError as SpreadError
    from planfly.campaigns.find_battery import BatteryResult as BatteryResult
    from planfly.campaigns.find_ground_risk import GroundRiskResult as GroundRiskResult
    from planfly.campaigns.find_window import WindowResult as WindowResult
    from planfly.campaigns.find_winds import WindsResult as WindsResult
    from planfly.campaigns.worker_pool import SchedulerError as SchedulerError
    from planfly.planning.paper import PaperTables as PaperTables
    from planfly.planning.paper import paper_tables as paper_tables
    from planfly.runtime.stages import progress as progress
    from planfly.studio.open_studio import open_studio as open_studio
    from planfly.workflow.imported_flights import ImportedFlight as ImportedFlight
    from planfly.workflow.pipeline import FlownMission as FlownMission
    from planfly.workflow.pipeline import PlanThenFly as PlanThenFly
    from planner.plan import Plan as Plan
    from planner.search.plan_front import Front as Front
    from planner.search.plan_front import FrontPlan as FrontPlan
    from world.errors import ArgumentError as ArgumentError
    from world.errors import FlightError as FlightError
    from world.errors import ForecastError as ForecastError
    from world.errors import LogError as LogError
    from world.errors import MissingExtraError as MissingExtraError
    from world.errors import MissionError as MissionError
    from world.errors import ParameterError as ParameterError
    from world.errors import PlanflyError as PlanflyError
    from world.errors import ScenarioError as ScenarioError
    from world.errors import StartError as StartError
    from world.errors import TerrainError as TerrainError
    from world.scenario import Scenario as Scenario

# The module of each public name.
_HOMES = {
    name: module
    for module, names in {
        "flight.simulation.track": ("Track",),
        "logs.recording.reader": (
            "FlightLog",
            "read_log",
        ),
        "logs.views.replay.instruments": ("Instruments",),
        "logs.views.replay.timeline": ("TimelineEntry",),
        "logs.views.report.compare": ("Comparison",),
        "logs.verdict.verdict": ("Verdict",),
        "planfly.api.aircraft": (
            "AircraftNumbers",
            "aircraft",
            "describe_aircraft",
            "new_aircraft",
        ),
        "planfly.api.identifying": (
            "IdentifiedAircraft",
            "identify_aircraft",
        ),
        "planfly.api.ground_risk": ("ground_risk",),
        "planfly.api.campaigns": (
            "CampaignFlight",
            "battery",
            "campaign",
            "campaign_flight",
            "compare_campaigns",
            "winds",
        ),
        "planfly.api.cutting_terrain": ("terrain",),
        "planfly.api.drafting": ("new_scenario",),
        "planfly.api.exporting": (
            "ExportedFiles",
            "export",
        ),
        "planfly.api.finding_windows": ("window",),
        "planfly.api.flying": (
            "Judged",
            "check",
            "fly",
            "fly_by_each",
            "judge",
            "plan_then_fly",
        ),
        "planfly.api.fronts": ("plan_front",),
        "planfly.api.imported": (
            "Reflown",
            "ColumnGuesses",
            "guess_columns",
            "import_log",
            "recover",
            "refly",
        ),
        "planfly.api.linking": (
            "LinkResult",
            "link",
        ),
        "planfly.api.making_scenarios": ("make_scenario",),
        "planfly.api.optimising": (
            "BestFound",
            "Optimiser",
            "optimise",
        ),
        "planfly.api.planning": (
            "plan",
            "replan",
            "scenarios",
            "what_blocks",
            "what_may_fail",
        ),
        "planfly.api.predicting": (
            "Predicted",
            "predict",
        ),
        "planfly.api.replaying": (
            "instruments",
            "movie",
            "play_to_foxglove",
            "play_to_stations",
            "replay",
            "timeline",
        ),
        "planfly.api.reporting": (
            "WrittenReport",
            "compare",
            "figures",
            "foxglove_layout",
            "report",
        ),
        "planfly.api.returning": (
            "ReturnsResult",
            "returns",
        ),
        "planfly.api.running": (
            "Round",
            "RunResult",
            "run",
        ),
        "planfly.api.serving": ("serve",),
        "planfly.api.surveying": (
            "SurveyResult",
            "survey",
        ),
        "planfly.studio.open_studio": ("open_studio",),
        "planfly.campaigns.campaign_result": ("CampaignResult",),
        "planfly.campaigns.compare_campaigns": ("CampaignComparison",),
        "planfly.campaigns.worker_pool": ("SchedulerError",),
        "planfly.campaigns.find_battery": ("BatteryResult",),
        "planfly.campaigns.find_window": ("WindowResult",),
        "planfly.campaigns.find_ground_risk": ("GroundRiskResult",),
        "planfly.campaigns.find_winds": ("WindsResult",),
        "planfly.campaigns.dispersions": ("SpreadError",),
        "planfly.workflow.imported_flights": ("ImportedFlight",),
        "planfly.planning.paper": (
            "PaperTables",
            "paper_tables",
        ),
        "planfly.workflow.pipeline": (
            "FlownMission",
            "PlanThenFly",
        ),
        "planfly.runtime.stages": ("progress",),
        "planner.plan": ("Plan",),
        "planner.search.plan_front": (
            "Front",
            "FrontPlan",
        ),
        "world.errors": (
            "ArgumentError",
            "FlightError",
            "ForecastError",
            "LogError",
            "MissingExtraError",
            "MissionError",
            "ParameterError",
            "PlanflyError",
            "ScenarioError",
            "StartError",
            "TerrainError",
        ),
        "world.scenario": ("Scenario",),
    }.items()
    for name in names
}
__all__ = ["__version__", *_HOMES]


def __getattr__(name: str) -> Any:
    """Return a public name of the package, whose module is loaded only at the first use.

    ``planfly --help`` is faster without these modules.  Raises AttributeError for an unknown name.
    """
    if name in _HOMES:
        from importlib import import_module

        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """Return all public names, including those that are not loaded yet."""
    return sorted(__all__)
