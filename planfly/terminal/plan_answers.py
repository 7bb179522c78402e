"""Answer of ``planfly plan`` with ``--json``, and the text of a front."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pydantic.dataclasses import dataclass

from logs.verdict.conditions import Conditions
from planfly.terminal.answers import DispersedFlights
from planfly.terminal.verdict_answers import STRICT
from world.wording import count_text

if TYPE_CHECKING:
    from planner.search.plan_front import Front


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class PlanAnswer:
    """planfly plan: the plan file, and the properties of the plan."""

    schema: Literal["planfly.plan-answer/1"] = "planfly.plan-answer/1"
    exit_code: int
    scenario: str
    seed: int
    file: str
    safe: bool
    feasible: bool
    waypoints: int
    length_ratio: float
    """Length of the path divided by the length of the straight line."""
    algorithm: str
    evaluations: int
    ended: str
    """Reason for the end of the search: completed, budget or interrupted."""
    problems: list[str]
    """Reasons why the plan is not feasible."""
    expected_failures: list[str]
    """Known reasons to expect that more than 5 % of the dispersed flights of a safe plan fail."""
    dispersed: DispersedFlights | None
    """Dispersed flights of the plan (--flights); null without this option, or if the plan is not feasible."""
    conditions: Conditions
    """Conditions for which the plan was made."""


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class FrontEntry:
    """One plan of a front, and the criteria of its comparison."""

    file: str
    length_m: float
    exposure_s: float
    """Exposure to radars: the density of detection integrated over the flight time, not the time inside their range."""
    clearance_m: float
    """Lowest height above ground, m."""
    energy_wh: float | None
    """Energy, Wh; null if the power of the aircraft is not known."""
    time_s: float


@dataclass(frozen=True, slots=True, kw_only=True, config=STRICT)
class FrontAnswer:
    """planfly plan --front: the plans, the shortest first; empty if there is no safe plan."""

    schema: Literal["planfly.front-answer/1"] = "planfly.front-answer/1"
    exit_code: int
    scenario: str
    seed: int
    folder: str
    fourth: Literal["energy", "time"]
    """Fourth criterion, in addition to length, exposure and clearance."""
    asked: int
    """Requested number of plans; there may be fewer."""
    plans: list[FrontEntry]
    problems: list[str]
    """Reasons why there is no plan."""
    conditions: Conditions
    """Conditions for which the plans were made."""


# Answer of ``planfly plan``, without or with --front.
PlanDocument = PlanAnswer | FrontAnswer


def front_answer(front: "Front", folder: Path, code: int) -> FrontAnswer:
    """Return the JSON answer for a Pareto front whose files are in a folder.

    code: exit code of the command.
    """
    from planfly.api.fronts import table_rows
    from planfly.api.planning import conditions_of_plan

    default_plan = front.default.plan
    entries = []
    for row in table_rows(front):
        number = row.pop("plan")
        entries.append(FrontEntry(file=str(folder / f"plan-{number}.json"), **row))
    return FrontAnswer(
        exit_code=code,
        scenario=default_plan.scenario.name,
        seed=default_plan.seed,
        folder=str(folder),
        fourth="time" if front.fourth == "time" else "energy",
        asked=front.asked,
        plans=entries,
        problems=[] if front.plans else list(default_plan.certificate.problems),
        conditions=conditions_of_plan(default_plan),
    )


def fewer_plans_line(front: "Front") -> str:
    """Return a line that explains why a front has fewer plans than requested.

    Either the search was stopped, or no further plan gains a noticeable amount in any of the objectives.
    """
    if front.ended != "completed":
        cause = "the time budget" if front.ended == "budget" else "an interruption"
        unit = "evaluation" if front.evaluations == 1 else "evaluations"
        return (
            f"{len(front.plans)} of the {front.asked} requested plans: the search was stopped by {cause} after "
            f"{front.evaluations:,} {unit}; more time may find more plans"
        )
    from planner.search.plan_front import NOTICEABLE_CLEARANCE_M, NOTICEABLE_EXPOSURE_FRACTION, NOTICEABLE_GAIN_FRACTION

    min_fraction, min_exposure = f"{NOTICEABLE_GAIN_FRACTION:.1%}", f"{NOTICEABLE_EXPOSURE_FRACTION:.0%}"
    min_height = f"{NOTICEABLE_CLEARANCE_M:g} m"
    refused_verb = "was" if front.refused == 1 else "were"
    refused_text = (
        f"{count_text(front.refused, 'other plan')} {refused_verb} not safe after completion, and "
        if front.refused
        else ""
    )
    return (
        f"{len(front.plans)} of the {front.asked} requested plans: {refused_text}no further plan "
        f"gains more than {min_fraction} in length or {front.fourth}, {min_exposure} in "
        f"exposure or {min_height} in height above ground"
    )


def front_lines(front: "Front", folder: Path) -> list[str]:
    """Return the lines that the terminal shows for a front.

    They are the conditions, a table of the plans, and the written files.
    """
    from logs.verdict.conditions import autopilot_line, condition_lines
    from planfly.api.fronts import PICTURES
    from planfly.api.planning import conditions_of_plan
    from planfly.planning.expected_failures import expected_failures
    from planfly.workflow.uav import load_uav

    default_plan = front.default.plan
    if not front.plans:
        reasons = [f"  failed  {problem}" for problem in default_plan.certificate.problems]
        return [
            "no safe plan was found, so there is no front",
            *reasons,
            f"front     {folder}/ (front.csv, front.json)",
        ]
    conditions = conditions_of_plan(default_plan)
    comparison = f", none better than another in length, exposure, height above ground and {front.fourth} at once"
    lines = [
        "front of 1 safe plan" if len(front.plans) == 1 else f"front of {len(front.plans)} safe plans{comparison}",
        *condition_lines(conditions),
        autopilot_line(conditions, is_flown=False),
        "  plan   length km  exposure s  above ground m  energy Wh   time s",
    ]
    for number, front_plan in enumerate(front.plans, 1):
        energy = f"{front_plan.energy / 3600.0:11.2f}" if math.isfinite(front_plan.energy) else "          -"
        values = (
            f"{front_plan.length / 1e3:>12.3f}{front_plan.exposure:>12.2f}{front_plan.clearance:>16.1f}{energy}"
            f"{front_plan.time:>9.1f}"
        )
        lines.append(f"  {number:>4}{values}")
    uav = load_uav(default_plan.scenario)
    for number, front_plan in enumerate(front.plans, 1):
        lines += [f"  note    plan {number}: {text}" for text in expected_failures(front_plan.plan, uav)]
    if len(front.plans) < front.asked:
        lines.append(f"  note    {fewer_plans_line(front)}")
    names = f"plan-1.json ... plan-{len(front.plans)}.json" if len(front.plans) > 1 else "plan-1.json"
    return [*lines, f"front     {folder}/ ({names}, front.csv, front.json, {', '.join(PICTURES)})"]
