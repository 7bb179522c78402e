"""Define ground contacts of an aircraft: belly skids or wheels, and points of the structure.

Most models have no contacts, because a flight in the air requires none. Contacts are added to the model only for a
flight with take-off or landing, so that a flight in the air loads the unchanged file. A model with contacts keeps them.

Positions and stiffness scale with span and mass, from an Aerosonde (11 kg, 2.9 m) that took off and landed in JSBSim
under ArduPlane: a belly of 3000 N/m per skid, 0.18 m below the center of gravity at rest, friction 0.5 and 0.4.
"""

import math
import re
from dataclasses import dataclass, replace
from typing import Literal
from xml.etree import ElementTree

import numpy as np

from aircraft.catalog import Aircraft
from aircraft.envelope import GRAVITY
from world.arrays import Floats

# Landing gear that is added to an aircraft whose model has no contacts.
Gear = Literal["belly", "wheels"]
# Metres in each unit of length of a model.
_METRES_PER_UNIT = {"M": 1.0, "FT": 0.3048, "IN": 0.0254}
# Kilograms in each unit of mass of a model.
_KILOGRAMS_PER_UNIT = {"KG": 1.0, "LBS": 0.45359237}
# Minimum depth of the points on which a model without wheels stands, as a ratio to the deepest point.
_MIN_SKID_DEPTH_RATIO = 0.75

# Positions of belly skids relative to the center of gravity, forward, right and down, in spans. A point to the right
# has a twin to the left, so belly and wheels have three points each.
_BELLY_POINTS = {"belly front": (0.12, 0.025, 0.069), "belly rear": (-0.12, 0.0, 0.069)}
# Positions of wheels, as for belly skids.
_WHEEL_POINTS = {"nose wheel": (0.20, 0.0, 0.085), "main wheel": (-0.04, 0.10, 0.085)}
# Positions of other points of the structure, as for belly skids.
_STRUCTURE_POINTS = {"nose": (0.25, 0.0, 0.02), "tail": (-0.35, 0.0, 0.0), "wing tip": (0.0, 0.5, -0.02)}
# Static compression of skids or wheels under the aircraft's weight, in spans.
_SAG_SPANS = 0.0062
# Damping of skids or wheels, as a ratio to critical damping.
_DAMPING_RATIO = 0.6
# Static, dynamic and rolling friction of a belly on grass.
_SKID_FRICTION = (0.5, 0.4, 0.0)
# Static, dynamic and rolling friction of small wheels without a brake.
_WHEEL_FRICTION = (0.8, 0.5, 0.05)


@dataclass(frozen=True, slots=True)
class Contact:
    """Point of an aircraft that may touch the ground.

    name: name in the model.
    forward, right, down: position relative to the center of gravity, m.
    is_support: True if the aircraft stands and slides on the point; other points must not touch the ground at speed.
    wheel: True for a wheel.
    """

    name: str
    forward: float
    right: float
    down: float
    is_support: bool
    wheel: bool = False


def default_contacts(aircraft: Aircraft, gear: Gear) -> tuple[Contact, ...]:
    """Return default ground contacts, scaled by the wing span, for an aircraft whose model has none.

    >>> from aircraft.catalog import load_aircraft
    >>> contacts = default_contacts(load_aircraft("aerosonde"), "belly")
    >>> len(contacts), contacts[0].name, round(contacts[0].down, 2), contacts[-1].is_support
    (7, 'belly front left', 0.2, False)
    """
    span, standing_points = aircraft.wing_span, _WHEEL_POINTS if gear == "wheels" else _BELLY_POINTS
    contacts = []
    for name, (forward, right, down) in {**standing_points, **_STRUCTURE_POINTS}.items():
        for side, sign in (("left", -1.0), ("right", 1.0)) if right else (("", 0.0),):
            position = (forward * span, sign * right * span, down * span)
            contacts.append(
                Contact(f"{name} {side}".strip(), *position, name in standing_points, name in _WHEEL_POINTS)
            )
    return tuple(contacts)


def find_contacts(aircraft: Aircraft, gear: Gear) -> tuple[Contact, ...]:
    """Return the ground contacts of an aircraft's model, or default contacts if the model has none.

    gear: landing gear of the default contacts.

    Contacts on which the aircraft stands come first. Raises ValueError for a model that is not XML.

    >>> from aircraft.catalog import load_aircraft
    >>> [contact.name for contact in find_contacts(load_aircraft("c172x"), "belly") if contact.wheel]
    ['Nose Gear', 'Left Main Gear', 'Right Main Gear']
    """
    model_contacts = _model_contacts(aircraft.model_file.read_bytes())
    return model_contacts or default_contacts(aircraft, gear)


def with_contacts(model: bytes, aircraft: Aircraft, gear: Gear) -> bytes:
    """Return the XML of a model with default contacts added; unchanged if the model has contacts.

    model: XML of the model.
    gear: landing gear that is added, belly skids or wheels.
    """
    if _model_contacts(model):
        return model
    contacts = default_contacts(aircraft, gear)
    # The contacts on which the aircraft stands share its weight.
    standing_count = sum(contact.is_support for contact in contacts)
    stiffness = aircraft.mass * GRAVITY / (_SAG_SPANS * aircraft.wing_span) / standing_count
    damping = 2.0 * _DAMPING_RATIO * math.sqrt(stiffness * aircraft.mass / standing_count)
    centre = _center_of_gravity(model)
    texts = []
    for contact in contacts:
        # Position in meters aft, right and up from the model's reference point.
        aft, right, up = centre + np.array([-contact.forward, contact.right, -contact.down])
        static, dynamic, rolling = _WHEEL_FRICTION if contact.wheel else _SKID_FRICTION
        contact_type, name = "BOGEY" if contact.wheel else "STRUCTURE", contact.name.upper().replace(" ", "_")
        texts.append(f"""  <contact type="{contact_type}" name="{name}">
    <location unit="M"> <x> {aft:.6f} </x> <y> {right:.6f} </y> <z> {up:.6f} </z> </location>
    <static_friction> {static} </static_friction>
    <dynamic_friction> {dynamic} </dynamic_friction>
    <rolling_friction> {rolling} </rolling_friction>
    <spring_coeff unit="N/M"> {stiffness:.6f} </spring_coeff>
    <damping_coeff unit="N/M/SEC"> {damping:.6f} </damping_coeff>
    <max_steer unit="DEG"> 0 </max_steer>
    <brake_group> NONE </brake_group>
    <retractable> 0 </retractable>
  </contact>""")
    section = "\n".join(["<ground_reactions>", *texts, "</ground_reactions>"]).encode()
    changed_model, count = re.subn(
        rb"<ground_reactions\s*(/>|>\s*</ground_reactions>)", lambda _: section, model, count=1
    )
    return changed_model if count else model.replace(b"</fdm_config>", section + b"\n</fdm_config>")


def _model_contacts(model: bytes) -> tuple[Contact, ...]:
    """Return the contacts in a model's XML; the contacts on which the aircraft stands come first.

    The aircraft stands on its wheels, or without wheels on its lowest points.
    """
    # Contacts in the XML; only wheels have `is_support` set.
    section = ElementTree.fromstring(model).find("ground_reactions")
    contacts, centre = [], _center_of_gravity(model)
    for element in [] if section is None else section.findall("contact"):
        position = _read_location(element.find("location"))
        if position is None:
            continue
        is_wheel = element.get("type", "BOGEY") == "BOGEY"
        forward, right, down = np.array([-1.0, 1.0, -1.0]) * (position - centre)
        contacts.append(Contact(element.get("name", ""), float(forward), float(right), float(down), is_wheel, is_wheel))
    if not any(contact.wheel for contact in contacts):
        max_depth = max((contact.down for contact in contacts), default=0.0)
        contacts = [
            replace(contact, is_support=contact.down >= _MIN_SKID_DEPTH_RATIO * max_depth > 0.0) for contact in contacts
        ]
    return tuple(sorted(contacts, key=lambda contact: not contact.is_support))


def _center_of_gravity(model: bytes) -> Floats:
    """Return the loaded aircraft's center of gravity, m aft, right and up of the reference point, (3,).

    As in JSBSim, the loaded aircraft consists of the empty aircraft, its point masses and the initial contents of its
    tanks.
    """
    root = ElementTree.fromstring(model)
    cg_elements = [element for element in root.findall("mass_balance/location") if element.get("name") == "CG"]
    loads = [(root.find("mass_balance/emptywt"), _read_location(cg_elements[0]) if cg_elements else None)]
    loads += [
        (element.find("weight"), _read_location(element.find("location")))
        for element in root.findall("mass_balance/pointmass")
    ]
    loads += [
        (element.find("contents"), _read_location(element.find("location")))
        for element in root.findall("propulsion/tank")
    ]
    masses = [
        (
            0.0
            if weight is None
            else _KILOGRAMS_PER_UNIT.get(weight.get("unit", "LBS"), 1.0) * float(weight.text or "0"),
            position,
        )
        for weight, position in loads
        if position is not None
    ]
    total = sum(mass for mass, _ in masses)
    if not total > 0.0:
        return masses[0][1] if masses else np.zeros(3)
    return np.asarray(sum(mass * position for mass, position in masses) / total)


def _read_location(location: ElementTree.Element | None) -> Floats | None:
    """Return the position in a location element of a model, m, (3,); None if the element is missing."""
    if location is None:
        return None
    unit = _METRES_PER_UNIT.get(location.get("unit", "IN"), 1.0)
    return unit * np.array([float(location.findtext(axis, "0")) for axis in "xyz"])
