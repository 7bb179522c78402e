"""``planfly run``: the whole chain into one folder, once or in rounds."""

import argparse
import json
from pathlib import Path
from typing import Any

from flight.mission.from_plan import plan_mission
from logs.verdict.findings import Verdict
from logs.verdict.judge_flight import judge_plan_only
from planfly.airframe import Airframe, choose_seed, load_airframe, tightened_airframe
from planfly.pipeline import flight_events, fly, make_plan, make_setup
from planfly.refine import refine
from planfly.terminal.progress import progress
from planfly.terminal.results import print_verdict, write_missions, write_pictures, write_verdict
from planfly.terminal.targets import RUN_FILES, default_folder, prepare_folder, refuse_folder
from planner.plan import Plan, plan_json
from world.atomic_files import write_whole
from world.scenario import Scenario, load_scenario
from world.scenario_variants import with_flight


def run(args: argparse.Namespace) -> Verdict:
    """Plan, export, fly, record, judge and report; with ``--refine N`` up to N rounds more."""
    scenario = with_flight(load_scenario(args.scenario), guidance=args.guidance, nav=args.nav)
    seed = choose_seed(scenario, args.seed)
    airframe = load_airframe(scenario)
    folder = Path(args.out) if args.out else default_folder(scenario.name, seed)
    if args.out:
        refuse_folder(folder, args.overwrite)
    command = f"planfly run {args.scenario} --seed {seed}" + "".join(
        f" --{name} {value}"
        for name, value in (("refine", args.refine), ("guidance", args.guidance), ("nav", args.nav))
        if value
    )
    cleared = False

    def one_round(planned_in: Scenario) -> tuple[Verdict, bool]:
        nonlocal cleared
        planned_with = airframe if planned_in is scenario else tightened_airframe(airframe, planned_in)
        with progress(f"planning {scenario.name}") as advance:
            plan = make_plan(planned_in, planned_with, seed, advance=advance)
        if not cleared:
            prepare_folder(folder)
            cleared = True
        return _fly_round(folder, scenario, airframe, plan, seed, command)

    verdict, rounds = refine(scenario, args.refine, one_round, lambda number: _keep(folder, number))
    if args.refine:
        write_whole(folder / "rounds.json", json.dumps(rounds, indent=1) + "\n")
        _print_rounds(rounds, folder)
    return verdict


def _fly_round(
    folder: Path, scenario: Scenario, airframe: Airframe, plan: Plan, seed: int, command: str
) -> tuple[Verdict, bool]:
    write_whole(folder / "plan.json", plan_json(plan))
    mission = plan_mission(plan, airframe.airspeed, airframe.max_bank, source="mission.waypoints")
    write_missions(mission, [folder / "mission.waypoints", folder / "mission.plan"])
    setup = make_setup(scenario, airframe, mission, seed, plan=plan)
    if not plan.feasible:
        verdict = judge_plan_only(plan)
        write_verdict(folder / "verdict.json", verdict)
        print_verdict(verdict, [])
        print(f"results   {folder}/ (plan.json, mission.waypoints, mission.plan, verdict.json; nothing was flown)")
        return verdict, False
    with progress("flying") as advance:
        track, ended, verdict = fly(setup, airframe, folder / "flight.mcap", advance)
    write_verdict(folder / "verdict.json", verdict)
    with progress("drawing"):
        write_pictures(folder, setup, track, verdict, ended, command, events=flight_events(track, ended))
    print_verdict(verdict, setup.route.notes)
    print(f"results   {folder}/ (report.html, map.png, profile.png, flight.mcap, verdict.json, plan.json, missions)")
    return verdict, True


def _keep(folder: Path, number: int) -> None:
    """Move a round's results out of the way of the next."""
    kept = folder / f"round-{number}"
    kept.mkdir(exist_ok=True)
    for name in RUN_FILES:
        if (folder / name).exists():
            (folder / name).replace(kept / name)


def _print_rounds(rounds: list[dict[str, Any]], folder: Path) -> None:
    print("rounds")
    for entry in rounds:
        kept = folder if entry is rounds[-1] else folder / f"round-{entry['round']}"
        changes = "; ".join(entry["changes"]) or "as given"
        print(f"  {entry['round']}  {kept}/  {changes}: {entry['summary']}")
    print(f"  {rounds[-1]['next']}")
