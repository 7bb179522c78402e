"""Where an aircraft meets the ground: belly skids or wheels, and the points that are not to touch it.

Most models have no contacts, for a flight in the air needs none: they are given to the model that is loaded for a
flight which takes off or lands, so that a flight in the air loads the same file as ever.  A model that has contacts of
its own keeps them.

Places and stiffness go by span and mass, about those of an Aerosonde (11 kg, 2.9 m) that took off and landed in JSBSim
under ArduPlane: a belly of 3000 N/m a skid, 0.18 m below the centre of gravity at rest, friction 0.5 and 0.4.
"""

import math
import re
from dataclasses import dataclass, replace
from typing import Literal
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from aircraft.catalog import Aircraft
from aircraft.envelope import GRAVITY

Floats = NDArray[np.float64]

Gear = Literal["belly", "wheels"]
_METRES = {"M": 1.0, "FT": 0.3048, "IN": 0.0254}
_KILOGRAMS = {"KG": 1.0, "LBS": 0.45359237}
# A model without wheels stands on its lowest points: on those that are at least so deep, as a share of the deepest.
_SKIDS = 0.75

# In spans, forward, to the right and down from the centre of gravity.  Of the belly and the wheels each side has one
# more: all stand on three points.
_BELLY = {"belly front": (0.12, 0.025, 0.069), "belly rear": (-0.12, 0.0, 0.069)}
_WHEELS = {"nose wheel": (0.20, 0.0, 0.085), "main wheel": (-0.04, 0.10, 0.085)}
_STRUCTURE = {"nose": (0.25, 0.0, 0.02), "tail": (-0.35, 0.0, 0.0), "wing tip": (0.0, 0.5, -0.02)}
# So far the aircraft's weight presses its skids or wheels in, in spans; damping, as a share of the critical one.
_SAG, _DAMPING = 0.0062, 0.6
# Static, dynamic and rolling friction: a belly on grass, and small wheels without a brake.
_SKID, _WHEEL = (0.5, 0.4, 0.0), (0.8, 0.5, 0.05)


@dataclass(frozen=True, slots=True)
class Contact:
    """A point that may meet the ground.

    name: as the model has it.  forward, right, down: from the centre of gravity, m.
    stands: whether the aircraft stands and slides on it; any other is not to touch the ground at speed.
    wheel: whether it rolls.
    """

    name: str
    forward: float
    right: float
    down: float
    stands: bool
    wheel: bool = False


def usual_contacts(aircraft: Aircraft, gear: Gear) -> tuple[Contact, ...]:
    """The contacts of an aircraft whose model has none, by its span.

    >>> from aircraft.catalog import load_aircraft
    >>> made = usual_contacts(load_aircraft("aerosonde"), "belly")
    >>> len(made), made[0].name, round(made[0].down, 2), made[-1].stands
    (7, 'belly front left', 0.2, False)
    """
    span, stands = aircraft.wing_span, _WHEELS if gear == "wheels" else _BELLY
    found = []
    for name, (forward, right, down) in {**stands, **_STRUCTURE}.items():
        for side, sign in (("left", -1.0), ("right", 1.0)) if right else (("", 0.0),):
            place = (forward * span, sign * right * span, down * span)
            found.append(Contact(f"{name} {side}".strip(), *place, name in stands, name in _WHEELS))
    return tuple(found)


def contacts_of(aircraft: Aircraft, gear: Gear) -> tuple[Contact, ...]:
    """The contacts that an aircraft flies with: those of its model, what it stands on first, or the usual ones.

    Raises ValueError for a model that is no XML.

    >>> from aircraft.catalog import load_aircraft
    >>> [contact.name for contact in contacts_of(load_aircraft("c172x"), "belly") if contact.wheel]
    ['Nose Gear', 'Left Main Gear', 'Right Main Gear']
    """
    own = _own_contacts(aircraft.model_file.read_bytes())
    return own or usual_contacts(aircraft, gear)


def with_contacts(model: bytes, aircraft: Aircraft, gear: Gear) -> bytes:
    """A model's XML with the usual contacts; as it is where it has contacts of its own."""
    if _own_contacts(model):
        return model
    made = usual_contacts(aircraft, gear)
    text = "\n".join(_contact_xml(contact, aircraft, made, _centre(model)) for contact in made)
    section = f"<ground_reactions>\n{text}\n</ground_reactions>".encode()
    found, count = re.subn(rb"<ground_reactions\s*(/>|>\s*</ground_reactions>)", lambda _: section, model, count=1)
    return found if count else model.replace(b"</fdm_config>", section + b"\n</fdm_config>")


def _contact_xml(contact: Contact, aircraft: Aircraft, made: tuple[Contact, ...], centre: Floats) -> str:
    """One contact as JSBSim reads it: metres aft, to the right and up, where the model counts them from."""
    carrying = sum(one.stands for one in made)
    stiffness = aircraft.mass * GRAVITY / (_SAG * aircraft.wing_span) / carrying
    damping = 2.0 * _DAMPING * math.sqrt(stiffness * aircraft.mass / carrying)
    aft, right, up = centre + np.array([-contact.forward, contact.right, -contact.down])
    static, dynamic, rolling = _WHEEL if contact.wheel else _SKID
    kind, name = "BOGEY" if contact.wheel else "STRUCTURE", contact.name.upper().replace(" ", "_")
    return f"""  <contact type="{kind}" name="{name}">
    <location unit="M"> <x> {aft:.6f} </x> <y> {right:.6f} </y> <z> {up:.6f} </z> </location>
    <static_friction> {static} </static_friction>
    <dynamic_friction> {dynamic} </dynamic_friction>
    <rolling_friction> {rolling} </rolling_friction>
    <spring_coeff unit="N/M"> {stiffness:.6f} </spring_coeff>
    <damping_coeff unit="N/M/SEC"> {damping:.6f} </damping_coeff>
    <max_steer unit="DEG"> 0 </max_steer>
    <brake_group> NONE </brake_group>
    <retractable> 0 </retractable>
  </contact>"""


def _own_contacts(model: bytes) -> tuple[Contact, ...]:
    """The contacts that a model states: it stands on its wheels, or on its lowest points where it has none."""
    found = _stated(model)
    if not any(one.wheel for one in found):
        deepest = max((one.down for one in found), default=0.0)
        found = [replace(one, stands=one.down >= _SKIDS * deepest > 0.0) for one in found]
    return tuple(sorted(found, key=lambda one: not one.stands))


def _stated(model: bytes) -> list[Contact]:
    """The contacts of a model, of which its wheels alone stand."""
    section = ElementTree.fromstring(model).find("ground_reactions")
    found, centre = [], _centre(model)
    for one in [] if section is None else section.findall("contact"):
        place = _place(one.find("location"))
        if place is None:
            continue
        wheel = one.get("type", "BOGEY") == "BOGEY"
        forward, right, down = np.array([-1.0, 1.0, -1.0]) * (place - centre)
        found.append(Contact(one.get("name", ""), float(forward), float(right), float(down), wheel, wheel))
    return found


def _centre(model: bytes) -> Floats:
    """The loaded aircraft's centre of gravity where the model counts places from, (3,) m aft, to the right, up.

    Of the empty aircraft, its point masses and what its tanks begin with, as JSBSim adds them up.
    """
    root = ElementTree.fromstring(model)
    empty = [one for one in root.findall("mass_balance/location") if one.get("name") == "CG"]
    loads = [(root.find("mass_balance/emptywt"), _place(empty[0]) if empty else None)]
    loads += [(one.find("weight"), _place(one.find("location"))) for one in root.findall("mass_balance/pointmass")]
    loads += [(one.find("contents"), _place(one.find("location"))) for one in root.findall("propulsion/tank")]
    carried = [(_mass(weight), place) for weight, place in loads if place is not None]
    total = sum(mass for mass, _ in carried)
    if not total > 0.0:
        return carried[0][1] if carried else np.zeros(3)
    return np.asarray(sum(mass * place for mass, place in carried) / total)


def _mass(weight: ElementTree.Element | None) -> float:
    """A weight of a model, kg."""
    if weight is None:
        return 0.0
    return _KILOGRAMS.get(weight.get("unit", "LBS"), 1.0) * float(weight.text or "0")


def _place(location: ElementTree.Element | None) -> Floats | None:
    """A place of a model, (3,) m."""
    if location is None:
        return None
    unit = _METRES.get(location.get("unit", "IN"), 1.0)
    return unit * np.array([float(location.findtext(axis, "0")) for axis in "xyz"])
