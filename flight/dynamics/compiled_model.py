"""Fly a model in compiled code instead of JSBSim, if both give the same result in every bit.

A `CompiledModel` copies the state of a JSBSim instance at the start of a flight. `CompiledModel.find_differences` then
steps both with changing commands and gusts, and compares every register that JSBSim has as a property.
"""

import math
from collections.abc import Sequence
from itertools import accumulate

import numpy as np

from flight.dynamics.compiled_frame import CODE_HEADER, FRAME, FRAME_NUMBERS, initialise_attitude, step_repeatedly
from flight.dynamics.fdm import Fdm
from flight.dynamics.ground_contact import CONTACT, FRICTION
from flight.dynamics.instructions import LOWER_LIMIT, Code
from flight.dynamics.jsbsim_properties import FOOT, FORCES, GUST, MASS, MODEL_FIELDS, STATE_PROPERTIES, TERRAIN, WIND
from flight.dynamics.model_program import (
    FRAME_PROPERTIES,
    UnsupportedModel,
    frame_register,
    translate,
)
from world.arrays import Floats
from world.kernels import Record, Records

# Steps for which both engines are compared.
PROOF_STEPS = 240
# Steps between two comparisons; the commands change after each comparison.
_PROOF_STRIDE = 10
# Movement of the surfaces to either side of their trimmed position, rad: their rate limits act.
_PROOF_SURFACE_RAD = 0.15
# Movement of the throttle to either side of its trimmed position.
_PROOF_THROTTLE = 0.2
# Gusts to either side, ft/s.
_PROOF_GUST_FPS = 3.0
# Number of the first comparison with contacts on the ground.
_PROOF_GROUND_ROUND = 16
# Depth to which the lowest contact is pressed into the ground in these comparisons, ft.
_PROOF_DEPTH_FT = 0.05
# Contacts are computed up to this height above their reach, ft.
_REACH_MARGIN_FT = 1.0
# Properties of a contact by its fields.
_CONTACT_FIELDS = {"compression": "compression-ft", "compression_speed": "compression-velocity-fps"}
# Feet in an inch, JSBSim's value.
_INCH = 1.0 / 12.0

# JSBSim's properties for the vector fields of the frame.
_VECTOR_PROPERTIES = {
    "position": tuple(f"position/eci-{axis}-ft" for axis in "xyz"),
    "velocity": tuple(f"velocities/eci-{axis}-fps" for axis in "xyz"),
    "acceleration": tuple(f"accelerations/{axis}idot-ft_sec2" for axis in "uvw"),
    "inertial_rates": tuple(f"velocities/{axis}i-rad_sec" for axis in "pqr"),
    "angular_acceleration": tuple(f"accelerations/{axis}idot-rad_sec2" for axis in "pqr"),
    "ground_velocity": tuple(f"velocities/v-{axis}-fps" for axis in ("north", "east", "down")),
    "wind": WIND,
    "gust": GUST,
}
# JSBSim's properties for the scalar fields of the frame.
_NUMBER_PROPERTIES = {
    "time": "simulation/sim-time-sec",
    "earth_angle": "position/epa-rad",
    "latitude": "position/lat-geod-rad",
    "longitude": "position/long-gc-rad",
    "altitude": "position/h-sl-ft",
    "roll": "attitude/phi-rad",
    "pitch": "attitude/theta-rad",
    "yaw": "attitude/psi-rad",
    "load_factor": "accelerations/Nz",
}


class CompiledModel:
    """Compiled model of an aircraft in flight, which continues a flight that JSBSim has started.

    numbers: registers: the values of all quantities; a register is named by its index in this array.
    frames: (1,) of `flight.dynamics.compiled_frame.FRAME`, the first registers.
    code: sections as `flight.dynamics.compiled_frame` describes them.
    contacts, frictions: records of `flight.dynamics.ground_contact`.
    properties: register of each JSBSim property that has a register, by name.
    """

    def __init__(self, fdm: Fdm, reads: Sequence[str], steps: int, *, gusts: bool, terrain: bool) -> None:
        """Copy the state of an aircraft at the start of a flight, before the first step.

        reads: fields of `flight.dynamics.state.STATE` that are read in each tick.
        steps: steps in a tick.
        gusts, terrain: True if gusts, or the altitude of the ground, are set in each tick.

        Raises UnsupportedModel for a model that is not covered.
        """
        if fdm.flat_earth:
            raise UnsupportedModel("a flat earth")
        program = translate(fdm.model_text())
        self._fdm, self._program = fdm, program
        # Register of each JSBSim property by name: properties of the frame first, then properties of the program.
        vector_registers = {
            name: frame_register(field, k)
            for field, names in _VECTOR_PROPERTIES.items()
            for k, name in enumerate(names)
        }
        number_registers = {name: frame_register(field) for field, name in _NUMBER_PROPERTIES.items()}
        self.properties = (
            vector_registers
            | number_registers
            | {name: frame_register(*field_and_element) for name, field_and_element in FRAME_PROPERTIES.items()}
        ) | program.properties
        # Two more registers: a zero for quantities that the aircraft lacks, and one for outputs that are not used.
        self.numbers: Floats = np.array([*program.numbers, 0.0, 0.0])
        zero_register = len(program.numbers)
        access = fdm.properties
        self._getters = {name: (register, access.getter(name)) for name, register in self.properties.items()}
        commands = (self._register(command.name) for command in fdm.aircraft.model.commands)
        outputs = (*commands, *map(self._register, GUST), frame_register("terrain"))
        is_used = (True, True, True, True, gusts, gusts, gusts, terrain)
        writes = [register if is_set else zero_register + 1 for register, is_set in zip(outputs, is_used, strict=True)]
        self.contacts: Records = np.zeros(len(program.contacts), CONTACT)
        self.frictions: Records = np.zeros(2 * len(program.contacts), FRICTION)
        self._contact_getters = [
            (number, field, access.getter(f"{contact.base}/{name}"))
            for number, contact in enumerate(program.contacts)
            for field, name in _CONTACT_FIELDS.items()
        ]
        self.frames: Records = self.numbers[:FRAME_NUMBERS].view(FRAME)
        # Registers of the fields of the state; the zero for a quantity that the aircraft lacks.
        state_registers = []
        for field in reads:
            if field in STATE_PROPERTIES:
                name = STATE_PROPERTIES[field][0]
            else:
                name = fdm.aircraft.model.readings[MODEL_FIELDS.index(field)].name
            state_registers.append(self._register(name) if name else zero_register)
        # The code is the header, then the sections in order.
        forces = [number for force in program.forces for number in (force.magnitude, force.axes)]
        sections = (
            program.fcs,
            program.aero,
            program.external,
            forces,
            state_registers,
            writes,
        )
        bounds = accumulate(map(len, sections), initial=CODE_HEADER)
        self.code = np.array([steps, *bounds, *(number for section in sections for number in section)], dtype=np.uint32)
        self._copy_state()

    def find_differences(self) -> list[str]:
        """Step JSBSim and the compiled model together; return the properties that then differ in any bit.

        The steps end at the first difference. The list is empty if there is no difference in `PROOF_STEPS` steps. Only
        the state of the compiled model is restored, so a flight with JSBSim must start again.
        """
        initial_numbers, initial_contacts = self.numbers.copy(), self.contacts.copy()
        differing = self.differing_properties()
        for round_number in range(PROOF_STEPS // _PROOF_STRIDE):
            if differing:
                break
            # Perturb commands and gusts equally in JSBSim and in the compiled model, with new signs in each round. In
            # the later rounds the ground touches the contacts.
            perturbations = [_PROOF_SURFACE_RAD] * 3 + [_PROOF_THROTTLE] + [_PROOF_GUST_FPS] * 3
            scales = [command.above for command in self._fdm.aircraft.model.commands] + [1.0] * 3
            names = [*(command.name for command in self._fdm.aircraft.model.commands), *GUST]
            for k, (name, perturbation, scale) in enumerate(zip(names, perturbations, scales, strict=True)):
                # A Gray code of five bits gives the signs: from one round to the next only one bit changes. The last
                # two of the seven inputs (two gusts) share the bits of the first two.
                sign = 1.0 if (round_number ^ (round_number >> 1)) >> k % 5 & 1 else -1.0
                register = self.properties[name]
                self.numbers[register] = initial_numbers[register] + sign * perturbation * scale
                self._fdm.properties.set(name, self.numbers[register])
            if len(self.contacts) and round_number >= _PROOF_GROUND_ROUND:
                # The ground is raised until the lowest point of the aircraft touches it.
                depths = (self.contacts["arm"] @ self.frames[0].local_to_body)[:, 2]
                frame = self.frames[0]
                frame.terrain = frame.geodetic_altitude - float(depths.max()) + _PROOF_DEPTH_FT
                self._fdm.properties.set(TERRAIN, frame.terrain)
            self._fdm.step(_PROOF_STRIDE)
            step_repeatedly(*self.arrays, _PROOF_STRIDE)
            differing = self.differing_properties()
        self.numbers[:], self.contacts[:] = initial_numbers, initial_contacts
        return differing

    @property
    def arrays(self) -> tuple[Records, Floats, Code, Records, Records]:
        """Arrays of the model, in the order of the arguments of a `flight.autopilots.parts.Loop`."""
        return self.frames, self.numbers, self.code, self.contacts, self.frictions

    # ----------------------------------------------------------------------

    def _register(self, name: str) -> int:
        """Return the register of a property; raise UnsupportedModel if the property has no register."""
        if name not in self.properties:
            raise UnsupportedModel(f"property {name}")
        return self.properties[name]

    def _copy_state(self) -> None:
        """Copy the state and the constants of the JSBSim instance to the frame and the registers."""
        read_property, numbers = self._fdm.properties.read, self.numbers
        for register, getter in self._getters.values():
            numbers[register] = getter()
        frame: Record = self.frames[0]
        frame.dt, frame.mass = self._fdm.dt, read_property(MASS)
        inertia = {axes: read_property(f"inertia/i{axes}-slugs_ft2") for axes in ("xx", "yy", "zz", "xy", "xz", "yz")}
        frame.inertia, frame.inverse_inertia = _inertia_matrices(**inertia)
        frame.specific_force = [1.0 / frame.mass * read_property(name) for name in FORCES]
        # Initial conditions fill the last values of the integrators with the current ones.
        frame.last_velocity, frame.second_last_velocity = frame.velocity, frame.velocity
        frame.last_acceleration = frame.acceleration
        centre = [read_property(f"inertia/cg-{axis}-in") for axis in "xyz"]
        frame.aero_arm = _arm_about_center([read_property(f"metrics/aero-rp-{axis}-in") for axis in "xyz"], centre)
        for force in self._program.forces:
            base = f"external_reactions/{force.name}"
            direction = [read_property(f"{base}/{axis}") for axis in ("lmn" if force.is_moment else "xyz")]
            axes = [0.0] * 3 + direction + [0.0] * 3
            if not force.is_moment:
                axes = (
                    direction
                    + [0.0] * 3
                    + _arm_about_center([read_property(f"{base}/location-{axis}-in") for axis in "xyz"], centre)
                )
            numbers[force.axes : force.axes + len(axes)] = axes
        for block in self._program.actuators:
            # The registers of an actuator up to `LOWER_LIMIT`, with its output equal to its input.
            output, lag = numbers[block.source], frame.dt * block.lag
            numbers[block.first_register : block.first_register + LOWER_LIMIT] = [
                *[output] * 3,
                lag / (2.0 + lag),
                (2.0 - lag) / (2.0 + lag),
                frame.dt * block.rate,
            ]
        # JSBSim has no property for the friction forces of a contact on the ground.
        frame.centre, frame.terrain = centre, self._fdm.terrain_amsl / FOOT
        for contact, data in zip(self.contacts, self._program.contacts, strict=True):
            if read_property(f"{data.base}/WOW"):
                raise UnsupportedModel("a start on the ground")
            contact.position = [read_property(f"{data.base}/{axis}-position") for axis in "xyz"]
            contact.arm = _arm_about_center(contact.position, centre)
            for field in data._fields[1:]:
                contact[field] = getattr(data, field)
        arms = np.linalg.norm(self.contacts["arm"], axis=1)
        frame.contact_reach = float(np.max(arms, initial=0.0)) + _REACH_MARGIN_FT
        initialise_attitude(self.frames, self._fdm.attitudes())

    def differing_properties(self) -> list[str]:
        """Return the names of the properties and contact fields that now differ from JSBSim's in any bit."""
        numbers = self.numbers.tolist()
        differing = [
            name for name, (register, getter) in self._getters.items() if not _is_equal(numbers[register], getter())
        ]
        contacts = self.contacts
        return differing + [
            field
            for number, field, getter in self._contact_getters
            if not _is_equal(float(contacts[number][field]), getter())
        ]


def _is_equal(a: float, b: float) -> bool:
    """Return True if two numbers are equal, or if both are NaN."""
    return a == b or (math.isnan(a) and math.isnan(b))


def _arm_about_center(position: Sequence[float], center: Sequence[float]) -> list[float]:
    """Return the arm from the center of gravity to a position, ft, in body axes.

    position, center: the position and the center of gravity in JSBSim's structural frame, inches.
    """
    return [_INCH * (center[0] - position[0]), _INCH * (position[1] - center[1]), _INCH * (center[2] - position[2])]


def _inertia_matrices(xx: float, yy: float, zz: float, xy: float, xz: float, yz: float) -> tuple[Floats, Floats]:
    """Return the inertia matrix and its inverse, (3, 3) each, from JSBSim's inertia properties.

    xx, yy, zz: moments of inertia about the body axes, slug ft^2.
    xy, xz, yz: products of inertia, slug ft^2.

    As in FGMassBalance, xz has the opposite sign convention to the other products of inertia. The inverse has
    the elements k1 to k6, which are cofactors divided by the determinant.
    """
    ixz = -xz
    k1, k2, k3 = yy * zz - yz * yz, yz * ixz + xy * zz, xy * yz + yy * ixz
    factor = 1.0 / (xx * k1 - xy * k2 - ixz * k3)
    k1, k2, k3 = k1 * factor, k2 * factor, k3 * factor
    k4, k5, k6 = (zz * xx - ixz * ixz) * factor, (xy * ixz + yz * xx) * factor, (xx * yy - xy * xy) * factor
    matrix = [[xx, -xy, -ixz], [-xy, yy, -yz], [-ixz, -yz, zz]]
    return np.array(matrix), np.array([[k1, k2, k3], [k2, k4, k5], [k3, k5, k6]])
