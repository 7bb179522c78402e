"""Will this plan really fly?  Plan a fixed-wing path, fly it in JSBSim over its terrain and threats, and judge it.

    import planfly

    path = planfly.plan("jacksboro", seed=1)
    flown = planfly.fly(path, wind=(8, 270), turbulence="light", log="flight.mcap")
    print(flown.verdict.summary)
    planfly.figures(flown)["map"].savefig("map.png")
    planfly.export(path, "mission.waypoints")
    planfly.report(flown, "report")

plan, fly, plan_then_fly     make a path, fly a plan or a mission file, or both at once
check, read_log              judge a log, a plan or a mission; read a log, its track as a table
figures, report, compare     matplotlib figures; a page of a flight; two flights beside each other
export                       a mission in the forms that ground stations and maps read
campaign, winds              how likely it is to fly; the largest wind from each direction
scenarios, aircraft          what is embedded
optimise                     the planner's estimation of distribution algorithm alone, by ask and tell
PlanflyError                 what bad input raises, with file, field, value and allowed; and its kinds

Paths are `str` or `pathlib.Path`.  The command line is ``planfly --help``.
"""

from typing import TYPE_CHECKING, Any

from planfly.own_packages import refuse_hidden_packages

refuse_hidden_packages()

__version__ = "0.1.0"

if TYPE_CHECKING:
    from flight.simulation.track import Track as Track
    from logs.recording.reader import FlightLog as FlightLog
    from logs.recording.reader import read_log as read_log
    from logs.verdict.findings import Verdict as Verdict
    from logs.views.report.compare import Comparison as Comparison
    from planfly.api.flying import ExportedFiles as ExportedFiles
    from planfly.api.flying import FlownMission as FlownMission
    from planfly.api.flying import WrittenReport as WrittenReport
    from planfly.api.flying import check as check
    from planfly.api.flying import fly as fly
    from planfly.api.optimising import BestFound as BestFound
    from planfly.api.optimising import Optimiser as Optimiser
    from planfly.api.optimising import optimise as optimise
    from planfly.api.planning import aircraft as aircraft
    from planfly.api.planning import plan as plan
    from planfly.api.planning import plan_then_fly as plan_then_fly
    from planfly.api.planning import scenarios as scenarios
    from planfly.api.reporting import compare as compare
    from planfly.api.reporting import export as export
    from planfly.api.reporting import figures as figures
    from planfly.api.reporting import report as report
    from planfly.api.wind_limits import winds as winds
    from planfly.campaigns.campaign_result import CampaignResult as CampaignResult
    from planfly.campaigns.campaign_result import campaign as campaign
    from planfly.campaigns.dispersions import SpreadError as SpreadError
    from planfly.campaigns.find_winds import WindsFound as WindsFound
    from planfly.campaigns.worker_pool import SchedulerError as SchedulerError
    from planfly.pipeline import PlanThenFly as PlanThenFly
    from planner.plan import Plan as Plan
    from world.errors import FlightError as FlightError
    from world.errors import LogError as LogError
    from world.errors import MissionError as MissionError
    from world.errors import ParameterError as ParameterError
    from world.errors import PlanflyError as PlanflyError
    from world.errors import ScenarioError as ScenarioError
    from world.errors import StartError as StartError
    from world.errors import TerrainError as TerrainError

# The module of each public name.
_HOMES = {
    name: module
    for module, names in {
        "flight.simulation.track": ("Track",),
        "logs.recording.reader": ("FlightLog", "read_log"),
        "logs.views.report.compare": ("Comparison",),
        "logs.verdict.findings": ("Verdict",),
        "planfly.api.flying": ("ExportedFiles", "FlownMission", "WrittenReport", "check", "fly"),
        "planfly.api.optimising": ("BestFound", "Optimiser", "optimise"),
        "planfly.api.planning": ("aircraft", "plan", "plan_then_fly", "scenarios"),
        "planfly.api.reporting": ("compare", "export", "figures", "report"),
        "planfly.api.wind_limits": ("winds",),
        "planfly.campaigns.campaign_result": ("CampaignResult", "campaign"),
        "planfly.campaigns.worker_pool": ("SchedulerError",),
        "planfly.campaigns.find_winds": ("WindsFound",),
        "planfly.campaigns.dispersions": ("SpreadError",),
        "planfly.pipeline": ("PlanThenFly",),
        "planner.plan": ("Plan",),
        "world.errors": (
            *("FlightError", "LogError", "MissionError", "ParameterError", "PlanflyError", "ScenarioError"),
            *("StartError", "TerrainError"),
        ),
    }.items()
    for name in names
}
__all__ = ["__version__", *_HOMES]


def __getattr__(name: str) -> Any:
    """Load what is asked for when it is first asked for: ``planfly --help`` needs none of it."""
    if name in _HOMES:
        from importlib import import_module

        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """The public names, whatever of planfly is loaded."""
    return sorted(__all__)
