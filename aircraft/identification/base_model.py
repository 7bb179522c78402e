"""Define the initial model of an identification as numbers.

These are mass, geometry, inertia, coefficients and motor.
"""

from dataclasses import dataclass

from aircraft.identification.motor import Motor


@dataclass(frozen=True, slots=True)
class Coefficients:
    """Dimensionless coefficients about steady flight, per rad of an angle or of a reduced rate.

    drag_zero, drag_induced: CD = drag_zero + drag_induced (CL - lift_least_drag)^2 + drag_elevator elevator, with CL
        from only the angle of attack.
    lift_...: lift.
    side_...: side force.
    roll_..., pitch_..., yaw_...: moments.

    A reduced rate is rate x length / (2 V). Signs of the controls: trailing edge down, roll to the right, yaw to the
    left are positive.
    """

    drag_zero: float
    drag_induced: float
    drag_elevator: float
    lift_zero: float
    lift_alpha: float
    lift_rate: float
    lift_elevator: float
    side_beta: float
    side_aileron: float
    side_rudder: float
    roll_beta: float
    roll_roll: float
    roll_yaw: float
    roll_aileron: float
    roll_rudder: float
    pitch_zero: float
    pitch_alpha: float
    pitch_rate: float
    pitch_elevator: float
    yaw_beta: float
    yaw_roll: float
    yaw_yaw: float
    yaw_aileron: float
    yaw_rudder: float
    lift_least_drag: float = 0.0
    side_roll: float = 0.0
    side_yaw: float = 0.0


@dataclass(frozen=True, slots=True)
class BaseModel:
    """Model of the aircraft before its logs are used.

    mass: kg.
    area: m^2.
    span, chord: m.
    inertia: (4,) Ixx, Iyy, Izz and Ixz (the integral of x z dm), kg m^2.
    servo_lag, motor_lag: first-order time constants, s.
    has_torque_reaction: True if the propeller's torque rolls the aircraft; False for a flying wing, whose elevons are
        rigged against the torque.
    induced_factor: ratio of drag_induced to the value of the aircraft that it was scaled from.
    """

    mass: float
    area: float
    span: float
    chord: float
    inertia: tuple[float, float, float, float]
    servo_lag: float
    motor_lag: float
    coefficients: Coefficients
    motor: Motor
    has_torque_reaction: bool = True
    induced_factor: float = 1.0
