"""Judge the radio link between a ground station and an aircraft along a mission or a flight."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple, Unpack

import numpy as np

from flight.simulation.setup import FlightSetup
from logs.recording.reader import FlightLog
from logs.verdict.findings import Finding
from logs.verdict.measures.link_outages import LinkAlongPath
from logs.verdict.measures.route_requirements import route_requirements
from logs.verdict.measures.track_alignment import align_track, flown_phases
from logs.verdict.returns.judge_returns import Returns
from logs.verdict.returns.returns_text import return_range_text
from logs.verdict.rules.link_rule import duration_text, judge_link, period_text
from logs.verdict.wording import place_text
from planfly.api.api_function import api_function
from planfly.api.flying import judge
from planfly.arguments import check_arguments, parse_position
from planfly.flight_options import LinkOptions, select_log_and_mission_options
from planfly.kernel_units.unit_kernels import FLYING
from planfly.rtl.jsbsim_returns import fly_return
from planfly.runtime.stages import stage
from planfly.workflow.open_flight import with_ground_at_station
from planfly.workflow.output_paths import check_output_folder, replace_files
from planfly.workflow.pipeline import FlownMission
from planner.plan import Plan
from world.arrays import Floats
from world.errors import ArgumentError
from world.frames import to_geo
from world.scenario import with_link

# Entry of [link] that each option replaces; `station` replaces the position.
_ENTRIES = {
    "frequency": "frequency_mhz",
    "power": "power_dbm",
    "sensitivity": "sensitivity_dbm",
    "antenna": "antenna_m",
    "station_gain": "station_gain_dbi",
    "aircraft_gain": "aircraft_gain_dbi",
    "cable_loss": "cable_loss_db",
    "fade_margin": "fade_margin_db",
    "max_outage": "max_outage_s",
    "use": "use",
}
# Options without which a scenario without [link] has no link.
_NEEDED = ("frequency", "power", "sensitivity")


class WorstPoint(NamedTuple):
    """Point of an outage with the smallest margin.

    margin: signal above the fade margin, dB; negative.
    lat_deg, lon_deg: position of the aircraft.
    """

    margin: float
    lat_deg: float
    lon_deg: float


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class LinkResult:
    """Result of `planfly.link`.

    setup: the flown mission, in a scenario with the link.
    finding: the verdict's finding on the link.
    along: the link once a second along the flight; None if it cannot be computed.
    antenna: position of the station's antenna, (3,) m; None without `along`.
    where: leg with the least margin; "" if no margin is known.
    returns: the autopilot's returns to launch from the outages, judged as by `planfly.returns`; None if there are none.
    files: files written; empty if no folder was named.
    """

    setup: FlightSetup
    finding: Finding
    along: LinkAlongPath | None = None
    antenna: Floats | None = None
    where: str = ""
    returns: Returns | None = None
    files: tuple[Path, ...] = ()

    @property
    def worst_points(self) -> tuple[WorstPoint, ...]:
        """Worst point of each outage, in order of time; () if the link was not judged along a path."""
        if self.along is None:
            return ()
        points = []
        for outage in self.along.outages:
            is_lost = (self.along.time >= outage.start) & (self.along.time <= outage.end)
            margins = np.where(is_lost & np.isfinite(self.along.points.margin), self.along.points.margin, np.inf)
            k = int(np.argmin(margins))
            lat, lon = to_geo(self.setup.scenario.origin, *self.along.positions[k, :2].tolist())
            points.append(WorstPoint(float(margins[k]), float(lat), float(lon)))
        return tuple(points)

    @property
    def outage_lines(self) -> tuple[str, ...]:
        """One line for each outage of the link, in order of time."""
        outages = () if self.along is None else self.along.outages
        return tuple(
            f"{period_text(outage)}: the signal is below the fade margin for {duration_text(outage.duration)}, by up to"
            f" {-worst_point.margin:.1f} dB at {worst_point.lat_deg:.6f}, {worst_point.lon_deg:.6f}"
            for outage, worst_point in zip(outages, self.worst_points, strict=True)
        )

    @property
    def return_lines(self) -> tuple[str, ...]:
        """One line for each period of the outages whose returns have the same outcome, the worst first.

        () if no returns were simulated.
        """
        if self.returns is None:
            return ()
        return tuple(
            f"return from {return_range_text(return_range, self.returns, self.setup.scenario)}"
            for return_range in self.returns.ranges
        )

    def __repr__(self) -> str:
        return f"<LinkResult {self.setup.scenario.name}: {self.finding.reason}>"


@api_function(*FLYING)
def link(
    what: FlightLog | FlownMission | Plan | str | Path,
    *,
    out: str | Path | None = None,
    overwrite: bool = True,
    **options: Unpack[LinkOptions],
) -> LinkResult:
    """Judge the radio link to the ground station along a flight; a plan or a mission is flown first.

    what: a `Plan`, or the path of a plan.json, .waypoints or .plan; or a flight, which is a result of `planfly.fly`, a
    flight log or its path, or an autopilot's log.
    out: folder for pictures of the link over time and on the map, and for the coverage as a GeoTIFF; None writes no
    files.  overwrite: True replaces existing files.
    options: see `planfly.judge`.  The following options replace entries of the scenario's [link]:
    frequency: MHz.  power, sensitivity: power of the transmitter and sensitivity of the receiver, dBm.
    station: latitude and longitude of the station's antenna, degrees; the mission's home by default.
    antenna: height of the station's antenna above ground, m.
    station_gain, aircraft_gain: dBi.  cable_loss, fade_margin: dB.
    max_outage: longest accepted time below the fade margin, s.
    use: "telemetry" or "control" (the remote control).
    Raises a `planfly.PlanflyError` for bad input, and for a scenario without [link] if frequency, power or sensitivity
    is missing.

    >>> import planfly
    >>> flown = planfly.fly(planfly.plan("jacksboro-air", seed=1))
    >>> found = planfly.link(flown, frequency=915, power=27, sensitivity=-105, station=(36.3, -84.2))
    >>> found.finding.ok
    False
    """
    station = options["station"]
    link_options = {name: value for name, value in options.items() if name in _ENTRIES}
    check_arguments(**link_options)
    lat, lon = (None, None) if station is None else parse_position("station", station)
    if out is not None:
        check_output_folder(Path(out), overwrite)
    judged_flight = judge(what, **select_log_and_mission_options(options))
    if judged_flight.setup.scenario.link is None:
        missing = next((name for name in _NEEDED if link_options[name] is None), None)
        if missing is not None:
            raise ArgumentError.of_argument(
                missing, None, "missing; state it, or name a scenario with [link]", shown=""
            )
    entries = {_ENTRIES[name]: value for name, value in link_options.items()}
    scenario = with_link(judged_flight.setup.scenario, **entries, lat_deg=lat, lon_deg=lon)
    setup = judged_flight.setup.in_scenario(with_ground_at_station(scenario, judged_flight.setup.mission))
    scenario_link, track = setup.scenario.link, judged_flight.track
    if scenario_link is None:
        raise ValueError("the scenario has no link")
    # As in the verdict.  If the track, the terrain or the position of the station is missing, the finding is undecided.
    with stage("computing the radio link"):
        requirements, aligned = route_requirements(setup), None
        if track is not None and len(track) and setup.imported_log is None:
            requirements, aligned = flown_phases(requirements, track)
        elif track is not None and len(track):
            aligned = align_track(requirements, track)
        judged_link = judge_link(requirements, aligned, scenario_link, fly_again=fly_return)
    where = "" if judged_link.leg is None else place_text(judged_link.leg)
    result = LinkResult(setup, judged_link.finding, judged_link.along, judged_link.antenna, where, judged_link.returns)
    if out is None or result.along is None or result.antenna is None:
        return result
    # Imported here: only pictures need matplotlib.
    from logs.views.exports.coverage_file import coverage_geotiff
    from logs.views.figures import View, draw_pictures
    from logs.views.link import compute_link, link_chart, link_map

    with stage("drawing", "drawing a link"):
        drawn = compute_link(setup, result.along, result.antenna, is_flown=True)
        if drawn is None:
            return result
        views: dict[str, View] = {"link": link_chart(setup, drawn), "link-map": link_map(setup, drawn)}
        files = draw_pictures(views)
        files["link-coverage.tif"] = coverage_geotiff(drawn.coverage, setup.scenario.origin)
    return replace(result, files=replace_files(Path(out), files, overwrite=overwrite))
