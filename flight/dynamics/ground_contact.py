"""Compute the forces of ground contact as JSBSim does: springs and dampers, and friction by a projected Gauss-Seidel.

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
# A contact, its memory and its friction.
CONTACT = record_dtype(
    ("arm", np.float64, (3,)),  # ft, along the body's axes from the center of gravity
    ("place", np.float64, (3,)),  # in, of the structure
    "spring",  # lbf/ft
    "damping",  # lbf s/ft
    "static_friction",
    "dynamic_friction",
    "rolling_friction",
    ("is_wheel", np.bool_),
    "compression",  # ft
    "compression_speed",  # ft/s
    "slip_angle",  # degrees, of a wheel
    # Last values of the friction along the wheel, across it, and against the motion, lbf.
    ("friction", np.float64, (3,)),
)
# Friction of a contact in one direction.
FRICTION = record_dtype(
    ("contact", np.int64),
    ("kind", np.int64),  # element of the contact's friction
    ("direction", np.float64, (3,)),
    ("arm", np.float64, (3,)),  # ft
    "least",  # lbf
    "most",
    "right_side",  # of its equation
    ("row", np.float64, (2 * MAX_CONTACTS,)),  # of the matrix of the equations
)
# Elements of the friction of a contact.
_ALONG = 0
_ACROSS = 1
_AGAINST = 2
# Speed along the ground above which a point of the structure slides, ft/s.
_MIN_SLIDING_SPEED = 1e-3
# Stiffness, shape and curvature of the side force of a tyre, by Pacejka's formula.
_TYRE_STIFFNESS = 0.06
_TYRE_SHAPE = 2.8
_TYRE_CURVATURE = 1.03
# Largest number of iterations, and the change at which they end, lbf.
_MAX_ITERATIONS = 50
_CONVERGED_LBF = 1e-5
# Feet in an inch.
_INCH = 1.0 / 12.0
_DEGREES = 180.0 / math.pi


@inner
def contact_forces(frame: Record, contacts: Records, frictions: Records) -> tuple[Vector, Vector, int]:
    """Return the force of all contacts along the body's axes, its moment, and the number of frictions to solve."""
    force, moment, count = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0
    if frame.geodetic_altitude - frame.terrain > frame.contact_reach:
        for k in range(contacts.size):
            _release(contacts[k])
        return force, moment, count
    for k in range(contacts.size):
        contact = contacts[k]
        local = transform_back(matrix_of(frame.local_to_body), vector_of(contact.arm))
        place = add(transform_back(matrix_of(frame.earth_to_local), local), vector_of(frame.place))
        latitude, altitude, _, _ = geodetic(place)
        height = altitude - frame.terrain
        if height >= 0.0:
            _release(contact)
            continue
        longitude = math.atan2(place[1], place[0])
        cos_lat = math.cos(latitude)
        normal = (cos_lat * math.cos(longitude), cos_lat * math.sin(longitude), math.sin(latitude))
        one, own, count = _press(frame, contact, height, normal, frictions, k, count)
        force, moment = add(force, one), add(moment, own)
    return force, moment, count


@inlined
def _release(contact: Record) -> None:
    """Clear the memory of a contact that is above the ground."""
    contact.compression = contact.compression_speed = contact.slip_angle = 0.0
    friction = contact.friction
    friction[0] = friction[1] = friction[2] = 0.0


@inner
def _press(
    frame: Record, contact: Record, height: float, normal: Vector, frictions: Records, number: int, count: int
) -> tuple[Vector, Vector, int]:
    """Return the force of a contact below the ground, its moment, and the number of frictions with its own.

    height: above the ground, ft.
    normal: of the ground, in axes fixed to the earth.
    """
    upward = transform(matrix_of(frame.earth_to_body), normal)
    normal_z = transform(matrix_of(frame.earth_to_local), normal)[2]
    leg = -upward[2]
    if contact.is_wheel:
        compression = height * normal_z / leg if leg > 0.0 else 0.0
        displacement = (0.0, 0.0, -compression)
    else:
        compression = height * normal_z / dot(normal, normal)
        displacement = scale(compression, upward)
    touching = add(vector_of(contact.arm), displacement)
    velocity = add(cross(vector_of(frame.rates), touching), vector_of(frame.body_velocity))
    across = cross(upward, (1.0, 0.0, 0.0))
    along = subtract((1.0, 0.0, 0.0), scale(dot((1.0, 0.0, 0.0), upward), upward))
    along, across = unit(along), unit(across)
    axes = (
        (along[0], across[0], upward[0]),
        (along[1], across[1], upward[1]),
        (along[2], across[2], upward[2]),
    )
    sliding = transform_back(axes, velocity)
    speed = -sliding[2]
    if contact.is_wheel:
        speed /= leg
    largest = compression / frame.dt
    if abs(speed) > largest:
        speed = (1.0 if speed >= 0.0 else -1.0) * largest
    contact.compression, contact.compression_speed = compression, speed
    strut = -compression * contact.spring + -speed * contact.damping
    strut = 0.0 if strut > 0.0 else strut
    pressure = strut / upward[2] if contact.is_wheel else -strut
    force = transform(axes, (0.0, 0.0, pressure))
    moment = cross(_moment_arm(frame, contact, displacement), force)
    return force, moment, _add_frictions(contact, axes, sliding, pressure, touching, frictions, number, count)


@inlined
def _moment_arm(frame: Record, contact: Record, displacement: Vector) -> Vector:
    """Return the arm of a contact, by way of its place in the structure, as JSBSim rounds it."""
    place, centre, inches = contact.place, frame.centre, 1.0 / _INCH
    x, y = place[0] + -inches * displacement[0], place[1] + inches * displacement[1]
    z = place[2] + -inches * displacement[2]
    return _INCH * (centre[0] - x), _INCH * (y - centre[1]), _INCH * (centre[2] - z)


@inner
def _add_frictions(
    contact: Record,
    axes: Matrix,
    sliding: Vector,
    pressure: float,
    arm: Vector,
    frictions: Records,
    number: int,
    count: int,
) -> int:
    """Append the frictions of a contact, and return their number.

    sliding: velocity along the axes of the ground, ft/s.
    """
    along = math.sqrt(sliding[0] * sliding[0] + sliding[1] * sliding[1])
    moves = along > _MIN_SLIDING_SPEED
    if moves and not contact.is_wheel:
        direction = transform(axes, unit((sliding[0], sliding[1], 0.0)))
        least = -abs(contact.dynamic_friction * pressure)
        _append(contact, frictions[count], number, _AGAINST, direction, arm, least, 0.0)
        return count + 1
    forward = abs(contact.static_friction * pressure)
    sideways = forward
    if contact.is_wheel:
        if moves:
            contact.slip_angle = -math.atan2(sliding[1], abs(sliding[0])) * _DEGREES
        stiff = _TYRE_STIFFNESS * contact.slip_angle
        bend = math.atan(stiff - _TYRE_CURVATURE * (stiff - math.atan(stiff)))
        sideways = abs(contact.static_friction * math.sin(_TYRE_SHAPE * bend) * pressure)
        forward = abs(contact.rolling_friction * pressure)
    _append(contact, frictions[count], number, _ALONG, transform(axes, (1.0, 0.0, 0.0)), arm, -forward, forward)
    side = transform(axes, (0.0, 1.0, 0.0))
    _append(contact, frictions[count + 1], number, _ACROSS, side, arm, -sideways, sideways)
    return count + 2


@inner
def _append(
    contact: Record,
    friction: Record,
    number: int,
    kind: int,
    direction: Vector,
    arm: Vector,
    least: float,
    most: float,
) -> None:
    """Fill a friction, and limit the contact's last value of it."""
    friction.contact, friction.kind, friction.least, friction.most = number, kind, least, most
    set_vector(friction.direction, direction)
    set_vector(friction.arm, arm)
    contact.friction[kind] = _constrain(least, contact.friction[kind], most)


@inlined
def _constrain(least: float, value: float, most: float) -> float:
    if value < least:
        return least
    return most if value > most else value


@inner
def friction_accelerations(
    frame: Record, contacts: Records, frictions: Records, count: int, body: Vector, angular: Vector
) -> tuple[Vector, Vector]:
    """Return the accelerations by friction, along and about the body's axes.

    count: number of the frictions.
    body, angular: accelerations without friction, relative to the earth and about the body's axes.
    """
    mass, inverse = 1.0 / frame.mass, matrix_of(frame.inverse_inertia)
    for i in range(count):
        one = frictions[i]
        direction = vector_of(one.direction)
        moved = scale(mass, direction)
        turned = transform(inverse, cross(vector_of(one.arm), direction))
        for j in range(i):
            one.row[j] = frictions[j].row[i]
        for j in range(i, count):
            other = frictions[j]
            one.row[j] = dot(vector_of(other.direction), add(moved, cross(turned, vector_of(other.arm))))
    step = 1.0 / frame.dt
    body = add(body, scale(step, vector_of(frame.body_velocity)))
    angular = add(angular, scale(step, vector_of(frame.rates)))
    for i in range(count):
        one = frictions[i]
        own = one.row[i]
        one.right_side = -dot(vector_of(one.direction), add(body, cross(angular, vector_of(one.arm)))) / own
        for j in range(count):
            one.row[j] /= own
    _solve(contacts, frictions, count)
    force, moment = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for i in range(count):
        one = frictions[i]
        part = scale(contacts[one.contact].friction[one.kind], vector_of(one.direction))
        force, moment = add(force, part), add(moment, cross(vector_of(one.arm), part))
    return scale(mass, force), transform(inverse, moment)


@inner
def _solve(contacts: Records, frictions: Records, count: int) -> None:
    """Find the frictions by Gauss and Seidel's method, each within its limits."""
    for _ in range(_MAX_ITERATIONS):
        changed = 0.0
        for i in range(count):
            one = frictions[i]
            values = contacts[one.contact].friction
            before = values[one.kind]
            change = one.right_side
            for j in range(count):
                other = frictions[j]
                change -= one.row[j] * contacts[other.contact].friction[other.kind]
            values[one.kind] = _constrain(one.least, before + change, one.most)
            changed += abs(values[one.kind] - before)
        if changed < _CONVERGED_LBF:
            break
