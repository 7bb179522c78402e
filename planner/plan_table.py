"""A plan as a small table for a notebook."""

import math

from planner.plan import Objective, Plan
from world.notebooks.html_table import html_table


def plan_html(plan: Plan) -> str:
    """What a plan is, how far it keeps from its limits, and what of it fails."""
    made = plan.certificate
    rows = [
        ("waypoints", len(plan.waypoints)),
        ("length / straight line", f"{plan.objectives[Objective.LENGTH_RATIO]:.4f}"),
        ("clearance to spare", f"{made.clearance:.1f} m"),
        ("outside missiles' reach by", f"{made.kill_distance:.0f} m" if math.isfinite(made.kill_distance) else "none"),
        ("turns and slopes to spare", f"{math.degrees(made.turn):.1f}°, {math.degrees(made.slope):.2f}°"),
        ("algorithm, seed", f"{plan.algorithm}, {plan.seed}"),
        *(("fails", problem) for problem in made.problems),
    ]
    return html_table(f"Plan {plan.scenario.name}: {plan.state}", rows)
