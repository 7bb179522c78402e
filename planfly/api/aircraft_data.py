"""The aircraft that planfly knows, and one's own."""

from pathlib import Path
from typing import overload

from aircraft.catalog import Aircraft, aircraft_names, find_aircraft, load_aircraft


@overload
def aircraft() -> dict[str, Aircraft]: ...
@overload
def aircraft(name: str | Path) -> Aircraft: ...
def aircraft(name: str | Path | None = None) -> Aircraft | dict[str, Aircraft]:
    """An aircraft by its name, or by the folder of one's own: masses, speeds and limits, in SI units and radians.

    name: None for all embedded ones by name.
    Raises a `planfly.PlanflyError` for a name that is none and a folder that holds no aircraft.

    >>> import planfly
    >>> planfly.aircraft("aerosonde").airspeed
    25.0
    >>> list(planfly.aircraft())
    ['aerosonde', 'c172x']
    """
    if name is None:
        return {known: load_aircraft(known) for known in aircraft_names()}
    return find_aircraft(str(name.resolve()) if isinstance(name, Path) else name)
