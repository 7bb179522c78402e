"""Fly PX4 itself, as a program in lockstep with planfly's physics."""

import contextlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from aircraft.catalog import Aircraft
from flight.autopilots.autopilot import AutopilotProgram
from flight.autopilots.program import ProgramAutopilot
from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4_sitl.parameters import collect_px4_parameters
from flight.autopilots.px4_sitl.physics import HilLockstep, SimulatorPort
from flight.autopilots.px4_sitl.preflight import Px4Preflight, version_text
from flight.autopilots.px4_sitl.process import STARTED, px4_launch
from flight.autopilots.sitl.exchange import FRAME_HZ
from flight.autopilots.sitl.flight import SitlFlight
from flight.autopilots.sitl.link import UdpLink
from flight.autopilots.sitl.process import AutopilotProcess, check_binary
from flight.autopilots.sitl.servos import load_servo_map
from flight.simulation.setup import FlightSetup
from world.scenario_tables import NEWEST_PX4, Px4Version

# Timeout to connect to the simulator, s by the clock.
_CONNECT_TIMEOUT_S = 30.0
# Timeout of PX4's start-up script, s by the clock.
_STARTUP_TIMEOUT_S = 60.0
# Time without an answer after which PX4 is waiting for a step, s by the clock.
_STALL_TIME_S = 0.2
# Fraction of the launch along the rail after which mission mode is started.
_MODE_START_FRACTION = 0.9
# Time for PX4 to close its log, s of simulated time.
_LOG_CLOSING_TIME_S = 2.0
# flight_sw_version of the first release that turns only by NAV_ACC_RAD.
_FIRST_WITHOUT_ANTICIPATION = 0x01110000


class Px4Flight(SitlFlight):
    """One flight of PX4 itself; see `SitlFlight`.

    autopilot: autopilot that flies the setup instead of the setup's own; it has PX4's parameters and the program's
        file, with the start-up files next to it.

    Its MAVLink port (UDP) is open on every interface of this machine, because PX4 has no setting to restrict it.
    """

    def __init__(self, setup: FlightSetup, aircraft: Aircraft, autopilot: ProgramAutopilot) -> None:
        if not isinstance(autopilot, Px4):
            raise TypeError("PX4's program needs PX4's parameters")
        parameters, binary = autopilot.parameters, autopilot.file
        setup = replace(setup, autopilot=autopilot)
        digest = check_binary(binary, autopilot.title)
        servos = load_servo_map(aircraft)
        flight_parameters = collect_px4_parameters(setup, aircraft, parameters)
        super().__init__(setup, aircraft, binary)
        self._mode_start: Iterator[None] = iter(())
        with contextlib.ExitStack() as stack, self._name_program_in_errors():
            port = stack.enter_context(contextlib.closing(SimulatorPort()))
            link = stack.enter_context(contextlib.closing(UdpLink()))
            self._link = link
            launch = px4_launch(binary, flight_parameters.values, port.port, link.program_port, link.port)
            process = stack.enter_context(AutopilotProcess(binary, launch))
            self._process, port.check_program = process, process.check_running
            lockstep = HilLockstep(port, servos, self.fdm, self._workspace, self._mission.home, self._poll_link)
            self._lockstep = lockstep
            self._preflight = Px4Preflight(link, lambda: lockstep.time)
            self._apply_gnss_error()
            port.connect(_CONNECT_TIMEOUT_S)
            # The output shows when PX4's start-up script has ended.
            lockstep.boot(
                self._rail,
                lambda: any(STARTED in line for line in process.output_lines()),
                _STALL_TIME_S,
                _STARTUP_TIMEOUT_S,
            )
            self._hold_on_rail_during(self._preflight.identify(flight_parameters.values))
            # The program that flew, from the messages that it sent.
            reported, changed = link.reported, flight_parameters.changed
            unknown_names = changed.keys() - reported.parameters.keys()
            program = AutopilotProgram(
                version=version_text(reported.version),
                sha256=digest,
                parameters={
                    name: reported.parameters[name]
                    for name in sorted(flight_parameters.values)
                    if name in reported.parameters
                },
                changed={name: value for name, value in sorted(changed.items()) if name not in unknown_names},
                unused=tuple(sorted({*flight_parameters.unused, *unknown_names})),
            )
            version: Px4Version = (
                "1.16"
                if (reported.version or _FIRST_WITHOUT_ANTICIPATION) < _FIRST_WITHOUT_ANTICIPATION
                else NEWEST_PX4
            )
            flown_autopilot = replace(autopilot.with_release(version), program=program)
            self.setup = replace(setup, autopilot=flown_autopilot)
            self._stack = stack.pop_all()

    @property
    def last_item(self) -> int:
        """Number of the mission's last item, counted from 0."""
        return len(self._mission.items) - 1

    @property
    def _is_ending(self) -> bool:
        """True if the mission is about to end.

        If PX4 loiters at the last waypoint, the mission ends once it has reached this waypoint. For other missions the
        base class decides.
        """
        ends_in_circle = self._workspace.path["waypoint"]["is_mission_end"][self.setup.route.legs]
        return self._link.reported.reached >= self.last_item if ends_in_circle else super()._is_ending

    def save_log(self, target: Path) -> bool:
        """Make PX4 close its log (.ulg), end the program, and move the log; return True if there was a log."""
        self._preflight.disarm()
        for _ in range(round(_LOG_CLOSING_TIME_S * FRAME_HZ)):
            if not self._answer_frame():
                break
        return super().save_log(target)

    def _prepare_program(self) -> None:
        """Upload the mission, and start it while the aircraft is pushed along the rail."""
        self._hold_on_rail_during(self._preflight.prepare(self._mission))
        self._push(end_fraction=_MODE_START_FRACTION)
        # PX4 confirms the mode while the aircraft moves on.
        self._mode_start = self._preflight.start_mission()
        self._push(start_fraction=_MODE_START_FRACTION)

    def _poll_link(self) -> None:
        """Read the messages of PX4, and send the messages that PX4 expects."""
        super()._poll_link()
        self._preflight.send_periodic_messages()
        next(self._mode_start, None)
