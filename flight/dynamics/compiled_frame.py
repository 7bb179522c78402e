"""Step a flight as JSBSim does, to the last bit.

A step computes motion, gravity, atmosphere, wind, aerodynamics and forces.

A step has JSBSim's order (FGFDMExec): Propagate, Inertial, Atmosphere, Winds, FCS, Auxiliary, Aerodynamics,
GroundReactions, ExternalReactions, Aircraft, Accelerations. Propagate integrates the accelerations of the previous
step, and the flight controls read the air data of the previous step. Units are JSBSim's: feet, slugs, pounds, rad and
s. Computations and constants are taken from JSBSim 1.3.
"""

import math

import numpy as np

from flight.dynamics.earth import AXES_RATIO, EARTH_RATE, ECCENTRICITY_2, SEMI_MAJOR, geodetic
from flight.dynamics.ground_contact import contact_forces, friction_accelerations
from flight.dynamics.instructions import Code, run_instructions
from flight.dynamics.jsbsim_properties import FOOT
from flight.dynamics.vectors import (
    Vector,
    add,
    cross,
    euler_angles,
    matrix_of,
    matrix_of_quaternion,
    product,
    product_with_transpose,
    quaternion_of_angles,
    quaternion_of_matrix,
    quaternion_product,
    quaternion_rate,
    rotation,
    scale,
    set_matrix,
    set_vector,
    subtract,
    transform,
    transform_back,
    unit_quaternion,
    vector_of,
)
from world.arrays import Floats
from world.kernels import Record, Records, compiled, inlined, inner, record_dtype

_VECTOR = (np.float64, (3,))
_MATRIX = (np.float64, (3, 3))
# State of a flight between two steps; its numbers are the first registers of a model.
FRAME = record_dtype(
    "dt",  # s
    "time",  # s
    # Motion, in inertial axes with the center of the earth at rest (ECI).
    "attitude_real",  # real part of the quaternion to the body's axes
    ("attitude", *_VECTOR),  # its other parts
    "attitude_rate_real",  # 1/s
    ("attitude_rate", *_VECTOR),
    ("inertial_rates", *_VECTOR),  # about the body's axes, rad/s
    ("angular_acceleration", *_VECTOR),  # about the body's axes, rad/s^2
    ("position", *_VECTOR),  # ft
    ("velocity", *_VECTOR),  # ft/s
    ("last_velocity", *_VECTOR),
    ("second_last_velocity", *_VECTOR),
    ("acceleration", *_VECTOR),  # ft/s^2
    ("last_acceleration", *_VECTOR),
    ("specific_force", *_VECTOR),  # along the body's axes, ft/s^2
    # Position.
    "earth_angle",  # rad, from inertial axes to axes fixed to the earth (ECEF)
    "earth_sin",
    "earth_cos",
    ("earth_position", *_VECTOR),  # ft, ECEF
    "radius",  # ft
    "geocentric_latitude",  # rad
    "latitude",  # rad, geodetic
    "longitude",  # rad
    "altitude",  # ft, radius above the ellipsoid's radius
    "geodetic_altitude",  # ft
    "terrain",  # ft, altitude of the ground
    ("gravity", *_VECTOR),  # ft/s^2, ECEF
    # Axes: north, east and down are local.
    ("inertial_to_body", *_MATRIX),
    ("local_to_body", *_MATRIX),
    ("earth_to_body", *_MATRIX),
    ("earth_to_local", *_MATRIX),
    # Motion relative to the earth.
    ("body_velocity", *_VECTOR),  # ft/s
    ("rates", *_VECTOR),  # rad/s
    ("ground_velocity", *_VECTOR),  # ft/s, north, east, down
    "roll",  # rad
    "pitch",
    "yaw",
    # Air.
    "temperature",  # degrees Rankine
    "pressure",  # lbf/ft^2
    "density",  # slug/ft^3
    ("wind", *_VECTOR),  # ft/s, north, east, down
    ("gust", *_VECTOR),  # ft/s, added to the wind
    ("air_rates", *_VECTOR),  # rad/s
    "airspeed",  # ft/s
    "alpha",  # rad
    "beta",
    "load_factor",
    "dynamic_pressure",  # lbf/ft^2
    "pressure_area",  # lbf
    "span_time",  # s, span over twice the airspeed
    "chord_time",  # s, chord over twice the airspeed
    # Sums of the aerodynamic functions.
    ("aero_force", *_VECTOR),  # lbf, in stability axes: drag, side force, lift
    ("aero_moment", *_VECTOR),  # lbf ft, about the body's axes
    # Aircraft.
    "mass",  # slugs
    ("inertia", *_MATRIX),  # slug ft^2
    ("inverse_inertia", *_MATRIX),
    ("aero_arm", *_VECTOR),  # ft, from the center of gravity to the aerodynamic reference point
    "wing_area",  # ft^2
    "wing_span",  # ft
    "wing_chord",
    ("centre", *_VECTOR),  # in, center of gravity in the structure
    "contact_reach",  # ft, height below which a contact may touch the ground
)
# Registers of the frame.
FRAME_NUMBERS = FRAME.itemsize // 8
# Header of the code: the number of steps in a tick, and the index of the first number of each section. The sections
# follow one another.
STEPS = 0
FCS_START = 1
AERO_START = 2
EXTERNAL_START = 3
# External forces and moments.
FORCES_START = 4
# Registers of `flight.simulation.tick.READ_FIELDS`.
READS_START = 5
# Registers of the fields of `flight.simulation.tick.OUTPUT`.
WRITES_START = 6
CODE_END = 7
# Length of this header.
CODE_HEADER = 8
# Count of numbers in the code for an external force or moment: register of its magnitude, first register of its axes.
FORCE_NUMBERS = 2
# Offsets of the directions of an external force and of an external moment among its registers.
FORCE_DIRECTION = 0
MOMENT_DIRECTION = 3
# Offset of the arm from the center of gravity, ft.
FORCE_ARM = 6
# Number of these registers.
FORCE_REGISTERS = 9

# ----------------------------------------------------------------------
# Atmosphere.

# Gravitational parameter of the earth, ft^3/s^2.
GRAVITY_PARAMETER = 14.0764417572e15
# Dynamic form factor of the earth.
J2 = 1.08262982e-03
# Slugs in a kilogram, the value in JSBSim's atmosphere.
_SLUGS = 0.06852168
# Standard gravity, ft/s^2.
STANDARD_GRAVITY = 9.80665 / FOOT
# Gas constant of dry air, ft lbf/(slug R).
_GAS_CONSTANT = (8.31432 * _SLUGS / ((FOOT * FOOT) * 1.8)) / (28.9645 * _SLUGS / 1000.0)
# Radius of the earth for geopotential altitudes, ft.
_GEOPOTENTIAL_RADIUS = 6356766.0 / FOOT
# Geopotential altitude of the tropopause, ft.
_TROPOPAUSE = 36089.2388
# Temperature at sea level and in the stratosphere, degrees Rankine.
_SEA_LEVEL_TEMPERATURE = 518.67
_STRATOSPHERE_TEMPERATURE = 389.97
# Pressure at sea level, lbf/ft^2.
_SEA_LEVEL_PRESSURE = 2116.228
# Temperature gradient of the troposphere, R/ft.
_LAPSE_RATE = (_STRATOSPHERE_TEMPERATURE - _SEA_LEVEL_TEMPERATURE) / (_TROPOPAUSE - 0.0) - 0.0
_PRESSURE_EXPONENT = STANDARD_GRAVITY / (_GAS_CONSTANT * _LAPSE_RATE)
# Pressure at the tropopause, lbf/ft^2.
_TROPOPAUSE_PRESSURE = _SEA_LEVEL_PRESSURE * math.pow(
    _SEA_LEVEL_TEMPERATURE / (_SEA_LEVEL_TEMPERATURE + _LAPSE_RATE * (_TROPOPAUSE - 0.0)), _PRESSURE_EXPONENT
)
# Airspeed below which alpha and beta are zero, ft/s.
_MIN_AIRSPEED = 0.001
# Square of the airspeed in the plane of symmetry below which alpha is zero, ft^2/s^2.
_MIN_SYMMETRIC_AIRSPEED_2 = 1e-6


@inner
def step(frame: Record, numbers: Floats, code: Code, contacts: Records, frictions: Records) -> None:
    """Advance the compiled model by one time step.

    frame: record of `FRAME`, which shares the memory of the first registers.
    numbers: registers of the model.
    code: header and sections of instructions, as described above.
    contacts, frictions: records of `flight.dynamics.ground_contact`, possibly none.
    """
    _integrate(frame)
    _update_position(frame)
    _update_motion(frame)
    _update_gravity(frame)
    _update_atmosphere(frame)
    run_instructions(numbers, code, code[FCS_START], code[AERO_START])
    _update_air_data(frame)
    run_instructions(numbers, code, code[AERO_START], code[EXTERNAL_START])
    # Aerodynamic force (lbf) and moment about the center of gravity (lbf ft), in body axes.
    cos, sin = math.cos(frame.alpha), math.sin(frame.alpha)
    drag, side, lift = vector_of(frame.aero_force)
    force = transform(((cos, 0.0, -sin), (0.0, 1.0, 0.0), (sin, 0.0, cos)), (-drag, side, -lift))
    moment = add(vector_of(frame.aero_moment), cross(vector_of(frame.aero_arm), force))
    ground_force, ground_moment, count = contact_forces(frame, contacts, frictions)
    run_instructions(numbers, code, code[EXTERNAL_START], code[FORCES_START])
    # Sums of the external forces (lbf) and moments (lbf ft), in body axes; the section of forces names the registers of
    # each force and its axes.
    external_force, external_moment = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for k in range(code[FORCES_START], code[READS_START], FORCE_NUMBERS):
        magnitude, first_axis = numbers[code[k]], int(code[k + 1])
        single_force = scale(magnitude, _read_registers(numbers, first_axis + FORCE_DIRECTION))
        pure_moment = scale(magnitude, _read_registers(numbers, first_axis + MOMENT_DIRECTION))
        external_force = add(external_force, single_force)
        external_moment = add(
            external_moment, add(pure_moment, cross(_read_registers(numbers, first_axis + FORCE_ARM), single_force))
        )
    force = add(add(force, ground_force), external_force)
    moment = add(add(moment, ground_moment), external_moment)
    # Linear and angular accelerations for the next step, without friction.
    inertial_rates = vector_of(frame.inertial_rates)
    gyroscopic_moment = cross(inertial_rates, transform(matrix_of(frame.inertia), inertial_rates))
    set_vector(
        frame.angular_acceleration, transform(matrix_of(frame.inverse_inertia), subtract(moment, gyroscopic_moment))
    )
    specific_force = scale(1.0 / frame.mass, force)
    set_vector(frame.specific_force, specific_force)
    gravity = transform_back(rotation(frame.earth_cos, frame.earth_sin), vector_of(frame.gravity))
    set_vector(frame.acceleration, add(transform_back(matrix_of(frame.inertial_to_body), specific_force), gravity))
    if count > 0:
        _add_friction(frame, contacts, frictions, count)


@inner
def _integrate(frame: Record) -> None:
    """Integrate the motion over one time step, in inertial axes.

    Attitude and rates are integrated by Euler's method, the velocity by the second-order Adams-Bashforth method, and
    the position by the third-order Adams-Bashforth method.

    frame: state and derivatives of the motion, a `FRAME` record; updated.
    """
    dt = frame.dt
    real_part = frame.attitude_real + dt * frame.attitude_rate_real
    vector_part = add(vector_of(frame.attitude), scale(dt, vector_of(frame.attitude_rate)))
    attitude = unit_quaternion((real_part, vector_part))
    frame.attitude_real = attitude[0]
    set_vector(frame.attitude, attitude[1])
    set_vector(
        frame.inertial_rates, add(vector_of(frame.inertial_rates), scale(dt, vector_of(frame.angular_acceleration)))
    )
    velocity, last_velocity, second_last_velocity = frame.velocity, frame.last_velocity, frame.second_last_velocity
    twelfth = (1.0 / 12.0) * dt
    for k in range(3):
        frame.position[k] += twelfth * (23.0 * velocity[k] - 16.0 * last_velocity[k] + 5.0 * second_last_velocity[k])
        second_last_velocity[k], last_velocity[k] = last_velocity[k], velocity[k]
        velocity[k] += dt * (1.5 * frame.acceleration[k] - 0.5 * frame.last_acceleration[k])
        frame.last_acceleration[k] = frame.acceleration[k]
    frame.earth_angle += EARTH_RATE * dt
    frame.time += dt


@inner
def _update_position(frame: Record) -> None:
    """Compute latitude, longitude, altitude and local axes from the inertial position."""
    cos, sin = math.cos(frame.earth_angle), math.sin(frame.earth_angle)
    frame.earth_cos, frame.earth_sin = cos, sin
    earth_position = transform(rotation(cos, sin), vector_of(frame.position))
    set_vector(frame.earth_position, earth_position)
    x, y, z = earth_position
    radius = math.sqrt(x * x + y * y + z * z)
    axis_distance = math.sqrt(x * x + y * y)
    geocentric_latitude = math.atan2(z, axis_distance)
    frame.radius, frame.geocentric_latitude = radius, geocentric_latitude
    frame.latitude, frame.geodetic_altitude, sin_lat, cos_lat = geodetic(earth_position)
    frame.longitude = math.atan2(y, x)
    cos_geocentric = math.cos(geocentric_latitude)
    frame.altitude = radius - SEMI_MAJOR * AXES_RATIO / math.sqrt(
        1.0 - ECCENTRICITY_2 * cos_geocentric * cos_geocentric
    )
    sin_lon, cos_lon = y / axis_distance, x / axis_distance
    # Local axes point north, east and down.
    set_matrix(
        frame.earth_to_local,
        (
            (-cos_lon * sin_lat, -sin_lon * sin_lat, cos_lat),
            (-sin_lon, cos_lon, 0.0),
            (-cos_lon * cos_lat, -sin_lon * cos_lat, -sin_lat),
        ),
    )


@inner
def _update_motion(frame: Record) -> None:
    """Compute the body axes, and the velocity, rates and attitude of the body relative to the earth."""
    inertial_to_earth = rotation(frame.earth_cos, frame.earth_sin)
    quaternion = (frame.attitude_real, vector_of(frame.attitude))
    inertial_to_body = matrix_of_quaternion(quaternion)
    local_to_body = product_with_transpose(
        inertial_to_body, product(matrix_of(frame.earth_to_local), inertial_to_earth)
    )
    set_matrix(frame.inertial_to_body, inertial_to_body)
    set_matrix(frame.local_to_body, local_to_body)
    set_matrix(frame.earth_to_body, product_with_transpose(inertial_to_body, inertial_to_earth))
    earth_velocity = cross((0.0, 0.0, EARTH_RATE), vector_of(frame.position))
    body_velocity = transform(inertial_to_body, subtract(vector_of(frame.velocity), earth_velocity))
    set_vector(frame.body_velocity, body_velocity)
    inertial_rates = vector_of(frame.inertial_rates)
    set_vector(frame.rates, subtract(inertial_rates, transform(inertial_to_body, (0.0, 0.0, EARTH_RATE))))
    rate = quaternion_rate(quaternion, inertial_rates)
    frame.attitude_rate_real = rate[0]
    set_vector(frame.attitude_rate, rate[1])
    # JSBSim computes the Euler angles from the quaternion of this matrix.
    angles = euler_angles(matrix_of_quaternion(quaternion_of_matrix(local_to_body)))
    frame.roll, frame.pitch, frame.yaw = angles[0], angles[1], angles[2]
    set_vector(frame.ground_velocity, transform_back(local_to_body, body_velocity))


@inner
def _update_gravity(frame: Record) -> None:
    """Compute the gravity of the oblate earth, ft/s^2, in axes fixed to the earth.

    It is the central gravity with the correction of its second zonal harmonic J2.

    frame: position and gravity, a `FRAME` record; updated.
    """
    radius = frame.radius
    sin_lat = math.sin(frame.geocentric_latitude)
    ratio = SEMI_MAJOR / radius
    j2_term = 1.5 * J2 * ratio * ratio
    equatorial_factor = 1.0 - 5.0 * (sin_lat * sin_lat)
    polar_factor = 3.0 - 5.0 * (sin_lat * sin_lat)
    central_gravity = GRAVITY_PARAMETER / (radius * radius)
    earth_position, gravity = frame.earth_position, frame.gravity
    gravity[0] = -central_gravity * ((1.0 + (j2_term * equatorial_factor)) * earth_position[0] / radius)
    gravity[1] = -central_gravity * ((1.0 + (j2_term * equatorial_factor)) * earth_position[1] / radius)
    gravity[2] = -central_gravity * ((1.0 + (j2_term * polar_factor)) * earth_position[2] / radius)


@inner
def _update_atmosphere(frame: Record) -> None:
    """Compute temperature, pressure and density of the standard atmosphere of 1976; valid below 20 km."""
    geopotential_altitude = (frame.altitude * _GEOPOTENTIAL_RADIUS) / (_GEOPOTENTIAL_RADIUS + frame.altitude)
    if geopotential_altitude < _TROPOPAUSE:
        if geopotential_altitude <= 0.0:
            temperature = _SEA_LEVEL_TEMPERATURE + geopotential_altitude * _LAPSE_RATE
        else:
            fraction = (geopotential_altitude - 0.0) / _TROPOPAUSE
            temperature = fraction * (_STRATOSPHERE_TEMPERATURE - _SEA_LEVEL_TEMPERATURE) + _SEA_LEVEL_TEMPERATURE
        ratio = _SEA_LEVEL_TEMPERATURE / (_SEA_LEVEL_TEMPERATURE + _LAPSE_RATE * geopotential_altitude)
        pressure = _SEA_LEVEL_PRESSURE * math.pow(ratio, _PRESSURE_EXPONENT)
    else:
        temperature = _STRATOSPHERE_TEMPERATURE
        exponent = -STANDARD_GRAVITY * (geopotential_altitude - _TROPOPAUSE) / (_GAS_CONSTANT * temperature)
        pressure = _TROPOPAUSE_PRESSURE * math.exp(exponent)
    frame.temperature, frame.pressure = temperature, pressure
    frame.density = pressure / (_GAS_CONSTANT * temperature)


@inner
def _update_air_data(frame: Record) -> None:
    """Compute airspeed, angles of attack and sideslip, pressures, and the previous step's load factor."""
    wind = add(vector_of(frame.wind), vector_of(frame.gust))
    u, v, w = subtract(vector_of(frame.body_velocity), transform(matrix_of(frame.local_to_body), wind))
    symmetric_2 = u * u + w * w
    airspeed_2 = symmetric_2 + v * v
    airspeed = math.sqrt(airspeed_2)
    alpha = beta = 0.0
    if airspeed > _MIN_AIRSPEED:
        beta = math.atan2(v, math.sqrt(symmetric_2))
        if symmetric_2 >= _MIN_SYMMETRIC_AIRSPEED_2:
            alpha = math.atan2(w, u)
    frame.airspeed, frame.alpha, frame.beta = airspeed, alpha, beta
    set_vector(frame.air_rates, vector_of(frame.rates))
    frame.dynamic_pressure = 0.5 * frame.density * airspeed_2
    frame.load_factor = -(frame.specific_force[2] * (1.0 / STANDARD_GRAVITY))
    double_airspeed = 2.0 * airspeed
    if double_airspeed != 0.0:
        frame.span_time = frame.wing_span / double_airspeed
        frame.chord_time = frame.wing_chord / double_airspeed
    frame.pressure_area = frame.wing_area * frame.dynamic_pressure


@inlined
def _read_registers(numbers: Floats, first_register: int) -> Vector:
    """Return three successive registers as a vector.

    first_register: index of the first register.
    """
    return numbers[first_register], numbers[first_register + 1], numbers[first_register + 2]


@inner
def _add_friction(frame: Record, contacts: Records, frictions: Records, count: int) -> None:
    """Add the accelerations that friction causes at the contacts to the accelerations of the frame.

    count: number of friction records.
    """
    inertial_to_body = matrix_of(frame.inertial_to_body)
    earth_rates = transform(inertial_to_body, (0.0, 0.0, EARTH_RATE))
    rates = add(vector_of(frame.rates), scale(2.0, earth_rates))
    acceleration = subtract(vector_of(frame.specific_force), cross(rates, vector_of(frame.body_velocity)))
    centripetal = cross((0.0, 0.0, EARTH_RATE), cross((0.0, 0.0, EARTH_RATE), vector_of(frame.position)))
    acceleration = subtract(acceleration, transform(inertial_to_body, centripetal))
    acceleration = add(acceleration, transform(matrix_of(frame.earth_to_body), vector_of(frame.gravity)))
    angular_acceleration = add(
        vector_of(frame.angular_acceleration), cross(vector_of(frame.inertial_rates), earth_rates)
    )
    friction_acceleration, friction_angular_acceleration = friction_accelerations(
        frame, contacts, frictions, count, acceleration, angular_acceleration
    )
    set_vector(frame.specific_force, add(vector_of(frame.specific_force), friction_acceleration))
    set_vector(
        frame.acceleration, add(vector_of(frame.acceleration), transform_back(inertial_to_body, friction_acceleration))
    )
    set_vector(frame.angular_acceleration, add(vector_of(frame.angular_acceleration), friction_angular_acceleration))


# ----------------------------------------------------------------------
# Calls from Python.


@compiled
def step_repeatedly(
    frames: Records, numbers: Floats, code: Code, contacts: Records, frictions: Records, count: int
) -> None:
    """Advance the model by ``count`` time steps.

    frames: one record of `FRAME`, (1,), which shares the memory of the first registers.
    numbers: registers of the model.
    code: header and sections of instructions.
    contacts, frictions: `CONTACT` and `FRICTION` records of the landing gear, possibly none.
    """
    for _ in range(count):
        step(frames[0], numbers, code, contacts, frictions)


@compiled
def initialise_attitude(frames: Records, angles: Floats) -> None:
    """Set the attitude of the frame to the attitude of JSBSim's initial conditions, to the last bit.

    JSBSim's FGInitialCondition stores a quaternion that cannot be read. Setting an angle changes one Euler angle of
    this quaternion, so its last bits depend on all angles that have ever been set.

    frames: one record of `FRAME`, (1,), with the position, the rates and the angle of the earth.
    angles: roll, pitch and yaw of all evaluations of a JSBSim instance in order, rad, (n, 3).
    """
    frame: Record = frames[0]
    local_attitude = (1.0, (0.0, 0.0, 0.0))
    for row in range(angles.shape[0]):
        for k in range(3):
            roll, pitch, yaw = euler_angles(matrix_of_quaternion(local_attitude))
            value = angles[row, k]
            if k == 0:
                local_attitude = quaternion_of_angles(value, pitch, yaw)
            elif k == 1:
                local_attitude = quaternion_of_angles(roll, value, yaw)
            else:
                local_attitude = quaternion_of_angles(roll, pitch, value)
    _update_position(frame)
    inertial_to_local = product(matrix_of(frame.earth_to_local), rotation(frame.earth_cos, frame.earth_sin))
    attitude = quaternion_product(quaternion_of_matrix(inertial_to_local), local_attitude)
    rate = quaternion_rate(attitude, vector_of(frame.inertial_rates))
    frame.attitude_real, frame.attitude_rate_real = attitude[0], rate[0]
    set_vector(frame.attitude, attitude[1])
    set_vector(frame.attitude_rate, rate[1])
