"""An engine settles while everything else stands still, and then everything moves as before."""

from collections.abc import Callable

import pytest

from flight.dynamics.engine import Engine

INTEGRATORS = tuple(
    f"simulation/integrator/{kind}"
    for kind in ("rate/rotational", "rate/translational", "position/rotational", "position/translational")
)
RATE = "accelerations/udot-ft_sec2"
DT = 1.0 / 120.0


class FakeJsbsim:
    """An engine whose push halves its distance to its final value at each step that takes time."""

    def __init__(self) -> None:
        self.values = {name: 3.0 + k for k, name in enumerate(INTEGRATORS)}
        self.push, self.calls, self.steps = 64.0, list[str](), list[float]()
        self.dt = DT
        self.engine = Engine(self, DT, self.getter, self.setter)

    def getter(self, name: str) -> Callable[[], float]:
        return lambda: self.push if name == RATE else self.values.get(name, 0.0)

    def setter(self, name: str) -> Callable[[float], None]:
        def put(value: float) -> None:
            self.values[name] = value
            self.calls.append(name)

        return put

    def run_ic(self) -> None:
        self.calls.append("run_ic")

    def set_dt(self, dt: float) -> None:
        self.dt = dt

    def run(self) -> None:
        self.steps.append(self.dt)
        if self.dt > 0.0:
            self.push *= 0.5


@pytest.fixture
def fake() -> FakeJsbsim:
    return FakeJsbsim()


def test_held_nothing_moves_and_no_fuel_is_used(fake: FakeJsbsim) -> None:
    fake.engine.hold()
    assert [fake.values[name] for name in INTEGRATORS] == [0.0] * 4
    assert fake.values["propulsion/fuel_freeze"] == 1.0


def test_it_is_started_once(fake: FakeJsbsim) -> None:
    fake.engine.hold()
    # All engines: -1, after the initial conditions, which would stop it.
    assert fake.values["propulsion/set-running"] == -1.0
    assert fake.calls.index("run_ic") < fake.calls.index("propulsion/set-running")
    fake.engine.hold()
    assert fake.calls.count("propulsion/set-running") == 1


def test_released_everything_moves_as_before(fake: FakeJsbsim) -> None:
    fake.engine.hold()
    fake.engine.release()
    assert [fake.values[name] for name in INTEGRATORS] == [3.0, 4.0, 5.0, 6.0]
    assert fake.values["propulsion/fuel_freeze"] == 0.0


def test_it_runs_until_its_push_is_steady(fake: FakeJsbsim) -> None:
    fake.engine.settle(spin=True)
    # 64 / 2^n changes by less than 1e-10 from n = 40 on: 2^-34 is 5.8e-11.
    assert len(fake.steps) == 40
    assert all(step > 0.0 for step in fake.steps)
    assert fake.dt == DT


def test_without_spin_no_time_passes(fake: FakeJsbsim) -> None:
    fake.engine.settle(spin=False)
    assert fake.push == 64.0
    assert set(fake.steps) == {0.0}
    assert fake.dt == DT


def test_an_engine_that_never_settles_is_given_up(fake: FakeJsbsim) -> None:
    fake.run = lambda: (fake.steps.append(0.0), setattr(fake, "push", -fake.push))  # type: ignore[assignment,func-returns-value,method-assign]  # the one call that matters here
    fake.engine.settle(spin=True)
    assert 100 <= len(fake.steps) <= 1000
    assert fake.dt == DT
