"""Identify an aircraft from its flight logs."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aircraft.catalog import Aircraft, check_new_folder, find_aircraft, read_aircraft, write_aircraft_folder
from aircraft.identification.estimate import Estimate, estimate_model, score_predictions
from aircraft.identification.flight_record import FlightRecord
from aircraft.identification.prediction import PredictedLog
from logs.importers.motion import MotionLog
from logs.importers.motion_log import read_motion
from planfly.api.api_function import api_function
from planfly.arguments import check_arguments
from planfly.identification.base_numbers import base_model, scale_base_model
from planfly.identification.checks import check_battery, check_commands, check_estimate, check_power
from planfly.identification.folder import Identified, make_folder_files, make_identification
from planfly.identification.model_text import check_base
from planfly.identification.propulsion_check import PowerConflict
from planfly.identification.records import (
    AMPLE_HZ,
    LEFT,
    MIN_CHECK_SECONDS,
    MIN_HZ,
    MIN_SECONDS,
    describe_recording_setting,
    find_slowest_log_rate,
    flight_records,
    log_outputs,
)
from planfly.identification.servos import ServoOutput, read_servos
from planfly.identification.wide_quantities import WideQuantity, wide_quantities
from planfly.runtime.stages import stage
from planfly.workflow.data_sheets import parse_sheet
from world.arrays import Floats
from world.errors import FlightError, LogError, PlanflyError
from world.extras import requires_extra
from world.files import absolute_path
from world.scenario_tables import names_folder

# Maximum ratio of the stated mass or span to the base's mass or span, or its inverse, for which the base is a usable
# prior.
_MAX_SIZE_RATIO = 1.6
# Allowed range and unit of each stated number, for small aircraft.
_RANGES = {"mass": (0.3, 50.0, "kg"), "span": (0.4, 10.0, "m"), "area": (0.03, 10.0, "m2")}


@dataclass(frozen=True, slots=True)
class SlowLog:
    """A log with few rows of inertial sensors or servo outputs.

    source: the file.
    hertz: rows per second.
    setting: the autopilot parameter with the value that records more rows.
    """

    source: str
    hertz: float
    setting: str


@dataclass(frozen=True, slots=True)
class IdentifiedAircraft:
    """Result of `planfly.identify_aircraft`.

    aircraft: the aircraft as written to its folder.
    estimate: estimate of each parameter, with covariance.
    climb: lower end, estimate and upper end (95 %) of the climb angle at cruise and full throttle, degrees.
    sink: lower end, estimate and upper end (95 %) of the sink angle at cruise and idle, degrees.
    power: lower end, estimate and upper end (95 %) of the power of level flight at cruise, W.
    predicted: predictions of the check log, or of `logs` without one, up to a second ahead: by constant rates, by the
    base and by the identified model.
    without_current: logs without battery current, if other logs have it; then the current of no log is used.
    slow: logs with few rows per second.
    wide: numbers with a wide interval, each with the flight that would narrow the interval.
    conflict: conflict of drag and power, which widens the interval of the power; None without one.
    """

    aircraft: Aircraft
    estimate: Estimate
    climb: tuple[float, float, float]
    sink: tuple[float, float, float]
    power: tuple[float, float, float]
    predicted: PredictedLog
    without_current: tuple[str, ...] = ()
    slow: tuple[SlowLog, ...] = ()
    wide: tuple[WideQuantity, ...] = ()
    conflict: PowerConflict | None = None


@requires_extra("identification")
@api_function()
def identify_aircraft(
    logs: str | Path | Sequence[str | Path],
    folder: str | Path,
    *,
    mass: float,
    span: float,
    area: float | None = None,
    battery: str | None = None,
    base: str | Path = "aerosonde",
    check: str | Path | None = None,
    until: float | None = None,
    overwrite: bool = False,
) -> IdentifiedAircraft:
    """Make the folder of an aircraft from flight logs of ArduPlane or PX4.

    logs: `.BIN` or `.ulg` of one aircraft with one mass, with inertial sensors and servo outputs.
    folder: the folder to make, with a list of uncertain properties.  overwrite: True replaces an aircraft's folder.
    mass: mass in flight, kg.  span: wing span, m.  area: wing area, m^2; None takes the ratio of area to squared span
    from the base.
    battery: volts and capacity, "44.4V,888Wh"; None takes the battery of the base.
    base: the most similar aircraft, by name or folder; it supplies every property that the logs do not show.
    until: end of the part of each log that is used, s of the log; `planfly.predict` judges the rest.
    check: a log that is not among `logs`, to predict with the base and the identified model; a minute is enough.
    Raises a `planfly.PlanflyError` for logs that cannot be used; then nothing is written.
    """
    check_arguments(until=until)
    target = check_new_folder(Path(folder), overwrite=overwrite)
    paths = [Path(path) for path in ([logs] if isinstance(logs, str | Path) else logs)]
    if not paths:
        raise PlanflyError.of_argument("logs", "", "expected at least one log", shown="")
    prior = _load_base(base)
    stated_numbers = {"mass": mass, "span": span, **({} if area is None else {"area": area})}
    _check_stated_numbers(stated_numbers, prior)
    stated_numbers.setdefault("area", prior.wing_area * (span / prior.wing_span) ** 2)
    if battery is None:
        volts, energy = prior.battery_voltage, prior.battery_energy
    else:
        sheet = parse_sheet({}, battery=battery, prop=None, layout=None)
        volts, energy = sheet.volts, sheet.energy
    base_numbers = scale_base_model(base_model(prior), **stated_numbers, volts=volts)
    check_base(prior)
    with stage(f"reading {len(paths)} log{'s' if len(paths) > 1 else ''}", "reading logs"):
        motion_logs = [read_motion(path) for path in paths]
        check_motion = None if check is None else read_motion(Path(check))
        all_motion = [*motion_logs, *([] if check_motion is None else [check_motion])]
        for number, log in enumerate(all_motion):
            for earlier_log in all_motion[:number]:
                overlap = min(log.span[1], earlier_log.span[1]) - max(log.span[0], earlier_log.span[0])
                if log.sha256 == earlier_log.sha256 and overlap > 0.0:
                    allowed = "name each log only once, and use another log to check the result"
                    message = f"{log.source}: has the same bytes as {earlier_log.source}: {allowed}"
                    raise LogError(message, file=log.source, allowed=allowed)
        log_parts = [(log, *read_records_and_outputs(log, prior, until=until)) for log in motion_logs]
        checked = [] if check_motion is None else read_records_and_outputs(check_motion, prior, MIN_CHECK_SECONDS)[0]
    records = [record for _, stretches, _ in log_parts for record in stretches]
    check_battery(records, volts)
    check_commands(records)
    log, _, outputs = log_parts[-1]
    with stage("estimating"):
        has_fast_rows = all(find_slowest_log_rate(motion_log) >= MIN_HZ for motion_log, _, _ in log_parts)
        estimate = estimate_model(records, base_numbers, dynamics=has_fast_rows)
        # Logs of PX4 and tables of columns contain the controls themselves, not servo outputs.
        has_outputs = log.program_kind not in ("px4", "columns")
        servo_outputs = log_outputs(log, prior).items() if has_outputs else ()
        check_estimate(estimate, base_numbers, {name: servo.output for name, servo in servo_outputs}, log.source)
        check_power(estimate, records, base_numbers)
        identified = make_identification(prior, base_numbers, estimate, motion_logs, outputs, until)
        files = make_folder_files(identified, target.name, (volts, energy))
    with stage("predicting"):
        predicted = score_predictions(estimate, checked or records, base_numbers, prior.name)
    with stage("drawing", "drawing an identification"):
        files["identify.html"] = _report_page(identified, predicted, check, target.name)
    write_aircraft_folder(target, {name: text.encode() for name, text in files.items()})
    return _make_result(read_aircraft(target), identified, predicted, records)


def _make_result(
    aircraft: Aircraft, identified: Identified, predicted: PredictedLog, records: Sequence[FlightRecord]
) -> IdentifiedAircraft:
    """Return the result of an identification.

    It has the aircraft's performance and the deficiencies of the logs.

    aircraft: the aircraft as read from its new folder.
    records: usable segments of the logs.
    """
    climb, sink, power = _compute_performance_intervals(identified)
    return IdentifiedAircraft(
        aircraft=aircraft,
        estimate=identified.estimate,
        climb=climb,
        sink=sink,
        power=power,
        predicted=predicted,
        without_current=find_logs_without_current(records),
        slow=find_slow_logs(identified.logs),
        wide=_find_wide_numbers(identified),
        conflict=identified.power_conflict(),
    )


def _load_base(base: str | Path) -> Aircraft:
    """Load the base of an identification (the aircraft that it starts from), by name or folder.

    Raises FlightError for an aircraft that was itself identified, or that burns fuel.
    """
    text = str(base.absolute()) if isinstance(base, Path) else base
    aircraft = find_aircraft(absolute_path(Path(text)) if names_folder(text) else text)
    if (aircraft.folder / "posterior.toml").is_file():
        allowed = "this aircraft was itself identified from flight logs; name the `base` that its posterior.toml states"
        raise FlightError.of_argument("base", str(base), allowed)
    if aircraft.battery_voltage == 0.0:
        allowed = "expected an electric aircraft; engines that burn fuel cannot be identified"
        raise FlightError.of_argument("base", str(base), allowed)
    return aircraft


def _check_stated_numbers(stated_numbers: dict[str, float], prior: Aircraft) -> None:
    """Raise FlightError for a stated number that is implausible, or too different from the base aircraft.

    Each must be in `_RANGES`, and mass and span within a factor of `_MAX_SIZE_RATIO` of the base aircraft.

    prior: the base aircraft.
    """
    for name, value in stated_numbers.items():
        min_value, max_value, unit = _RANGES[name]
        if isinstance(value, bool) or not isinstance(value, int | float) or not min_value <= value <= max_value:
            raise FlightError.of_argument(
                name, value, f"allowed {min_value:g}..{max_value:g} {unit}", shown=f"{value} {unit}"
            )
    for name, value, base_value in (
        ("mass", stated_numbers["mass"], prior.mass),
        ("span", stated_numbers["span"], prior.wing_span),
    ):
        if not 1.0 / _MAX_SIZE_RATIO <= value / base_value <= _MAX_SIZE_RATIO:
            min_value, max_value = base_value / _MAX_SIZE_RATIO, base_value * _MAX_SIZE_RATIO
            unit = _RANGES[name][2]
            allowed = f"allowed {min_value:.3g}..{max_value:.3g} {unit} with the base {prior.name}"
            advice = "for another size make a `base` from a data sheet (planfly aircraft --new FOLDER)"
            raise FlightError.of_argument(name, value, f"{allowed}; {advice}", shown=f"{value:g} {unit}")


def read_records_and_outputs(
    log: MotionLog, prior: Aircraft, min_seconds: float = MIN_SECONDS, until: float | None = None
) -> tuple[list[FlightRecord], dict[str, ServoOutput]]:
    """Return the flight records of a log, and the servo outputs with which they were read, by name.

    The servo outputs of the base are used if all of them match the log, and otherwise the servo outputs of the log.
    PX4, tables of columns and aircraft with elevons, whose mixer is part of the model, always use the outputs of the
    base.

    prior: the base aircraft.

    min_seconds: shortest usable flight, s.
    until: end of the part that is used, s of the log; None for the whole log.
    """
    end = math.inf if until is None else until
    file = prior.folder / "ardupilot.toml"
    base_outputs = read_servos(file) if file.is_file() else {}
    if log.program_kind in ("px4", "columns"):
        return flight_records(log, prior, min_seconds=min_seconds, until=end), dict(base_outputs)
    outputs = log_outputs(log, prior)
    if LEFT in outputs:
        return flight_records(log, prior, outputs, min_seconds, end), dict(base_outputs)
    is_same = base_outputs.keys() == outputs.keys()
    for name in outputs if is_same else ():
        first, second = base_outputs[name], outputs[name]
        is_same &= first.output == second.output
        is_same &= (first.pulse[0], first.pulse[-1]) == (second.pulse[0], second.pulse[-1])
        # Both outputs move the surface in the same direction.
        is_same &= (first.value[-1] - first.value[0]) * (second.value[-1] - second.value[0]) > 0.0
    used_outputs = dict(base_outputs) if is_same else outputs
    return flight_records(log, prior, used_outputs if is_same else None, min_seconds, end), used_outputs


def _report_page(identified: Identified, predicted: PredictedLog, check: str | Path | None, name: str) -> str:
    """Return the HTML page of an identification.

    check: log that was predicted; None if the logs of the identification were predicted.
    name: name of the aircraft.
    """
    from logs.views.report.identification import IdentificationFacts, identification_page

    numbers = tuple(
        (title, unit, *interval)
        for (title, unit), interval in zip(
            (("climb at full throttle", "°"), ("sink at idle", "°"), ("power in level flight", "W")),
            _compute_performance_intervals(identified),
            strict=True,
        )
    )
    logs = tuple((Path(log.source).name, log.sha256) for log in identified.logs)
    conflict = identified.power_conflict()
    conflicts = () if conflict is None else (conflict.text,)
    wide = (*conflicts, *(wide_number.text for wide_number in _find_wide_numbers(identified)))
    check_name = None if check is None else Path(check).name
    return identification_page(
        IdentificationFacts(name, identified.estimate, logs, numbers, predicted, check_name, wide)
    )


def _find_wide_numbers(identified: Identified) -> tuple[WideQuantity, ...]:
    """Return the quantities that the logs determine only within a wide interval.

    The quantities are sink angle and power.
    """
    _, sink, power = _compute_performance_intervals(identified)
    return wide_quantities(sink, power, with_current=identified.estimate.with_current)


# Lower end, estimate and upper end (95 %) of a number.
Interval = tuple[float, float, float]


def _compute_performance_intervals(identified: Identified) -> tuple[Interval, Interval, Interval]:
    """Return the intervals of climb angle (deg), sink angle (deg) and power (W) at cruise.

    Each interval is (lower end, estimate, upper end), with 95 % probability.
    """
    best, samples = identified.performance()

    def make_interval(value: Floats, sample_values: Floats, factor: float = 1.0) -> Interval:
        """Return the samples' 2.5 % quantile, the estimate and the 97.5 % quantile, times a factor."""
        lower, upper = np.percentile(sample_values, [2.5, 97.5])
        return factor * float(lower), factor * float(value[0]), factor * float(upper)

    degrees = math.degrees(1.0)
    lower_power, power, upper_power = make_interval(best.power, samples.power)
    if (conflict := identified.power_conflict()) is not None:
        upper_power = max(upper_power, conflict.largest_power)
    return (
        make_interval(best.climb, samples.climb, degrees),
        make_interval(best.sink, samples.sink, degrees),
        (lower_power, power, upper_power),
    )


def find_logs_without_current(records: Sequence[FlightRecord]) -> tuple[str, ...]:
    """Return the names of the logs without battery current, if other logs have it.

    The result is empty if no log has battery current.
    """
    lacking = {record.source: None for record in records if not record.has_current}
    return tuple(lacking) if any(record.has_current for record in records) else ()


def find_slow_logs(logs: Sequence[MotionLog]) -> tuple[SlowLog, ...]:
    """Return the logs whose sensors or servo outputs have fewer than `AMPLE_HZ` rows per second."""
    rates = [(log, find_slowest_log_rate(log)) for log in logs]
    return tuple(SlowLog(log.source, rate, describe_recording_setting(log)) for log, rate in rates if rate < AMPLE_HZ)
