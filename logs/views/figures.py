"""List the figures of a plan and its flight, for PNG files and for the HTML page.

Each figure has a module (`logs.views.profile`, ...) that builds its view: a description as plain data, which
matplotlib and the page both draw.  To add a figure, write its module and one entry here.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from flight.simulation.setup import FlightSetup
from flight.simulation.track import Track
from logs.verdict.measures.route_requirements import with_fence_zones
from logs.verdict.returns.drawn_returns import DrawnReturns
from logs.verdict.returns.glides_text import glides_headline
from logs.verdict.returns.returns_text import returns_headline
from logs.verdict.verdict import Verdict
from logs.views.charts import Chart, chart_json
from logs.views.envelope import envelope_chart
from logs.views.failures import collect_failures
from logs.views.glides import glide_chart
from logs.views.link import DrawnLink, compute_scenario_link, link_chart, link_map
from logs.views.map import MapChart, flight_map, map_json
from logs.views.moments import waypoint_names
from logs.views.profile import profile_chart
from logs.views.returns import return_heights_chart, returns_map, worst_returns_chart
from logs.views.scene import SceneView, scene_data
from logs.views.surveys import survey_chart
from logs.views.time_series import control_chart, energy_chart, exposure_chart, time_chart
from logs.views.turns import turn_chart
from world.wording import count_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

View = Chart | MapChart | SceneView


@dataclass(frozen=True, slots=True)
class Subject:
    """The flight or plan that the figures show.

    setup: setup whose scenario includes the zones of the mission's fence.
    track: track of at least one row; None for a plan that was not flown.
    returns: judged returns to launch; None if none were judged.
    link: the scenario's radio link; None without a link, or if it cannot be computed.
    """

    setup: FlightSetup
    track: Track | None
    verdict: Verdict
    returns: DrawnReturns | None = None
    link: DrawnLink | None = None

    @property
    def contents_text(self) -> str:
        """List of what a figure from above or from the side shows: ground, number of threats, and paths."""
        legs, threats = self.setup.route.legs, len(self.setup.scenario.threats)
        ground = "shaded terrain" if self.setup.scenario.terrain is not None else "no terrain"
        track_text = self.text_if_flown(" and the flown track")
        return f"{ground}, {count_text(threats, 'threat')}, the planned path of {count_text(legs, 'leg')}{track_text}."

    def text_if_flown(self, flight_text: str, plan_text: str = "") -> str:
        """Return `flight_text` for a flight, `plan_text` for a plan that was not flown."""
        return flight_text if self.track is not None else plan_text


@dataclass(frozen=True, slots=True)
class FigureEntry:
    """One figure.

    name: name of its section in the page, and of its file.
    title: its heading.
    make_view: function that builds its view, or returns None if there is nothing to draw.
    alternative: function that returns the description for readers who cannot see the figure.
    caption: function that returns the explanation below the figure.
    still: True if the page embeds the figure also as a picture, for readers without scripts.
    """

    name: str
    title: str
    make_view: Callable[[Subject], View | None]
    alternative: Callable[[Subject], str]
    caption: Callable[[Subject], str]
    still: bool = False


def _make_path_arguments(subject: Subject) -> dict[str, Any]:
    """Return the arguments that `flight_map` and `profile_chart` share: paths, verdict, numbering."""
    plan = subject.setup.plan
    return {
        "plan_waypoints": plan.waypoints if plan is not None else None,
        "route_waypoints": subject.setup.display_waypoints,
        "track": subject.track,
        "verdict": subject.verdict,
        "stops": subject.setup.route.stops.tolist(),
        "items": subject.setup.route.items.tolist(),
    }


def _make_flight_view(make_chart: Callable[[FlightSetup, Track], Chart | None]) -> Callable[[Subject], Chart | None]:
    """Turn `make_chart` into a function of a subject that returns None for a plan that was not flown."""
    return lambda subject: None if subject.track is None else make_chart(subject.setup, subject.track)


# Function that builds the view of each figure on simulated returns to launch, by the figure's name.
RETURN_FIGURES: dict[str, Callable[[FlightSetup, DrawnReturns, Track | None], View | None]] = {
    "returns": returns_map,
    "worst-returns": lambda setup, drawn, _: worst_returns_chart(setup, drawn),
    "return-heights": return_heights_chart,
    "glide": glide_chart,
}


def return_views(setup: FlightSetup, drawn_returns: DrawnReturns, track: Track | None) -> dict[str, View]:
    """Build the views of simulated returns to launch, keyed by figure name.

    Views without data are omitted.

    track: flown track; None if the returns start on the planned path.
    """
    setup = with_fence_zones(setup)
    views = ((name, make_view(setup, drawn_returns, track)) for name, make_view in RETURN_FIGURES.items())
    return {name: view for name, view in views if view is not None and drawn_returns.returns.each}


def _make_returns_view(name: str) -> Callable[[Subject], View | None]:
    """Make a function that builds the view of one of the `RETURN_FIGURES`.

    It returns None if no returns were judged.
    """

    def make_view(subject: Subject) -> View | None:
        """Build the figure's view; None if no returns were judged or there is nothing to draw."""
        if subject.returns is None or not subject.returns.returns.each:
            return None
        return RETURN_FIGURES[name](subject.setup, subject.returns, subject.track)

    return make_view


def _make_link_view(make_view: Callable[[FlightSetup, DrawnLink], View]) -> Callable[[Subject], View | None]:
    """Turn `make_view` into a function of a subject that returns None if the subject has no radio link."""
    return lambda subject: None if subject.link is None else make_view(subject.setup, subject.link)


def _make_fixed_caption(text: str) -> Callable[[Subject], str]:
    """Make a caption function that returns the same text for every subject."""
    return lambda _: text


def _make_sentence(line: str) -> str:
    """Return a line with a capital first letter, followed by a full stop and a space."""
    return f"{line[:1].upper()}{line[1:]}. "


# In the page's order.
FIGURES = (
    FigureEntry(
        "map",
        "Map",
        lambda subject: flight_map(
            subject.setup.scenario, **_make_path_arguments(subject), waypoint_texts=waypoint_names(subject.setup)
        ),
        alternative=lambda subject: f"Map, north up: {subject.contents_text}",
        caption=lambda subject: subject.text_if_flown(
            "The broad line is the plan, and the thin line on it is the flight."
            + (" At corners the two differ: the aircraft flies an arc." if subject.setup.imported_log is None else ""),
            "Nothing was flown: the line is the plan.",
        ),
        still=True,
    ),
    FigureEntry(
        "profile",
        "Profile",
        lambda subject: profile_chart(
            subject.setup.scenario,
            **_make_path_arguments(subject),
            above_ground=subject.setup.route.points["above_ground"],
        ),
        alternative=lambda subject: (
            "Heights along the path: terrain, required clearance, "
            f"{subject.text_if_flown('planned and flown', 'planned')} heights, the ceiling, "
            "and the missile and radar spheres that stand over the path."
        ),
        caption=lambda subject: (
            subject.text_if_flown("Flown heights are plotted at the flight's progress along the planned path. ")
            + (
                "A sphere appears where the path passes above or below it, or through it; the path "
                "is within reach only where its line is inside the sphere."
            )
        ),
        still=True,
    ),
    FigureEntry(
        "scene",
        "3-D view",
        lambda subject: SceneView(
            subject.setup, subject.track, collect_failures(subject.verdict, len(subject.setup.route.points))
        ),
        alternative=lambda subject: f"View from the side: {subject.contents_text}",
        caption=_make_fixed_caption(
            "Domes are the missiles' reach, dashed domes the radars' reach; thin poles join the "
            "ground and the waypoints. Parts behind a ridge are faint."
        ),
    ),
    FigureEntry(
        "turns",
        "Turn by turn, leg by leg",
        lambda subject: turn_chart(subject.setup.scenario.name, subject.verdict),
        alternative=_make_fixed_caption(
            "Bars, dots and dashes: planned value, flown value and limit of each turn, slope, "
            "height above ground, waypoint distance, and distance from the legs."
        ),
        caption=_make_fixed_caption(
            "Bar: planned. Dot: flown. Dash: limit (the tighter one of scenario and aircraft; "
            "for a waypoint, the distance within which it counts as reached). Ringed: fails."
        ),
    ),
    FigureEntry(
        "returns",
        "Returns to launch",
        _make_returns_view("returns"),
        alternative=_make_fixed_caption(
            "Map, north up: the route coloured by the outcome of a return from there, and the worst returns."
        ),
        caption=lambda subject: (
            ("" if subject.returns is None else _make_sentence(returns_headline(subject.returns.returns)))
            + "The worst returns are drawn; their numbers refer to the profiles below."
        ),
    ),
    FigureEntry(
        "worst-returns",
        "The worst returns",
        _make_returns_view("worst-returns"),
        alternative=_make_fixed_caption("Heights along the worst returns: terrain, required clearance and spheres."),
        caption=lambda subject: (
            "Simulated with "
            + ("the autopilot's" if subject.returns is None else f"the {subject.returns.returns.autopilot}")
            + " model on a point mass, in the mean wind, from the point where each return begins."
        ),
    ),
    FigureEntry(
        "return-heights",
        "Return to launch, or engine failure",
        _make_returns_view("return-heights"),
        alternative=_make_fixed_caption(
            "Over time: the flight's altitude coloured by the outcome of a return, the lowest "
            "altitude from which a return is safe, and the altitude to spare of a glide without "
            "the engine."
        ),
        caption=_make_fixed_caption(
            "The limit line is the lowest altitude from which a return is safe. Where a return "
            "from the flight's altitude is not safe, the line is the nearest safe altitude above the "
            "flight. Altitude to spare: the flight's altitude minus the altitude that a glide needs; below "
            "zero the glide does not arrive."
        ),
    ),
    FigureEntry(
        "glide",
        "Without its engine",
        _make_returns_view("glide"),
        alternative=_make_fixed_caption(
            "Map, north up: the lowest height from which the aircraft can glide home; flat ground suitable for a "
            "landing; and the route, coloured by what a glide from each point can reach."
        ),
        caption=lambda subject: (
            ("" if subject.returns is None else _make_sentence(glides_headline(subject.returns.glides)))
            + (
                "Blue: the lowest height above ground from which home or another chosen place is in "
                "reach, up to 3 km from the route. Flat ground is flat according to the elevation "
                "file, which contains no trees, houses or water."
            )
        ),
    ),
    FigureEntry(
        "survey",
        "Photo lines",
        _make_flight_view(survey_chart),
        alternative=_make_fixed_caption(
            "Each survey's photo lines from above: the usable parts, the lost parts, and the flown track."
        ),
        caption=_make_fixed_caption(
            "Broad line: flown on the photo line, level, at its height above ground and with the camera on. "
            "Marked line: lost. The axes have different scales."
        ),
    ),
    FigureEntry(
        "link-map",
        "Radio link",
        _make_link_view(link_map),
        alternative=_make_fixed_caption(
            "Map, north up: the path coloured by the margin of the radio link, the station, and the areas in which the "
            "link is weak or lost at the height of the flight."
        ),
        caption=lambda subject: (
            "".join(_make_sentence(finding.reason) for finding in subject.verdict.findings if finding.rule == "link")
            + "The areas show the link of an aircraft"
            + ("" if subject.link is None else f" at {subject.link.coverage.height.text}")
            + ", the median height of this flight."
        ),
    ),
    FigureEntry(
        "link",
        "Radio link over time",
        _make_link_view(link_chart),
        alternative=_make_fixed_caption(
            "Plots over time: margin of the radio link, diffraction loss, Fresnel clearance, and distance of the "
            "station."
        ),
        caption=_make_fixed_caption(
            "Link margin: strength of the signal above the fade margin. Fresnel clearance: height of the line of sight "
            "above the ground, in radii of the first Fresnel zone; below 0 the terrain hides the aircraft."
        ),
    ),
    FigureEntry(
        "time",
        "Over time",
        _make_flight_view(time_chart),
        alternative=_make_fixed_caption(
            "Plots over time: airspeed, bank, load factor, cross-track error, height error, height above ground."
        ),
        caption=_make_fixed_caption(
            "Cross-track and height error are errors of the guidance, relative to the path with "
            "rounded corners. Height above ground is computed from track and terrain."
        ),
    ),
    FigureEntry(
        "exposure",
        "Exposure",
        _make_flight_view(exposure_chart),
        alternative=_make_fixed_caption(
            "Plots along the flown distance: strength and sum of the exposure to missiles and to radars."
        ),
        caption=_make_fixed_caption(
            "Strength is the sum over all units of (scale/distance)⁴ inside their reach: 1 where "
            "distance equals scale (Yang, Tang and Lozano 2014, eq. 9 and 10, as a density). The panels "
            "“so far” show the integral of the strength over time."
        ),
    ),
    FigureEntry(
        "controls",
        "Controls",
        _make_flight_view(control_chart),
        alternative=_make_fixed_caption(
            "Plots over time: elevator, aileron, rudder and throttle, commanded and actual, with their limits."
        ),
        caption=_make_fixed_caption("Shaded: the command is at the control's limit (saturated)."),
    ),
    FigureEntry(
        "energy",
        "Energy",
        _make_flight_view(energy_chart),
        alternative=_make_fixed_caption(
            "Plots over time: battery energy used, power, current, and the aircraft's energy as a height."
        ),
        caption=_make_fixed_caption(
            "Energy height: height plus airspeed²/2g. Its slope is the climb that the motor provides."
        ),
    ),
    FigureEntry(
        "envelope",
        "Envelope",
        lambda subject: envelope_chart(subject.setup, subject.track),
        alternative=_make_fixed_caption(
            "Path angle over airspeed with the steepest climbs and descents, and bank over airspeed with its limit."
        ),
        caption=_make_fixed_caption(
            "Lines: the steepest steady climb and descent of the aircraft, from trims of its "
            "model. A dot may be outside for a moment, in a gust or a pull-up; a leg may not."
        ),
    ),
)


def make_subject(
    setup: FlightSetup, track: Track | None, verdict: Verdict, returns: DrawnReturns | None = None
) -> Subject:
    """Collect the data that the figures of a flight or a plan show.

    The zones of the mission's fence are added to the setup, and the radio link is computed.

    track: track of the flight; None, or a track without rows, for a plan that was not flown.
    returns: judged returns to launch; None if none were judged.
    """
    track = track if track is not None and len(track) else None
    setup = with_fence_zones(setup)
    return Subject(setup, track, verdict, returns, compute_scenario_link(setup, track))


def figure_views(subject: Subject) -> dict[str, View]:
    """Build the views of a flight or a plan, keyed by figure name; figures without data are omitted.

    >>> from logs.recording.example_log import example_log
    >>> from logs.verdict.judge_geometry import judge_geometry
    >>> setup = example_log().setup
    >>> list(figure_views(make_subject(setup, None, judge_geometry(setup))))
    ['map', 'profile', 'scene', 'turns', 'envelope']
    """
    views = ((entry.name, entry.make_view(subject)) for entry in FIGURES)
    return {name: view for name, view in views if view is not None}


def draw(view: View) -> "Figure":
    """Draw a view of any type with matplotlib.

    Matplotlib is imported only here, because its import takes most of a second.
    """
    from logs.views.draw_map import draw_map
    from logs.views.draw_scene import draw_scene
    from logs.views.drawing import draw_chart

    if isinstance(view, MapChart):
        return draw_map(view)
    return draw_scene(view) if isinstance(view, SceneView) else draw_chart(view)


def view_json(view: View) -> dict[str, Any]:
    """Convert a view of any type to JSON data for the HTML page."""
    if isinstance(view, MapChart):
        return map_json(view)
    return scene_data(view) if isinstance(view, SceneView) else chart_json(view)


def draw_figures(setup: FlightSetup, track: Track | None, verdict: Verdict) -> dict[str, "Figure"]:
    """Draw the figures of a flight or a plan, keyed by figure name; figures without data are omitted."""
    return {name: draw(view) for name, view in figure_views(make_subject(setup, track, verdict)).items()}


def draw_pictures(views: Mapping[str, View], *, svg: bool = False) -> dict[str, bytes]:
    """Render views as PNG files, 1500 pixels wide.

    Return the bytes of each file, keyed by file name (`map.png`).

    views: views keyed by figure name.
    svg: True to render each figure as an SVG file (`map.svg`), too.
    """
    from logs.views.drawing import png_bytes, svg_bytes

    figures = {name: draw(view) for name, view in views.items()}
    files = {f"{name}.png": png_bytes(figure) for name, figure in figures.items()}
    if svg:
        files |= {f"{name}.svg": svg_bytes(figure) for name, figure in figures.items()}
    return files
