"""``planfly serve``: a vehicle that ground stations find, upload to, arm, start and watch."""

import argparse
import math
import multiprocessing
import time
from multiprocessing.connection import Connection
from pathlib import Path

from flight.live.link import SYSTEM, Link
from flight.live.parameters import vehicle_parameters
from flight.live.snapshot import Moment
from flight.live.vehicle import Vehicle
from flight.mission.items import Home
from planfly.commands.served_flights import Served, fly_process, open_world
from planfly.terminal.link_options import link_access, stop_signals
from world.errors import PlanflyError
from world.frames import to_geo
from world.scenario import Scenario


def serve(args: argparse.Namespace) -> int:
    """``planfly serve``."""
    access = link_access(args)
    served = Served(args.mission or "", args.scenario, args.terrain, args.speed, Path(args.log))
    world = open_world(served)
    if served.logs.exists() and not served.logs.is_dir():
        raise PlanflyError(f"--log {served.logs}: is a file; a folder is expected")
    link = Link(access)
    parameters = vehicle_parameters(
        airspeed=world.airframe.airspeed,
        slowest=world.airframe.aircraft.airspeed_min,
        fastest=world.airframe.aircraft.airspeed_max,
        max_bank_deg=math.degrees(world.airframe.max_bank),
        system=SYSTEM,
        speed=served.speed,
    )
    nursery = _Nursery(served)
    with stop_signals() as stopped:
        vehicle = Vehicle(link, nursery.spawn, parameters, standing(world.scenario), world.airframe.battery, _tell)
        host, port = link.address
        targets = ", ".join(f"{to}:{number}" for to, number in access.to)
        print(f"vehicle {SYSTEM} at {host}:{port}, calling {targets}; scenario {world.scenario.name}", flush=True)
        print(f"flight logs go to {served.logs}/; Ctrl-C ends", flush=True)
        if world.mission is not None:
            vehicle.load(world.mission)
        try:
            vehicle.run(stopped)
        finally:
            vehicle.close()
            link.close()
            nursery.join()
    return 0


class _Nursery:
    """Starts processes that fly."""

    def __init__(self, served: Served) -> None:
        self._served = served
        self._context = multiprocessing.get_context("spawn")
        self._children: list[multiprocessing.process.BaseProcess] = []

    def spawn(self) -> Connection:
        """Start one: the pipe to it."""
        for child in self._children:
            child.join(timeout=0.0)
        self._children = [child for child in self._children if child.is_alive()]
        ours, theirs = self._context.Pipe()
        child = self._context.Process(target=fly_process, args=(theirs, self._served), daemon=True)
        child.start()
        theirs.close()
        self._children.append(child)
        return ours

    def join(self) -> None:
        """Wait for them to end."""
        for child in self._children:
            child.join(timeout=5.0)


def standing(scenario: Scenario) -> tuple[Moment, Home]:
    """Where the aircraft stands without a mission: the scenario's start, on a course to its destination."""
    east, north, amsl = (float(value) for value in scenario.start)
    lat, lon = (float(value) for value in to_geo(scenario.origin, east, north))
    ground = math.nan if scenario.terrain is None else float(scenario.terrain.height(east, north))
    step = scenario.destination - scenario.start
    course = math.atan2(float(step[0]), float(step[1]))
    zero = 0.0
    moment = Moment(
        zero, lat, lon, amsl, amsl - ground, zero, zero, zero, zero, zero, course, zero, zero, zero, zero, zero, zero,
        zero, zero, zero, -1.0,
    )  # fmt: skip
    return moment, Home(lat, lon, amsl if math.isnan(ground) else ground)


def _tell(text: str) -> None:
    print(f"{time.strftime('%H:%M:%S')} {text}", flush=True)
