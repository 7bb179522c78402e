"""Write a first table of columns for data files, guessed from names and values, for a person to check."""

import os
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from logs.importers.columns.column_table import MAIN_CLOCK
from logs.importers.columns.data_files import Column, DataFile, read_data_file
from logs.importers.columns.quantities import ANGLES, QUANTITIES, QUATERNION, UNIT_ZEROS, UNITS
from world.errors import LogError
from world.wording import count_text

# Usual names of the columns of each quantity, reduced to lower-case letters and digits; the best name first.
NAMES: dict[str, tuple[str, ...]] = {
    "latitude": ("navlat", "lat", "latitude", "gpslat", "latitudedeg"),
    "longitude": ("navlon", "lon", "lng", "long", "longitude", "gpslon", "gpslng"),
    "altitude": (
        "navalt",
        "altitude",
        "altmsl",
        "altamsl",
        "alt",
        "height",
        "gpsalt",
        "h",
        "altitudemsl",
        "altitudeamsl",
        "altitudeabovemsl",
        "amsl",
        "gpsaltitude",
    ),
    "velocity_north": ("navvn", "vn", "velnorth", "velocitynorth", "vnorth", "veln", "vx", "northvelocity"),
    "velocity_east": ("navve", "ve", "veleast", "velocityeast", "veast", "vele", "vy", "eastvelocity"),
    "velocity_down": ("navvd", "vd", "veldown", "velocitydown", "vdown", "veld", "vz", "downvelocity"),
    "ground_speed": ("groundspeed", "gs", "gspd", "sog", "spd"),
    "ground_course": ("groundcourse", "course", "cog", "gcrs", "courseoverground"),
    "roll": ("roll", "phi", "bank", "rollangle"),
    "pitch": ("pitch", "theta", "pitchangle"),
    "yaw": ("yaw", "psi", "heading", "hdg", "yawangle"),
    "quaternion_w": ("q0", "qw", "quaternionw", "orientationw"),
    "quaternion_x": ("q1", "qx", "quaternionx", "orientationx"),
    "quaternion_y": ("q2", "qy", "quaterniony", "orientationy"),
    "quaternion_z": ("q3", "qz", "quaternionz", "orientationz"),
    "roll_rate": ("p", "rollrate", "gyrx", "gyrox", "rollspeed", "wx", "angvelx", "angularvelocityx", "omegax"),
    "pitch_rate": ("q", "pitchrate", "gyry", "gyroy", "pitchspeed", "wy", "angvely", "angularvelocityy", "omegay"),
    "yaw_rate": ("r", "yawrate", "gyrz", "gyroz", "yawspeed", "wz", "angvelz", "angularvelocityz", "omegaz"),
    "acceleration_forward": ("ax", "accx", "accelx", "accelerationx", "xacc", "accbx", "bodyaccx", "specificforcex"),
    "acceleration_right": ("ay", "accy", "accely", "accelerationy", "yacc", "accby", "bodyaccy", "specificforcey"),
    "acceleration_down": ("az", "accz", "accelz", "accelerationz", "zacc", "accbz", "bodyaccz", "specificforcez"),
    "airspeed": (
        "ias",
        "airspeed",
        "arspd",
        "eas",
        "cas",
        "aspd",
        "tas",
        "trueairspeed",
        "va",
        "indicatedairspeed",
        "calibratedairspeed",
        "equivalentairspeed",
    ),
    "wind_north": ("windnorth", "windn", "vwn", "wn"),
    "wind_east": ("windeast", "winde", "vwe", "we"),
    "wind_speed": ("windspeed", "wspd"),
    "wind_direction": ("winddirection", "winddir", "wdir"),
    "static_pressure": ("staticpressure", "pstatic", "ps", "press", "pressure", "baropress"),
    "temperature": ("temperature", "oat", "temp"),
    "elevator": ("elevator", "elev", "ele", "de"),
    "aileron": ("aileron", "ail", "da"),
    "aileron_left": ("aileronleft", "leftaileron", "dal", "aill"),
    "aileron_right": ("aileronright", "rightaileron", "dar", "ailr"),
    "elevon_left": ("elevonleft", "leftelevon"),
    "elevon_right": ("elevonright", "rightelevon"),
    "rudder": ("rudder", "rud", "dr"),
    "throttle": ("throttle", "dthr", "thr", "throut", "motorthrottle", "dt"),
    "voltage": ("voltage", "volt", "volts", "vbat", "batteryvoltage", "motorvoltage", "batvoltage", "batteryvolt"),
    "current": ("current", "curr", "amp", "amps", "ibat", "batterycurrent", "motorcurrent", "batcurrent"),
    "mode": ("flightmode", "modenum", "mode"),
}
# Usual names of columns of times.
_TIMES = (
    "time",
    "times",
    "timestamp",
    "timems",
    "timeus",
    "timeboot",
    "elapsed",
    "elapsedtime",
    "t",
    "motortime",
    "seconds",
)
# Quantities that each command needs; those that were not found are listed in the table.
_NEEDED = {
    "import": ("latitude", "longitude", "altitude"),
    "aircraft --identify": (
        *("roll", "pitch", "yaw", "roll_rate", "pitch_rate", "yaw_rate"),
        *("acceleration_forward", "acceleration_right", "acceleration_down"),
        *(
            "velocity_north",
            "velocity_east",
            "velocity_down",
            "altitude",
            "airspeed",
            "elevator",
            "aileron",
            "throttle",
        ),
    ),
}
# Unit by its spelling at the end of a column's name, or in a row below the header.
_SPELLINGS = {
    **{unit.lower(): unit for units in UNITS.values() for unit in units if unit not in ("", "iso", "fraction")},
    **{"degs": "deg/s", "dps": "deg/s", "rads": "rad/s", "mps": "m/s", "kts": "kt", "knots": "kt", "kmh": "km/h"},
    **{"mps2": "m/s2", "m/s^2": "m/s2", "c": "degC", "pct": "%", "percent": "%", "sec": "s"},
}
# Units to try for each dimension; the first unit in which the values are plausible is guessed.
_TRIED = {
    "angle": ("rad", "deg", "cdeg", "degE7"),
    "angular rate": ("rad/s", "deg/s"),
    "acceleration": ("m/s2", "g", "cm/s2"),
    "speed": ("m/s", "cm/s"),
    "length": ("m", "mm"),
    "deflection": ("rad", "deg"),
    "fraction": ("fraction", "%", "us"),
    "voltage": ("V", "cV", "mV"),
    "current": ("A", "cA", "mA"),
    "pressure": ("kPa", "hPa", "Pa"),
    "temperature": ("degC", "K"),
    "ratio": ("",),
}
# Range of usual intervals between rows, s.
_STEPS_S = (0.001, 5.0)
# Smallest median of some quantities in flight, which distinguishes their units.
_LEAST_MEDIANS = {"acceleration_down": 4.0, "voltage": 2.5}
# Highest voltage that is guessed, V.
_HIGHEST_VOLTAGE_V = 130.0
_HEAD = (
    "# Table of columns, guessed from names and values.  Check column, unit, sign and frame of each line with the mark",
    "# `guess`, and remove the mark.  planfly refuses quantities that contradict each other, but cannot know the sign",
    "# of a surface, or the datum of an altitude.",
    "",
)
# Unit at the end of a column's name: "speed [m/s]", "speed (m/s)" or "speed_mps".
_UNIT_SUFFIX = re.compile(r"(?:\s*[\[(]\s*([^\])]*)\s*[\])]|_([a-zA-Z%]+[0-9]?))\s*$")


@dataclass(frozen=True, slots=True)
class _Clock:
    """The column of times of a group of columns: all columns of one file with the same prefix and length.

    file: name of the file in the table.
    prefix: text before the last dot in the names of the columns, such as a message name.
    column: name of the column of times.
    unit: unit of the times.
    length: number of rows.
    span: first and last time, s; (0, 0) for dates.
    """

    file: str
    prefix: str
    column: str
    unit: str
    length: int
    span: tuple[float, float]

    @property
    def group(self) -> tuple[str, str, int]:
        """File, prefix and length that the columns with this clock share."""
        return self.file, self.prefix, self.length

    def overlap(self, other: "_Clock") -> float:
        """Return the duration that this clock has in common with another clock, s; negative if there is none."""
        return min(self.span[1], other.span[1]) - max(self.span[0], other.span[0])


@dataclass(frozen=True, slots=True)
class _Guess:
    """A guess that a column has a quantity, in a unit and a frame.

    clock: clock of the column.
    reason: text after "guess" in the remark for the person who checks the entry; may be "".
    """

    quantity: str
    column: str
    clock: _Clock
    unit: str
    frame: str
    reason: str


def guess_column_table(paths: Sequence[Path], target: Path) -> str:
    """Guess a table of columns for data files, and return it as TOML text.

    Raises LogError for a file that cannot be read, and if no column was recognized.

    paths: data files, the main file first.
    target: path at which the table will be written; paths of data files in the table are relative to its folder.
    """
    file_names = [Path(os.path.relpath(path, target.parent)).as_posix() for path in paths]
    files = {name: read_data_file(path) for name, path in zip(file_names, paths, strict=True)}
    # A clock is a column with increasing values and a name that means time.
    all_clocks = []
    for file, data in files.items():
        for column, values in data.columns.items():
            prefix, name, stated_unit = _split_column_name(data, column)
            is_time = not {_normalize_name(name), _normalize_name(column.rpartition(".")[2])}.isdisjoint(_TIMES)
            unit = _find_time_unit(values, stated_unit) if is_time else ""
            if unit:
                factor = UNITS["time"][unit]
                span = (0.0, 0.0) if unit == "iso" else (float(values[0]) * factor, float(values[-1]) * factor)
                all_clocks.append(_Clock(file, prefix, column, unit, len(values), span))
    clocks: list[_Clock] = []
    for clock in sorted(all_clocks, key=lambda clock: -clock.length):
        # Of several columns of times in a group, use the column with the most time in common with the longest group.
        clocks_of_group = [
            other
            for other in all_clocks
            if (other.file, other.prefix, other.length) == (clock.file, clock.prefix, clock.length)
        ]
        best = max(clocks_of_group, key=lambda candidate: candidate.overlap(clocks[0]) if clocks else 0.0)
        if best not in clocks:
            clocks.append(best)
    guesses: list[_Guess] = []
    alternatives: list[_Guess] = []
    for quantity in NAMES:
        # A column on the first clock, which has the most rows, is preferred.
        candidates = sorted(_guess_entries(quantity, clocks, files), key=lambda guess: guess.clock != clocks[0])
        guesses += candidates[:1]
        alternatives += [guess for guess in candidates[1:] if guess.clock != candidates[0].clock]
    if not guesses:
        names = ", ".join(list(next(iter(files.values())).columns)[:12])
        raise LogError(f"{paths[0]}: no column was recognized among {names}; write a table by hand", file=paths[0])
    return _format_table(guesses, alternatives, files)


def _normalize_name(name: str) -> str:
    """Return only the letters and digits of a name, in lower case."""
    return re.sub(r"[^a-z0-9]", "", name.lower())


def _split_column_name(data: DataFile, column: str) -> tuple[str, str, str]:
    """Split a column's name into a prefix, a name and a unit.

    The prefix is the text before the last dot, such as a message name; "" without a dot.  The unit comes from the
    file's row of units, or else from the end of the name; it is "" if neither states a known unit.
    """
    prefix, _, name = column.rpartition(".")
    unit = _SPELLINGS.get(data.units.get(column, "").strip().lower(), "")
    match = _UNIT_SUFFIX.search(name)
    spelling = (match[1] or match[2] or "").strip().lower() if match else ""
    if match and spelling in _SPELLINGS and match.start() > 0:
        return prefix, name[: match.start()], unit or _SPELLINGS[spelling]
    return prefix, name, unit


def _find_time_unit(values: Column, stated_unit: str) -> str:
    """Return the unit in which a column has times that do not decrease, at usual intervals.

    It is "iso" for dates with times of day.  Return "" if the column is not such a series of times.

    stated_unit: unit that the column's name or the file states, else "".
    """
    if values.dtype.kind == "M":
        return "iso"
    if values.dtype.kind not in "fiu":
        return "iso" if len(values) and re.match(r"\d{4}-\d\d-\d\d", str(values[0])) else ""
    steps = np.diff(values.astype(np.float64))
    if len(steps) < 2 or not np.isfinite(steps).all() or (steps < 0.0).any() or not (steps > 0.0).any():
        return ""
    usual_step = float(np.median(steps[steps > 0.0]))
    units = [stated_unit] if stated_unit in UNITS["time"] else ["s", "ms", "us", "ns"]
    return next((unit for unit in units if _STEPS_S[0] <= usual_step * UNITS["time"][unit] <= _STEPS_S[1]), "")


def _guess_entries(quantity: str, clocks: Sequence[_Clock], files: dict[str, DataFile]) -> Iterator[_Guess]:
    """Yield a guess for each column that is named like a quantity and has plausible values.

    Columns with better names, see `NAMES`, come first.

    clocks: clocks whose columns are examined.
    files: data files, keyed by their name in the table.
    """
    for name in NAMES[quantity]:
        for clock in clocks:
            data = files[clock.file]
            for column, values in data.columns.items():
                prefix, column_name, unit = _split_column_name(data, column)
                has_clock = prefix == clock.prefix and len(values) == clock.length
                if not has_clock or name not in (
                    _normalize_name(column_name),
                    _normalize_name(column.rpartition(".")[2]),
                ):
                    continue
                guess = _guess_entry(quantity, column, clock, values, unit)
                if guess is not None:
                    yield guess


def _guess_entry(quantity: str, column: str, clock: _Clock, values: Column, stated_unit: str) -> _Guess | None:
    """Guess the unit and the frame of a column that may have a quantity.

    Return None if the column is not numeric, is constant, or is implausible in every unit; a stated unit is accepted
    without this test.  A column for the quantity `mode` may have any values.

    stated_unit: unit that the column's name or the file states, else "".
    """
    entry = QUANTITIES[quantity]
    if quantity == "mode":
        return _Guess(quantity, column, clock, "", "", "")
    if values.dtype.kind not in "fiu":
        return None
    numbers = values.astype(np.float64)
    known = numbers[np.isfinite(numbers)]
    if not known.size or not np.ptp(known):
        return None
    units = (stated_unit,) if stated_unit in UNITS[entry.dimension] else _TRIED[entry.dimension]
    for unit in units:
        # At least 98 % of the values must lie in the range of the quantity, and their median must be usual for it.
        scaled = known * UNITS[entry.dimension][unit] + UNIT_ZEROS.get(unit, 0.0)
        plausible_fraction = float(((scaled >= entry.low) & (scaled <= entry.high)).mean())
        median = float(np.median(np.abs(scaled)))
        is_usual = median >= _LEAST_MEDIANS.get(quantity, 0.0)
        is_usual &= quantity != "voltage" or median <= _HIGHEST_VOLTAGE_V
        if unit == stated_unit or (plausible_fraction >= 0.98 and is_usual):
            break
    else:
        return None
    reason = f": largest value {np.abs(known).max():.4g}" + (
        f", named {stated_unit}" if stated_unit and unit == stated_unit else ""
    )
    if quantity == "airspeed":
        frame = "true" if "tas" in column.lower() or "true" in column.lower() else "indicated"
    elif quantity == "acceleration_down":
        frame = "FLU" if float(np.median(known)) > 0.0 else "FRD"
    else:
        frames = QUANTITIES[quantity].frames
        frame = frames[0] if frames else ""
    return _Guess(quantity, column, clock, unit, frame, reason)


def _format_table(guesses: Sequence[_Guess], alternatives: Sequence[_Guess], files: dict[str, DataFile]) -> str:
    """Return the guessed table of columns as TOML text, each guess with a remark.

    guesses: guess for each quantity.
    alternatives: columns that have the same quantities on other clocks; these clocks are aligned by them.
    files: data files, keyed by their name in the table; the main file first.
    """
    # The clock with the most guesses is the main clock.
    counts = Counter(guess.clock for guess in guesses)
    names: dict[_Clock, str] = {}
    for used_clock, _ in counts.most_common():
        source_name = used_clock.prefix.rpartition(".")[2] or Path(used_clock.file).stem
        name = re.sub(r"\W", "_", source_name) if names else MAIN_CLOCK
        names[used_clock] = name if name not in names.values() else f"{name}_{len(names)}"
    file = next(iter(files))
    lines = [*_HEAD, f'file = "{file}"', 'program = ""']
    main_clock = next(clock for clock, name in names.items() if name == MAIN_CLOCK)
    for clock, name in names.items():
        lines += ["", f"[clocks.{name}]  # guess: {count_text(clock.length, 'row')}"]
        lines += [f'file = "{clock.file}"'] if clock.file != file else []
        lines += [f'column = "{clock.column}"', f'unit = "{clock.unit}"']
        partner = next((guess for guess in alternatives if guess.clock == clock), None)
        # Groups of one file with names of their own (GPS, IMU) share one clock.
        is_separate = clock != main_clock and (clock.file != main_clock.file or clock.prefix == main_clock.prefix)
        if is_separate and partner is not None:
            pair = f'column = "{partner.column}", with = "{partner.quantity}"'
            lines.append(f"align = {{ {pair} }}  # guess: both vary together")
        elif is_separate:
            lines.append('# guess: this clock equals main; otherwise add align = { column = "...", with = "..." }')
    lines += ["", "[columns]"]
    for guess in guesses:
        parts = [f'column = "{guess.column}"', *([f'unit = "{guess.unit}"'] if guess.unit else [])]
        parts += [f'frame = "{guess.frame}"'] if guess.frame else []
        parts += [f'clock = "{names[guess.clock]}"'] if guess.clock != main_clock else []
        lines.append(f"{guess.quantity} = {{ {', '.join(parts)} }}  # guess{guess.reason}")
    # The needed and the optional quantities that were not found.
    found_quantities = {guess.quantity for guess in guesses}
    substitutes = dict.fromkeys(ANGLES, QUATERNION[-1]) | {
        "elevator": "elevon_left",
        "aileron": "aileron_left" if "aileron_left" in found_quantities else "elevon_left",
    }
    lines.append("")
    for purpose, quantities in _NEEDED.items():
        missing = [name for name in quantities if found_quantities.isdisjoint({name, substitutes.get(name)})]
        if missing:
            lines.append(f"# Not found, and needed by planfly {purpose}: {', '.join(missing)}")
    settled = found_quantities.union(*_NEEDED.values(), QUATERNION if found_quantities.issuperset(ANGLES) else ())
    remaining_quantities = [name for name in QUANTITIES if name not in settled]
    if remaining_quantities:
        lines.append(f"# Not found, and optional: {', '.join(remaining_quantities)}")
    # The unused columns next to columns that a guess uses.
    used = {(guess.clock.file, column) for guess in guesses for column in (guess.column, guess.clock.column)}
    for data_file, data in files.items():
        kinds = {(guess.clock.prefix, guess.clock.length) for guess in guesses if guess.clock.file == data_file}
        unused = [
            column
            for column, values in data.columns.items()
            if (data_file, column) not in used and (column.rpartition(".")[0], len(values)) in kinds
        ]
        if unused:
            lines.append(f"# Columns of {data_file} that are not used: {', '.join(unused)}")
    return "\n".join(lines) + "\n"
