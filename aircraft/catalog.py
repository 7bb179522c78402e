"""Read the metadata of aircraft in SI units, and make folders for a user's own aircraft.

An aircraft is a folder with ``<name>.xml`` (JSBSim) and ``<name>.toml`` (metadata: masses, speeds, limits, energy).
`find_aircraft` reads an embedded aircraft or a folder, `model_hash` identifies a model's files, and
`copy_aircraft_folder` copies an aircraft under a new name.
"""

import hashlib
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from aircraft.jsbsim_model import DEFAULT_MODEL, Model, read_model
from world.errors import FlightError
from world.files import did_you_mean, read_at_most, read_toml, write_folder
from world.scenario_tables import names_folder

# Largest size of a model's file, bytes; JSBSim's own largest has 200 kB.
MAX_MODEL_BYTES = 32 * 2**20
# Folder of the embedded aircraft.
_ROOT = Path(__file__).parent
# Radians in one degree.
_RAD_PER_DEG = math.pi / 180.0

# TOML key: (field of Aircraft, factor to SI).
_FIELD_BY_KEY = {
    "mass_kg": ("mass", 1.0),
    "wing_area_m2": ("wing_area", 1.0),
    "wing_span_m": ("wing_span", 1.0),
    "airspeed_mps": ("airspeed", 1.0),
    "airspeed_min_mps": ("airspeed_min", 1.0),
    "airspeed_max_mps": ("airspeed_max", 1.0),
    "stall_speed_mps": ("stall_speed", 1.0),
    "max_bank_deg": ("max_bank", _RAD_PER_DEG),
    "max_pitch_deg": ("max_pitch", _RAD_PER_DEG),
    "max_elevator_deg": ("max_elevator", _RAD_PER_DEG),
    "max_aileron_deg": ("max_aileron", _RAD_PER_DEG),
    "max_rudder_deg": ("max_rudder", _RAD_PER_DEG),
    "surface_rate_deg_s": ("surface_rate", _RAD_PER_DEG),
    "surface_lag_s": ("surface_lag", 1.0),
    "motor_lag_s": ("motor_lag", 1.0),
}
# Keys of the energy of an aircraft with a battery.
_BATTERY_KEYS = ("battery_v", "battery_wh")
# Keys of the energy of an aircraft that burns fuel.
_FUEL_KEYS = ("fuel_kg", "fuel_mj_per_kg")


@dataclass(frozen=True, slots=True)
class Aircraft:
    """Aircraft model: its JSBSim files and its metadata.

    folder: folder of ``<name>.xml`` (JSBSim) and ``<name>.toml``.
    mass: kg.
    wing_area: m^2.
    wing_span: m.
    airspeed: cruise airspeed, m/s; all airspeeds are true airspeeds.
    airspeed_min, airspeed_max: range of airspeeds that guidance may use, m/s.
    stall_speed: minimum airspeed of a level trim at sea level, m/s.
    max_bank: bank limit of planned turns, rad.
    max_pitch: limit of the pitch command in either direction, rad.
    max_elevator, max_aileron, max_rudder: travel in either direction, rad.
    surface_rate: rate limit of the control surfaces, rad/s.
    surface_lag, motor_lag: first-order time constants, s.
    battery_voltage: V; 0 for an aircraft that burns fuel.
    battery_energy: energy of the battery, or heat of the fuel, J.
    model: properties of the JSBSim model.
    """

    name: str
    title: str
    folder: Path
    mass: float
    wing_area: float
    wing_span: float
    airspeed: float
    airspeed_min: float
    airspeed_max: float
    stall_speed: float
    max_bank: float
    max_pitch: float
    max_elevator: float
    max_aileron: float
    max_rudder: float
    surface_rate: float
    surface_lag: float
    motor_lag: float
    battery_voltage: float
    battery_energy: float
    model: Model = DEFAULT_MODEL

    @property
    def model_file(self) -> Path:
        """XML file of the JSBSim model."""
        if shipped := self.model.shipped:
            return jsbsim_folder() / "aircraft" / shipped / f"{shipped}.xml"
        return self.folder / f"{self.name}.xml"

    @property
    def model_folders(self) -> tuple[Path, ...]:
        """Folders that may contain files that the model includes."""
        if self.model.shipped:
            root = jsbsim_folder()
            return (root / "aircraft" / self.model.shipped, root / "engine", root / "systems")
        subfolders = ("Engines", "engine", "Systems", "systems")
        return (self.folder, *(self.folder / name for name in subfolders))

    @property
    def is_embedded(self) -> bool:
        """True if the aircraft ships with planfly."""
        return self.folder.parent == _ROOT


def jsbsim_folder() -> Path:
    """Return the folder of the installed JSBSim package, without importing it.

    The folder also has JSBSim's own models.
    """
    spec = find_spec("jsbsim")
    return Path(spec.origin if spec and spec.origin else "jsbsim").parent


def aircraft_names() -> tuple[str, ...]:
    """Return the names that `load_aircraft` accepts, in alphabetical order.

    >>> aircraft_names()
    ('aerosonde', 'c172x', 'ultrastick25e', 'x8', 'zagi')
    """
    return tuple(sorted(file.stem for file in _ROOT.glob("*/*.toml") if file.stem == file.parent.name))


@lru_cache
def load_aircraft(name: str) -> Aircraft:
    """Return the aircraft with a name that ships with planfly.

    Raises FlightError for an unknown name, and for a metadata file with a missing, unknown or invalid entry.

    >>> aircraft = load_aircraft("aerosonde")
    >>> aircraft.mass, aircraft.airspeed
    (11.0, 25.0)
    """
    names = aircraft_names()
    if name not in names:
        suggestion = did_you_mean(name, names)
        # A folder is only recognized by a slash in its name.
        suggestion = suggestion or (f": did you mean './{name}'?" if Path(name).is_dir() else "")
        allowed = f"built-in aircraft: {', '.join(names)}; a folder is written with a slash, such as ./mine"
        message = f"no aircraft called {name!r}{suggestion} ({allowed})"
        raise FlightError(message, file=name, allowed=allowed)
    return read_aircraft(_ROOT / name)


def find_aircraft(name: str) -> Aircraft:
    """Return the aircraft with a name, or the aircraft in a folder if the name contains a slash.

    Raises FlightError as `load_aircraft` does.

    >>> find_aircraft("c172x").airspeed
    50.0
    """
    return read_aircraft(Path(name)) if names_folder(name) else load_aircraft(name)


def find_logged_aircraft(name: str, stated_name: str) -> Aircraft:
    """Return the aircraft that a setup or log names.

    name: name of the aircraft in the setup or log.
    stated_name: name or folder of the aircraft in the scenario; a folder is read if its last part is `name`.

    A setup or log contains only a name; the folder of a user's own aircraft is stated in the scenario.

    Raises FlightError as `load_aircraft` does.

    >>> find_logged_aircraft("c172x", "aerosonde").name
    'c172x'
    """
    return find_aircraft(stated_name if names_folder(stated_name) and Path(stated_name).name == name else name)


def read_aircraft(folder: Path) -> Aircraft:
    """Read the aircraft in a folder from ``<folder>/<folder's name>.toml``.

    Raises FlightError as `load_aircraft` does.
    """
    file = folder / f"{folder.name}.toml"
    try:
        table = read_toml(file, "aircraft")
    except OSError as error:
        models = sorted(file.stem for file in folder.glob("*.xml")) if isinstance(error, FileNotFoundError) else []
        advice = (
            f": the folder has a JSBSim model ({', '.join(models[:3])}), but also needs {folder.name}.toml;"
            " planfly aircraft --new FOLDER makes a folder with all files"
            if models
            else ""
        )
        raise FlightError(f"{file}: {error.strerror}{advice}", file=file) from None
    except ValueError as error:  # a TOML or a UTF-8 error
        raise FlightError(f"{file}: {' '.join(str(error).split())}", file=file) from None
    title = table.pop("title", folder.name)
    if not isinstance(title, str):
        raise FlightError(f"{file}: title = {title!r} is not a string", file=file, field="title", value=title)
    try:
        model = read_model(table.pop("model"), folder.name) if "model" in table else DEFAULT_MODEL
        values = _numeric_fields(table)
    except FlightError as error:
        raise FlightError.from_error(error, file) from None
    if not values["stall_speed"] <= values["airspeed_min"] <= values["airspeed"] <= values["airspeed_max"]:
        raise FlightError(
            f"{file}: expected stall_speed_mps <= airspeed_min_mps <= airspeed_mps <= airspeed_max_mps, found"
            f" {values['stall_speed']}, {values['airspeed_min']}, {values['airspeed']}, {values['airspeed_max']}",
            file=file,
            field="airspeed_mps",
            value=values["airspeed"],
        )
    return Aircraft(name=folder.name, title=title, folder=folder, model=model, **values)


def _numeric_fields(table: dict[str, Any]) -> dict[str, float]:
    """Return the numeric fields of `Aircraft` in SI units, from the table of a metadata file.

    Raises FlightError for a missing, unknown or invalid entry; its message does not name the file.
    """
    energy_keys = _FUEL_KEYS if set(_FUEL_KEYS) & table.keys() else _BATTERY_KEYS
    allowed = {*_FIELD_BY_KEY, *energy_keys}
    missing, unknown = sorted(allowed - table.keys()), sorted(table.keys() - allowed)
    suggestion = did_you_mean(unknown[0], missing) if unknown else ""
    # A misspelled key is missing, too: in this case report the spelling.
    if missing and not suggestion:
        raise FlightError(f"missing {', '.join(missing)}", field=missing[0])
    if unknown:
        raise FlightError(f"unknown key {', '.join(unknown)}{suggestion}", field=unknown[0], value=table[unknown[0]])
    for key, value in table.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 < value < math.inf:
            raise FlightError(f"{key} = {value!r} is not a positive number", field=key, value=value)
    values = {field: table[key] * factor for key, (field, factor) in _FIELD_BY_KEY.items()}
    first_value, second_value = (float(table[key]) for key in energy_keys)
    # Watt hours to joules, or kilograms of fuel times megajoules per kilogram.
    values["battery_voltage"], values["battery_energy"] = (
        (first_value, second_value * 3600.0)
        if energy_keys is _BATTERY_KEYS
        else (0.0, first_value * second_value * 1e6)
    )
    return values


def model_hash(aircraft: Aircraft) -> str:
    """Return the SHA-256 of the names and contents of a model's XML and TOML files, in hexadecimal.

    Any change of the model changes the hash, so it identifies the model of a cached envelope or an old log. Other files
    in the folder, such as guidance gains, are not included. Raises FlightError for a file that cannot be read.

    >>> len(model_hash(load_aircraft("aerosonde")))
    64
    """
    folders = {aircraft.model_file.parent, *(() if aircraft.model.shipped else aircraft.model_folders)}
    models = sorted({file.resolve() for folder in folders if folder.is_dir() for file in folder.glob("*.xml")})
    files = (aircraft.folder / f"{aircraft.name}.toml", *(models or (aircraft.model_file,)))
    try:
        return _hash_files(files, tuple((file.stat().st_mtime_ns, file.stat().st_size) for file in files))
    except OSError as error:
        message = f"{error.filename}: the aircraft model cannot be read: {error.strerror}"
        raise FlightError(message, file=error.filename) from None


@cache
def _hash_files(files: tuple[Path, ...], stamps: tuple[tuple[int, int], ...]) -> str:
    """Return the SHA-256 of the names, sizes and contents of files, in hexadecimal.

    stamps: modification times and sizes of the files, which are only used as a part of the cache's key.
    """
    digest = hashlib.sha256()
    for file in files:
        data = read_at_most(file, MAX_MODEL_BYTES, "model")
        digest.update(f"{file.name}\n{len(data)}\n".encode())
        digest.update(data)
    return digest.hexdigest()


# --- Copies of aircraft, for a user's own aircraft ---

# Valid name of a folder.
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")
# Names of files that every folder has.
_RESERVED_NAMES = ("ardupilot", "draws", "gains", "posterior", "uncertainty", "README")
# Suffixes of the files that are copied.
_SUFFIXES = frozenset({".xml", ".toml", ".parm", ".md", ".csv"})
# Entry of a metadata file for a model that JSBSim ships.
_SHIPPED_ENTRY = re.compile(r"^([ \t]*shipped_by_jsbsim\s*=\s*)\S.*\n", re.MULTILINE)


def copy_aircraft_folder(
    folder: Path, source: Aircraft, model: Mapping[str, bytes] | None = None, *, overwrite: bool = False
) -> tuple[str, ...]:
    """Copy an aircraft into a new folder, and name it after the folder; create all files or none.

    folder: the new folder.
    source: the aircraft to copy.
    model: files of a model that JSBSim ships, as contents by name, to be written to the new folder as well; None to let
        the copy refer to JSBSim's own files.
    overwrite: True to replace the folder of an aircraft.

    Returns the sorted names of the created files. Raises FlightError as `check_new_folder` does, and OSError if the
    folder cannot be written.

    >>> from tempfile import TemporaryDirectory
    >>> from aircraft.catalog import load_aircraft, read_aircraft
    >>> with TemporaryDirectory() as home:
    ...     print(copy_aircraft_folder(Path(home) / "mine", load_aircraft("c172x")))
    ...     read_aircraft(Path(home) / "mine").mass
    ('README.md', 'ardupilot.parm', 'ardupilot.toml', 'gains.toml', 'mine.toml')
    1124.9
    """
    target = check_new_folder(folder, overwrite=overwrite)
    # The metadata, and files that are named after the aircraft, get the name of the copy.
    model = model or {}
    folders = [source.folder, *(folder for folder in source.model_folders if source.folder in folder.parents)]
    source_files = [file for folder in folders if folder.is_dir() for file in folder.iterdir()]
    files = {}
    for file in source_files:
        if file.suffix not in _SUFFIXES or not file.is_file():
            continue
        path = file.relative_to(source.folder)
        new_path = path if path.stem != source.name else path.with_name(f"{target.name}{path.suffix}")
        files[str(new_path)] = file.read_bytes()
    metadata = files[f"{target.name}.toml"].decode("utf-8").replace(f"{source.name}.xml", f"{target.name}.xml")
    shipped_model_file = f"{source.model.shipped}.xml"
    files |= {f"{target.name}.xml" if file == shipped_model_file else file: data for file, data in model.items()}
    shipped_model_entry = "" if model else rf'\g<1>"{source.model.shipped}"\n'
    files[f"{target.name}.toml"] = _SHIPPED_ENTRY.sub(shipped_model_entry, metadata).encode()
    write_aircraft_folder(target, files)
    return tuple(sorted(files))


def write_aircraft_folder(target: Path, files: Mapping[str, bytes]) -> None:
    """Write the files of an aircraft into a folder, either all of them or none.

    In an existing folder the aircraft's files are replaced; files of other kinds are kept.
    """
    other_files = [file.name for file in target.iterdir() if file.suffix not in _SUFFIXES] if target.exists() else []
    new_names = {name.split("/")[0] for name in files}
    write_folder(target, files, kept_names=[name for name in other_files if name not in new_names])


def check_new_folder(folder: Path, *, overwrite: bool = False) -> Path:
    """Check that a folder can become an aircraft's folder; return its absolute path.

    overwrite: True to accept an existing folder of an aircraft.

    Raises FlightError if the folder exists (with `overwrite`: if it is not an aircraft's folder), if its parent does
    not exist, or if its name is not valid for a model.
    """
    target = folder.absolute()
    if _NAME.fullmatch(target.name) is None or target.name in _RESERVED_NAMES:
        allowed = (
            f"expected a folder name of letters, digits, '.', '_' and '-', other than {', '.join(_RESERVED_NAMES)}"
        )
        raise FlightError(f"{folder}: {allowed}", file=folder, value=target.name, allowed=allowed)
    if overwrite and target.exists() and not target.is_symlink():
        if not (target / f"{target.name}.toml").is_file():
            raise FlightError(f"{folder}: not an aircraft's folder: it has no {target.name}.toml", file=folder)
    elif target.exists() or target.is_symlink():
        raise FlightError(f"{folder}: exists; overwrite=True replaces it, or name another folder", file=folder)
    if not target.parent.is_dir():
        raise FlightError(f"{folder}: its parent folder '{target.parent}' does not exist", file=folder)
    return target
