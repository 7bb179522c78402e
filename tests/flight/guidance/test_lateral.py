"""The guidance core by parts: projection, profile, signs of the commands, limits; and its packed order."""

import math
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from aircraft.catalog import Aircraft
from flight.dynamics.state import COMMAND_SIZE, STATE_SIZE, C, S
from flight.guidance.fly_by_path import arc_point, fly_by_path
from flight.guidance.gains import Gains, load_gains
from flight.guidance.lateral import guide
from flight.guidance.path_kernels import mean_curvature, profile, project
from flight.guidance.rows import MEMORY_SIZE, G, M
from flight.simulation.flight_setup import FlightSetup
from world.errors import FlightError
from world.geometry import signed_turns

Floats = NDArray[np.float64]
MakeSetup = Callable[..., FlightSetup]


def _piece(course: float, curvature: float, length: float = 300.0) -> Floats:
    return np.array([50.0, length, 120.0, -80.0, course, curvature, 0.0, math.inf])


@given(
    st.floats(-7.0, 7.0),
    st.floats(-2.0, 4.5),
    st.floats(-90.0, 90.0),
    st.floats(100.0, 5000.0),
    st.sampled_from([-1, 0, 1]),
)
def test_projection_undoes_the_construction(
    course: float, share: float, aside: float, radius: float, side: int
) -> None:
    # A point `aside` to the right of the place `along` on the piece; arcs up to 258 degrees, and a little before.
    piece = _piece(course, side / radius)
    along = share * radius if share > 0.0 else share * 0.5 * radius
    east, north = arc_point(piece, along)
    here = course + piece[5] * along
    got = project(piece, east + aside * math.cos(here), north - aside * math.sin(here))
    assert got[0] == pytest.approx(along, abs=1e-6 * radius)
    assert got[1] == pytest.approx(aside, abs=1e-6)
    assert math.remainder(got[2] - here, math.tau) == pytest.approx(0.0, abs=1e-6)


def test_mean_curvature_of_a_window() -> None:
    pieces = np.array([_piece(0.0, 0.0), _piece(0.0, 0.01), _piece(0.0, 0.0)])
    pieces[:, 0] = [0.0, 300.0, 600.0]
    for start, end, wanted in ((0.0, 100.0, 0.0), (250.0, 350.0, 0.005), (400.0, 500.0, 0.01), (550.0, 950.0, 0.00125)):
        assert mean_curvature(pieces, 0, start, end) == pytest.approx(wanted)
    assert mean_curvature(pieces, 2, 5000.0, 5100.0) == 0.0  # beyond the end


def test_profile_by_hand() -> None:
    # Level at 500 m, from 1000 m on with a slope of 0.1, its parabola 100 m to either side.
    nodes = np.array([[0.0, 500.0, 0.0, 0.0], [1000.0, 500.0, 0.1, 100.0], [2000.0, 600.0, 0.1, 0.0]])
    for s, wanted in (
        (-50.0, (500.0, 0.0, 0.0)),
        (899.0, (500.0, 0.0, 0.0)),
        (1000.0, (500.0 + 0.5 * 5e-4 * 100**2, 0.05, 5e-4)),
        (1101.0, (510.1, 0.1, 0.0)),
        (2500.0, (650.0, 0.1, 0.0)),
    ):
        assert profile(nodes, s) == pytest.approx(wanted, abs=1e-9)


def test_gains_are_packed_in_the_order_that_the_core_reads(aerosonde: Aircraft) -> None:
    assert [item.name for item in fields(Gains)] == [row.name.lower() for row in G]
    gains = load_gains(aerosonde)
    assert gains.packed().shape == (len(G),)
    assert gains.packed()[G.TURN_LEAD] == gains.turn_lead
    assert len(M) == MEMORY_SIZE
    # flight.md: 0.2 to 0.3 s of roll lead.
    assert 0.1 <= gains.turn_lead <= 0.4


class Tick:
    """One call of the core on a straight level path to the north at 500 m."""

    def __init__(self, setup: FlightSetup, gains: Gains) -> None:
        path = fly_by_path(setup.route, setup.limits)
        self.pieces, self.nodes, self.speeds = path.pieces, path.nodes, setup.route.airspeed
        way = setup.route.waypoints
        turns = np.concatenate([[0.0], np.abs(signed_turns(way)), [0.0]])
        self.corners = np.column_stack([way[:, :2], turns, np.zeros((len(way), 2))])
        self.gains = gains.packed()
        self.memory = np.zeros(MEMORY_SIZE)
        self.memory[M.LAST_AIRSPEED], self.memory[M.MAX_BANK] = -1.0, math.radians(33.0)
        self.memory[M.TRIM_THROTTLE], self.memory[M.TRIM_ELEVATOR] = 0.5, -0.1

    def __call__(
        self, east: float = 0.0, up: float = 500.0, north: float = 1000.0, course: float = 0.0, **state: float
    ) -> Floats:
        values = np.zeros(STATE_SIZE)
        values[[S.AIRSPEED, S.ACCEL_N]] = 25.0, 1.0
        for name, value in state.items():
            values[S[name]] = value
        place = np.array([east, north, up, 25.0 * math.sin(course), 25.0 * math.cos(course), 0.0])
        commands = np.zeros(COMMAND_SIZE)
        guide(
            values, place, self.pieces, self.nodes, self.corners, self.speeds, self.gains, self.memory, commands, 1 / 60
        )
        return commands


@pytest.fixture
def tick(make_setup: MakeSetup, aerosonde: Aircraft) -> Tick:
    return Tick(make_setup([[0, 0, 500], [0, 3000, 500], [3000, 3000, 500]]), load_gains(aerosonde))


def test_on_the_path_nothing_is_asked(tick: Tick) -> None:
    commands = tick()
    assert commands[[C.AILERON, C.RUDDER]] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert commands[C.ELEVATOR] == pytest.approx(-0.1, abs=1e-12)
    assert commands[C.THROTTLE] == pytest.approx(0.5)
    assert tick.memory[[M.LEG, M.CROSS_TRACK, M.HEIGHT_ERROR, M.DONE]].tolist() == [0.0, 0.0, 0.0, 0.0]
    assert tick.memory[M.DISTANCE] == 1000.0


def test_which_way_the_controls_move(tick: Tick) -> None:
    # A positive aileron command rolls to the right, a positive elevator command pitches down.
    right, left = tick(east=30.0), tick(east=-30.0)
    assert right[C.AILERON] < 0.0 < left[C.AILERON]
    assert tick(course=0.2)[C.AILERON] < 0.0 < tick(course=-0.2)[C.AILERON]
    assert tick(up=505.0)[C.ELEVATOR] > tick()[C.ELEVATOR] > tick(up=495.0)[C.ELEVATOR]
    assert tick(AIRSPEED=22.0)[C.THROTTLE] > tick()[C.THROTTLE] > tick(AIRSPEED=28.0)[C.THROTTLE]
    assert tick(Q=0.3)[C.ELEVATOR] > tick()[C.ELEVATOR]  # damping
    assert tick(P=0.3)[C.AILERON] < 0.0


@given(
    st.floats(-3000.0, 3000.0),
    st.floats(100.0, 900.0),
    st.floats(-3.2, 3.2),
    st.floats(5.0, 60.0),
    st.floats(-1.3, 1.3),
)
def test_commands_stay_sane_from_anywhere(
    make_setup: MakeSetup, aerosonde: Aircraft, east: float, up: float, course: float, speed: float, roll: float
) -> None:
    one = Tick(make_setup([[0, 0, 500], [0, 3000, 500], [3000, 3000, 500]]), load_gains(aerosonde))
    for _ in range(3):
        commands = one(east=east, up=up, course=course, AIRSPEED=speed, ROLL=roll)
    assert np.isfinite(commands).all()
    assert 0.0 <= commands[C.THROTTLE] <= 1.0
    assert np.isfinite(one.memory).all()


def test_far_away_it_flies_towards_the_path_not_at_a_right_angle(tick: Tick) -> None:
    # 1 km to the right and on course to the left at the steepest intercept, no bank is asked for.
    angle = tick.gains[G.INTERCEPT]
    assert abs(tick(east=1000.0, course=-angle, YAW=-angle)[C.AILERON]) < 0.02
    assert tick(east=1000.0, course=0.0)[C.AILERON] < -0.05


def test_end_of_the_path(tick: Tick) -> None:
    tick(north=2999.0)
    assert tick.memory[M.LEG] in (0.0, 1.0)
    tick(east=1500.0, north=3000.0, course=math.pi / 2)
    assert tick.memory[[M.LEG, M.DONE]].tolist() == [1.0, 0.0]
    tick(east=3000.1, north=3000.0, course=math.pi / 2)
    assert tick.memory[[M.LEG, M.DONE]].tolist() == [1.0, 1.0]


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        ("", "missing "),
        ("surprise = 1.0", "unknown surprise"),
        ("roll_gain_1_s = nan", "not a finite number"),
        ("roll_gain_1_s = true", "not a finite number"),
        ('roll_gain_1_s = "4"', "not a finite number"),
        ("= 3", "gains.toml: "),
    ],
)
def test_bad_gains_are_refused_in_one_line(line: str, wanted: str, aerosonde: Aircraft, tmp_path: Path) -> None:
    folder = tmp_path
    with pytest.raises(FlightError, match="gains"):
        load_gains(replace(aerosonde, folder=folder))
    text = (aerosonde.folder / "gains.toml").read_text(encoding="utf-8")
    kept = [row for row in text.splitlines() if not row.startswith("roll_gain")]
    (folder / "gains.toml").write_text("\n".join([*kept, line]), encoding="utf-8")
    with pytest.raises(FlightError, match=wanted) as caught:
        load_gains(replace(aerosonde, folder=folder))
    assert "\n" not in str(caught.value)
