"""Will this plan really fly?  Plan a fixed-wing path, fly it in JSBSim over its terrain and threats, and judge it.

    import planfly

    result = planfly.plan_then_fly("jacksboro", seed=1)
    print(result.verdict.summary)

    sure = planfly.campaign("plan.json", prove=0.99)
    print(sure.probability, sure.interval)

`plan_then_fly` and `campaign` are the public Python API; the command line is ``planfly --help``.
"""

from typing import TYPE_CHECKING, Any

from planfly.own_packages import refuse_hidden_packages

refuse_hidden_packages()

__version__ = "0.1.0"
__all__ = ["CampaignResult", "PlanThenFly", "__version__", "campaign", "plan_then_fly"]

if TYPE_CHECKING:
    from planfly.campaigns.campaign_result import CampaignResult
    from planfly.campaigns.campaign_result import run_campaign as campaign
    from planfly.pipeline import PlanThenFly, plan_then_fly

# Module and name there of each public name.
_HOMES = {
    "PlanThenFly": ("planfly.pipeline", "PlanThenFly"),
    "plan_then_fly": ("planfly.pipeline", "plan_then_fly"),
    "CampaignResult": ("planfly.campaigns.campaign_result", "CampaignResult"),
    "campaign": ("planfly.campaigns.campaign_result", "run_campaign"),
}


def __getattr__(name: str) -> Any:
    """Load what is asked for when it is first asked for: ``planfly --help`` needs none of it."""
    if name in _HOMES:
        from importlib import import_module

        module, there = _HOMES[name]
        return getattr(import_module(module), there)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
