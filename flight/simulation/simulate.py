"""Fly JSBSim with a simulated autopilot along a route and over its terrain, until the flight ends."""

import math
import struct
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

from aircraft.catalog import Aircraft
from aircraft.contacts import find_contacts
from flight.autopilots.parts import ControlLaw
from flight.dynamics.compiled_model import PROOF_STEPS, CompiledModel
from flight.dynamics.fdm import JSBSIM_VERSION, Fdm, Variation
from flight.dynamics.jsbsim_properties import Getter, Setter
from flight.dynamics.model_program import UnsupportedModel
from flight.dynamics.trim import steady_flight
from flight.guidance.gains import load_gains
from flight.guidance.path import FlyByPath
from flight.mission.ground_phases import GroundPhases
from flight.simulation.local_map import LocalMap
from flight.simulation.running_flight import RunningFlight, Start, default_gear, find_release, release
from flight.simulation.setup import EngineChoice, FlightSetup
from flight.simulation.tick import READ_FIELDS, Workspace
from flight.simulation.track import COLUMNS, Rows, Track, as_track, join_rows
from world.errors import FlightError, StartError

# ----------------------------------------------------------------------
# The flight loop: read JSBSim, do a tick, set JSBSim and step it, with as little Python as possible.


def make_loop(
    getters: Sequence[Getter],
    setters: Sequence[Setter],
    tick: Callable[[], int],
    workspace: Workspace,
    step_model: Callable[[], object],
    steps: int,
) -> Callable[[int], int]:
    """Return a function that flies up to a number of ticks in JSBSim; it returns the flight's end code, or 0.

    getters: getters of the state, in the order of `flight.simulation.tick.READ_FIELDS`.
    setters: setters of the outputs, in the order of `flight.simulation.tick.OUTPUT`.
    tick: the control law's tick, on this workspace.
    step_model: function that steps JSBSim; it is called ``steps`` times per tick.
    """
    # Call each getter by name: a loop over the list takes 1.5 times as long.
    (
        latitude,
        longitude,
        amsl,
        velocity_north,
        velocity_east,
        velocity_down,
        roll,
        pitch,
        yaw,
        roll_rate,
        pitch_rate,
        yaw_rate,
        airspeed,
        alpha,
        beta,
        elevator,
        aileron,
        rudder,
        throttle,
        current,
        power,
        load_factor,
    ) = getters
    (
        set_elevator,
        set_aileron,
        set_rudder,
        set_throttle,
        set_gust_north,
        set_gust_east,
        set_gust_down,
        set_ground,
    ) = setters
    # struct writes these floats in half the time of a slice assignment.
    pack: Callable[..., None] = struct.Struct(f"{len(READ_FIELDS)}d").pack_into
    readings, output, step_range = workspace.readings, workspace.output.tolist, (None,) * steps

    def fly(count: int) -> int:
        for _ in range(count):
            pack(
                readings,
                0,
                latitude(),
                longitude(),
                amsl(),
                velocity_north(),
                velocity_east(),
                velocity_down(),
                roll(),
                pitch(),
                yaw(),
                roll_rate(),
                pitch_rate(),
                yaw_rate(),
                airspeed(),
                alpha(),
                beta(),
                elevator(),
                aileron(),
                rudder(),
                throttle(),
                current(),
                power(),
                load_factor(),
            )
            if status := tick():
                return status
            elevator_out, aileron_out, rudder_out, throttle_out, north_out, east_out, down_out, ground_out = output()
            set_elevator(elevator_out)
            set_aileron(aileron_out)
            set_rudder(rudder_out)
            set_throttle(throttle_out)
            set_gust_north(north_out)
            set_gust_east(east_out)
            set_gust_down(down_out)
            set_ground(ground_out)
            for _ in step_range:
                step_model()
        return 0

    return fly


# Default duration of a guidance tick, s; `Flight.dt` is the duration in one flight.
TICK_S = 1.0 / 60.0
# Duration of one block of rows from `simulate`, s.
BLOCK_DURATION_S = 1.0
# The same for a flight that is neither recorded nor shown; 40 us are spent in Python for each block.
LONG_BLOCK_DURATION_S = 10.0
# Smallest number of rows by which a track under construction is enlarged.
_MIN_ADDED_ROWS = 6_000
# Bank that guidance may add to the bank of planned turns in order to correct an error, rad.
BANK_RESERVE_RAD = math.radians(3.0)
# Time added to the time limit of a flight that takes off or lands, s.
GROUND_TIME_ALLOWANCE_S = 120.0


@dataclass(frozen=True, slots=True)
class SimulatedFlight:
    """A flight that has ended.

    track: flown track.
    ended: "completed", or the reason why the flight ended earlier.
    path: reference path.
    """

    track: Track
    ended: str
    path: FlyByPath


class FlightBlock(NamedTuple):
    """Consecutive rows of a flight, as `simulate` yields them.

    rows: `flight.simulation.track.TRACK_ROW` records, (t,).
    end_reason: "completed", or the reason why the flight ended with these rows; "" while it continues.
    distance: distance along the path at the last row, m.
    """

    rows: Rows
    end_reason: str
    distance: float


def simulate(flight: RunningFlight, block_duration: float = BLOCK_DURATION_S) -> Iterator[FlightBlock]:
    """Fly until the flight ends, and yield its track rows in blocks.

    block_duration: duration of a block, s.

    >>> import numpy as np
    >>> from types import SimpleNamespace
    >>> from flight.simulation.track import TRACK_ROW
    >>> blocks = iter([(np.zeros(60, TRACK_ROW), ""), (np.zeros(12, TRACK_ROW), "ground contact")])
    >>> memory, path = SimpleNamespace(distance=0.0), SimpleNamespace(length=9.0)
    >>> flight = SimpleNamespace(dt=1 / 60, guidance_memory=memory, path=path, fly_block=lambda count: next(blocks))
    >>> [(len(block.rows), block.end_reason) for block in simulate(flight)]
    [(60, ''), (12, 'ground contact')]
    """
    end_reason = ""
    while not end_reason:
        rows, end_reason = flight.fly_block(round(block_duration / flight.dt))
        yield FlightBlock(rows, end_reason, min(float(flight.guidance_memory.distance), flight.path.length))


def fly_to_end(flight: RunningFlight) -> SimulatedFlight:
    """Fly until the flight ends. The same setup always gives the same track, bit for bit.

    Raises FlightError if a program does not fly to the end.

    >>> import numpy as np
    >>> from aircraft.catalog import load_aircraft
    >>> from flight.dynamics.envelope_tables import load_envelope
    >>> from flight.mission.items import Mission
    >>> from flight.mission.route import Route, route_points
    >>> from flight.simulation.setup import make_limits
    >>> from world.scenario import load_scenario
    >>> scenario, aerosonde = load_scenario("tight"), load_aircraft("aerosonde")
    >>> waypoints = scenario.start + np.array([[0.0, 0.0, 0.0], [300.0, 0.0, 0.0]])
    >>> route = Route(route_points(waypoints, 25.0), "")
    >>> limits = make_limits(scenario, load_envelope(aerosonde), 25.0, 0.5)
    >>> setup = FlightSetup(scenario, Mission(None, ()), route, limits, "aerosonde", 888.0, 1)
    >>> flown = fly_to_end(Flight(setup, aerosonde))
    >>> flown.ended, round(float(flown.track.time[-1])), bool(abs(flown.track.cross_track).max() < 0.1)
    ('completed', 12, True)
    """
    builder, end_reason = TrackBuilder(), ""
    for block in simulate(flight, LONG_BLOCK_DURATION_S):
        builder.add(block.rows)
        end_reason = block.end_reason
    return SimulatedFlight(builder.track(), end_reason, flight.path)


class TrackBuilder:
    """Build the track of a flight while it is flown, in half the memory of the flown rows.

    >>> import numpy as np
    >>> from flight.simulation.track import TRACK_ROW
    >>> builder = TrackBuilder()
    >>> for _ in range(2):
    ...     builder.add(np.zeros(60, TRACK_ROW))
    >>> len(builder.track())
    120
    """

    def __init__(self) -> None:
        no_rows = as_track(join_rows([]))
        self._columns = {name: getattr(no_rows, name).copy() for name in COLUMNS}
        self._row_count = 0

    def add(self, rows: Rows) -> None:
        """Append rows, copied into arrays of the track's types."""
        start, self._row_count = self._row_count, self._row_count + len(rows)
        if self._row_count > len(self._columns["time"]):
            self._set_capacity(max(self._row_count + _MIN_ADDED_ROWS, int(1.5 * self._row_count)))
        for name, column in self._columns.items():
            column[start : self._row_count] = rows[name]

    def track(self) -> Track:
        """Return the track of all rows; no rows can be added afterwards."""
        self._set_capacity(self._row_count)
        for column in self._columns.values():
            column.setflags(write=False)
        return Track(**self._columns)

    def _set_capacity(self, row_count: int) -> None:
        """Resize all columns to a number of rows."""
        for column in self._columns.values():
            # Resize the array in place: a copy of a long flight takes as much memory again.
            column.resize((row_count, *column.shape[1:]), refcheck=False)


# Fields of `flight.guidance.inner_loops.GUIDANCE_MEMORY` that describe the flown path and not the aircraft.
_PATH_MEMORY_FIELDS = (
    *(
        "piece",
        "leg",
        "distance",
        "cross_track",
        "height_error",
        "is_finished",
        "is_in_rtl",
        "loiter_time",
        "loiter_angle",
        "bearing",
    ),
    *("cross_track_integrator", "path_bank", "path_bank_rate", "roll_offset", "roll_offset_rate", "max_arc_speed"),
    *("l1_leg", "l1_integrator", "course_integrator", "altitude_integrator", "slope_acceleration"),
)
# Records that a flight keeps when it is diverted to another route.
_DIVERSION_RECORDS = ("state", "true", "estimated", "commands", "air", "place", "wind", "gusts", "navigation", "memory")


class Flight(RunningFlight):
    """A flight by a simulated autopilot: as fast as possible by `simulate`, or live in real time."""

    _law: ControlLaw

    def __init__(
        self,
        setup: FlightSetup,
        aircraft: Aircraft,
        variation: Variation | None = None,
        local_map: LocalMap | None = None,
        start_offset: tuple[float, float, float] = (0.0, 0.0, 0.0),
        engine: EngineChoice | None = None,
    ) -> None:
        """Start the flight from a trimmed state.

        variation: differences of the aircraft from its model, which guidance does not know.
        local_map: local map of the setup, if another flight has already fitted one.
        start_offset: east, north and up from the route's first waypoint to the start of the flight, m.
        engine: flight model that flies; None for the choice of the setup.

        Raises FlightError if the aircraft cannot be loaded, and StartError if the flight cannot start.
        """
        gains = load_gains(aircraft)
        self._chosen_engine = engine or setup.engine
        self._ground_phases, gear = setup.ground_phases, None
        self._law = setup.autopilot.model.control_law
        ground_law = setup.autopilot.ground.control_law
        if self._ground_phases and ground_law is not None:
            gear = default_gear(self._ground_phases)
            self._law = ground_law(self._ground_phases, aircraft, find_contacts(aircraft, gear))
        super().__init__(setup, aircraft, gains, variation, local_map, start_offset, gear)
        if self._ground_phases:
            self.max_ticks += int(GROUND_TIME_ALLOWANCE_S / self.dt)
        # Guidance knows the model, but not the differences of the aircraft from it.
        model = Fdm(aircraft, rate_hz=setup.fdm_hz, motor_braking=setup.scenario.flight.motor_braking)
        self._trim_at_start(setup, model, gains.reference_airspeed)
        self.guidance_memory.max_bank = setup.limits.max_bank + BANK_RESERVE_RAD
        self._law.initialise(self.guidance_memory, self._workspace.law_record)
        self._start_disturbances(setup)
        self._compiled, self.engine = self._choose_engine(setup)
        self._fly_ticks = self._make_loop()

    def divert(self, setup: FlightSetup, local_map: LocalMap) -> None:
        """Change to the route of another setup, which starts at the aircraft's position at time 0.

        The aircraft, its wind and the estimates of guidance are kept; the state of guidance on the old route is
        discarded.

        setup: setup with the same aircraft, autopilot, wind and rates.
        local_map: local map of that setup.
        """
        old_record, old_law_record = self._work, self._workspace.law_record
        # The aircraft is in the air, even if the new mission starts with a take-off.
        self._ground_phases, self._law = GroundPhases(), setup.autopilot.model.control_law
        self._prepare_route(setup, self.fdm.aircraft, local_map)
        for name in _DIVERSION_RECORDS:
            setattr(self._work, name, getattr(old_record, name))
        self._work.wind.start_time += old_record.timing.tick * self.dt
        for name in _PATH_MEMORY_FIELDS:
            setattr(self.guidance_memory, name, 0)
        self._law.initialise(self.guidance_memory, self._workspace.law_record)
        self._law.transfer_state(old_law_record, self._workspace.law_record, setup.route.positions[0])
        self._fly_ticks = self._make_loop()

    def _trim_at_start(self, setup: FlightSetup, model: Fdm, reference_airspeed: float) -> None:
        """Trim the aircraft at the start of the route, and store the trim of the model in the guidance memory.

        reference_airspeed: airspeed for which the gains apply, m/s.
        """
        start = self._find_start(setup)
        if setup.autopilot.speeds.equivalent:
            true_airspeed = start.airspeed * setup.autopilot.speeds.true_airspeed_factor(start.amsl)
            start = replace(start, slope=0.0, airspeed=min(self.fdm.aircraft.airspeed_max, true_airspeed))
        level_trim = steady_flight(model, reference_airspeed, start.amsl)
        if level_trim is None:
            reason = f"no level flight at {reference_airspeed:.1f} m/s and {start.amsl:.0f} m AMSL"
            raise StartError(setup.aircraft, reason, field="airspeed", value=reference_airspeed)
        self._start_fdm = partial(self._start_motion, setup, start, level_trim.elevator)
        self._start_fdm()
        memory = self.guidance_memory
        memory.trim_elevator, memory.trim_alpha = level_trim.elevator, level_trim.alpha
        memory.trim_throttle = (steady_flight(model, start.airspeed, start.amsl) or level_trim).throttle
        memory.last_airspeed = -1.0
        memory.stall_speed = self.fdm.aircraft.stall_speed

    def _start_motion(self, setup: FlightSetup, start: Start, elevator: float) -> None:
        """Start the aircraft trimmed in the air, and then release it from its launcher if it takes off.

        elevator: elevator command at the release, rad.
        """
        self._start_trimmed(setup.mission.source, start)
        if self._ground_phases.take_off is not None:
            release_state = find_release(setup, self.map, self._ground, self.fdm.aircraft, self._ground_phases.take_off)
            commands = (elevator, 0.0, 0.0, self._law.released_throttle)
            self._work.commands = release(self.fdm, release_state, commands)
            self._work.air.wind_north, self._work.air.wind_east = release_state.wind[:2]

    def _choose_engine(self, setup: FlightSetup) -> tuple[CompiledModel | None, str]:
        """Choose between the compiled model and JSBSim, by comparing their steps.

        Returns the compiled model, or None for JSBSim, and a text that names the choice and its reason.
        """
        if self._chosen_engine == "jsbsim":
            return None, "JSBSim, as requested"
        if self._law.loop is None:
            return None, f"JSBSim, because the control loop of {setup.autopilot.title} is not compiled"
        has_gusts, has_terrain = self._windy, bool(self._ground.known)
        try:
            model = CompiledModel(self.fdm, READ_FIELDS, self._steps, gusts=has_gusts, terrain=has_terrain)
        except UnsupportedModel as unsupported:
            return None, f"JSBSim, because the compiled model does not cover {unsupported}"
        except (FlightError, ArithmeticError) as error:
            return None, f"JSBSim, because the compiled model cannot start: {error}"
        if differences := model.find_differences():
            # Start again, since the comparison has moved the aircraft.
            self.fdm = self._new_fdm()
            self._start_fdm()
            return None, f"JSBSim, because the compiled model differs from it in {differences[0]}"
        return model, f"compiled model, bit-identical to JSBSim {JSBSIM_VERSION} over {PROOF_STEPS} test steps"

    def _make_loop(self) -> Callable[[int], int]:
        """Return a function that flies up to a number of ticks, fills the rows, and returns the end code or 0."""
        record, workspace, access = self._work, self._workspace, self.fdm.loop_access()
        record.state_factors = access.factors[0]
        record.scale_positive, record.scale_negative = (tuple(scales) for scales in zip(*access.scales, strict=True))
        if self._compiled is not None and self._law.loop is not None:
            model = self._compiled
            return partial(self._law.loop, workspace.block, self._ground.heights, *model.arrays)
        # Do not set gusts in still air, nor the altitude of unknown ground.
        is_used = (True, True, True, True, self._windy, self._windy, self._windy, self._ground.known)
        setters = [setter if use else _discard for setter, use in zip(access.setters, is_used, strict=True)]
        return make_loop(
            [access.getters[field] for field in READ_FIELDS],
            setters,
            partial(self._law.tick, workspace.block, self._ground.heights),
            workspace,
            access.run,
            self._steps,
        )


def _discard(_value: float) -> None:
    """Do nothing; stands for the setter of an output that the flight does not use."""
