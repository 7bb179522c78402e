"""Implement planfly's own guidance as an autopilot that follows the fly-by path by one of three lateral laws."""

from dataclasses import dataclass
from typing import ClassVar, Self

from aircraft.catalog import Aircraft
from flight.autopilots.autopilot import Autopilot, Level, Loop, StoredAutopilot, Tick
from flight.autopilots.gust_height import height_in_gusts
from flight.autopilots.planfly.law import LAWS, planfly_loop, planfly_tick
from flight.guidance.gains import GAINS_FILE, load_gains
from world.kernels import Record
from world.scenario_tables import FlightTable, Guidance
from world.wind import Turbulence

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
    level: ClassVar[Level] = "airframe"
    guidance: Guidance = "path"

    @classmethod
    def load(cls, table: FlightTable, aircraft: Aircraft, scenario: str) -> Self:
        """Return the guidance of a [flight] table; a table with parameters names another autopilot."""
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
        """Return a sentence if the gains file is missing; its gains tune the inner loops of every lateral law."""
        if (aircraft.folder / GAINS_FILE).exists():
            load_gains(aircraft)
            return []
        return [f"{aircraft.folder / GAINS_FILE}: missing; {aircraft.name} does not fly without gains"]

    @property
    def tick(self) -> Tick:
        """Compiled function for one tick, for all three lateral laws."""
        return planfly_tick

    @property
    def loop(self) -> Loop:
        """Compiled simulation loop of the guidance and the aircraft model."""
        return planfly_loop

    def initialise_records(self, guidance: Record, record: Record) -> None:
        """Set the lateral law in the guidance memory."""
        guidance.lateral_law = LAWS[self.guidance]

    def gust_sink(self, climb_reserve: float, turbulence: Turbulence) -> float:
        """Return the altitude loss in a downdraft with an exceedance probability of 1 %, m.

        Updrafts do not lift the aircraft, because the guidance dives and flies faster.
        """
        return height_in_gusts(climb_reserve, turbulence)

    def described(self, aircraft: str) -> str:
        """Return a description of the lateral law."""
        return _LAW_NAMES[self.guidance]

    @property
    def keeps_to_arcs(self) -> bool:
        """False for the reference laws, which may pass a waypoint at any distance."""
        return self.guidance == "path"
