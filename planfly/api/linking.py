"""Judge the radio link between a ground station and an aircraft along a mission or a flight."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Unpack

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.recording.reader import FlightLog
from logs.verdict.findings import Finding
from logs.verdict.measures.link_outages import LinkAlongPath, link_along_path, station_antenna
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.measures.track_alignment import align_track
from logs.verdict.rules.link_rule import link_findings
from planfly.api.flying import FlownMission, judge
from planfly.arguments import check_arguments, parse_position
from planfly.flight_options import LogOptions, takes_options
from planfly.kernel_units.unit_kernels import FLYING
from planfly.runtime.first_start import with_warm_up
from planfly.runtime.stages import stage
from planfly.workflow.output_paths import LINK_FILES, check_output_folder, clean_folder
from planner.plan import Plan
from world.arrays import Floats
from world.errors import ArgumentError
from world.files import write_atomically
from world.scenario import with_link

# Entries of [link] that a scenario without this table needs.
_NEEDED = ("frequency", "power", "sensitivity")


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class LinkResult:
    """Result of `planfly.link`.

    setup: the flown mission, in a scenario with the link.
    finding: the verdict's finding on the link.
    along: the link once a second along the flight; None if it cannot be computed.
    antenna: position of the station's antenna, (3,) m; None without `along`.
    files: files written; empty if no folder was named.
    """

    setup: FlightSetup
    finding: Finding
    along: LinkAlongPath | None = None
    antenna: Floats | None = None
    files: tuple[Path, ...] = ()

    @property
    def outage_lines(self) -> tuple[str, ...]:
        """One line for each outage of the link, in order of time."""
        if self.along is None:
            return ()
        lines = []
        for outage in self.along.outages:
            is_lost = (self.along.time >= outage.start) & (self.along.time <= outage.end)
            margin = self.along.points.margin[is_lost]
            worst_text = f", at worst {-float(margin.min()):.1f} dB" if margin.size else ""
            lines.append(
                f"{outage.start:.0f} to {outage.end:.0f} s: {outage.duration:.0f} s below the fade margin{worst_text}"
            )
        return tuple(lines)

    def __repr__(self) -> str:
        return f"<LinkResult {self.setup.scenario.name}: {self.finding.reason}>"


@with_warm_up(*FLYING)
@takes_options
def link(
    what: FlightLog | FlownMission | Plan | str | Path,
    *,
    frequency: float | None = None,
    power: float | None = None,
    sensitivity: float | None = None,
    station: tuple[float, float] | None = None,
    antenna: float | None = None,
    fade_margin: float | None = None,
    out: str | Path | None = None,
    overwrite: bool = True,
    **options: Unpack[LogOptions],
) -> LinkResult:
    """Judge the radio link to the ground station along a flight; a plan or a mission is flown first.

    what: a `Plan`, or the path of a plan.json, .waypoints or .plan; or a flight, which is a result of `planfly.fly`, a
    flight log or its path, or an autopilot's log.
    A scenario's [link] describes the link; these replace its entries, None keeps them:
    frequency: MHz.
    power: output power of the transmitter, dBm.
    sensitivity: sensitivity of the receiver, dBm.
    station: latitude and longitude of the station's antenna, degrees; by default the antenna stands at the mission's
    home.
    antenna: height of the station's antenna above ground, m.
    fade_margin: required power above the sensitivity, dB.
    out: folder for pictures of the link over time and on the map; None writes none.  overwrite: True replaces them.
    options: see `planfly.judge`.
    Raises a `planfly.PlanflyError` for bad input, and for a scenario without [link] if frequency, power or sensitivity
    is missing.

    >>> import planfly
    >>> flown = planfly.fly(planfly.plan("jacksboro-air", seed=1))
    >>> found = planfly.link(flown, frequency=915, power=27, sensitivity=-105, station=(36.3, -84.2))
    >>> found.finding.ok
    False
    """
    lat, lon = (None, None) if station is None else parse_position("station", station)
    entries: dict[str, Any] = {
        "frequency_mhz": frequency,
        "power_dbm": power,
        "sensitivity_dbm": sensitivity,
        "lat_deg": lat,
        "lon_deg": lon,
        "antenna_m": antenna,
        "fade_margin_db": fade_margin,
    }
    check_arguments(frequency=frequency, power=power, sensitivity=sensitivity, antenna=antenna, fade_margin=fade_margin)
    if out is not None:
        check_output_folder(Path(out), overwrite)
    judged = judge(what, **options)
    if judged.setup.scenario.link is None:
        required_values = dict(zip(_NEEDED, (frequency, power, sensitivity), strict=True))
        missing = next((name for name, value in required_values.items() if value is None), None)
        if missing is not None:
            raise ArgumentError.of_argument(missing, "missing", "expected a number, or a scenario with [link]")
    setup = judged.setup.in_scenario(with_link(judged.setup.scenario, **entries))
    result = _judge_link(setup, judged.track)
    return result if out is None else _with_pictures(result, Path(out), overwrite=overwrite)


def _with_pictures(result: LinkResult, folder: Path, *, overwrite: bool) -> LinkResult:
    """Write the pictures of a link into a folder, and return the result with their files."""
    if result.along is None or result.antenna is None:
        return result
    # Imported here: only pictures need matplotlib.
    from logs.views.figures import View, draw_pictures
    from logs.views.link import link_chart, link_map

    setup = result.setup
    with stage("drawing", "drawing a link"):
        views: dict[str, View] = {
            "link": link_chart(setup, result.along),
            "link-map": link_map(setup, result.along, result.antenna),
        }
        pictures = draw_pictures(views)
    clean_folder(folder, LINK_FILES, overwrite=overwrite)
    for name in LINK_FILES:
        write_atomically(folder / name, pictures[name])
    return replace(result, files=tuple(folder / name for name in LINK_FILES))


def _judge_link(setup: FlightSetup, track: Track | None) -> LinkResult:
    """Judge the radio link of a scenario along a track.

    Without a track or terrain the finding is undecided, and the result has no link along the path.
    """
    with stage("computing the radio link"):
        requirements = route_requirements(setup)
        aligned = None if track is None else align_track(requirements, track)
        (finding,) = link_findings(requirements, aligned)
        link_of_scenario, terrain = setup.scenario.link, setup.scenario.terrain
        antenna = None
        if terrain is not None and link_of_scenario is not None:
            antenna = station_antenna(setup, link_of_scenario, terrain)
        if track is None or not len(track) or terrain is None or link_of_scenario is None or antenna is None:
            return LinkResult(setup, finding)
        along = link_along_path(link_of_scenario, terrain, antenna, track.time, track.position)
        return LinkResult(setup, finding, along, antenna)
