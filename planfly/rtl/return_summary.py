"""Summarise returns to launch from a few points of a flight, for a line, a scene and pictures next to its verdict."""

from dataclasses import dataclass

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.measures.route_requirements import RouteRequirements
from logs.verdict.returns.drawn_returns import DrawnReturns, drawn_returns, drawn_returns_without_glides
from logs.verdict.returns.judge_glides import judge_glides
from logs.verdict.returns.judge_returns import Returns, ReturnWorld, judge_returns, make_return_world
from logs.verdict.returns.return_starts import ReturnStarts, flown_starts, planned_starts
from logs.verdict.returns.returns_text import headline, unjudged_parts_text
from world.errors import PlanflyError


def return_starts(
    setup: FlightSetup, track: Track | None, interval: float, requirements: RouteRequirements | None = None
) -> ReturnStarts:
    """Return the states from which returns start, on the flown track, or on the planned path without a flight.

    interval: time between two returns, s.
    requirements: the setup's route requirements if already known.
    """
    if track is not None and len(track):
        return flown_starts(setup, track, interval)
    return planned_starts(setup, interval, requirements)


# Number of returns in the summary and its pictures.
_SUMMARY_RETURN_COUNT = 50


@dataclass(frozen=True, slots=True)
class ReturnSummary:
    """Returns from a few points of a flight, simulated only with a point mass, to accompany its verdict.

    line: summary of all returns in a line; "" if no return can be judged.
    world, starts, returns: data of the returns; None if no return is judged.
    """

    line: str = ""
    world: ReturnWorld | None = None
    starts: ReturnStarts | None = None
    returns: Returns | None = None

    @property
    def has_failures(self) -> bool:
        """True if a return is unsafe."""
        returns = self.returns
        return returns is not None and bool(returns.each) and not (returns.safe or returns.undecided)

    def data_for_pictures(self) -> DrawnReturns | None:
        """Return the data for pictures of returns and glides, or None without judged returns.

        The computation of the glides takes a few seconds.
        """
        if self.world is None or self.starts is None or self.returns is None or not self.returns.each:
            return None
        return drawn_returns(self.world, self.starts, self.returns, judge_glides(self.world, self.starts))

    def drawn_returns_without_glides(self) -> DrawnReturns | None:
        """Return the data for pictures of returns without glides, or None without judged returns."""
        if self.world is None or self.starts is None or self.returns is None or not self.returns.each:
            return None
        return drawn_returns_without_glides(self.world, self.starts, self.returns)


def return_summary(
    setup: FlightSetup, track: Track | None, requirements: RouteRequirements | None = None
) -> ReturnSummary:
    """Judge returns from a few points of a flight or planned path.

    The summary is empty without home or terrain.

    requirements: the setup's route requirements if already known.
    """
    if setup.mission.home is None or setup.scenario.terrain is None:
        return ReturnSummary()
    try:
        world = make_return_world(setup)
        duration = setup.path.length / max(1.0, setup.airspeed)
        if track is not None and len(track):
            duration = float(track.time[-1] - track.time[0])
        interval = max(1.0, duration / _SUMMARY_RETURN_COUNT)
        starts = return_starts(setup, track, interval, requirements)
        returns = judge_returns(world, starts, interval)
    except PlanflyError as error:
        return ReturnSummary(f"not judged: {error}")
    is_replaced = world.stands_in and not world.uses_other_autopilot
    replacement_text = f" (simulated with ArduPlane in place of {setup.autopilot.title})" if is_replaced else ""
    return ReturnSummary(headline(returns) + replacement_text, world, starts, returns)


def return_law_lines(setup: FlightSetup) -> list[str]:
    """Return lines on the autopilot whose returns are simulated, their path, and their unjudged parts.

    Return [] for a mission without a home.
    """
    if setup.mission.home is None:
        return []
    world = make_return_world(setup)
    behaviour, unjudged = world.autopilot.returns, world.unjudged_parts
    lines = [f"returns to launch are simulated with a point-mass model under {world.autopilot.title}'s control laws"]
    lines += [behaviour.path_text] if behaviour.path_text else []
    if unjudged:
        extent = "in full" if world.is_simulated else "at all"
        lines.append(f"the returns are not judged {extent}: {unjudged_parts_text(unjudged)}")
    return lines


def returns_line(setup: FlightSetup, track: Track | None) -> str:
    """Return a line on the returns of a flight or of the planned path, or "" without a home or a terrain."""
    return return_summary(setup, track).line
