"""The flight loop: read JSBSim, do a tick, set JSBSim, step it, with as little Python between as there can be."""

import struct
from collections.abc import Callable, Sequence

from flight.dynamics.property_access import Getter, Setter
from flight.simulation.workspace import READ_FIELDS, Workspace


def make_loop(
    getters: Sequence[Getter],
    setters: Sequence[Setter],
    tick: Callable[[], int],
    workspace: Workspace,
    run: Callable[[], object],
    steps: int,
) -> Callable[[int], int]:
    """Make what flies up to a number of ticks and returns the last one's status: 0, or how the flight ended.

    getters: of the state, by `flight.simulation.workspace.READ_FIELDS`.
    setters: by `flight.simulation.workspace.OUTPUT`.
    tick: `flight.simulation.tick.tick` on this workspace.
    run: steps JSBSim, ``steps`` times a tick.
    """
    # Each by its name: going through a list of them takes half as long again.
    (
        latitude, longitude, amsl, velocity_north, velocity_east, velocity_down, roll, pitch, yaw,
        roll_rate, pitch_rate, yaw_rate, airspeed, alpha, beta, elevator, aileron, rudder, throttle,
        current, power, load_factor,
    ) = getters  # fmt: skip
    (
        set_elevator, set_aileron, set_rudder, set_throttle, set_gust_north, set_gust_east, set_gust_down, set_ground,
    ) = setters  # fmt: skip
    # struct writes so many floats in half the time of a slice assignment.
    pack: Callable[..., None] = struct.Struct(f"{len(READ_FIELDS)}d").pack_into
    readings, output, repeat = workspace.readings, workspace.output.tolist, (None,) * steps

    def fly(count: int) -> int:
        for _ in range(count):
            pack(
                readings, 0,
                latitude(), longitude(), amsl(), velocity_north(), velocity_east(), velocity_down(),
                roll(), pitch(), yaw(), roll_rate(), pitch_rate(), yaw_rate(), airspeed(), alpha(), beta(),
                elevator(), aileron(), rudder(), throttle(), current(), power(), load_factor(),
            )  # fmt: skip
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
            for _ in repeat:
                run()
        return 0

    return fly
