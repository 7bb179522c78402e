"""A MAVLink vehicle that ground stations find, upload to, arm, start and follow."""

import contextlib
import ipaddress
import math
import multiprocessing
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path

from flight.live.link import SYSTEM, Access, Link, check_access, read_key
from flight.live.station_requests import vehicle_parameters
from flight.live.telemetry import Snapshot
from flight.live.vehicle import Standby, Vehicle
from flight.mission.items import Home
from planfly.api.flying import FencePaths, named_fences
from planfly.api.planning import flight_entries
from planfly.arguments import check_arguments
from planfly.first_start import with_warm_up
from planfly.kernel_units.unit_kernels import FLYING
from planfly.served_flights import ServedScenario, ServeOptions, flown_parameters, fly_process, open_served
from world.errors import FlightError, PlanflyError
from world.frames import to_geo
from world.interruption import children_ignore_sigint, end_children, uninterrupted
from world.scenario import Scenario
from world.scenario_tables import Guidance, Navigation

# A process that has been asked to end may take this long to do so before it is killed, s.
_CHILD_PATIENCE = 0.3


def _never() -> bool:
    return False


def _ignore(_text: str) -> None:
    pass


@with_warm_up(*FLYING)
def serve(
    mission: str | Path | None = None,
    *,
    scenario: str | Path | None = None,
    terrain: str | Path | None = None,
    fence: FencePaths = (),
    at: str | None = None,
    params: str | Path | None = None,
    guidance: Guidance | None = None,
    autopilot_law: str | None = None,
    nav: Navigation | None = None,
    to: str | Sequence[str] = "127.0.0.1:14550",
    bind: str = "127.0.0.1:14580",
    allow: str | Sequence[str] = (),
    sign_key: str | Path | None = None,
    speed: float = 1.0,
    log: str | Path = "runs/serve",
    stop: Callable[[], bool] = _never,
    on_message: Callable[[str], None] = _ignore,
) -> None:
    """Be a MAVLink vehicle in a simulated world, until ``stop`` is true.

    mission: a file to begin with; None waits for an upload.
    scenario, terrain, fence, at, params, guidance, autopilot_law, nav: as of `planfly.fly`; without a mission the
    scenario is "jacksboro" unless another is named.
    to: where ground stations listen, IP:PORT, one or several.  bind: where the vehicle listens.
    allow: IP addresses beyond this machine that may talk to it.  sign_key: a file with a MAVLink signing key.
    speed: times real time, 0.1 to 100.  log: the folder of the flight logs.
    stop: asked all the time.  on_message: called with what happens, a line each.

    A script that calls it does so under ``if __name__ == "__main__":``, for the processes that fly import it.
    Raises a `planfly.PlanflyError` for bad input.
    """
    access = link_access(to, bind, allow, sign_key)
    check_arguments(served_speed=speed)
    named = ["" if one is None else str(one) for one in (mission, scenario, terrain)]
    entries = flight_entries(params=params, guidance=guidance, autopilot_law=autopilot_law, nav=nav)
    fences = named_fences(fence)
    options = ServeOptions(named[0], named[1] or None, named[2] or None, speed, Path(log), entries, fences, at)
    served = open_served(options)
    if options.logs.exists() and not options.logs.is_dir():
        raise PlanflyError.of_argument("log", log, "is a file; a folder is expected")
    _serve(access, options, served, stop, on_message)


def _serve(
    access: Access,
    options: ServeOptions,
    served: ServedScenario,
    stop: Callable[[], bool],
    on_message: Callable[[str], None],
) -> None:
    with contextlib.ExitStack() as opened:
        link = Link(access)
        opened.callback(link.close)
        pool = _FlightPool(options)
        opened.callback(pool.end)
        vehicle = _vehicle(link, pool, served, options.speed, on_message)
        host, port = link.address
        targets = ", ".join(f"{station}:{number}" for station, number in access.to)
        on_message(f"vehicle {SYSTEM} at {host}:{port}, calling {targets}; scenario {served.scenario.name}")
        on_message(f"flight logs go to {options.logs}/; Ctrl-C ends")
        if served.mission is not None:
            vehicle.load(served.mission)
        elif options.fences.items:
            vehicle.load_fence(options.fences.items)
        opened.callback(vehicle.close)
        vehicle.run(stop)
    dropped = ", ".join(f"{count:,} {reason}" for reason, count in asdict(link.dropped).items() if count)
    if dropped:
        on_message(f"frames dropped: {dropped}")


def _vehicle(
    link: Link, pool: "_FlightPool", served: ServedScenario, speed: float, on_message: Callable[[str], None]
) -> Vehicle:
    airframe = served.airframe
    law = airframe.autopilot.parameters
    parameters = vehicle_parameters(
        flown=partial(flown_parameters, served.scenario),
        not_flown=() if law is None else law.not_flown,
        airspeed=airframe.airspeed,
        slowest=airframe.aircraft.airspeed_min,
        fastest=airframe.aircraft.airspeed_max,
        max_bank_deg=math.degrees(airframe.max_bank),
        system=SYSTEM,
        speed=speed,
    )
    standby = standby_at_start(served.scenario)
    return Vehicle(
        link, pool.spawn, parameters, standby, airframe.battery,
        lambda text: on_message(f"{time.strftime('%H:%M:%S')} {text}"),
    )  # fmt: skip


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
        with children_ignore_sigint(), uninterrupted():
            child.start()
        theirs.close()
        self._children.append(child)
        return ours

    def end(self) -> None:
        """End those that have not ended yet."""
        end_children([child for child in self._children if child.is_alive()], _CHILD_PATIENCE)


def standby_at_start(scenario: Scenario) -> Standby:
    """State and home of an aircraft without a mission: at the scenario's start, on a course to its destination."""
    east, north, amsl = (float(value) for value in scenario.start)
    lat, lon = (float(value) for value in to_geo(scenario.origin, east, north))
    ground = math.nan if scenario.terrain is None else float(scenario.terrain.height(east, north))
    step = scenario.destination - scenario.start
    course = math.atan2(float(step[0]), float(step[1]))
    snapshot = Snapshot(time=0.0, lat_deg=lat, lon_deg=lon, amsl=amsl, height=amsl - ground, yaw=course)
    return Standby(snapshot, Home(lat, lon, amsl if math.isnan(ground) else ground))


# ----------------------------------------------------------------------
# Who may talk to a vehicle.


def link_access(
    to: str | Sequence[str], bind: str, allow: str | Sequence[str] | None = (), sign_key: str | Path | None = None
) -> Access:
    """Addresses and key of a link.

    to: IP:PORT of each station.  bind: IP:PORT of the vehicle.  allow: IP addresses of stations beyond this machine.
    Several are a sequence, or separated by commas.  Raises FlightError or PlanflyError.

    >>> link_access("127.0.0.1:14550", "127.0.0.1:0").to
    (('127.0.0.1', 14550),)
    """
    allowed = frozenset(_ip("allow", part.strip()) for part in _parts(allow or ()) if part.strip())
    key = read_key(Path(sign_key)) if sign_key else None
    access = Access(_address("bind", bind), tuple(_address("to", text) for text in _parts(to)), allowed, key)
    check_access(access)
    return access


def _parts(given: str | Sequence[str]) -> Sequence[str]:
    return given.split(",") if isinstance(given, str) else given


def _address(argument: str, text: str) -> tuple[str, int]:
    host, colon, port = text.strip().rpartition(":")
    if not colon and port.isdigit():
        raise FlightError.of_argument(argument, text, f"IP:PORT is expected, such as 127.0.0.1:{port}")
    if not port.isdigit() or not 0 <= int(port) <= 65535:
        raise FlightError.of_argument(argument, text, "IP:PORT is expected, with a port 0..65535")
    return _ip(argument, host.strip("[]")), int(port)


def _ip(argument: str, text: str) -> str:
    try:
        return str(ipaddress.ip_address(text))
    except ValueError as error:
        raise FlightError.of_argument(argument, text, "an IP address is expected") from error
