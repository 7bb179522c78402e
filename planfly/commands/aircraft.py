"""``planfly aircraft``: show an aircraft as tables and pictures, or make the folder of a new aircraft."""

import argparse
import math
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from planfly.terminal.arguments import complete_aircraft, file_completer, number_parser, with_completer
from planfly.terminal.command_parser import FLYABLE, CommandParser, LineParser
from planfly.terminal.options import add_result_options, given_options
from planfly.terminal.output import print_warnings, write_json_if_requested
from world.errors import PlanflyError

if TYPE_CHECKING:
    from aircraft.catalog import Aircraft
    from aircraft.envelope import Envelope
    from planfly import AircraftNumbers, IdentifiedAircraft

# Bank angles of the printed turn radii, degrees.
_BANKS_DEG = (15.0, 20.0, 30.0, 40.0)
# Course changes of the printed turns, degrees.
_TURNS_DEG = (30.0, 45.0, 60.0, 90.0, 120.0)
# Keywords of the numbers of a data sheet.
_DATA_SHEET_KEYWORDS = (
    *("mass", "span", "area", "cruise", "stall", "top", "bank", "climb"),
    *("battery", "motor", "prop", "layout", "fuel"),
)
# Half width of the interval of 95 % of a normal distribution, in standard deviations.
_INTERVAL_SIGMAS = 1.96
# Wind of the printed ground slopes, m/s.
_WIND_MPS = 10.0


def add_aircraft_parser(command_line: LineParser) -> None:
    """Add the parser of ``planfly aircraft``."""
    parser = command_line.add_command(
        "aircraft",
        "show an aircraft: mass, trims, modes, envelope and step responses; without a name, list the aircraft",
        "planfly aircraft aerosonde --out aerosonde",
        "planfly aircraft --new ./mine --mass 2.1 --span 1.6 --cruise 15 --stall 10 --layout wing",
        "planfly aircraft --new ./copy --from aerosonde",
        "planfly aircraft --identify A.BIN B.BIN --mass 13.2 --span 2.9 --area 0.55 --check C.BIN --out ./mine",
    )
    with_completer(
        parser.add_argument(
            "name", metavar="NAME", nargs="?", help="name of a built-in aircraft, or a folder such as ./mine"
        ),
        complete_aircraft,
    )
    parser.add_argument("--motor-braking", action="store_true", help="let the motor brake in descents")
    new_group = parser.add_group("an aircraft of your own")
    new_group.add_argument("--new", dest="folder", metavar="FOLDER", help="folder to make; it must not exist yet")
    with_completer(
        new_group.add_argument(
            "--from", dest="source", metavar="NAME", help="with --new: the aircraft to copy (default: aerosonde)"
        ),
        complete_aircraft,
    )
    _add_data_sheet_options(parser)
    log_group = parser.add_group("flight logs: with --mass and --span, and --out for the folder to make")
    with_completer(
        log_group.add_argument(
            "--identify",
            dest="logs",
            metavar="LOG",
            nargs="+",
            help="its flight logs (.BIN, .tlog, .ulg or a table of columns); requires planfly[identification]",
        ),
        file_completer("bin", "BIN", "tlog", "ulg", "toml", "csv", "mat", "parquet", "h5"),
    )
    with_completer(
        log_group.add_argument(
            "--base",
            metavar="NAME",
            help="with --identify: the known aircraft that is most similar to it (default: aerosonde)",
        ),
        complete_aircraft,
    )
    with_completer(
        log_group.add_argument("--check", metavar="LOG", help="with --identify: another log that tests the result"),
        file_completer("bin", "BIN", "tlog", "ulg", "toml", "csv", "mat", "parquet", "h5"),
    )
    log_group.add_argument(
        "--until",
        metavar="S",
        type=number_parser("until"),
        help="with --identify: use the log only up to this time, s; then 'planfly predict' can be tested on the rest",
    )
    add_result_options(
        parser,
        "folder for the pictures (default: runs/aircraft-NAME; an existing folder is replaced); "
        "with --identify, the folder to create for the aircraft",
    )


def _add_data_sheet_options(parser: CommandParser) -> None:
    """Add the options for the values of a data sheet."""
    group = parser.add_group("a data sheet: with --new; mass, span, cruise and stall are required, the rest is guessed")
    numbers = {
        "mass": ("KG", "mass, 0.5 to 25 kg"),
        "span": ("M", "wing span, m"),
        "area": ("M2", "wing area, m2 (default: the area that lifts the mass at the stall speed)"),
        "cruise": ("M/S", "cruise airspeed, m/s"),
        "stall": ("M/S", "minimum airspeed of level flight, m/s"),
        "top": ("M/S", "maximum airspeed of level flight, m/s (default: 1.65 times the cruise airspeed)"),
        "bank": ("DEG", "maximum bank in turns, degrees (default: 35)"),
        "climb": (
            "DEG",
            "steepest climb at the cruise airspeed, degrees (default: 12, or the climb that fits the top speed)",
        ),
        "motor": ("KV", "motor constant, rpm per volt"),
        "fuel": ("KG", "fuel carried, for an aircraft without a battery"),
    }
    for name, (unit, text) in numbers.items():
        group.add_argument(f"--{name}", metavar=unit, type=float, help=text)
    group.add_argument("--battery", metavar="V,AH", help="voltage and capacity of the battery, such as 14.8V,5Ah")
    group.add_argument("--prop", metavar="DxP", help="diameter and pitch of the propeller, inches, such as 12x6")
    group.add_argument(
        "--layout",
        choices=("tail", "wing", "vtail"),
        help="layout of the airframe: a tail, a flying wing or a V-tail (default: tail)",
    )
    group.add_argument(
        "--params",
        metavar="FILE",
        help="parameter file of ArduPlane or PX4, whose airspeeds and limits the aircraft gets",
    )


def aircraft(args: argparse.Namespace) -> int:
    """List the built-in aircraft, show one, or make or identify a new one, as the options say.

    Return the exit code.
    """
    from planfly.api import aircraft as aircraft_api

    if args.logs is not None:
        return _identify(args)
    for name in ("base", "check", "until"):
        if getattr(args, name) is not None:
            raise PlanflyError.of_argument(name, getattr(args, name), "allowed only with `logs` LOG", shown="")
    if args.folder is not None:
        return _make_folder(args)
    for name in _DATA_SHEET_KEYWORDS:
        if getattr(args, name) is not None:
            raise PlanflyError.of_argument(name, getattr(args, name), "allowed only with `folder` FOLDER", shown="")
    if args.source is not None:
        allowed = "allowed only with `folder` FOLDER, the folder to make"
        raise PlanflyError.of_argument("source", args.source, allowed, shown="")
    if args.name is None:
        embedded_aircraft = list(aircraft_api.aircraft().values())
        for entry in embedded_aircraft:
            size_text = f"{entry.mass:.5g} kg, span {entry.wing_span:.5g} m"
            print(f"{entry.name:<14} {entry.title}: {size_text}, cruises at {entry.airspeed:g} m/s")
        write_json_if_requested(args, lambda: _json_answer(embedded_aircraft))
        return FLYABLE
    out = args.out or "runs/aircraft-{name}"
    numbers = aircraft_api.describe_aircraft(
        **given_options(args, aircraft_api.describe_aircraft, out=out, overwrite=args.overwrite or args.out is None)
    )
    _print_numbers(numbers)
    print_warnings(numbers.lacking)
    for file in numbers.files:
        print(f"picture   {file}")
    write_json_if_requested(args, lambda: _json_answer([numbers.aircraft], numbers))
    return FLYABLE


def _json_answer(entries: "Sequence[Aircraft]", numbers: "AircraftNumbers | None" = None) -> object:
    """Return the answer of ``planfly aircraft`` for --json.

    It is one aircraft with its numbers, or several without.
    """
    from planfly.terminal.answers import AircraftAnswer, aircraft_detail, aircraft_entry

    detail = None if numbers is None else aircraft_detail(numbers)
    return AircraftAnswer(exit_code=FLYABLE, aircraft=[aircraft_entry(aircraft, detail) for aircraft in entries])


def _make_folder(args: argparse.Namespace) -> int:
    """Make the folder of a new aircraft from a data sheet or as a copy, and print its limits.

    Return the exit code.
    """
    from aircraft.uncertainty import read_uncertainty
    from flight.dynamics.envelope_tables import load_envelope
    from planfly.api import aircraft as aircraft_api

    if args.name is not None:
        message = f"{args.name}: cannot be combined with --new FOLDER; --from names the aircraft to start from"
        raise PlanflyError(message, field="--new", value=args.folder)
    for field, is_given, reason in (
        ("--out", args.out is not None, "--new names the folder to make"),
        ("--motor-braking", args.motor_braking, "it is an option for flights"),
    ):
        if is_given:
            raise PlanflyError(f"--new cannot be combined with {field}: {reason}", field=field)
    folder = Path(args.folder)
    new_aircraft = aircraft_api.new_aircraft(**given_options(args, aircraft_api.new_aircraft))
    files = sorted(file.name for file in new_aircraft.folder.iterdir())
    folder_text = folder if folder.is_absolute() else f"./{folder}"
    has_sheet = any(getattr(args, name) is not None for name in (*_DATA_SHEET_KEYWORDS, "params"))
    origin_text = "from a data sheet" if has_sheet else f"as {Path(args.source or 'aerosonde').name}"
    print(f"aircraft  {folder_text}/ ({', '.join(files)}), {origin_text}")
    if has_sheet:
        # The performance of the data sheet's model, and its uncertainty.
        envelope = load_envelope(new_aircraft)
        climb, descent = (math.degrees(angle) for angle in envelope.air_angles(new_aircraft.airspeed, 500.0))
        uncertainty = read_uncertainty(new_aircraft.folder)
        print(
            f"  speed    cruise {new_aircraft.airspeed:g} m/s, stall {new_aircraft.stall_speed:g}, fastest level flight"
            f" {envelope.level_speeds(500.0)[1]:.1f}; guidance flies at up to {new_aircraft.airspeed_max:g} m/s"
        )
        if uncertainty is not None:
            climb_sd = math.degrees(uncertainty.climb_sd)
            descent_sd = math.degrees(uncertainty.descent_sd)
            print(
                f"  slopes   climb {climb:.1f} degrees ± {climb_sd:.1f}; descent {descent:.1f} ± "
                f"{descent_sd:.1f} (at cruise and 500 m; one standard deviation)"
            )
            power = envelope.power(new_aircraft.airspeed, 500.0, 0.0)
            lower, upper = (power * math.exp(sign * _INTERVAL_SIGMAS * uncertainty.power_sd) for sign in (-1.0, 1.0))
            source = "from the battery" if new_aircraft.battery_voltage else "of fuel heat"
            print(f"  power    {power:.3g} W {source} in level flight at cruise, {lower:.3g} to {upper:.3g} (95 %)")
        print("  guessed  README.md lists the guessed values and their possible error")
    if args.params is not None:
        # Print the values of the parameter file, those that the data sheet overrides, and those that the model misses.
        from aircraft.uncertainty import read_uncertainty
        from flight.dynamics.fdm import Fdm
        from planfly.workflow import data_sheets

        stated = data_sheets.read_aircraft_parameters(Path(args.params))
        values_text = ", ".join(stated.texts.values()) or "no value differs from its default"
        print(f"  params   {args.params}: {values_text}")
        if overridden := data_sheets.overridden_texts(vars(args), stated):
            print(f"  params   the data sheet overrides {', '.join(overridden)}")
        performance = data_sheets.measure_performance(Fdm(new_aircraft, is_tested=True), new_aircraft)
        uncertainty = read_uncertainty(new_aircraft.folder)
        climb_shortfall = 0.0 if uncertainty is None else uncertainty.climb_shortfall
        airspeed = new_aircraft.airspeed
        for line in data_sheets.missed_value_lines(stated.values, airspeed, performance, climb_shortfall):
            print(f"  params   {line}")
    write_json_if_requested(args, lambda: _json_answer([new_aircraft]))
    print(
        f"next      `planfly aircraft {shlex.quote(str(folder_text))}` shows it; `planfly fly MISSION --aircraft"
        f" {shlex.quote(str(folder_text))}` flies it"
    )
    return FLYABLE


def _identify(args: argparse.Namespace) -> int:
    """Identify an aircraft from logs, make its folder, and print its performance; return the exit code.

    Raises PlanflyError for a missing option, and for options that cannot be combined with --identify.
    """
    from aircraft.identification.prediction import QUANTITIES
    from planfly.api import identifying

    for name in ("mass", "span", "out"):
        if getattr(args, name) is None:
            reason = "the folder to make" if name == "out" else f"the {name} of the aircraft in these flights"
            raise PlanflyError(f"--identify needs --{name}, {reason}", field=f"--{name}")
    extra_names = [
        name
        for name in _DATA_SHEET_KEYWORDS
        if name not in ("mass", "span", "area", "battery") and getattr(args, name) is not None
    ]
    if extra_names or args.name is not None or args.folder is not None:
        field = "name" if args.name is not None else f"--{extra_names[0]}" if extra_names else "--new"
        raise PlanflyError(f"--identify cannot be combined with {field}, which is taken from the logs", field=field)
    for field, is_given, reason_text in (
        ("--params", args.params is not None, "the parameters come from the logs"),
        ("--from", args.source is not None, "--base names the aircraft to start from"),
        ("--motor-braking", args.motor_braking, "it is an option for flights"),
    ):
        if is_given:
            raise PlanflyError(f"--identify cannot be combined with {field}: {reason_text}", field=field)
    result = identifying.identify_aircraft(**given_options(args, identifying.identify_aircraft, folder=args.out))
    new_aircraft, estimate = result.aircraft, result.estimate
    files_made = sorted(file.name for file in new_aircraft.folder.iterdir())
    print(f"aircraft  {args.out} ({', '.join(files_made)}), from {estimate.seconds / 60.0:.1f} min of flight")
    for name, unit, (lower, value, upper) in (
        ("climb", "deg", result.climb),
        ("sink", "deg", result.sink),
        ("power", "W", result.power),
    ):
        print(f"  {name:<8} {value:.{0 if unit == 'W' else 1}f} {unit} at cruise, {lower:.1f} to {upper:.1f} (95 %)")
    _print_uncertain_properties(result)
    if "identify.waypoints" not in files_made:
        print("  identify.waypoints not written: the logs have neither home (ORGN) nor a position on the ground (POS)")
    # Each model's rms errors 0.5 s ahead, and the whiteness of the identified model's innovations, which are errors of
    # predictions one step ahead.  Those of a complete model are white, which means not correlated in time.
    predicted = result.predicted
    print(
        f"  ahead    rms errors 0.5 s ahead, {predicted.count} predictions"
        f" {'on the same logs' if args.check is None else f'on {args.check}'} (deg/s, deg, m/s)"
    )
    for prediction in predicted.predictions:
        rms_text = ", ".join(f"{name} {rms:.2g}" for name, rms in zip(QUANTITIES, prediction.rms[0.5], strict=True))
        print(f"  ahead    {prediction.model}: {rms_text}")
    whiteness_text = ", ".join(f"{100.0 * fraction:.0f}" for fraction in predicted.predictions[-1].whiteness)
    print(
        f"  ahead    innovations of roll, pitch, yaw: white at {whiteness_text} % of lags to 0.5 s"
        " (95 % in a complete model)"
    )
    write_json_if_requested(args, lambda: _json_answer([new_aircraft]))
    print(
        f"next      `planfly aircraft {shlex.quote(args.out)}` prints the model; {args.out}/identify.html "
        "shows each estimate with its uncertainty"
    )
    return FLYABLE


def _print_uncertain_properties(result: "IdentifiedAircraft") -> None:
    """Print the properties that the logs determine poorly.

    Also print the logs or flights that would determine them.
    """
    if not result.estimate.dynamics:
        print("  performance only: moments need at least 10 rows of inertial sensors and of outputs per second")
    for log in result.slow:
        print(
            f"  rows     {log.source}: {log.hertz:.1f} rows of sensors or outputs per second;"
            f" {log.setting} records more"
        )
    if result.conflict is not None:
        print(f"  conflict {result.conflict.text}")
    for wide_number in result.wide:
        print(f"  wide     {wide_number.text}")
    for line in result.estimate.uninformed_lines():
        print(f"  not seen {line}")
    for log_name in result.without_current:
        print(
            f"  current  not used, because {log_name} has no current (BAT); identify from the other logs alone to use"
            " their current"
        )


def _print_numbers(numbers: "AircraftNumbers") -> None:
    """Print limits, trims, modes, envelope and turns of an aircraft."""
    from aircraft.envelope import turn_radius
    from flight.dynamics.characteristics import TRIM_AMSL

    aircraft, envelope = numbers.aircraft, numbers.envelope
    print(f"{aircraft.name}: {aircraft.title}")
    print(f"  model    {numbers.model_sha256[:16]}")
    _print_limits(aircraft, envelope)
    print(f"\nlevel flight at {TRIM_AMSL:.0f} m AMSL (endurance and range: still air, 80 % of the energy carried)")
    print("  airspeed   alpha  elevator  aileron  rudder  throttle    power  endurance   range")
    print("       m/s     deg       deg      deg     deg         %       kW          h      km")
    for row in numbers.trims:
        trim = row.trim
        print(
            f"  {trim.airspeed:8.1f}{math.degrees(trim.alpha):8.2f}{math.degrees(trim.elevator):10.2f}"
            f"{math.degrees(trim.aileron):9.2f}{math.degrees(trim.rudder):8.2f}{100.0 * trim.throttle:10.1f}"
            f"{row.power / 1000.0:9.3f}{row.endurance / 3600.0:11.2f}{row.endurance * trim.airspeed / 1000.0:8.0f}"
        )
    print(f"\nmodes at {aircraft.airspeed:g} m/s and {TRIM_AMSL:.0f} m AMSL, controls fixed")
    print("  mode           root, 1/s             frequency  damping  half or double")
    for mode in numbers.cruise:
        root = f"{mode.root.real:+.4f}" + (f" +-{mode.root.imag:.4f}j" if mode.root.imag else "")
        kind = "to half" if mode.root.real < 0.0 else "to DOUBLE"
        print(f"  {mode.name:<14} {root:<20} {mode.frequency:7.3f} rad/s{mode.damping:9.2f}{mode.time:9.2f} s {kind}")
    # The steepest climb and descent, relative to air and ground, and the speeds of level flight.
    altitudes = [float(amsl) for amsl in envelope.amsl[::2]]
    header = "".join(f"{amsl:>13.0f} m" for amsl in altitudes)
    print("\nsteepest climb / descent relative to the air, deg, by airspeed and altitude AMSL ('-': no steady flight)")
    print(f"  m/s  {header}")
    for airspeed in envelope.airspeed.tolist():
        cells = "".join(f"{_angle_pair_text(*envelope.air_angles(airspeed, amsl)):>15}" for amsl in altitudes)
        print(f"  {airspeed:5.1f}{cells}")
    for title, index in (("level, from", 0), ("level, to", 1)):
        cells = "".join(f"{envelope.level_speeds(amsl)[index]:11.1f} m/s" for amsl in altitudes)
        print(f"  {title:<5}{cells[len(title) - 5 :]}")
    print(f"\nsteepest climb / descent relative to the ground at {aircraft.airspeed:g} m/s and 500 m, deg")
    for title, tailwind, crosswind in (
        ("calm", 0.0, 0.0),
        (f"{_WIND_MPS:g} m/s tailwind", _WIND_MPS, 0.0),
        (f"{_WIND_MPS:g} m/s headwind", -_WIND_MPS, 0.0),
        (f"{_WIND_MPS:g} m/s crosswind", 0.0, _WIND_MPS),
    ):
        print(f"  {title:<18}{_angle_pair_text(*envelope.slope_limits(aircraft.airspeed, 500.0, tailwind, crosswind))}")
    speeds = [aircraft.airspeed_min, aircraft.airspeed, aircraft.airspeed_max, aircraft.airspeed + _WIND_MPS]
    print("\nturn radius, m, by ground speed and bank")
    print("  m/s     " + "".join(f"{bank:>8.0f} deg" for bank in _BANKS_DEG))
    for speed in speeds:
        cells = "".join(f"{turn_radius(speed, math.radians(bank)):12.0f}" for bank in _BANKS_DEG)
        print(f"  {speed:<8.1f}{cells}" + ("  (cruise in a 10 m/s tailwind)" if speed == speeds[-1] else ""))
    bank = math.degrees(aircraft.max_bank)
    print(f"\nshortest leg between two equal turns, m, at {bank:.0f} deg of bank, by ground speed and turn")
    print("  m/s     " + "".join(f"{turn:>8.0f} deg" for turn in _TURNS_DEG))
    for speed in speeds:
        radius = turn_radius(speed, aircraft.max_bank)
        print(
            f"  {speed:<8.1f}"
            + "".join(f"{2.0 * radius * math.tan(math.radians(turn) / 2.0):12.0f}" for turn in _TURNS_DEG)
        )


def _print_limits(aircraft: "Aircraft", envelope: "Envelope") -> None:
    """Print mass, energy, speeds and control limits, and the accuracy of the model if known."""
    min_speed, max_speed = envelope.level_speeds(0.0)
    if aircraft.battery_voltage > 0.0:
        storage_text = f"battery {aircraft.battery_energy / 3600.0:g} Wh at {aircraft.battery_voltage:g} V"
    else:
        storage_text = (
            f"fuel with {aircraft.battery_energy / 3.6e9:.4g} MWh of heat; energy is the heat of the fuel burned"
        )
    braking = "the motor brakes" if envelope.motor_braking else "the motor does not brake"
    if aircraft.battery_voltage == 0.0:
        braking = "descents with the throttle closed"
    print(
        f"  mass     {aircraft.mass:g} kg; wing {aircraft.wing_area:g} m2,"
        f" span {aircraft.wing_span:g} m; {storage_text}"
    )
    print(
        f"  speed    cruise {aircraft.airspeed:g} m/s, guidance uses"
        f" {aircraft.airspeed_min:g}..{aircraft.airspeed_max:g};"
        f" level flight at sea level {min_speed:.1f}..{max_speed:.1f} m/s"
    )
    print(
        f"  limits   bank {math.degrees(aircraft.max_bank):.0f}, pitch {math.degrees(aircraft.max_pitch):.0f}, elevator"
        f" {math.degrees(aircraft.max_elevator):.0f}, aileron {math.degrees(aircraft.max_aileron):.0f}, rudder"
        f" {math.degrees(aircraft.max_rudder):.0f} deg either way; {braking}"
    )
    if envelope.source:
        climb_sd = math.degrees(envelope.climb_sd)
        descent_sd = math.degrees(envelope.descent_sd)
        print(
            f"  accuracy from {envelope.source}: climb ± {climb_sd:.1f} deg, descent ± {descent_sd:.1f}, fastest level"
            f" flight ± {envelope.fastest_sd:.1f} m/s, power within a factor of {math.exp(envelope.power_sd):.2f}"
            " (one standard deviation)"
        )


def _angle_pair_text(climb: float, descent: float) -> str:
    """Return two angles (rad) as text in degrees, such as "5.2 / 8.0"; "-" replaces NaN."""

    def angle_text(angle: float) -> str:
        """Return an angle (rad) in degrees as text; "-" for NaN."""
        return "-" if math.isnan(angle) else f"{math.degrees(angle):.1f}"

    return f"{angle_text(climb)} / {angle_text(descent)}"
