"""Serve the vehicle of ``planfly serve`` to ground stations, with its link and its flight processes."""

import contextlib
import math
import multiprocessing
import time
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from multiprocessing.connection import Connection

from flight.live.link import SYSTEM, Access, Link
from flight.live.station_requests import vehicle_parameters
from flight.live.telemetry import Snapshot
from flight.live.vehicle import Standby, Vehicle
from flight.mission.items import Home
from planfly.live.served_flights import ServedScenario, ServeOptions, autopilot_parameters, run_flight_process
from planfly.runtime.process_setup import check_script_guard
from world.frames import to_geo
from world.interruption import children_ignore_sigint, delay_signals, end_children
from world.scenario import Scenario

# Maximum time for a process to end by itself before it is killed, s.
_CHILD_END_TIMEOUT_S = 0.3


def serve_vehicle(
    access: Access,
    options: ServeOptions,
    served_scenario: ServedScenario,
    stop: Callable[[], bool],
    on_message: Callable[[str], None],
) -> None:
    """Serve a MAVLink vehicle until `stop` returns True.

    access: addresses of the vehicle and its stations, and the key of the link.
    served_scenario: scenario as loaded from `options`.
    on_message: called with one line for each event.
    """
    with contextlib.ExitStack() as exit_stack:
        link = Link(access)
        exit_stack.callback(link.close)
        pool = _FlightPool(options)
        exit_stack.callback(pool.end_processes)
        # The vehicle waits at the scenario's start, without a mission.
        uav = served_scenario.uav
        autopilot_settings = uav.autopilot.parameters
        parameters = vehicle_parameters(
            autopilot_values=partial(autopilot_parameters, served_scenario.scenario),
            not_simulated=() if autopilot_settings is None else autopilot_settings.not_simulated,
            airspeed=uav.airspeed,
            min_airspeed=uav.aircraft.airspeed_min,
            max_airspeed=uav.aircraft.airspeed_max,
            max_bank_deg=math.degrees(uav.max_bank),
            system=SYSTEM,
            speed=options.speed,
        )
        vehicle = Vehicle(
            link,
            pool.spawn,
            parameters,
            make_standby_at_start(served_scenario.scenario),
            uav.battery,
            uav.aircraft.battery_voltage,
            lambda text: on_message(f"{time.strftime('%H:%M:%S')} {text}"),
        )
        host, port = link.address
        targets = ", ".join(f"{station}:{station_port}" for station, station_port in access.to)
        on_message(f"vehicle {SYSTEM} at {host}:{port}, calling {targets}; scenario {served_scenario.scenario.name}")
        on_message(f"flight logs are written to {options.logs}/; Ctrl-C ends")
        if served_scenario.mission is not None:
            vehicle.load(served_scenario.mission)
        elif served_scenario.fence or served_scenario.rally:
            vehicle.load_fence_and_rally(served_scenario.fence, served_scenario.rally)
        exit_stack.callback(vehicle.close)
        vehicle.run(stop)
    dropped = ", ".join(f"{count:,} {reason}" for reason, count in asdict(link.dropped).items() if count)
    if dropped:
        on_message(f"frames dropped: {dropped}")


class _FlightPool:
    """Flight processes of a vehicle, which requests another process when one has died."""

    def __init__(self, options: ServeOptions) -> None:
        """Start with no process; `spawn` starts the processes."""
        self._options = options
        self._context = multiprocessing.get_context("spawn")
        self._children: list[multiprocessing.process.BaseProcess] = []

    def spawn(self) -> Connection:
        """Start a flight process, and return the vehicle's end of the pipe to it."""
        for child in self._children:
            child.join(timeout=0.0)
        check_script_guard(self._children)
        self._children = [child for child in self._children if child.is_alive()]
        link_end, process_end = self._context.Pipe()
        child = self._context.Process(target=run_flight_process, args=(process_end, self._options), daemon=True)
        with children_ignore_sigint(), delay_signals():
            child.start()
        process_end.close()
        self._children.append(child)
        return link_end

    def end_processes(self) -> None:
        """End the processes that are still alive."""
        end_children([child for child in self._children if child.is_alive()], _CHILD_END_TIMEOUT_S)


def make_standby_at_start(scenario: Scenario) -> Standby:
    """Return state and home of a vehicle that waits without a mission.

    The vehicle is at the scenario's start and heads for the destination.  Home is on the ground below the start, or at
    the altitude of the start without terrain.
    """
    east, north, amsl = (float(value) for value in scenario.start)
    lat, lon = (float(value) for value in to_geo(scenario.origin, east, north))
    terrain_altitude = math.nan if scenario.terrain is None else float(scenario.terrain.height(east, north))
    displacement = scenario.destination - scenario.start
    course = math.atan2(float(displacement[0]), float(displacement[1]))
    snapshot = Snapshot(time=0.0, lat_deg=lat, lon_deg=lon, amsl=amsl, height=amsl - terrain_altitude, yaw=course)
    return Standby(snapshot, Home(lat, lon, amsl if math.isnan(terrain_altitude) else terrain_altitude))
