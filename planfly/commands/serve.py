"""``planfly serve``: a vehicle that ground stations find, upload to, arm, start and follow."""

import argparse
import contextlib
import math
import multiprocessing
import time
from dataclasses import asdict
from multiprocessing.connection import Connection
from pathlib import Path

from flight.live.link import SYSTEM, Link
from flight.live.station_requests import vehicle_parameters
from flight.live.telemetry import Snapshot
from flight.live.vehicle import Standby, Vehicle
from flight.mission.items import Home
from planfly.open_mission import read_named_fences
from planfly.served_flights import ServeOptions, fly_process, open_served
from planfly.terminal.options import flight_entries, link_access, stop_signals
from world.errors import PlanflyError
from world.frames import to_geo
from world.interruption import children_ignore_sigint, end_children
from world.scenario import Scenario

# A process that has been told to end may take this long to do so before it is killed, s.
_LAST_WORDS = 0.3


def serve(args: argparse.Namespace) -> int:
    """``planfly serve``."""
    access = link_access(args)
    mission, logs = args.mission or "", Path(args.log)
    fences = read_named_fences(args.fence)
    options = ServeOptions(mission, args.scenario, args.terrain, args.speed, logs, flight_entries(args), fences)
    served = open_served(options)
    if options.logs.exists() and not options.logs.is_dir():
        raise PlanflyError.of_option("--log", options.logs, "is a file; a folder is expected")
    parameters = vehicle_parameters(
        airspeed=served.airframe.airspeed,
        slowest=served.airframe.aircraft.airspeed_min,
        fastest=served.airframe.aircraft.airspeed_max,
        max_bank_deg=math.degrees(served.airframe.max_bank),
        system=SYSTEM,
        speed=options.speed,
    )
    standby = standby_at_start(served.scenario)
    with stop_signals() as stopped, contextlib.ExitStack() as opened:
        link = Link(access)
        opened.callback(link.close)
        pool = _FlightPool(options)
        opened.callback(pool.end)
        vehicle = Vehicle(link, pool.spawn, parameters, standby, served.airframe.battery, _show)
        host, port = link.address
        targets = ", ".join(f"{to}:{number}" for to, number in access.to)
        print(f"vehicle {SYSTEM} at {host}:{port}, calling {targets}; scenario {served.scenario.name}", flush=True)
        print(f"flight logs go to {options.logs}/; Ctrl-C ends", flush=True)
        if served.mission is not None:
            vehicle.load(served.mission)
        elif fences.items:
            vehicle.load_fence(fences.items)
        opened.callback(vehicle.close)
        vehicle.run(stopped)
    dropped = ", ".join(f"{count:,} {reason}" for reason, count in asdict(link.dropped).items() if count)
    if dropped:
        print(f"frames dropped: {dropped}", flush=True)
    return 0


class _FlightPool:
    """Processes that fly, of which the vehicle asks for another when one has died."""

    def __init__(self, options: ServeOptions) -> None:
        self._options = options
        self._context = multiprocessing.get_context("spawn")
        self._children: list[multiprocessing.process.BaseProcess] = []

    def spawn(self) -> Connection:
        """Start one, and return the link's end of its pipe."""
        for child in self._children:
            child.join(timeout=0.0)
        self._children = [child for child in self._children if child.is_alive()]
        ours, theirs = self._context.Pipe()
        child = self._context.Process(target=fly_process, args=(theirs, self._options), daemon=True)
        with children_ignore_sigint():
            child.start()
        theirs.close()
        self._children.append(child)
        return ours

    def end(self) -> None:
        """End those that have not ended yet."""
        end_children([child for child in self._children if child.is_alive()], _LAST_WORDS)


def standby_at_start(scenario: Scenario) -> Standby:
    """State and home of an aircraft without a mission: at the scenario's start, on a course to its destination."""
    east, north, amsl = (float(value) for value in scenario.start)
    lat, lon = (float(value) for value in to_geo(scenario.origin, east, north))
    ground = math.nan if scenario.terrain is None else float(scenario.terrain.height(east, north))
    step = scenario.destination - scenario.start
    course = math.atan2(float(step[0]), float(step[1]))
    snapshot = Snapshot(time=0.0, lat_deg=lat, lon_deg=lon, amsl=amsl, height=amsl - ground, yaw=course)
    return Standby(snapshot, Home(lat, lon, amsl if math.isnan(ground) else ground))


def _show(text: str) -> None:
    print(f"{time.strftime('%H:%M:%S')} {text}", flush=True)
