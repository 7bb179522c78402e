"""A running engine in a JSBSim model: its speed is a state of its own, which settles before anything is measured."""

from collections.abc import Callable
from typing import Any

import numpy as np

from flight.dynamics.jsbsim_properties import RATES

# An engine's speed settles in steps of this, s; at most so many; rates within this, ft/s^2 and rad/s^2, are steady.
_SETTLE_STEP, _SETTLE_STEPS, _SETTLED = 0.2, 300, 1e-10
_RATE_STEPS = 6


class Engine:
    """A running engine that can be let turn until it is steady, while the aircraft stands still in its flow of air.

    fdm: the JSBSim instance.  dt: s, of its flight.  getter, setter: of its properties.
    """

    def __init__(self, fdm: Any, dt: float, getter: Callable[[str], Any], setter: Callable[[str], Any]) -> None:
        self._exec, self._dt = fdm, dt
        kinds = ("rate/rotational", "rate/translational", "position/rotational", "position/translational")
        names = [f"simulation/integrator/{kind}" for kind in kinds]
        self._integrators = [setter(name) for name in names]
        self._usual = [getter(name)() for name in names]
        self._rates = [getter(name) for name in RATES[:6]]
        self._freeze = setter("propulsion/fuel_freeze")
        self._start = setter("propulsion/set-running")
        self._running = False

    def hold(self) -> None:
        """Stop the motion of the aircraft and the use of fuel; start the engine if it does not run."""
        for integrator in self._integrators:
            integrator(0.0)
        self._freeze(1.0)
        if not self._running:
            self._exec.run_ic()
            self._start(-1.0)
            self._running = True

    def settle(self, *, spin: bool) -> None:
        """Let the engine take up its speed for the air and the throttle that are set; it keeps its speed without spin.

        Without spin, only what follows its own derivative (the lift of a changing angle of attack) settles.
        """
        self._exec.set_dt(_SETTLE_STEP if spin else 0.0)
        before = np.zeros(6)
        for _ in range(_SETTLE_STEPS if spin else _RATE_STEPS):
            self._exec.run()
            now = np.array([rate() for rate in self._rates])
            if np.abs(now - before).max() < _SETTLED:
                break
            before = now
        self._exec.set_dt(self._dt)

    def release(self) -> None:
        """Let everything move again."""
        for integrator, usual in zip(self._integrators, self._usual, strict=True):
            integrator(usual)
        self._freeze(0.0)
