r"""A right-invariant extended Kalman filter with two contacts; compiled by `wholebody.jit`.

The state is one matrix Lie group element: orientation R, velocity v and position p of the IMU and the places d of both
soles, all in world; beside it the biases of gyro and accelerometer. Its error ``xi`` is the turn and the shifts that
lead to the true one, ``X_true = exp(xi) X``: orientation, velocity, position, left and right sole, biases, three each.
In these terms the rows of what the legs say, ``R h = d - p``, and of what the IMU says of the vertical do not depend on
the state, and its motion does only by the biases.

Source:
    Hartley, Ghaffari, Eustice and Grizzle 2020, "Contact-aided invariant extended Kalman filtering for robot state
    estimation", IJRR 39(4), equations 29 to 42 and appendix.
"""

from __future__ import annotations

import math

from wholebody.jit.arrays import Matrix, Vector
from wholebody.jit.packed import Packed
from wholebody.robot.kernels.rotation import base_rotation, rotate

TURN, SPEED, PLACE, SOLE, GYRO, ACC, SIZE = 0, 3, 6, 9, 15, 18, 21
"""Where the parts of the error begin, and how long it is."""


def turned(x: float, y: float, z: float, q: Vector, ahead: bool) -> None:
    """Turn a quaternion ``q[3:7]`` (xyzw) by a rotation vector [rad], given in the axes of world, or in its own."""
    angle = math.sqrt(x * x + y * y + z * z)
    s = 0.5 if angle < 1e-9 else math.sin(0.5 * angle) / angle
    c, x, y, z, b = math.cos(0.5 * angle), s * x, s * y, s * z, 1.0 if ahead else -1.0
    i, j, k, r = q[3], q[4], q[5], q[6]
    q[3] = c * i + x * r + b * (y * k - z * j)
    q[4] = c * j + y * r + b * (z * i - x * k)
    q[5] = c * k + z * r + b * (x * j - y * i)
    q[6] = c * r - x * i - y * j - z * k
    size = math.sqrt(q[3] * q[3] + q[4] * q[4] + q[5] * q[5] + q[6] * q[6])
    for a in range(3, 7):
        q[a] /= size


def move(memory: Packed, dt: float, feels: bool) -> None:
    """Carry the state on by what the IMU says, without a word on how sure that is.

    Args:
        memory: ``x`` (7,) is position and orientation, ``v`` (3,) velocity, ``gyro`` and ``felt`` what the IMU says,
            biases taken off.
        dt: Time that has passed [s].
        feels: Whether there is an accelerometer; if not, the velocity is kept.
    """
    x, v, w, f, g, Rw = memory.x, memory.v, memory.gyro, memory.felt, memory.gravity, memory.Rw
    turned(0.5 * dt * w[0], 0.5 * dt * w[1], 0.5 * dt * w[2], x, False)
    base_rotation(x, Rw)
    for k in range(3):
        a = rotate(Rw, k, f[0], f[1], f[2]) + g[k] if feels else 0.0
        x[k] += dt * (v[k] + 0.5 * dt * a)
        v[k] += dt * a
    turned(0.5 * dt * w[0], 0.5 * dt * w[1], 0.5 * dt * w[2], x, False)
    base_rotation(x, Rw)


def spread(memory: Packed, dt: float, feels: bool) -> None:
    """Carry the covariance on: ``P = F P F' + Q`` with ``F = 1 + A dt``, by rows and then by columns."""
    P, B, R, g = memory.P, memory.B, memory.Rw, memory.gravity
    for part in range(5):
        x, y, z = lever(memory, part)
        for c in range(3):
            a, b, e = R[0, c], R[1, c], R[2, c]
            if part > 0:
                a, b, e = y * e - z * b, z * a - x * e, x * b - y * a
            B[3 * part, c], B[3 * part + 1, c], B[3 * part + 2, c] = dt * a, dt * b, dt * e
    mix(P, B, R, g, dt)
    for a in range(SIZE):
        for b in range(a):
            P[a, b], P[b, a] = P[b, a], P[a, b]
    mix(P, B, R, g, dt)
    add_noise(memory, dt, feels)
    # Rounding that is not alike on both sides of the diagonal would grow, and be everything after some minutes.
    for a in range(SIZE):
        for b in range(a):
            P[a, b] = P[b, a] = 0.5 * (P[a, b] + P[b, a])


def lever(memory: Packed, part: int) -> tuple[float, float, float]:
    """What a turn about the origin moves: velocity, position or one of the soles."""
    if part < 2:
        return memory.v[0], memory.v[1], memory.v[2]
    if part == 2:
        return memory.x[0], memory.x[1], memory.x[2]
    d = memory.d[part - 3]
    return d[0], d[1], d[2]


def mix(P: Matrix, B: Matrix, R: Matrix, g: Vector, dt: float) -> None:
    """``P = F P`` (SIZE, SIZE); places before speeds before turns: each still finds what it depends on as it was."""
    for r in range(SOLE, GYRO):
        less(P, r, GYRO, B[r, 0], B[r, 1], B[r, 2])
    for k in range(3):
        for c in range(SIZE):
            P[PLACE + k, c] += dt * P[SPEED + k, c]
        less(P, PLACE + k, GYRO, B[PLACE + k, 0], B[PLACE + k, 1], B[PLACE + k, 2])
    for k in range(3):
        r, s, t = SPEED + k, (k + 1) % 3, (k + 2) % 3
        up, down = dt * g[s], dt * g[t]
        for c in range(SIZE):
            P[r, c] += up * P[t, c] - down * P[s, c]
        less(P, r, GYRO, B[r, 0], B[r, 1], B[r, 2])
        less(P, r, ACC, dt * R[k, 0], dt * R[k, 1], dt * R[k, 2])
    for r in range(SPEED):
        less(P, r, GYRO, B[r, 0], B[r, 1], B[r, 2])


def less(P: Matrix, r: int, bias: int, x: float, y: float, z: float) -> None:
    """Row ``r`` of P (SIZE, SIZE) less a mixture of the three rows of a bias."""
    for c in range(SIZE):
        P[r, c] -= x * P[bias, c] + y * P[bias + 1, c] + z * P[bias + 2, c]


def add_noise(memory: Packed, dt: float, feels: bool) -> None:
    """Add what gyro, accelerometer, biases and soles may do in a time [s]: ``noise`` (7,), variances a second."""
    P, B, noise, speed = memory.P, memory.B, memory.noise, memory.noise[1] if feels else memory.noise[6]
    # The columns of B are those of the gyro's error, times dt.
    share = noise[0] / dt
    for a in range(GYRO):
        x, y, z = share * B[a, 0], share * B[a, 1], share * B[a, 2]
        for b in range(GYRO):
            P[a, b] += x * B[b, 0] + y * B[b, 1] + z * B[b, 2]
    for k in range(3):
        P[SPEED + k, SPEED + k] += dt * speed
        P[GYRO + k, GYRO + k] += dt * noise[2]
        P[ACC + k, ACC + k] += dt * noise[3]
        for foot in range(2):
            at = SOLE + 3 * foot + k
            P[at, at] += dt * (noise[4] if memory.stands[foot] else noise[5])


def look(memory: Packed, plus: int, minus: int, off: float, variance: float) -> None:
    """Take in a row: entry ``plus`` of the error less entry ``minus``, none if negative, was seen to be ``off``.

    What is known of the error is gathered in ``xi`` and put into the state by `correct` at the end.
    """
    P, K, xi = memory.P, memory.K, memory.xi
    for a in range(SIZE):
        K[a] = P[plus, a] - (P[minus, a] if minus >= 0 else 0.0)
    size = variance + K[plus] - (K[minus] if minus >= 0 else 0.0)
    along, share = (off - xi[plus] + (xi[minus] if minus >= 0 else 0.0)) / size, 1.0 / size
    for a in range(SIZE):
        xi[a] += along * K[a]
        for b in range(SIZE):
            P[a, b] -= K[a] * K[b] * share  # in this order: as much on either side of the diagonal


def correct(memory: Packed) -> None:
    """Put the error that was found into the state, ``X = exp(xi) X``, and forget it."""
    x, xi, E = memory.x, memory.xi, memory.E
    E[3] = E[4] = E[5] = 0.0
    E[6] = 1.0
    turned(xi[0], xi[1], xi[2], E, True)
    base_rotation(E, memory.Re)
    turned(xi[0], xi[1], xi[2], x, True)
    base_rotation(x, memory.Rw)
    shift(memory.Re, memory.v, xi, SPEED)
    shift(memory.Re, x, xi, PLACE)
    shift(memory.Re, memory.d[0], xi, SOLE)
    shift(memory.Re, memory.d[1], xi, SOLE + 3)
    for k in range(3):
        memory.gyro_bias[k] += xi[GYRO + k]
        memory.acc_bias[k] += xi[ACC + k]
    for a in range(SIZE):
        xi[a] = 0.0


def shift(R: Matrix, p: Vector, xi: Vector, at: int) -> None:
    """``p = R p + xi[at:at + 3]``."""
    x, y, z = p[0], p[1], p[2]
    for k in range(3):
        p[k] = rotate(R, k, x, y, z) + xi[at + k]


def in_world(memory: Packed, covariance: Matrix) -> None:
    """Covariance of orientation, velocity and position of the IMU themselves (9, 9).

    The filter's error moves what it turns about the origin: they are off by ``xi``, less ``v x xi`` and ``x x xi`` of
    the turn in velocity and position.
    """
    P, v, x = memory.P, memory.v, memory.x
    for a in range(9):
        for b in range(9):
            covariance[a, b] = P[a, b]
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        for b in range(9):
            covariance[SPEED + k, b] += v[j] * covariance[i, b] - v[i] * covariance[j, b]
            covariance[PLACE + k, b] += x[j] * covariance[i, b] - x[i] * covariance[j, b]
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        for a in range(9):
            covariance[a, SPEED + k] += v[j] * covariance[a, i] - v[i] * covariance[a, j]
            covariance[a, PLACE + k] += x[j] * covariance[a, i] - x[i] * covariance[a, j]
