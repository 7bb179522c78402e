"""Loads an aircraft's model into a JSBSim instance, from a checked copy."""

import itertools
from pathlib import Path
from typing import Any

from aircraft.catalog import Aircraft
from flight.dynamics.jsbsim_properties import FLAT_PLANET, POUND
from flight.dynamics.model_check import check_model
from flight.dynamics.model_trial import try_model
from world.errors import FlightError

# How far a stated mass may be from the model's, as a share of it.
MASS_TOLERANCE = 0.01


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
        shipped=bool(aircraft.model.shipped),
    )
    if not tried:
        try_model(aircraft)
    folder = copy / aircraft.name
    folder.mkdir()
    for name, data in files.items():
        # JSBSim looks for the folder's name.
        own = f"{aircraft.name}.xml" if name == aircraft.model_file.name else name
        (folder / own).write_bytes(data)
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
    _check_mass(instance, aircraft)


def _check_mass(instance: Any, aircraft: Aircraft) -> None:
    """Refuse a stated mass that is not the model's, fuel included.  Raises FlightError."""
    known = instance.get_property_manager().hasNode
    tanks = itertools.takewhile(known, (f"propulsion/tank[{k}]/contents-lbs" for k in itertools.count()))
    # JSBSim adds its fuel when it first runs.
    pounds = sum(map(instance.get_property_value, tanks), instance.get_property_value("inertia/weight-lbs"))
    mass = pounds * POUND
    if not abs(aircraft.mass - mass) <= MASS_TOLERANCE * mass:
        file = aircraft.folder / f"{aircraft.name}.toml"
        raise FlightError(
            f"{file}: mass_kg = {aircraft.mass:g}: the model"
            f" {aircraft.model_file.name} has {mass:.5g} kg with its fuel; the two may differ by"
            f" {100.0 * MASS_TOLERANCE:g} %",
            file=file,
            field="mass_kg",
            value=aircraft.mass,
        )
