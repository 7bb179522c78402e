"""Compute the forces of ground contact as JSBSim does.

They come from springs, dampers, and friction by projected Gauss-Seidel.

The ground is level at the altitude of the frame's terrain (FGDefaultGroundCallback). Contacts are points of the
structure, or wheels that neither steer nor brake (FGLGear). Friction is solved for all contacts together so that it
stops the motion along the ground where it can (FGAccelerations).
"""

import math

import numpy as np

from flight.dynamics.earth import geodetic
from flight.dynamics.vectors import (
    Matrix,
    Vector,
    add,
    cross,
    dot,
    matrix_of,
    scale,
    set_vector,
    subtract,
    transform,
    transform_back,
    unit,
    vector_of,
)
from world.kernels import Record, Records, inlined, inner, record_dtype

# Largest number of contacts of a model.
MAX_CONTACTS = 16
# A contact: its constants, its internal state and its friction.
CONTACT = record_dtype(
    ("arm", np.float64, (3,)),  # ft, along the body's axes from the center of gravity
    ("position", np.float64, (3,)),  # in, position in JSBSim's structural frame
    "spring",  # lbf/ft
    "damping",  # lbf s/ft
    "static_friction",
    "dynamic_friction",
    "rolling_friction",
    ("is_wheel", np.bool_),
    "compression",  # ft
    "compression_speed",  # ft/s
    "slip_angle",  # degrees, of a wheel
    # Last friction forces along the wheel, across it, and against the motion, lbf.
    ("friction", np.float64, (3,)),
)
# Friction of a contact in one direction.
FRICTION = record_dtype(
    ("contact", np.int64),
    ("kind", np.int64),  # element of the contact's friction
    ("direction", np.float64, (3,)),
    ("arm", np.float64, (3,)),  # ft
    "min_force",  # lbf
    "max_force",
    "right_side",  # of its equation
    ("row", np.float64, (2 * MAX_CONTACTS,)),  # of the matrix of the equations
)
# Elements of the friction of a contact.
_ALONG = 0
_ACROSS = 1
_AGAINST = 2
# Speed along the ground above which a contact slides, ft/s.
_MIN_SLIDING_SPEED = 1e-3
# Stiffness, shape and curvature of the side force of a tyre, by Pacejka's formula.
_TYRE_STIFFNESS = 0.06
_TYRE_SHAPE = 2.8
_TYRE_CURVATURE = 1.03
# Maximum number of iterations.
_MAX_ITERATIONS = 50
# Total change of an iteration below which the solution has converged, lbf.
_CONVERGED_LBF = 1e-5
# Feet in an inch.
_INCH = 1.0 / 12.0
_DEGREES = 180.0 / math.pi


@inner
def contact_forces(frame: Record, contacts: Records, frictions: Records) -> tuple[Vector, Vector, int]:
    """Return total force (lbf) and moment (lbf ft) of all contacts, and the number of friction records.

    Force and moment are in body axes. They exclude friction, which `friction_accelerations` computes from the friction
    records. These records are filled here for the contacts below the ground.
    """
    force, moment, count = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0
    if frame.geodetic_altitude - frame.terrain > frame.contact_reach:
        for k in range(contacts.size):
            _clear_contact(contacts[k])
        return force, moment, count
    for k in range(contacts.size):
        contact = contacts[k]
        local_arm = transform_back(matrix_of(frame.local_to_body), vector_of(contact.arm))
        contact_position = add(
            transform_back(matrix_of(frame.earth_to_local), local_arm), vector_of(frame.earth_position)
        )
        latitude, altitude, _, _ = geodetic(contact_position)
        height = altitude - frame.terrain
        if height >= 0.0:
            _clear_contact(contact)
            continue
        longitude = math.atan2(contact_position[1], contact_position[0])
        cos_lat = math.cos(latitude)
        normal = (cos_lat * math.cos(longitude), cos_lat * math.sin(longitude), math.sin(latitude))
        contact_force, contact_moment, count = _contact_force(frame, contact, height, normal, frictions, k, count)
        force, moment = add(force, contact_force), add(moment, contact_moment)
    return force, moment, count


@inlined
def _clear_contact(contact: Record) -> None:
    """Reset the internal state of a contact that is above the ground."""
    contact.compression = contact.compression_speed = contact.slip_angle = 0.0
    friction = contact.friction
    friction[0] = friction[1] = friction[2] = 0.0


@inner
def _contact_force(
    frame: Record,
    contact: Record,
    height_above_ground: float,
    normal: Vector,
    frictions: Records,
    contact_index: int,
    friction_count: int,
) -> tuple[Vector, Vector, int]:
    """Return force (lbf) and moment (lbf ft) of a contact below the ground.

    Also return the number of friction records.

    Force and moment are in body axes, and exclude friction. The compression and its rate are stored in `contact`. The
    rate is limited to one that compresses the strut from nothing within a time step.

    frame: attitude and motion of the aircraft, a `FRAME` record.
    contact: `CONTACT` record; a wheel is compressed along its strut, any other contact along the normal of the ground.
    height_above_ground: height of the uncompressed contact, ft; negative.
    normal: normal of the ground, in axes fixed to the earth.
    frictions: `FRICTION` records, of which the next one or two are filled; `friction_count` are already filled.
    contact_index: index of the contact.
    """
    upward = transform(matrix_of(frame.earth_to_body), normal)
    normal_z = transform(matrix_of(frame.earth_to_local), normal)[2]
    strut_cosine = -upward[2]
    if contact.is_wheel:
        compression = height_above_ground * normal_z / strut_cosine if strut_cosine > 0.0 else 0.0
        displacement = (0.0, 0.0, -compression)
    else:
        compression = height_above_ground * normal_z / dot(normal, normal)
        displacement = scale(compression, upward)
    contact_arm = add(vector_of(contact.arm), displacement)
    velocity = add(cross(vector_of(frame.rates), contact_arm), vector_of(frame.body_velocity))
    lateral = cross(upward, (1.0, 0.0, 0.0))
    longitudinal = subtract((1.0, 0.0, 0.0), scale(dot((1.0, 0.0, 0.0), upward), upward))
    longitudinal, lateral = unit(longitudinal), unit(lateral)
    axes = (
        (longitudinal[0], lateral[0], upward[0]),
        (longitudinal[1], lateral[1], upward[1]),
        (longitudinal[2], lateral[2], upward[2]),
    )
    ground_velocity = transform_back(axes, velocity)
    speed = -ground_velocity[2]
    if contact.is_wheel:
        speed /= strut_cosine
    max_speed = compression / frame.dt
    if abs(speed) > max_speed:
        speed = (1.0 if speed >= 0.0 else -1.0) * max_speed
    contact.compression, contact.compression_speed = compression, speed
    strut_force = -compression * contact.spring + -speed * contact.damping
    strut_force = 0.0 if strut_force > 0.0 else strut_force
    normal_force = strut_force / upward[2] if contact.is_wheel else -strut_force
    force = transform(axes, (0.0, 0.0, normal_force))
    # The moment arm about the center of gravity, ft, in body axes; computed in JSBSim's structural frame (inches), to
    # reproduce JSBSim's rounding.
    position, centre, inches_per_foot = contact.position, frame.centre, 1.0 / _INCH
    x, y = position[0] + -inches_per_foot * displacement[0], position[1] + inches_per_foot * displacement[1]
    z = position[2] + -inches_per_foot * displacement[2]
    moment = cross((_INCH * (centre[0] - x), _INCH * (y - centre[1]), _INCH * (centre[2] - z)), force)
    return (
        force,
        moment,
        _add_frictions(
            contact, axes, ground_velocity, normal_force, contact_arm, frictions, contact_index, friction_count
        ),
    )


@inner
def _add_frictions(
    contact: Record,
    axes: Matrix,
    ground_velocity: Vector,
    normal_force: float,
    arm: Vector,
    frictions: Records,
    contact_index: int,
    friction_count: int,
) -> int:
    """Append the friction records of a contact; return the new number of friction records.

    A sliding contact that is not a wheel has friction against its motion. Any other contact has friction in the
    longitudinal and in the lateral direction; the lateral friction of a wheel depends on its slip angle.

    contact: `CONTACT` record; the slip angle of a sliding wheel is stored in it.
    axes: longitudinal, lateral and upward axis of the ground, as columns in body axes.
    ground_velocity: velocity of the contact along these axes, ft/s.
    normal_force: force of the ground on the contact, lbf.
    arm: position of the contact from the center of gravity, in body axes, ft.
    frictions: `FRICTION` records, of which the next one or two are filled.
    contact_index: index of the contact.
    friction_count: number of records that are already filled.
    """
    ground_speed = math.sqrt(ground_velocity[0] * ground_velocity[0] + ground_velocity[1] * ground_velocity[1])
    is_sliding = ground_speed > _MIN_SLIDING_SPEED
    if is_sliding and not contact.is_wheel:
        direction = transform(axes, unit((ground_velocity[0], ground_velocity[1], 0.0)))
        min_force = -abs(contact.dynamic_friction * normal_force)
        _set_friction(contact, frictions[friction_count], contact_index, _AGAINST, direction, arm, min_force, 0.0)
        return friction_count + 1
    max_longitudinal = abs(contact.static_friction * normal_force)
    max_lateral = max_longitudinal
    if contact.is_wheel:
        if is_sliding:
            contact.slip_angle = -math.atan2(ground_velocity[1], abs(ground_velocity[0])) * _DEGREES
        scaled_slip = _TYRE_STIFFNESS * contact.slip_angle
        slip_argument = math.atan(scaled_slip - _TYRE_CURVATURE * (scaled_slip - math.atan(scaled_slip)))
        max_lateral = abs(contact.static_friction * math.sin(_TYRE_SHAPE * slip_argument) * normal_force)
        max_longitudinal = abs(contact.rolling_friction * normal_force)
    _set_friction(
        contact,
        frictions[friction_count],
        contact_index,
        _ALONG,
        transform(axes, (1.0, 0.0, 0.0)),
        arm,
        -max_longitudinal,
        max_longitudinal,
    )
    lateral = transform(axes, (0.0, 1.0, 0.0))
    _set_friction(
        contact, frictions[friction_count + 1], contact_index, _ACROSS, lateral, arm, -max_lateral, max_lateral
    )
    return friction_count + 2


@inner
def _set_friction(
    contact: Record,
    friction: Record,
    contact_index: int,
    force_index: int,
    direction: Vector,
    arm: Vector,
    min_force: float,
    max_force: float,
) -> None:
    """Fill a friction record; limit the contact's last friction force to the range of the record.

    force_index: index in the contact's friction: `_ALONG` or `_ACROSS` the wheel, or `_AGAINST` the motion.
    direction: unit vector of the friction force, in body axes.
    arm: ft, in body axes, from the center of gravity.
    min_force, max_force: lbf.
    """
    friction.contact = contact_index
    friction.kind = force_index
    friction.min_force = min_force
    friction.max_force = max_force
    set_vector(friction.direction, direction)
    set_vector(friction.arm, arm)
    contact.friction[force_index] = _limit(min_force, contact.friction[force_index], max_force)


@inlined
def _limit(lower: float, value: float, upper: float) -> float:
    """Return the value, limited to the range from lower to upper."""
    if value < lower:
        return lower
    return upper if value > upper else value


@inner
def friction_accelerations(
    frame: Record, contacts: Records, frictions: Records, count: int, acceleration: Vector, angular_acceleration: Vector
) -> tuple[Vector, Vector]:
    """Return the linear (ft/s^2) and angular (rad/s^2) accelerations that friction causes, in body axes.

    The friction forces are those that stop all contacts along the ground within one time step, as far as their limits
    allow. They follow from a linear system with one equation for each friction record.

    contacts: `CONTACT` records, in which the friction forces are stored.
    frictions: `FRICTION` records; their rows of the system of equations are filled.
    count: number of friction records.
    acceleration, angular_acceleration: accelerations without friction, relative to the earth.
    """
    inverse_mass, inverse_inertia = 1.0 / frame.mass, matrix_of(frame.inverse_inertia)
    # Entry j of row i: acceleration at contact j along direction j for a unit friction force i (symmetric).
    for i in range(count):
        friction = frictions[i]
        direction = vector_of(friction.direction)
        unit_acceleration = scale(inverse_mass, direction)
        unit_angular_acceleration = transform(inverse_inertia, cross(vector_of(friction.arm), direction))
        for j in range(i):
            friction.row[j] = frictions[j].row[i]
        for j in range(i, count):
            other_friction = frictions[j]
            friction.row[j] = dot(
                vector_of(other_friction.direction),
                add(unit_acceleration, cross(unit_angular_acceleration, vector_of(other_friction.arm))),
            )
    # Friction has to cancel the acceleration at each contact, and its velocity within one time step.
    rate = 1.0 / frame.dt
    acceleration = add(acceleration, scale(rate, vector_of(frame.body_velocity)))
    angular_acceleration = add(angular_acceleration, scale(rate, vector_of(frame.rates)))
    for i in range(count):
        friction = frictions[i]
        diagonal = friction.row[i]
        friction.right_side = (
            -dot(vector_of(friction.direction), add(acceleration, cross(angular_acceleration, vector_of(friction.arm))))
            / diagonal
        )
        for j in range(count):
            friction.row[j] /= diagonal
    _solve_frictions(contacts, frictions, count)
    force, moment = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for i in range(count):
        friction = frictions[i]
        friction_force = scale(contacts[friction.contact].friction[friction.kind], vector_of(friction.direction))
        force, moment = add(force, friction_force), add(moment, cross(vector_of(friction.arm), friction_force))
    return scale(inverse_mass, force), transform(inverse_inertia, moment)


@inner
def _solve_frictions(contacts: Records, frictions: Records, count: int) -> None:
    """Solve for the friction force of each contact by the Gauss-Seidel method, within the force limits.

    contacts: `CONTACT` records, which hold the forces (lbf): the solution of the last step is the first guess.
    frictions: `FRICTION` records with the rows of the normalised system and the limits of the force.
    count: number of friction records.
    """
    for _ in range(_MAX_ITERATIONS):
        total_change = 0.0
        for i in range(count):
            friction = frictions[i]
            forces = contacts[friction.contact].friction
            last_force = forces[friction.kind]
            increment = friction.right_side
            for j in range(count):
                other_friction = frictions[j]
                increment -= friction.row[j] * contacts[other_friction.contact].friction[other_friction.kind]
            forces[friction.kind] = _limit(friction.min_force, last_force + increment, friction.max_force)
            total_change += abs(forces[friction.kind] - last_force)
        if total_change < _CONVERGED_LBF:
            break
