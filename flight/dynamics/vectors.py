"""Compute with vectors, matrices and quaternions as tuples in compiled code.

Each operation rounds as JSBSim's does: sums from left to right, and a vector is divided by multiplying it with the
reciprocal.
"""

import math

from world.arrays import Floats
from world.kernels import inlined

Vector = tuple[float, float, float]
# Rows of a matrix.
Matrix = tuple[Vector, Vector, Vector]
# Real part and vector part.
Quaternion = tuple[float, Vector]


@inlined
def vector_of(field: Floats) -> Vector:
    """Return a field (3,) of a record as a vector.

    >>> import numpy as np
    >>> vector_of(np.array([1.0, 2.0, 3.0]))
    (1.0, 2.0, 3.0)
    """
    return field[0], field[1], field[2]


@inlined
def matrix_of(field: Floats) -> Matrix:
    """Return a field (3, 3) of a record as a matrix."""
    return vector_of(field[0]), vector_of(field[1]), vector_of(field[2])


@inlined
def set_vector(field: Floats, vector: Vector) -> None:
    """Set a field (3,) of a record to a vector."""
    field[0], field[1], field[2] = vector[0], vector[1], vector[2]


@inlined
def set_matrix(field: Floats, matrix: Matrix) -> None:
    """Set a field (3, 3) of a record to a matrix."""
    set_vector(field[0], matrix[0])
    set_vector(field[1], matrix[1])
    set_vector(field[2], matrix[2])


@inlined
def add(a: Vector, b: Vector) -> Vector:
    """Return the sum of two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inlined
def subtract(a: Vector, b: Vector) -> Vector:
    """Return the difference of two vectors."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inlined
def scale(factor: float, v: Vector) -> Vector:
    """Return a vector times a factor."""
    return factor * v[0], factor * v[1], factor * v[2]


@inlined
def dot(a: Vector, b: Vector) -> float:
    """Return the scalar product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def cross(a: Vector, b: Vector) -> Vector:
    """Return the vector product of two vectors.

    >>> cross((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    (0.0, 0.0, 1.0)
    """
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inlined
def unit(v: Vector) -> Vector:
    """Return a vector scaled to length 1; a zero vector is returned unchanged."""
    length = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    if length == 0.0:
        return v
    return scale(1.0 / length, v)


@inlined
def transform(m: Matrix, v: Vector) -> Vector:
    """Return the product of a matrix and a vector."""
    return dot(m[0], v), dot(m[1], v), dot(m[2], v)


@inlined
def transform_back(m: Matrix, v: Vector) -> Vector:
    """Return the product of the transpose of a matrix and a vector."""
    x, y, z = m
    return (
        x[0] * v[0] + y[0] * v[1] + z[0] * v[2],
        x[1] * v[0] + y[1] * v[1] + z[1] * v[2],
        x[2] * v[0] + y[2] * v[1] + z[2] * v[2],
    )


@inlined
def product(a: Matrix, b: Matrix) -> Matrix:
    """Return the product of two matrices."""
    return transform_back(b, a[0]), transform_back(b, a[1]), transform_back(b, a[2])


@inlined
def product_with_transpose(a: Matrix, b: Matrix) -> Matrix:
    """Return the product of a matrix and the transpose of another matrix."""
    return transform(b, a[0]), transform(b, a[1]), transform(b, a[2])


@inlined
def rotation(cos: float, sin: float) -> Matrix:
    """Return the matrix that transforms vectors into axes rotated about the third axis.

    cos, sin: cosine and sine of the rotation angle.
    """
    return (cos, sin, 0.0), (-sin, cos, 0.0), (0.0, 0.0, 1.0)


# ----------------------------------------------------------------------
# Attitudes: quaternions, their matrices and their Euler angles.

# A quaternion whose length differs from 1 by less is not scaled.
_UNIT_TOLERANCE = 1e-10


@inlined
def unit_quaternion(q: Quaternion) -> Quaternion:
    """Return a quaternion scaled to length 1.

    It is returned unchanged if its length is 0, or differs from 1 by less than 1e-10.
    """
    w, (x, y, z) = q
    length = math.sqrt(w * w + x * x + y * y + z * z)
    if length == 0.0 or abs(length - 1.0) < _UNIT_TOLERANCE:
        return q
    factor = 1.0 / length
    return w * factor, (x * factor, y * factor, z * factor)


@inlined
def quaternion_product(a: Quaternion, b: Quaternion) -> Quaternion:
    """Return the product of two quaternions."""
    aw, (ax, ay, az) = a
    bw, (bx, by, bz) = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        (
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ),
    )


@inlined
def quaternion_rate(q: Quaternion, rates: Vector) -> Quaternion:
    """Return the time derivative of a body's attitude quaternion from the rates about the body's axes.

    rates: rad/s.
    """
    w, (x, y, z) = q
    roll, pitch, yaw = rates
    return (
        -0.5 * (x * roll + y * pitch + z * yaw),
        (
            0.5 * (w * roll - z * pitch + y * yaw),
            0.5 * (z * roll + w * pitch - x * yaw),
            0.5 * (-y * roll + x * pitch + w * yaw),
        ),
    )


@inlined
def matrix_of_quaternion(q: Quaternion) -> Matrix:
    """Return the matrix that transforms vectors into a body's axes, from the body's attitude quaternion."""
    w, (x, y, z) = q
    ww = w * w
    xx = x * x
    yy = y * y
    zz = z * z
    wx, wy, wz = w * x, w * y, w * z
    xy, xz, yz = x * y, x * z, y * z
    return (
        (ww + xx - yy - zz, 2.0 * (xy + wz), 2.0 * (xz - wy)),
        (2.0 * (xy - wz), ww - xx + yy - zz, 2.0 * (yz + wx)),
        (2.0 * (xz + wy), 2.0 * (yz - wx), ww - xx - yy + zz),
    )


@inlined
def quaternion_of_matrix(m: Matrix) -> Quaternion:
    """Return the quaternion of a rotation matrix, computed from its largest component."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = m
    w4, x4 = 1.0 + xx + yy + zz, 1.0 + xx - yy - zz
    y4, z4 = 1.0 - xx + yy - zz, 1.0 - xx - yy + zz
    if w4 >= x4 and w4 >= y4 and w4 >= z4:
        w = 0.5 * math.sqrt(w4)
        return w, (0.25 * (yz - zy) / w, 0.25 * (zx - xz) / w, 0.25 * (xy - yx) / w)
    if x4 >= y4 and x4 >= z4:
        x = 0.5 * math.sqrt(x4)
        return 0.25 * (yz - zy) / x, (x, 0.25 * (xy + yx) / x, 0.25 * (zx + xz) / x)
    if y4 >= z4:
        y = 0.5 * math.sqrt(y4)
        return 0.25 * (zx - xz) / y, (0.25 * (xy + yx) / y, y, 0.25 * (yz + zy) / y)
    z = 0.5 * math.sqrt(z4)
    return 0.25 * (xy - yx) / z, (0.25 * (zx + xz) / z, 0.25 * (yz + zy) / z, z)


@inlined
def euler_angles(m: Matrix) -> Vector:
    """Return roll, pitch and yaw (rad) from the matrix that transforms vectors into the body's axes.

    Yaw is 0 to 2 pi. With the nose straight up or down, yaw is 0.
    """
    (xx, xy, xz), (_, yy, yz), (_, zy, zz) = m
    if abs(xz) >= 1.0:
        return math.atan2(-zy, yy), math.copysign(0.5 * math.pi, -xz), 0.0
    yaw = math.atan2(xy, xx)
    if yaw < 0.0:
        yaw += 2.0 * math.pi
    return math.atan2(yz, zz), math.asin(-xz), yaw


@inlined
def quaternion_of_angles(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Return the quaternion of an attitude given by Euler angles, rad."""
    sin_roll, sin_pitch, sin_yaw = math.sin(0.5 * roll), math.sin(0.5 * pitch), math.sin(0.5 * yaw)
    cos_roll, cos_pitch, cos_yaw = math.cos(0.5 * roll), math.cos(0.5 * pitch), math.cos(0.5 * yaw)
    return unit_quaternion(
        (
            cos_roll * cos_pitch * cos_yaw + sin_roll * sin_pitch * sin_yaw,
            (
                sin_roll * cos_pitch * cos_yaw - cos_roll * sin_pitch * sin_yaw,
                cos_roll * sin_pitch * cos_yaw + sin_roll * cos_pitch * sin_yaw,
                cos_roll * cos_pitch * sin_yaw - sin_roll * sin_pitch * cos_yaw,
            ),
        )
    )
