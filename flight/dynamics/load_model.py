"""Loads an aircraft's model into a JSBSim instance, from a checked copy."""

from pathlib import Path
from typing import Any

from aircraft.catalog import Aircraft
from flight.dynamics.jsbsim_properties import FLAT_PLANET
from flight.dynamics.model_check import check_model
from flight.dynamics.model_trial import try_model
from world.errors import FlightError


def load_model(instance: Any, copy: Path, aircraft: Aircraft, dt: float, *, flat_earth: bool, tried: bool) -> None:
    """Check a model, copy it into an empty folder, and load it from there: some models write into their own folder.

    instance: a JSBSim instance with no model yet, made for this folder.  dt: s a step.  flat_earth, tried: see
    `flight.dynamics.fdm.Fdm`.

    Raises FlightError for a model that is missing, refused or not loadable.
    """
    instance.set_debug_level(0)
    files = check_model(
        aircraft.model_file,
        instance.get_property_manager().hasNode,
        aircraft.model_folders,
        shipped=aircraft.model.shipped,
    )
    if not tried:
        try_model(aircraft)
    folder = copy / aircraft.name
    folder.mkdir()
    for name, data in files.items():
        (folder / name).write_bytes(data)
    instance.set_aircraft_path(str(copy))
    instance.set_engine_path(str(folder))
    instance.set_systems_path(str(folder))
    instance.set_dt(dt)
    if flat_earth:
        planet = copy / "flat.xml"
        planet.write_text(FLAT_PLANET, encoding="utf-8")
        instance.load_planet(str(planet), False)
    try:
        loaded = instance.load_model(aircraft.name)
    # JSBSim's own errors are RuntimeErrors.
    except (RuntimeError, ValueError, OSError) as error:
        message = " ".join(str(error).split()).replace(str(folder), str(aircraft.model_file.parent))
        raise FlightError(f"{aircraft.model_file}: JSBSim: {message}", file=aircraft.model_file) from None
    if not loaded:
        raise FlightError(f"{aircraft.model_file}: JSBSim cannot load this model", file=aircraft.model_file)
