"""Plan a path over real terrain, fly it in six degrees of freedom, and ask whether the plan really flies."""

import planfly

result = planfly.plan_then_fly("jacksboro", seed=1)
print(result.verdict.summary)
print(f"{len(result.plan.waypoints)} waypoints, {len(result.mission.items)} mission items")
if result.track is not None:
    print(f"flown in {result.track.time[-1]:.0f} s with {result.track.energy[-1]:.0f} Wh")
