"""A person's MAVSDK script: python mavsdk_session.py PORT ITEMS.json fly|upload|plan|ask.  Prints one JSON object.

Run as a subprocess, because the library is native and starts threads.  ITEMS.json:
[[frame, command, p1, p2, x, y, z]], or for "plan" and "ask" [[latitude, longitude, height over home]].
"""

import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

from mavsdk import ComponentType, Configuration, Mavsdk, System
from mavsdk.plugins.action import Action
from mavsdk.plugins.mission import Mission, MissionPlan
from mavsdk.plugins.mission import MissionItem as PlanItem
from mavsdk.plugins.mission_raw import MissionItem, MissionRaw, MissionRawError
from mavsdk.plugins.param import Param
from mavsdk.plugins.telemetry import Telemetry


def main() -> None:
    port, name, task = sys.argv[1:]
    rows = json.loads(Path(name).read_text(encoding="utf-8"))
    sdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    print(sdk.add_any_connection(f"udpin://127.0.0.1:{port}"), file=sys.stderr)
    system = sdk.first_autopilot(120.0)
    if system is None:
        raise SystemExit("no vehicle")
    if task == "ask":
        found = by_asking(system, rows)
    else:
        found = by_plan(system, rows) if task == "plan" else by_items(system, rows, task == "fly")
    print(json.dumps(found), flush=True)
    # MAVSDK's threads would wait for a request that has no end.
    os._exit(0)


def by_items(system: System, rows: list[list[float]], flown: bool) -> dict[str, object]:
    """Upload items as they are, download them, and fly them if asked."""
    raw = MissionRaw(system)
    items = [
        MissionItem(k, frame, command, int(k == 0), 1, p1, p2, 0.0, 0.0, x, y, z, 0)
        for k, (frame, command, p1, p2, x, y, z) in enumerate(rows)
    ]
    raw.upload_mission(items)
    found: dict[str, object] = {}
    back, found["downloads"] = downloaded(raw)
    found["back"] = [[i.frame, i.command, i.param1, i.param2, i.x, i.y, i.z] for i in back]
    if flown:
        found |= fly(system, raw.start_mission, raw.is_mission_finished)
    return found


def downloaded(raw: MissionRaw) -> tuple[list[MissionItem], int]:
    """What the vehicle holds, and how many goes it took: MAVSDK gives up when it has asked five times for an item."""
    for goes in range(1, 5):
        try:
            return list(raw.download_mission()), goes
        except MissionRawError as error:
            if "TIMEOUT" not in str(error):
                raise
    raise SystemExit("four downloads timed out")


def by_plan(system: System, rows: list[list[float]]) -> dict[str, object]:
    """Fly latitudes, longitudes and heights over home through the `mission` plugin."""
    mission = Mission(system)
    mission.upload_mission(MissionPlan([PlanItem(y, x, z, 25.0, True) for y, x, z in rows]))
    found = fly(system, mission.start_mission, mission.is_mission_finished)
    progress = mission.mission_progress()
    return found | {"progress": [progress.current, progress.total]}


def by_asking(system: System, rows: list[list[float]]) -> dict[str, object]:
    """Ask for what a person may ask for, on the ground and in flight: each one's answer."""
    mission, action, telemetry = Mission(system), Action(system), Telemetry(system)
    mission.upload_mission(MissionPlan([PlanItem(y, x, z, 25.0, True) for y, x, z in rows]))
    wait(telemetry.health_all_ok)
    ground = {"item": asked(lambda: mission.set_current_mission_item(1))}
    ground |= by_parameters(Param(system))
    action.arm()
    mission.start_mission()
    wait(telemetry.in_air)
    # A log holds a second at the least.
    time.sleep(1.5)
    flight = {
        "pause": asked(mission.pause_mission),
        "resume": asked(mission.start_mission),
        "hold": asked(action.hold),
        "go": asked(lambda: action.goto_location(46.0, 8.01, 150.0, 0.0)),
        "item": asked(lambda: mission.set_current_mission_item(2)),
        "return": asked(action.return_to_launch),
        "speed": asked(lambda: action.set_current_speed(22.0)),
        "orbit": asked(lambda: action.do_orbit(100.0, 20.0, 0, 46.0, 8.0, 150.0)),
    }
    return {"ground": ground, "flight": flight}


def by_parameters(param: Param) -> dict[str, object]:
    """Read, list and set parameters by name."""
    before = param.get_param_float("WP_RADIUS")
    return {
        "set": asked(lambda: param.set_param_float("WP_RADIUS", before - 20.0)),
        "lowered": before - param.get_param_float("WP_RADIUS"),
        "listed": {one.name: one.value for one in param.get_all_params().float_params}["WP_RADIUS"] - before,
    }


def asked(request: Callable[[], object]) -> str:
    """MAVSDK's name for what came of a request."""
    try:
        request()
    except Exception as error:  # one class a plugin
        return str(error).split(";")[0]
    return "SUCCESS"


def fly(system: System, start: Callable[[], object], is_finished: Callable[[], bool]) -> dict[str, object]:
    """Arm, start, and watch until the mission is finished."""
    telemetry, action = Telemetry(system), Action(system)
    healthy = wait(telemetry.health_all_ok)
    action.arm()
    armed = wait(telemetry.armed)
    early = is_finished()
    start()
    begun = time.monotonic()
    seen: set[float] = set()
    while not is_finished() and time.monotonic() < begun + 300.0:
        time.sleep(0.02)
        seen.add(telemetry.position().longitude_deg)
    return {
        "healthy": healthy,
        "armed": armed,
        "early": early,
        "finished": is_finished(),
        "flown_s": time.monotonic() - begun,
        "places": len(seen),
    }


def wait(condition: Callable[[], bool]) -> bool:
    """Whether a condition comes true, waited for at most two minutes."""
    end = time.monotonic() + 120.0
    while not condition() and time.monotonic() < end:
        time.sleep(0.05)
    return condition()


main()
