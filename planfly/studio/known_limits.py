"""An aircraft's limits that remember its performance at each airspeed they were asked for.

A verdict asks some hundred times, at the few airspeeds of a mission's legs, and the next place of a drag asks the same.
"""

from dataclasses import fields, replace

from aircraft.path_limits import Limits, PerformanceTable
from planfly.airframe import Airframe

# Airspeeds that are remembered: each leg that ArduPlane flies has a true one of its own.
_MOST = 4_000


class KnownLimits(Limits):
    """Limits as any other, quicker when they are asked again.

    >>> from planfly.airframe import load_airframe
    >>> from world.scenario import load_scenario
    >>> known = with_known_limits(load_airframe(load_scenario("tight"))).limits
    >>> known.performance(25.0) is known.performance(25.0)
    True
    """

    def _kept(self, name: str) -> dict[float | None, object]:
        kept: dict[float | None, object] = self.__dict__.setdefault(name, {})
        return kept

    def performance(self, airspeed: float | None = None) -> PerformanceTable:
        """As of `Limits`."""
        kept = self._kept("known_tables")
        found = kept.get(airspeed)
        if not isinstance(found, PerformanceTable):
            if len(kept) >= _MOST:
                kept.clear()
            found = kept[airspeed] = Limits.performance(self, airspeed)
        return found

    def surely(self) -> Limits:
        """As of `Limits`."""
        kept = self._kept("known_surely")
        found = kept.get(None)
        if not isinstance(found, Limits):
            envelope = self.envelope.surely()
            found = kept[None] = self if envelope is self.envelope else replace(self, envelope=envelope)
        return found


def with_known_limits(airframe: Airframe) -> Airframe:
    """An airframe whose limits remember."""
    limits = airframe.limits
    return replace(airframe, limits=KnownLimits(*(getattr(limits, one.name) for one in fields(limits))))
