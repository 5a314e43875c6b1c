"""From the readings of an instant to the state of the robot; compiled by `wholebody.jit`.

Bodies and soles are in the axes of the base; the filter's position and velocity are those of the IMU in world.
"""

from __future__ import annotations

import math

from wholebody.estimation.kernels import invariant_filter, legs
from wholebody.estimation.kernels.invariant_filter import PLACE, SIZE, SOLE
from wholebody.jit.arrays import Matrix, Vector
from wholebody.jit.packed import Packed
from wholebody.robot.kernels.rotation import base_rotation, rotate
from wholebody.types import QUATERNION_TOLERANCE

PRESSED_FILTER = 0.01
"""Time constant of the forces on the soles [s]; chosen: five readings, noise of torques is left out and a lifted foot
is noticed before it is far."""

LEVEL_MAX = 0.015
"""Slope up to which a floor is taken to be level [rad]; derived: IMU and encoders of the realistic robot together made
0.011 at most in 200 draws. One of twice that counts as it looks."""
LEVEL_FIRST, LEVEL_TIME = 0.5, 60.0
"""Time over which the difference of the soles' normal and the IMU's vertical is averaged first, and its time constant
afterwards [s]; chosen: noise is gone after the first, and both stay wrong as they are, while soles give under a robot
that leans by 1 mrad in MuJoCo."""
FIRST_TIME = 1e-9
"""For which the first reading counts in it [s]; chosen: until there is another one."""
STEP_DRIFT = 5e-4
"""Standard deviation of what each foot that is set down adds to the place [m]; measured: encoders that are off by 2
mrad stay off, and what that makes of each step, 0.2 to 0.7 mm, adds up."""
BEGIN = -1.0
"""What stands for the time since the readings before where there are none that count [s]; definition."""


def estimate(
    memory: Packed, dt: float, quat: Vector, gyro: Vector, acc: Vector, q: Vector, dq: Vector, tau: Vector,
    q_out: Vector, v_out: Vector, covariance: Matrix
) -> bool:  # fmt: skip
    """One set of readings.

    Args:
        memory: As in `wholebody.estimation.state_estimator.memory`, changed.
        dt: Time since the ones before [s]; 0: the state stays as it is; below: begin anew.
        quat: Orientation by the IMU, xyzw (4,).
        gyro: [rad/s] (3,).
        acc: Specific force (3,) [m/s^2]; none if it is no number.
        q: Positions of the joints (n,) [rad].
        dq: Speeds likewise.
        tau: Torques likewise [N m]; none if they are no numbers.
        q_out: Configuration (7 + n,).
        v_out: Velocity (6 + n,).
        covariance: Of orientation, velocity and position of the IMU in world (9, 9).

    Returns:
        Whether IMU and legs gave numbers; if not, nothing is changed, and base, velocity and covariance are none.
    """
    if not sound(memory, quat, gyro, q, dq):
        for k in range(q.shape[0]):
            q_out[7 + k], v_out[6 + k] = q[k], dq[k]
        for k in range(6):
            q_out[k] = q_out[6] = v_out[k] = math.nan
        for a in range(9):
            for b in range(9):
                covariance[a, b] = math.nan
        return False
    feels, tells = math.isfinite(acc[0] + acc[1] + acc[2]), True
    for i in range(memory.joint.shape[0]):
        tells = tells and math.isfinite(tau[memory.joint[i]])
    for k in range(4):
        memory.E[3 + k] = quat[k]
    base_rotation(memory.E, memory.Ri)
    for k in range(3):
        memory.gyro[k] = gyro[k] - memory.gyro_bias[k]
        memory.felt[k] = acc[k] - memory.acc_bias[k] if feels else -memory.gravity[2] * memory.Ri[2, k]
    legs.place_soles(memory, q)
    if dt > 0.0:
        invariant_filter.move(memory, dt, feels)
        invariant_filter.spread(memory, dt, feels)
    if tells:
        legs.press(memory, tau, math.exp(-dt / PRESSED_FILTER) if dt >= 0.0 else 0.0)
    stand(memory, tells)
    if dt > 0.0:
        compare(memory, dt)
    elif dt < 0.0:
        begin(memory, dq)
    answer(memory, q, dq, q_out, v_out)
    invariant_filter.in_world(memory, covariance)
    for k in range(PLACE, SOLE):
        covariance[k, k] += (STEP_DRIFT * memory.landings) ** 2
    return True


def stand(memory: Packed, tells: bool) -> None:
    """Which foot stands now, by what presses on it if torques tell, and by what it is told to."""
    for foot in range(2):
        stood = memory.stands[foot]
        least = memory.press_min * (1.0 if stood else 2.0)
        memory.stands[foot] = memory.may_stand[foot] if not tells or memory.pressed[foot] >= least else 0
        if memory.stands[foot] and not stood:
            memory.landings += 1.0


def sound(memory: Packed, quat: Vector, gyro: Vector, q: Vector, dq: Vector) -> bool:
    """Whether the readings of IMU and legs are numbers, and the orientation is one."""
    size = quat[0] * quat[0] + quat[1] * quat[1] + quat[2] * quat[2] + quat[3] * quat[3]
    total = gyro[0] + gyro[1] + gyro[2]
    for i in range(memory.joint.shape[0]):
        total += q[memory.joint[i]] + dq[memory.joint[i]]
    return abs(math.sqrt(size) - 1.0) <= QUATERNION_TOLERANCE and math.isfinite(total)


def level(memory: Packed, dt: float) -> tuple[float, float]:
    """What to add to x and y of the IMU's vertical in world, for a floor that is level under both soles [rad].

    The soles' normal less the IMU's vertical is averaged in ``memory.lean`` while both stand. Of a floor that looks
    steeper than `LEVEL_MAX` less and less is corrected: it slopes.
    """
    Rw, Ri, lean = memory.Rw, memory.Ri, memory.lean
    if memory.stands[0] and memory.stands[1]:
        gain = dt / (memory.looked + dt if memory.looked < LEVEL_FIRST else LEVEL_TIME)
        memory.looked += dt
        for k in range(2):
            up = 0.0
            for foot in range(2):
                R = memory.R[memory.ankle[foot]]
                up += 0.5 * rotate(Rw, k, R[0, 2], R[1, 2], R[2, 2])
            lean[k] += gain * (up - rotate(Rw, k, Ri[2, 0], Ri[2, 1], Ri[2, 2]) - lean[k])
    size = math.sqrt(lean[0] * lean[0] + lean[1] * lean[1])
    share = memory.level_share * min(max(2.0 - size / LEVEL_MAX, 0.0), 1.0)
    return share * lean[0], share * lean[1]


def compare(memory: Packed, dt: float) -> None:
    """Hold the state against the vertical and the legs, and correct it."""
    Rw, Ri, variance = memory.Rw, memory.Ri, memory.variance
    x, y = level(memory, dt)
    x += rotate(Rw, 0, Ri[2, 0], Ri[2, 1], Ri[2, 2])
    y += rotate(Rw, 1, Ri[2, 0], Ri[2, 1], Ri[2, 2])
    invariant_filter.look(memory, 0, -1, y, variance[0])
    invariant_filter.look(memory, 1, -1, -x, variance[0])
    for foot in range(2):
        h, d = memory.h[foot], memory.d[foot]
        for k in range(3):
            off = rotate(Rw, k, h[0], h[1], h[2]) - (d[k] - memory.x[k])
            invariant_filter.look(memory, SOLE + 3 * foot + k, PLACE + k, off, variance[1])
    invariant_filter.correct(memory)


def begin(memory: Packed, dq: Vector) -> None:
    """World is midway between the soles, x the mean of their directions, z up; the legs say how fast the base is."""
    x, d, v, Ri = memory.x, memory.d, memory.v, memory.Ri
    ahead = side = 0.0
    for foot in range(2):
        R = memory.R[memory.ankle[foot]]
        ahead += rotate(Ri, 0, R[0, 0], R[1, 0], R[2, 0])
        side += rotate(Ri, 1, R[0, 0], R[1, 0], R[2, 0])
    for k in range(3, 7):
        x[k] = memory.E[k]
    invariant_filter.turned(0.0, 0.0, -math.atan2(side, ahead), x, True)
    base_rotation(x, memory.Rw)
    along_x, along_y = level(memory, FIRST_TIME)
    invariant_filter.turned(along_y, -along_x, 0.0, x, True)
    base_rotation(x, memory.Rw)
    for k in range(3):
        first = rotate(memory.Rw, k, memory.h[0, 0], memory.h[0, 1], memory.h[0, 2])
        second = rotate(memory.Rw, k, memory.h[1, 0], memory.h[1, 1], memory.h[1, 2])
        x[k], d[0, k], d[1, k] = -0.5 * (first + second), 0.5 * (first - second), 0.5 * (second - first)
        v[k] = 0.0
    for foot in range(2):
        a, b, c = legs.sole_speed(memory, foot, dq)
        for k in range(3):
            v[k] -= 0.5 * rotate(memory.Rw, k, a, b, c)
    for a in range(SIZE):
        for b in range(SIZE):
            memory.P[a, b] = 0.0
        memory.P[a, a] = memory.first[a]
    memory.landings = 0.0


def answer(memory: Packed, q: Vector, dq: Vector, q_out: Vector, v_out: Vector) -> None:
    """Configuration and velocity of the base from those of the IMU, and the joints as they are read."""
    Rw, r, w, v = memory.Rw, memory.imu, memory.gyro, memory.v
    sign = 1.0 if memory.x[6] >= 0.0 else -1.0
    for k in range(3):
        q_out[k] = memory.x[k] - rotate(Rw, k, r[0], r[1], r[2])
        v_out[3 + k] = w[k]
    for k in range(3, 7):
        q_out[k] = sign * memory.x[k]
    turn = w[1] * r[2] - w[2] * r[1], w[2] * r[0] - w[0] * r[2], w[0] * r[1] - w[1] * r[0]
    for k in range(3):
        v_out[k] = Rw[0, k] * v[0] + Rw[1, k] * v[1] + Rw[2, k] * v[2] - turn[k]
    for i in range(q.shape[0]):
        q_out[7 + i], v_out[6 + i] = q[i], dq[i]
