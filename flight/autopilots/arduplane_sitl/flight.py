"""Fly ArduPlane itself, as a program in lockstep with planfly's physics."""

import contextlib
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from aircraft.catalog import Aircraft
from flight.autopilots.arduplane.autopilot import ArduPlane
from flight.autopilots.arduplane.launch import motor_start_time, run_up_time
from flight.autopilots.arduplane.parameters import ArduPilotParameters
from flight.autopilots.arduplane.releases import simulated_release
from flight.autopilots.arduplane_sitl.ground_tick import program_ground_tick
from flight.autopilots.arduplane_sitl.physics import JsonLockstep, PhysicsPort
from flight.autopilots.arduplane_sitl.preflight import Preflight, version_text
from flight.autopilots.arduplane_sitl.process import (
    RENAMED_IN_4_7,
    arduplane_launch,
    collect_arduplane_parameters,
    load_user_parameters,
)
from flight.autopilots.autopilot import AutopilotProgram
from flight.autopilots.parts import Tick
from flight.autopilots.program import ProgramAutopilot
from flight.autopilots.sitl.conversation import ConversationStep
from flight.autopilots.sitl.flight import SitlFlight
from flight.autopilots.sitl.link import TcpLink
from flight.autopilots.sitl.process import AutopilotProcess, check_binary
from flight.autopilots.sitl.servos import load_servo_map
from flight.simulation.setup import FlightSetup
from flight.simulation.simulate import SimulatedFlight, fly_to_end

# Time in which the motor follows the throttle, s.
_SPOOL_TIME_S = 0.5


class AutopilotFlight(SitlFlight):
    """One flight of ArduPlane itself; see `SitlFlight`.

    autopilot: autopilot that flies the setup instead of the setup's own; it has ArduPlane's parameters and the
        program's file.
    user_parameters: the user's parameters by ArduPlane's names; None takes the parameters of the scenario's file.
    """

    def __init__(
        self,
        setup: FlightSetup,
        aircraft: Aircraft,
        autopilot: ProgramAutopilot,
        user_parameters: Mapping[str, float] | None = None,
    ) -> None:
        if not isinstance(autopilot, ArduPlane):
            raise TypeError("ArduPlane's program needs ArduPlane's parameters")
        binary = autopilot.file
        setup = replace(setup, autopilot=autopilot)
        digest = check_binary(binary, autopilot.title)
        servos = load_servo_map(aircraft)
        flight_parameters = collect_arduplane_parameters(
            setup, aircraft, servos, load_user_parameters(setup) if user_parameters is None else user_parameters
        )
        super().__init__(setup, aircraft, binary)
        with contextlib.ExitStack() as stack, self._name_program_in_errors():
            port = stack.enter_context(contextlib.closing(PhysicsPort()))
            self._link = stack.enter_context(contextlib.closing(TcpLink()))
            heading = math.degrees(self._rail.yaw) % 360.0
            launch = arduplane_launch(self._mission.home, heading, flight_parameters.values, port.port, self._link.port)
            self._process = stack.enter_context(AutopilotProcess(binary, launch))
            port.check_program = self._process.check_running
            self._lockstep = JsonLockstep(port, servos, self.fdm, self._workspace, self._mission.home, self._poll_link)
            self._preflight = Preflight(self._link, lambda: self._lockstep.time)
            self._apply_gnss_error()
            self._hold_on_rail_during(self._preflight.identify(flight_parameters.values))
            # The program that flew, from the messages that it sent.
            reported, changed = self._link.reported, flight_parameters.changed
            unknown_names = changed.keys() - {RENAMED_IN_4_7.get(name, name) for name in reported.parameters}
            program = AutopilotProgram(
                version=version_text(reported.texts, reported.version),
                sha256=digest,
                parameters={
                    name: reported.parameters[name]
                    for name in sorted(flight_parameters.values)
                    if name in reported.parameters
                },
                changed={name: value for name, value in sorted(changed.items()) if name not in unknown_names},
                unused=tuple(sorted({*flight_parameters.unused, *unknown_names})),
            )
            flown_autopilot = autopilot.with_release(simulated_release(program.version))
            self.setup = replace(setup, autopilot=replace(flown_autopilot, program=program))
            self._stack = stack.pop_all()

    @property
    def last_item(self) -> int:
        """Number of the mission's last item; items are numbered from 1, and 0 is home."""
        return self._mission.last or len(self._mission.items)

    @property
    def _ground_tick(self) -> Tick:
        """Compiled function for one tick of a flight that starts on the ground."""
        return program_ground_tick

    def _prepare_program(self) -> None:
        """Upload and start the mission, wait until the motor has thrust, and push the aircraft along the rail."""
        self._hold_on_rail_during(self._preflight.prepare(self._mission))
        self._hold_on_rail_during(self._wait_for_thrust())
        self._push()

    def _wait_for_thrust(self) -> ConversationStep:
        """Wait until the motor has full thrust, if ArduPlane starts the motor before the launch."""
        take_off = self._ground_phases.take_off
        parameters = self.setup.autopilot.parameters
        if take_off is None or take_off.launch.method == "runway" or not isinstance(parameters, ArduPilotParameters):
            return
        start_time = motor_start_time(take_off.acceleration, take_off.speed, take_off.launch.incline, parameters)
        run_up_s = run_up_time(start_time, parameters)
        deadline = self._lockstep.time + (run_up_s + _SPOOL_TIME_S if run_up_s else 0.0)
        while self._lockstep.time < deadline:
            yield


def fly_autopilot(
    setup: FlightSetup,
    aircraft: Aircraft,
    autopilot: ProgramAutopilot,
    user_parameters: Mapping[str, float] | None = None,
    *,
    log: Path | None = None,
) -> tuple[SimulatedFlight, FlightSetup]:
    """Fly a setup with ArduPlane SITL, from the program's boot to the end of the flight.

    setup, aircraft, autopilot, user_parameters: see `AutopilotFlight`.
    log: file to which the autopilot's own log (.BIN) is moved.

    Return the flight, and the setup with the program that flew it.
    """
    with AutopilotFlight(setup, aircraft, autopilot, user_parameters) as flight:
        flight.prepare()
        simulated = fly_to_end(flight)
        if log is not None:
            flight.save_log(log)
        return simulated, flight.setup
