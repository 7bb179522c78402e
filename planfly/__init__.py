"""Will this plan really fly?  Plan a fixed-wing path, fly it in JSBSim over its terrain and threats, and judge it.

    import planfly

    result = planfly.plan_then_fly("jacksboro", seed=1)
    print(result.verdict.summary)

`plan_then_fly` is the public Python API; the command line is ``planfly --help``.
"""

from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"
__all__ = ["PlanThenFly", "__version__", "plan_then_fly"]

if TYPE_CHECKING:
    from planfly.pipeline import PlanThenFly, plan_then_fly


def __getattr__(name: str) -> Any:
    """Load the pipeline when it is first asked for: ``planfly --help`` needs none of it."""
    if name in ("PlanThenFly", "plan_then_fly"):
        from planfly import pipeline

        return getattr(pipeline, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
