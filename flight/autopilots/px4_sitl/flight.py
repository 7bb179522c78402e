"""A flight that PX4 itself steers, as a program of its own in lockstep with our physics."""

import contextlib
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

from aircraft.catalog import Aircraft
from flight.autopilots.autopilot import AutopilotProgram
from flight.autopilots.program import ProgramAutopilot
from flight.autopilots.px4.autopilot import Px4
from flight.autopilots.px4_sitl.parameters import GivenParameters, given_parameters
from flight.autopilots.px4_sitl.physics import HilLockstep, SimulatorPort
from flight.autopilots.px4_sitl.preflight import Px4Preflight, version_text
from flight.autopilots.px4_sitl.process import STARTED, px4_launch
from flight.autopilots.sitl.exchange import FRAME_HZ
from flight.autopilots.sitl.flight import SitlFlight
from flight.autopilots.sitl.link import AutopilotLink, UdpLink
from flight.autopilots.sitl.process import AutopilotProcess, check_binary
from flight.autopilots.sitl.servos import load_servo_map
from flight.simulation.setup import FlightSetup
from world.scenario_tables import NEWEST_PX4, Px4Version

# s by the clock: to connect to the simulator, and to run its start-up script.
_CONNECTS, _STARTS = 30.0, 60.0
# s by the clock.  A PX4 that has not gone on for so long waits for a step.
_PATIENCE = 0.2
# Share of the push along the rail after which it is set on its way.
_SETS_OUT = 0.9
# s of its time that it has to close its log.
_CLOSING = 2.0
# flight_sw_version of the first release that turns by NAV_ACC_RAD alone.
_WITHOUT_ANTICIPATION = 0x01110000


class Px4Flight(SitlFlight):
    """One flight of PX4 itself; see `SitlFlight`.

    autopilot: flies the setup in place of its own autopilot; has PX4's parameters and the program's file, with the
        start-up files next to it.

    Its MAVLink port (UDP) is open on every interface of this machine, since PX4 has no setting for it.
    """

    def __init__(self, setup: FlightSetup, aircraft: Aircraft, autopilot: ProgramAutopilot) -> None:
        if not isinstance(autopilot, Px4):
            raise TypeError("PX4's program needs PX4's parameters")
        parameters, binary = autopilot.parameters, autopilot.file
        setup = replace(setup, autopilot=autopilot)
        digest = check_binary(binary, autopilot.title)
        servos = load_servo_map(aircraft)
        given = given_parameters(setup, aircraft, parameters)
        super().__init__(setup, aircraft, binary)
        self._setting_out: Iterator[None] = iter(())
        with contextlib.ExitStack() as stack, self._named():
            port = stack.enter_context(contextlib.closing(SimulatorPort()))
            link = stack.enter_context(contextlib.closing(UdpLink()))
            self._link = link
            launch = px4_launch(binary, given.given, port.port, link.theirs, link.port)
            process = stack.enter_context(AutopilotProcess(binary, launch))
            self._process, port.watch = process, process.watch
            lockstep = HilLockstep(port, servos, self.fdm, self._workspace, self._mission.home, self._look)
            self._lockstep = lockstep
            self._preflight = Px4Preflight(link, lambda: lockstep.time)
            self._apply_gnss_error()
            port.connect(_CONNECTS)
            lockstep.boot(self._rail, partial(_has_started, process), _PATIENCE, _STARTS)
            self._converse(self._preflight.meet(given.given))
            version: Px4Version = (
                "1.16" if (link.news.version or _WITHOUT_ANTICIPATION) < _WITHOUT_ANTICIPATION else NEWEST_PX4
            )
            flown = replace(autopilot.of_release(version), program=_program(link, digest, given))
            self.setup = replace(setup, autopilot=flown)
            self._stack = stack.pop_all()

    @property
    def last_item(self) -> int:
        """Items count from 0."""
        return len(self._mission.items) - 1

    @property
    def _is_ending(self) -> bool:
        """Where it circles about its last waypoint: from when it has reached that."""
        circles = self._workspace.path["waypoint"]["ends"][self.setup.route.legs]
        return self._link.news.reached >= self.last_item if circles else super()._is_ending

    def keep_log(self, target: Path) -> bool:
        """Have PX4 close its log (.ulg), end it, and move the log to a file; whether there was one."""
        self._preflight.disarm()
        for _ in range(round(_CLOSING * FRAME_HZ)):
            if not self._serve():
                break
        return super().keep_log(target)

    def _get_ready(self) -> None:
        self._converse(self._preflight.prepare(self._mission))
        self._push(last=_SETS_OUT)
        # It answers while it flies on.
        self._setting_out = self._preflight.set_out()
        self._push(first=_SETS_OUT)

    def _look(self) -> None:
        super()._look()
        self._preflight.accompany()
        next(self._setting_out, None)


def _has_started(process: AutopilotProcess) -> bool:
    return any(STARTED in line for line in process.lines())


def _program(link: AutopilotLink, digest: str, given: GivenParameters) -> AutopilotProgram:
    """Which program it is, by what it has told."""
    news = link.news
    unknown = given.changed.keys() - news.parameters.keys()
    return AutopilotProgram(
        version=version_text(news.version),
        sha256=digest,
        parameters={name: news.parameters[name] for name in sorted(given.given) if name in news.parameters},
        changed={name: value for name, value in sorted(given.changed.items()) if name not in unknown},
        unused=tuple(sorted({*given.unused, *unknown})),
    )
