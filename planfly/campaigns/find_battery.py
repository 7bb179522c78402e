"""Find the smallest battery with which a mission and its returns keep the reserve.

It is found by many flights and their returns to launch.

Each flight of a campaign is flown with a battery that does not run empty, and needs the largest of two energies: the
energy used at the end of the mission, and the highest energy used at the end of any return to launch.  The capacity
that covers a flight is this energy divided by the usable fraction of the battery and by the flight's drawn battery
factor.  The battery is the quantile of the capacities of all flights.
"""

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flight.simulation.simulate import Flight, fly_to_end
from flight.simulation.track import Track
from logs.verdict.measures.route_requirements import predicted_energy, route_requirements
from logs.verdict.returns.judge_returns import Returns, judge_returns, make_return_world
from logs.verdict.returns.return_starts import flown_starts
from logs.verdict.tolerances import ENERGY_RESERVE_FRACTION
from planfly.campaigns.campaign_base import CampaignBase, GivenWind, VariedFlight, vary_flight
from planfly.campaigns.dispersions import draw_flight
from planfly.campaigns.flight_requests import FlightRequest
from planfly.campaigns.flight_row import FlightRow, Outcome
from planfly.campaigns.statistics.decision import Interval
from planfly.campaigns.worker_pool import Workers, worker_pool
from planfly.runtime.stages import Advance
from world.arrays import Floats
from world.errors import PlanflyError

# Default number of flights.
DEFAULT_BATTERY_FLIGHTS = 100
# Capacity with which no flight ends early, Wh.
_ENDLESS_BATTERY_WH = 1e9
# Largest relative change of the capacity from one campaign to the next at which the battery's mass is settled.
_CAPACITY_TOLERANCE = 0.005
# Maximum number of campaigns in the search for the battery's mass.
_MAX_ROUNDS = 8
# Range of the aircraft's mass relative to its stated mass.  A heavier aircraft would be another one.  A lighter
# aircraft is flown with the lowest mass, which is safe because it needs more energy.
MIN_MASS_FACTOR = 0.6
_MAX_MASS_FACTOR = 1.5
# End reason of a flight that flew its mission to the end.
_COMPLETED = "completed"


@dataclass(frozen=True, slots=True)
class BatteryGoal:
    """Goal of a search for a battery.

    probability: probability with which the reserve is to be kept.
    confidence: confidence of the interval of the capacity.
    flights: number of flights of each campaign.
    interval: time between the starts of two simulated returns, s.
    reserve: fraction of the battery that is to be left.
    specific_energy: energy per battery mass, Wh/kg; None if the mass does not change with the battery.
    """

    probability: float = 0.95
    confidence: float = 0.95
    flights: int = DEFAULT_BATTERY_FLIGHTS
    interval: float = 10.0
    reserve: float = ENERGY_RESERVE_FRACTION
    specific_energy: float | None = None


@dataclass(frozen=True, slots=True)
class EnergyRow(FlightRow):
    """Row of a flight with the energies that it and its simulated returns to launch use.

    mission_energy: energy used at the end of the mission, Wh.
    return_energy: highest energy used at the end of a return, Wh; inf if a return does not reach its loiter, for
        example against the wind; NaN if no return's energy is known.
    return_time: start of this return, s.
    return_leg: number of the leg on which this return starts, as in messages; -1 without a return.
    leg_energies: energy used on each leg, Wh, by leg number; all legs around a loiter have one number.
    battery_factor: drawn factor on the battery's capacity.
    blocked_returns: number of returns that end at terrain, a zone or a threat; a larger battery would not help them.
    unknown_returns: number of returns whose energy is unknown, because they leave the terrain data.
    """

    mission_energy: float = math.nan
    return_energy: float = math.nan
    return_time: float = math.nan
    return_leg: int = -1
    leg_energies: tuple[float, ...] = ()
    battery_factor: float = 1.0
    blocked_returns: int = 0
    unknown_returns: int = 0

    def required_capacity(self, reserve: float) -> float:
        """Return the smallest nominal capacity that leaves the reserve in this flight and its returns, Wh.

        It is inf if a return does not arrive with any battery, and NaN if an energy is unknown.

        reserve: fraction of the battery that is to be left.
        """
        if self.unknown_returns and not math.isinf(self.return_energy):
            return math.nan
        return float(np.fmax(self.mission_energy, self.return_energy)) / ((1.0 - reserve) * self.battery_factor)

    @property
    def is_decided_by_return(self) -> bool:
        """True if a return needs more energy than the mission."""
        return self.return_energy > self.mission_energy


def fly_for_energy(
    base: CampaignBase, index: int, wind: GivenWind | None = None, *, interval: float, mass_factor: float
) -> EnergyRow:
    """Fly one flight of a campaign with an endless battery, and return its row.

    Its returns to launch are simulated, too.

    The row has no energies if the flight does not complete the mission.

    index: number of the flight, from 0.
    wind: mean wind that replaces the scenario's wind; None for the scenario's wind.
    interval: time between the starts of two returns, s.
    mass_factor: mass of the aircraft with its battery, relative to the stated mass.
    """
    draw = draw_flight(base.dispersions, base.seed, index)
    endless = replace(base, uav=replace(base.uav, battery=_ENDLESS_BATTERY_WH))
    varied = vary_flight(endless, draw, wind)
    variation = varied.off_nominal.variation
    variation = replace(variation, mass=variation.mass * mass_factor)
    flight = Flight(varied.setup, varied.uav.aircraft, variation, start_offset=varied.off_nominal.start_offset)
    flown_mission = fly_to_end(flight)
    track = flown_mission.track
    outcome: Outcome = "flyable" if flown_mission.ended == _COMPLETED else "not flyable"
    row = EnergyRow(draw=draw, outcome=outcome, ended=flown_mission.ended, battery_factor=draw.values["battery"])
    if flown_mission.ended != _COMPLETED or not len(track):
        return row
    energy = track.energy.astype(np.float64)
    row = replace(
        row,
        mission_energy=float(energy.max()),
        duration=float(track.time[-1]),
        leg_energies=tuple(
            np.bincount(varied.setup.route.leg_numbers_of(track.leg[1:]), weights=np.diff(energy)).tolist()
        ),
    )
    return _with_returns(row, varied, track, interval)


def _with_returns(row: EnergyRow, varied: VariedFlight, track: Track, interval: float) -> EnergyRow:
    """Return the row with energy and start of the simulated return to launch that needs the most energy.

    Without a home the row is returned unchanged.  The point mass of a simulated return does not know the drawn mass and
    drag, gusts and turns.  The energy of a return is therefore multiplied by a ratio from the mission of this flight:
    its flown energy divided by its predicted energy.
    interval: time between the starts of two returns, s.
    """
    if varied.setup.mission.home is None:
        return row
    predicted, _ = predicted_energy(route_requirements(varied.setup))
    ratio = row.mission_energy / predicted if predicted > 0.0 else 1.0
    returns: Returns = judge_returns(
        make_return_world(varied.setup), flown_starts(varied.setup, track, interval), interval
    )
    failed_kinds = Counter(ret.kind for ret in returns.each if math.isnan(ret.time_to_loiter))
    lost_returns = [ret for ret in returns.each if ret.kind == "lost"]
    arriving = [ret for ret in returns.each if math.isfinite(ret.time_to_loiter)]
    row = replace(
        row,
        unknown_returns=failed_kinds["unknown"] + failed_kinds["low"],
        blocked_returns=failed_kinds["ground"] + failed_kinds["threat"] + failed_kinds["zone"],
    )
    if not lost_returns and not arriving:
        return row
    worst_return = (
        lost_returns[0] if lost_returns else max(arriving, key=lambda ret: ret.energy_used + ratio * ret.energy)
    )
    worst_row = min(len(track) - 1, int(np.searchsorted(track.time, worst_return.time)))
    leg = int(varied.setup.route.leg_numbers_of(track.leg[worst_row : worst_row + 1])[0])
    needed = math.inf if lost_returns else worst_return.energy_used + ratio * worst_return.energy
    return replace(row, return_energy=needed, return_time=worst_return.time, return_leg=leg)


class CapacityRange(NamedTuple):
    """Confidence interval of a capacity, Wh."""

    low: float
    high: float


class BatteryDecision(NamedTuple):
    """Part that decides the capacity in some flights.

    It is the end of the mission, or the returns that start on one leg.

    flights: number of flights in which this part needs the most energy.
    leg: number of the leg on which the deciding return starts, as in messages; -1 for the end of the mission.
    time: median start of these returns, s; NaN for the end of the mission.
    """

    flights: int
    leg: int
    time: float


@dataclass(frozen=True, slots=True, repr=False)
class BatteryResult:
    """Result of `planfly.battery`.

    capacity: smallest capacity that keeps the reserve with the probability, Wh; inf if no battery does, because returns
        do not arrive, or because the energy that it adds is needed for its own mass; NaN if it is unknown.
    interval: interval of `capacity` with the goal's confidence, Wh; its upper end is inf if there are too few flights.
    own_capacity: capacity of the aircraft's battery, Wh.
    is_guessed: True if the aircraft's model and the scenario state no capacity, so that `own_capacity` is only a guess.
    kept: number of flights in which the aircraft's own battery keeps the reserve, at the stated mass.
    rows: the flights with the found battery's mass.
    mass_factor: mass of the aircraft with the found battery, relative to its stated mass.
    mass: stated mass, kg.
    volts: nominal voltage of the battery, V; 0 if unknown.
    has_returns: False if the autopilot's returns are not simulated, so that the battery covers only the mission.
    files: written files.
    """

    goal: BatteryGoal
    base: CampaignBase
    capacity: float
    interval: CapacityRange
    own_capacity: float
    is_guessed: bool
    kept: int
    rows: tuple[EnergyRow, ...]
    mass_factor: float
    mass: float
    volts: float
    has_returns: bool = True
    files: tuple[Path, ...] = ()

    def __repr__(self) -> str:
        return f"<BatteryResult {self.base.name}: {self.capacity:.0f} Wh>"

    @property
    def completed(self) -> tuple[EnergyRow, ...]:
        """Rows of the flights that completed the mission with a known energy."""
        return tuple(row for row in self.rows if row.mission_energy > 0.0)

    @property
    def own_probability(self) -> Interval:
        """Bounds of the probability that the aircraft's own battery suffices, at the goal's confidence."""
        from scipy import stats

        two_sided = 1.0 - 2.0 * (1.0 - self.goal.confidence)
        low, high = stats.binomtest(self.kept, max(1, len(self.rows))).proportion_ci(two_sided, method="exact")
        return Interval(float(low), float(high))

    @property
    def is_enough(self) -> bool | None:
        """True if the aircraft's battery keeps the reserve with the required probability; None if not known."""
        if self.is_guessed or math.isnan(self.capacity) or not self.has_returns:
            return None
        if self.own_probability.low >= self.goal.probability:
            return True
        return False if self.own_probability.high < self.goal.probability else None

    @property
    def known(self) -> tuple[EnergyRow, ...]:
        """Rows of the flights that completed the mission, and whose returns have known energies."""
        return tuple(row for row in self.completed if not math.isnan(row.required_capacity(self.goal.reserve)))

    @property
    def decisions(self) -> tuple[BatteryDecision, ...]:
        """Parts that decide the capacity in some flights, the most frequent first."""
        # Key -1 stands for flights that are decided by the mission, not by a return.
        times_by_leg: dict[int, list[float]] = {}
        for row in self.completed:
            leg = row.return_leg if row.is_decided_by_return else -1
            times_by_leg.setdefault(leg, []).append(row.return_time)
        decisions = []
        for leg, times in sorted(times_by_leg.items(), key=lambda entry: -len(entry[1])):
            median_time = float(np.median(times)) if leg >= 0 else math.nan
            decisions.append(BatteryDecision(len(times), leg, median_time))
        return tuple(decisions)

    @property
    def leg_energies(self) -> Floats:
        """Median energy of each leg number, Wh, (legs,), over the flights that complete the mission.

        The shape is (0,) if no flight completes the mission.
        """
        rows = [row.leg_energies for row in self.completed]
        if not rows:
            return np.zeros(0)
        leg_count = max(map(len, rows))
        # A leg that a flight did not record took no energy.
        energies = np.zeros((len(rows), leg_count))
        for k, row in enumerate(rows):
            energies[k, : len(row)] = row
        return np.median(energies, axis=0)


def find_battery(base: CampaignBase, goal: BatteryGoal, workers: Workers, advance: Advance) -> BatteryResult:
    """Find the smallest battery that keeps the reserve in the flights of a campaign.

    If the mass changes with the battery, the campaign is repeated until the capacity no longer changes: with the same
    draws, and with the mass of the battery that the previous campaign found.
    Raises PlanflyError for an aircraft that burns fuel.
    """
    aircraft = base.uav.aircraft
    if not aircraft.battery_voltage > 0.0:
        raise PlanflyError(
            f"{base.name}: {aircraft.name} burns fuel: expected an electric aircraft",
            field="aircraft",
            value=aircraft.name,
        )
    own_capacity = base.uav.battery
    rows = fly_energy_campaign(base, goal, workers, 1.0, advance)
    kept_count = sum(row.required_capacity(goal.reserve) <= own_capacity for row in rows)
    capacity, interval = quantile_of_capacities(rows, goal)
    mass_factor = 1.0
    if goal.specific_energy is not None and math.isfinite(capacity):
        for _ in range(_MAX_ROUNDS):
            assumed_capacity = capacity
            mass_factor = 1.0 + (assumed_capacity - own_capacity) / goal.specific_energy / aircraft.mass
            mass_factor = max(MIN_MASS_FACTOR, mass_factor)
            if mass_factor > _MAX_MASS_FACTOR:
                capacity, interval = math.inf, CapacityRange(math.inf, math.inf)
                break
            rows = fly_energy_campaign(base, goal, workers, mass_factor, advance)
            capacity, interval = quantile_of_capacities(rows, goal)
            change = abs(capacity - assumed_capacity)
            if not math.isfinite(capacity) or change <= _CAPACITY_TOLERANCE * assumed_capacity:
                break
    setup = base.nominal_setup()
    envelope = setup.envelope
    return BatteryResult(
        goal=goal,
        base=base,
        capacity=capacity,
        interval=interval,
        own_capacity=own_capacity,
        is_guessed=envelope.battery_guessed and base.scenario.flight.battery_wh is None,
        kept=kept_count,
        rows=rows,
        mass_factor=mass_factor,
        mass=aircraft.mass,
        volts=envelope.volts or 0.0,
        has_returns=setup.mission.home is None or make_return_world(setup).is_simulated,
    )


def fly_energy_campaign(
    base: CampaignBase, goal: BatteryGoal, workers: Workers, mass_factor: float, advance: Advance
) -> tuple[EnergyRow, ...]:
    """Fly the flights of a campaign; return their rows with the used energies in the order of the draws.

    mass_factor: factor on the mass of the aircraft's model.
    advance: called after each flight with the number of flights done, their total and a text.
    A flight whose worker died has no row.
    """
    indices: Iterator[int] = iter(range(goal.flights))

    def next_request() -> FlightRequest | None:
        """Return the request of the next flight; None if all flights are requested."""
        index = next(indices, None)
        return None if index is None else FlightRequest(index)

    fly = partial(fly_for_energy, interval=goal.interval, mass_factor=mass_factor)
    rows: dict[int, EnergyRow] = {}
    with worker_pool(workers, base, fly) as pool:
        for count, finished in enumerate(pool.fly(next_request), 1):
            advance(count, goal.flights, f"{count} of {goal.flights} flights")
            if isinstance(finished.row, EnergyRow):
                rows[finished.request.index] = finished.row
    return tuple(rows[index] for index in sorted(rows))


def quantile_of_capacities(rows: tuple[EnergyRow, ...], goal: BatteryGoal) -> tuple[float, CapacityRange]:
    """Return the capacity that keeps the reserve with the goal's probability, Wh.

    Also return its confidence interval.

    The capacity is a quantile of the capacities that the flights need; its interval follows from order statistics.
    The capacity or a bound is inf if no battery is enough.  All three are NaN if too few flights have a known energy to
    reach the goal's probability.

    rows: the flights, each with its energies.
    """
    from scipy import stats

    capacities = np.array([row.required_capacity(goal.reserve) for row in rows if row.mission_energy > 0.0])
    needed = np.minimum(capacities[~np.isnan(capacities)], _ENDLESS_BATTERY_WH)
    if len(needed) < 2 or len(needed) < goal.probability * len(rows):
        return math.nan, CapacityRange(math.nan, math.nan)
    capacity = float(np.quantile(needed, goal.probability, method="median_unbiased"))
    low, high = stats.quantile_test(needed, p=goal.probability).confidence_interval(goal.confidence)
    largest = float(needed[needed < _ENDLESS_BATTERY_WH].max(initial=0.0))
    bounds = [float(low) if math.isfinite(low) else 0.0, float(high) if math.isfinite(high) else math.inf]
    # A quantile interpolated between the largest capacity and infinity is infinite: no battery is enough.
    capacity, *bounds = (math.inf if value > largest else value for value in (capacity, *bounds))
    return capacity, CapacityRange(*bounds)
