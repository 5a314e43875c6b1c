"""What the hands carry and what pushes them, from the torques of the arms over one control period.

Compiled by `wholebody.jit`.

With ``dv`` the acceleration that happened, the arm's rows of the dynamics miss what an unknown mass m at the point x of
the hand adds: ``tau - M dv - nle = m J_x' (a_x - g)``. Feet and everything they touch have no part in these rows.

Both sides are low-passed alike, the right one for a unit mass, and the mass is their ratio in the sense of least
squares: the momentum observer of De Luca et al. for what acts along gravity. Speeds need not be smooth for that.

What the assumed masses leave over is low-passed by a faster filter, and is the force F on the palm in the sense of
damped least squares, with a moment where that is not at the palm: ``J_palm' (F, m) = M dv + nle - tau`` in the arm's
rows.

Source:
    De Luca, Albu-Schaeffer, Haddadin and Hirzinger 2006, "Collision detection and safe reaction with the DLR-III
    lightweight manipulator arm", IROS; Haddadin, De Luca and Albu-Schaeffer 2017, "Robot collisions: a survey", T-RO.
"""

from __future__ import annotations

import math

from wholebody.jit.arrays import Indices, Matrix, Vector
from wholebody.jit.packed import Packed
from wholebody.robot.kernels.frames import PALM_FRAME
from wholebody.robot.kernels.rotation import rotate
from wholebody.robot.kernels.spatial import velocity_at
from wholebody.robot.touch import FORCE, SHARE

SPEED_FEIGNS, TURN_FEIGNS = 6.0, 1.5
"""Force that a palm's speed feigns [N s/m], and its turning [N s/rad]; measured: realistic robots on the lissajous and
dances, whose arms have friction of 0.1 to 0.3 N m a joint that the model lacks."""
LEVEL_FEIGNS, FEIGNED_MAX, LEVEL_TIME = 1.5, 1.5, 2.0
"""Multiple of the mean torque of late by which it may be exceeded [no unit], the most of that [N m], and the time
constant of the mean [s]; measured likewise: of those robots it is 1 N m."""
MOVED_FEIGNS, LATE_FEIGNS = 0.2, 3e-3
"""Share of the torques that accelerate an arm that masses which are not the model's feign [no unit], and how late
torques may be told [s], which feigns as much as they change in that time; measured likewise: at 100 rad/s^2 and more,
chops of a karate dance felt like 12 N, and arms whose acceleration ends within 10 ms did where torques are told 2 ms
late."""
LEVER_MIN = 0.05
"""Least lever of a force over its arm that is counted on [m]; chosen: along a stretched arm nothing is felt. Joints
have friction, not palms: the less of a lever a force has, the more of it a torque feigns."""
FORCE_DAMPING, MOMENT_DAMPING = 2e-4, 2e-2
"""Damping of the least squares for force [m^2] and moment [no unit]; derived: torques wrong by 0.4 N m for forces of
30 N and moments of 3 N m, squared."""


def observe(
    tick: Packed, memory: Packed, v: Vector, tau: Vector, assumed: Vector, dt: float, keep: float, keep_fast: float,
    torque_error: float
) -> None:  # fmt: skip
    """One tick.

    Args:
        tick: The dynamics of the state before, with the assumed masses in its hands, and less the forces that its
            program counted on: ``v R p S V A M nle parent gravity`` as in `wholebody.robot.kernels.rigid_body`, ``J``
            and ``touch``.
        memory: Of the observer, as in `wholebody.estimation.load.memory`, changed.
        v: Velocity now (nv,).
        tau: Torques in between (nv - 6,).
        assumed: Masses (2,) [kg].
        dt: Time in between [s].
        keep: Share that the filters of loads keep, 0 to 1.
        keep_fast: The same of those of forces.
        torque_error: Of the torques of an arm [N m].
    """
    dv, x_load, M, S, nle, before, arm = memory.dv, memory.six, tick.M, tick.S, tick.nle, tick.v, memory.arm
    J = tick.J
    for c in range(v.shape[0]):
        dv[c] = (v[c] - before[c]) / dt
    for h in range(2):
        residual, unit, pushed = memory.residual[h], memory.unit[h], memory.pushed[h]
        moved, changes = memory.moved[h], memory.changes[h]
        touch, at = tick.touch[h], 6 * (PALM_FRAME + h)
        x, y, z = lifted(tick, memory.body[h], memory.place[h], dv, x_load)
        for i in range(residual.shape[0]):
            c = arm[h, i]
            moves = 0.0
            for k in range(dv.shape[0]):
                moves += M[c, k] * dv[k]
            missing = tau[c - 6] - nle[c] - moves
            more = (1.0 - keep_fast) * (moves - moved[i])
            moved[i] += more
            changes[i] += (1.0 - keep_fast * keep_fast) * (more / dt - changes[i])
            if touch[SHARE] > 0.0:
                for k in range(6):
                    missing -= J[at + k, c] * touch[FORCE + k]
            pushed[i] = keep_fast * pushed[i] - (1.0 - keep_fast) * missing
            jx, jy, jz = velocity_at(S[c], x_load)
            one = jx * x + jy * y + jz * z
            residual[i] = keep * residual[i] + (1.0 - keep) * (missing + assumed[h] * one)
            unit[i] = keep * unit[i] + (1.0 - keep) * one
        memory.mass[h], memory.error[h] = ratio(residual, unit, torque_error)
        size = push(J, arm[h], at, pushed, memory.normal, memory.wrench[h])
        torque = torque_of(J, arm[h], at, memory.wrench[h])
        feigns = min(LEVEL_FEIGNS * memory.level[h], FEIGNED_MAX) + MOVED_FEIGNS * length(moved)
        feigns += LATE_FEIGNS * length(changes)
        lever = max(torque / max(size, 1e-9), LEVER_MIN)
        memory.size[h] = size - feigns / lever - feigned(tick.frame_V[PALM_FRAME + h])
        if not touch[SHARE] > 0.0:
            memory.level[h] += min(dt / LEVEL_TIME, 1.0) * (torque - memory.level[h])


def feigned(V: Vector) -> float:
    """Force [N] that friction, and a model that is not the robot, feign at a palm with velocity V (6,)."""
    return SPEED_FEIGNS * length(V[:3]) + TURN_FEIGNS * length(V[3:])


def length(x: Vector) -> float:
    """Length of a vector (n,)."""
    total = 0.0
    for i in range(x.shape[0]):
        total += x[i] * x[i]
    return math.sqrt(total)


def torque_of(J: Matrix, arm: Indices, at: int, force: Vector) -> float:
    """Size of the torques [N m] that a force (3,) on a palm makes in its arm; arguments as of `push`."""
    squares = 0.0
    for i in range(arm.shape[0]):
        torque = 0.0
        for a in range(3):
            torque += J[at + a, arm[i]] * force[a]
        squares += torque * torque
    return math.sqrt(squares)


def push(J: Matrix, arm: Indices, at: int, pushed: Vector, A: Matrix, wrench: Vector) -> float:
    """Force and moment on a palm (6,) that account best for torques of its arm; the size of the force [N].

    Solves ``(J J' + d) w = J torques``. The damping d leaves out what a stretched arm cannot feel, and prefers a force
    at the palm to a moment, which only something that touches the hand or the arm elsewhere makes.

    Args:
        J: Jacobians of frames (any, nv).
        arm: Columns of the arm (k,).
        at: First row of the palm.
        pushed: Torques that push the arm (k,) [N m].
        A: Memory (6, 7).
        wrench: Out (6,) [N, N m].
    """
    for a in range(6):
        for b in range(6):
            A[a, b] = 0.0
        A[a, a] = FORCE_DAMPING if a < 3 else MOMENT_DAMPING
        A[a, 6] = 0.0
        for i in range(pushed.shape[0]):
            x = J[at + a, arm[i]]
            A[a, 6] += x * pushed[i]
            for b in range(6):
                A[a, b] += x * J[at + b, arm[i]]
    # Gauss's elimination: the matrix is positive definite.
    for a in range(6):
        for r in range(a + 1, 6):
            factor = A[r, a] / A[a, a]
            for b in range(a, 7):
                A[r, b] -= factor * A[a, b]
    for a in range(5, -1, -1):
        x = A[a, 6]
        for b in range(a + 1, 6):
            x -= A[a, b] * wrench[b]
        wrench[a] = x / A[a, a]
    return math.sqrt(wrench[0] * wrench[0] + wrench[1] * wrench[1] + wrench[2] * wrench[2])


def lifted(tick: Packed, body: int, place: Vector, dv: Vector, x: Vector) -> tuple[float, float, float]:
    """Acceleration of a load less gravity; its place (3,) from the base, in world axes, is left in ``x`` (6,)."""
    R, p, S, A, V, parent, g = tick.R[body], tick.p[body], tick.S, tick.A[body], tick.V[body], tick.parent, tick.gravity
    for k in range(3):
        x[k] = p[k] + rotate(R, k, place[0], place[1], place[2])
    vx, vy, vz = velocity_at(V, x)
    ax, ay, az = velocity_at(A, x)
    ax, ay, az = ax + V[4] * vz - V[5] * vy, ay + V[5] * vx - V[3] * vz, az + V[3] * vy - V[4] * vx
    k = body
    while k > 0:
        c = 5 + k
        jx, jy, jz = velocity_at(S[c], x)
        ax, ay, az = ax + jx * dv[c], ay + jy * dv[c], az + jz * dv[c]
        k = parent[k]
    for c in range(6):
        jx, jy, jz = velocity_at(S[c], x)
        ax, ay, az = ax + jx * dv[c], ay + jy * dv[c], az + jz * dv[c]
    return ax - g[0], ay - g[1], az - g[2]


def ratio(residual: Vector, unit: Vector, torque_error: float) -> tuple[float, float]:
    """Mass [kg] that accounts best for torques, and its error: what it leaves unaccounted for counts against it."""
    along = size = left = 0.0
    for i in range(unit.shape[0]):
        along += unit[i] * residual[i]
        size += unit[i] * unit[i]
    if not size > 0.0:
        return 0.0, math.inf
    mass = along / size
    for i in range(unit.shape[0]):
        left += (residual[i] - mass * unit[i]) ** 2
    return mass, math.sqrt((torque_error * torque_error + left) / size)
