"""Predict a logged flight as bands of 95 %, and measure which part of the flight is inside the bands."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, Unpack

import numpy as np

from aircraft.catalog import Aircraft, find_aircraft
from aircraft.identification.blind import DRAWS, Band, BlindPrediction, band_limits, uninformative_note
from aircraft.identification.estimate import estimate_clocks
from aircraft.identification.flight_record import FlightRecord
from flight.dynamics.fdm import Variation
from logs.importers.motion import MotionLog
from logs.importers.motion_log import read_motion
from logs.recording.reader import read_log
from planfly.api.api_function import api_function
from planfly.api.identifying import read_records_and_outputs
from planfly.api.imported import read_imported
from planfly.arguments import check_arguments
from planfly.campaigns.campaign_base import TURBULENCE_LEVELS, with_aircraft_draws
from planfly.campaigns.dispersions import default_dispersions, draw_flight
from planfly.flight_logs import is_log
from planfly.flight_options import LogOptions, option_defaults
from planfly.identification.base_numbers import varied_model
from planfly.identification.records import MIN_CHECK_SECONDS
from planfly.kernel_units.unit_kernels import FLYING
from planfly.runtime.stages import stage
from planfly.workflow.imported_flights import DrawnFlight, fly_draws
from planfly.workflow.output_paths import PREDICT_FILES, check_output_folder, clean_folder
from world.errors import LogError, PlanflyError
from world.extras import requires_extra
from world.files import read_toml, write_atomically
from world.scenario_tables import names_folder
from world.wording import count_text

# Inputs with which the model flies: the logged controls, or the autopilot's model with the logged mission.
PredictBy = Literal["controls", "mission"]
# Seed of the draws.
_SEED = 68
# Standard deviation of each component of the mean wind of a log, m/s. Without a sideslip vane an error of the heading
# of 3 degrees at 17 m/s is 0.9 m/s of wind on straight flight, and an error of the airspeed of 2 % is 0.3 m/s; the wind
# changes by about 0.4 m/s over minutes.  The root of the sum of their squares is 1.0.
LOGGED_WIND_SD_MPS = 1.0
# Name, unit and factor of each quantity of a flight by its mission, by the field of its profile.
_PROFILE_QUANTITIES = {
    "cross_track": ("cross-track", "m", 1.0),
    "height_error": ("height", "m", 1.0),
    "ground_speed": ("ground speed", "m/s", 1.0),
    "airspeed": ("airspeed", "m/s", 1.0),
    "bank": ("bank", "deg", math.degrees(1.0)),
    "throttle": ("throttle", "%", 100.0),
    "power": ("power", "W", 1.0),
}


@dataclass(frozen=True, slots=True)
class Predicted:
    """Result of `planfly.predict`.

    by: "controls" if the logged controls were followed, "mission" if the autopilot's model flew the logged mission.
    bands: band of each quantity, with the flight; over time, s, or over the distance along the legs, m.
    draws: number of flights that make the bands.
    windows: number of judged windows; 0 by the mission.
    start, end: judged part of the log, s.
    source: file of the log.
    aircraft: name of the aircraft.
    heading: line with the predicted part of the log, the inputs of the model and the number of flights.
    lines: description in lines, the heading first.
    files: written files.
    leg_ends: distance along the legs at which each ends, m; empty by the controls.
    """

    by: PredictBy
    bands: tuple[Band, ...]
    draws: int
    windows: int
    start: float
    end: float
    source: str
    aircraft: str
    heading: str
    lines: tuple[str, ...]
    files: tuple[Path, ...] = ()
    leg_ends: tuple[float, ...] = ()


@requires_extra("identification")
@api_function(*FLYING)
def predict(
    log: str | Path,
    out: str | Path | None = None,
    *,
    by: PredictBy | None = None,
    start: float | None = None,
    overwrite: bool = False,
    **options: Unpack[LogOptions],
) -> Predicted:
    """Predict a logged flight as bands of 95 % with a model that has not seen it.

    The result states which fraction of the flight lies inside each band.

    log: a log as `import_log` and `identify_aircraft` read it, or a flight log that `import_log` wrote.
    out: a folder for a page and a picture; None writes no files.  overwrite: True replaces results in the folder.
    by: "controls" follows the logged controls over windows of 2 s; "mission" flies the logged mission with the
    autopilot's model in the logged wind; None for the controls if the log has them.
    start: start of the judged part, s of the log, only with ``by="controls"``; the rows before it calibrate the bands.
    None takes the end of the part from which the aircraft was identified, or the middle of a log that was not used.
    aircraft: name or folder of the aircraft, which is required.  The other options are those of `import_log`.
    Raises a `planfly.PlanflyError` for bad input; then nothing is written.
    """
    if options["aircraft"] is None:
        raise PlanflyError.of_argument("aircraft", None, "name the aircraft that predicts the flight", shown="")
    check_arguments(start=start)
    if out is not None:
        check_output_folder(Path(out), overwrite)
    name = str(options["aircraft"])
    aircraft = find_aircraft(str(Path(name).resolve()) if names_folder(name) else name)
    path = Path(log)
    motion = None
    if by != "mission" and not is_log(path):
        try:
            motion = read_motion(path)
        except LogError:
            if by == "controls":
                raise
    if motion is not None and (len(motion.inertial.time) < 2 or len(motion.surface_commands.time) < 2):
        if by == "controls":
            raise LogError(f"{path}: no inertial sensors or no controls; predict it by its mission", file=path)
        motion = None
    if by == "controls" and motion is None:
        reason = "a flight log of planfly has no inertial sensors; predict it by its mission"
        raise LogError(f"{path}: {reason}", file=path)
    if motion is not None:
        defaults = option_defaults(LogOptions)
        for option, value in options.items():
            if option != "aircraft" and value != defaults[option]:
                allowed = "only for a prediction by mission; this one follows the logged controls"
                raise PlanflyError.of_argument(option, value, allowed)
        predicted = _predict_by_controls(motion, aircraft, start)
    elif start is not None:
        allowed = "only for a prediction by controls; a prediction by mission judges every leg that was followed"
        raise PlanflyError.of_argument("start", start, allowed)
    else:
        predicted = _predict_by_mission(path, aircraft, options)
    files: tuple[Path, ...] = ()
    if out is not None:
        folder = clean_folder(out, PREDICT_FILES, overwrite=True)
        with stage("drawing", "drawing a prediction"):
            # Imported here: only pictures need matplotlib.
            from logs.views.drawing import draw_chart, png_bytes
            from logs.views.prediction import band_chart
            from logs.views.report.prediction import prediction_page

            title = f"{Path(predicted.source).name}, predicted by {predicted.aircraft}"
            chart = band_chart(predicted.bands, title, by_time=predicted.by == "controls")
            page, picture = (folder / name for name in PREDICT_FILES)
            write_atomically(picture, png_bytes(draw_chart(chart)))
            write_atomically(page, prediction_page(predicted.heading, predicted.bands, chart).encode())
            files = page, picture
    return replace(predicted, files=files)


# ----------------------------------------------------------------------
# By the logged controls.


def _predict_by_controls(motion: MotionLog, aircraft: Aircraft, start: float | None) -> Predicted:
    """Predict a flight from its logged controls, over windows of 2 s.

    start: start of the judged part, s of the log; None for the default of `_choose_judged_start`.
    Raises LogError if there is too little usable flight before or after the start.
    """
    with stage("reading a log"):
        records, _ = read_records_and_outputs(motion, aircraft, MIN_CHECK_SECONDS)
    start = _choose_judged_start(motion, aircraft, records, start)
    earlier = [part for record in records if len((part := record.part_between(-math.inf, start)).time) > 1]
    judged_records = [part for record in records if len((part := record.part_between(start, math.inf)).time) > 1]
    for parts, side in ((earlier, "before"), (judged_records, "from")):
        seconds = sum(part.seconds for part in parts)
        if seconds < MIN_CHECK_SECONDS:
            allowed = f"at least {MIN_CHECK_SECONDS:g} s of usable flight are needed before and after this time"
            message = f"{motion.source}: {seconds:.1f} s of usable flight {side} {start:.1f} s: {allowed}"
            raise LogError(message, file=motion.source, field="start", value=start, allowed=allowed)
    with stage("predicting") as advance:
        central = varied_model(aircraft, Variation())
        clocks = estimate_clocks(earlier, central)[-1]
        prediction = BlindPrediction(earlier, judged_records, clocks, central)
        models = []
        for number, draw in enumerate(draw_flight_variations(aircraft), 1):
            models.append(varied_model(aircraft, draw.variation))
            advance(number, DRAWS, f"aircraft {number} of {DRAWS}")
        bands = prediction.bands(models)
    before, count = prediction.windows
    end = float(judged_records[-1].time[-1])
    heading = (
        f"{motion.source} by the logged controls: {count_text(count, 'window')} of 2 s from {start:.1f} s to"
        f" {end:.1f} s, {DRAWS} flights each; the model's errors are drawn from"
        f" {count_text(before, 'window')} before {start:.1f} s"
    )
    lines = (heading, *_format_band_lines(bands))
    return Predicted("controls", bands, DRAWS, count, start, end, motion.source, aircraft.name, heading, lines)


def _choose_judged_start(
    motion: MotionLog, aircraft: Aircraft, records: Sequence[FlightRecord], start: float | None
) -> float:
    """Return the start of the judged part, s of the log.

    The default is the end of the part from which the aircraft was identified, or the middle of a log that was not used
    for the identification.  Raises LogError if the aircraft was identified from the whole log, and PlanflyError for a
    start within the part from which it was identified.

    records: usable segments of the log.
    """
    first_time, last_time = motion.inertial.time[[0, -1]].tolist()
    used = None
    file = aircraft.folder / "posterior.toml"
    if file.is_file():
        # The log is recognised by the hash of its data; parts that end before its first time are ignored.
        entries = [log for log in read_toml(file, "uncertainty").get("log", []) if log.get("sha256") == motion.sha256]
        ends = [end for entry in entries if (end := float(entry.get("until_s", math.inf))) > first_time]
        used = max(ends, default=None)
    if used is None:
        return float(np.median(np.concatenate([record.time for record in records]))) if start is None else start
    if used >= last_time:
        allowed = "identify it with --until S, and predict the rest"
        message = f"{motion.source}: {aircraft.name} was identified from the whole log: {allowed}"
        raise LogError(message, file=motion.source, field="aircraft", value=aircraft.name, allowed=allowed)
    if start is not None and start < used:
        allowed = f"expected at least {used:g} s, because {aircraft.name} was identified from the rows before this time"
        raise PlanflyError.of_argument("start", start, allowed)
    return used if start is None else start


def draw_flight_variations(aircraft: Aircraft, count: int = DRAWS) -> list[DrawnFlight]:
    """Sample variations of aircraft, wind, turbulence and position, one set for each simulated flight.

    The quantities are drawn as in a campaign with planfly's own dispersions, with two differences: the wind varies by
    the error of a logged wind instead of a forecast, and all levels of turbulence are equally likely.  The position
    offset represents the error of the logged positions.
    """
    dispersions = with_aircraft_draws(default_dispersions(), aircraft)
    generator = np.random.default_rng(_SEED)
    winds = LOGGED_WIND_SD_MPS * generator.standard_normal((count, 2))
    levels = generator.integers(len(TURBULENCE_LEVELS), size=count).tolist()
    flights = []
    for index, level in enumerate(levels):
        draw = draw_flight(dispersions, _SEED, index)
        properties = () if dispersions.draws is None else dispersions.draws.properties(draw.seed)
        values = draw.values
        variation = Variation(
            mass=values["mass"], drag=values["drag"], control=values["control_power"], properties=properties
        )
        north, east = winds[index].tolist()
        offset = (values["start_east"], values["start_north"], values["start_up"])
        flights.append(DrawnFlight(variation, (north, east), TURBULENCE_LEVELS[level], draw.seed, offset))
    return flights


# ----------------------------------------------------------------------
# By the logged mission.


def _predict_by_mission(path: Path, aircraft: Aircraft, options: LogOptions) -> Predicted:
    """Predict a flight by flying its logged mission many times with sampled variations.

    Raises LogError for a log of a flight that planfly itself simulated.
    """
    if is_log(path):
        log = read_log(path)
        setup, track = log.setup, log.track
        if setup.imported_log is None:
            message = f"{path}: the flight was flown by planfly itself: expected a log that `planfly import` wrote"
            raise LogError(message, file=path)
    else:
        flight = read_imported(path, **options)
        setup, track = flight.setup, flight.track
    name = str(aircraft.folder) if not aircraft.is_embedded else aircraft.name
    with stage("flying by draws") as advance:
        flights = fly_draws(setup, track, name, draw_flight_variations(aircraft), advance)
    # The bands are over the distance along the legs.
    flown_profile, bands = flights[0].flown, []
    for field, (quantity, unit, factor) in _PROFILE_QUANTITIES.items():
        low, high = band_limits(np.stack([factor * getattr(flight.model, field) for flight in flights]))
        bands.append(Band(quantity, unit, flights[0].distance, low, high, factor * getattr(flown_profile, field)))
    stretch = flights[0].stretch
    heading = (
        f"{path} by its mission: {stretch.mode} from {stretch.start:.1f} s to {stretch.end:.1f} s, {len(flights)} of"
        f" {DRAWS} flights with other aircraft, wind and turbulence; no band is fitted to the log"
    )
    lines = (heading, *_format_band_lines(bands))
    ends = tuple(flights[0].ends.tolist())
    return Predicted(
        "mission",
        tuple(bands),
        len(flights),
        0,
        stretch.start,
        stretch.end,
        str(path),
        aircraft.name,
        heading,
        lines,
        leg_ends=ends,
    )


def _format_band_lines(bands: Sequence[Band]) -> list[str]:
    """Return a line for each band: the fraction of the flight inside the band, and the band's width."""
    lines = []
    for band in bands:
        if math.isnan(band.inside):
            lines.append(f"  {band.name:<12} not in the log")
            continue
        unchanged = "" if math.isnan(band.unchanged) else f" (if the value did not change: ±{band.unchanged:.3g})"
        width = f"band of ±{band.half_width:.3g} {band.unit} at the median"
        part = "" if band.known_fraction > 0.995 else f"{100.0 * band.known_fraction:.0f} % of "
        lines.append(f"  {band.name:<12} {100.0 * band.inside:.1f} % of {part}the flight inside, {width}{unchanged}")
    note = uninformative_note(bands)
    return [*lines, f"  {note}"] if note else lines
