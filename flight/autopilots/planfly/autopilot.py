"""Implement planfly's own guidance, which follows the fly-by path by one of three lateral laws."""

from dataclasses import dataclass
from typing import ClassVar, Self

from aircraft.catalog import Aircraft
from flight.autopilots.autopilot import AnswerName, Autopilot, StoredAutopilot
from flight.autopilots.gust_height import gust_displacement
from flight.autopilots.parts import ControlLaw, Deviations, TurnRules
from flight.autopilots.planfly.law import LAWS, planfly_loop, planfly_tick
from flight.guidance.gains import GAINS_FILE, load_gains
from world.kernels import Record
from world.scenario_tables import FlightTable, Guidance

_LAW_NAMES = {
    "path": "planfly's guidance on the fly-by path",
    "l1": "L1 along the legs, as in ArduPlane",
    "vector-field": "Beard and McLain's vector field on the fly-by path",
}


@dataclass(frozen=True)
class PlanflyGuidance(Autopilot):
    """Planfly's guidance, whose flight shows what the aircraft itself can do.

    guidance: lateral law, as in `[flight] guidance`.
    """

    name: ClassVar = "planfly"
    title: ClassVar = "planfly's guidance"
    answer_name: ClassVar[AnswerName] = "airframe"
    guidance: Guidance = "path"

    @classmethod
    def load(cls, table: FlightTable, aircraft: Aircraft, scenario: str) -> Self:
        """Return the guidance with the lateral law that a [flight] table states."""
        return cls(table.steering.guidance)

    @classmethod
    def restore(cls, stored: StoredAutopilot) -> Self:
        """Return the guidance that a log stores."""
        return cls(stored.guidance)

    def store(self) -> StoredAutopilot:
        """Return the lateral law for a log."""
        return StoredAutopilot(self.guidance)

    @classmethod
    def missing_files(cls, aircraft: Aircraft) -> list[str]:
        """Return a sentence on the gains file if the aircraft's folder lacks it; an empty list otherwise.

        Every lateral law needs the gains. Raises FlightError if the file is invalid.
        """
        if (aircraft.folder / GAINS_FILE).exists():
            load_gains(aircraft)
            return []
        return [f"{aircraft.folder / GAINS_FILE}: missing; planfly's guidance needs the gains of {aircraft.name}"]

    @property
    def control_law(self) -> ControlLaw:
        """Control law of the guidance, for all three lateral laws."""
        return ControlLaw(planfly_tick, planfly_loop, initialise=self._initialise)

    def _initialise(self, guidance: Record, record: Record) -> None:
        """Store the lateral law in the guidance memory."""
        guidance.lateral_law = LAWS[self.guidance]

    def describe(self, aircraft: str) -> str:
        """Return a description of the guidance with its lateral law."""
        return _LAW_NAMES[self.guidance]

    @property
    def turns(self) -> TurnRules:
        """Rules of turns; the laws "l1" and "vector-field" may pass a waypoint at any distance."""
        return TurnRules(keeps_to_arcs=self.guidance == "path")

    @property
    def deviations(self) -> Deviations:
        """Deviations of the guidance: it loses altitude in downdrafts, and otherwise follows its path exactly.

        In updrafts the guidance dives and flies faster, so it gains no altitude.
        """
        return Deviations(gust_sink=gust_displacement)
