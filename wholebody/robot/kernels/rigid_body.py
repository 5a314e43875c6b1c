r"""Arithmetic of the robot's rigid-body dynamics: one pass out to the fingers, one pass back, on flat arrays.

Everything is plain Python on float64 arrays and compiles as it stands (`wholebody.jit.entry`).

All spatial vectors are written in world axes about one point, the origin of the base ("about the base" below):
twists and accelerations ``[linear; angular]``, forces ``[force; moment]``. With one common point nothing has to be
transformed between bodies: inertias and forces are simply added up on the way back (Featherstone 2008, "Rigid Body
Dynamics Algorithms", chapters 5 and 6, in ground coordinates). Taking that point at the base keeps full precision
wherever the robot stands.

Legend: body 0 is the base, body i > 0 hangs on joint i, whose column in ``v`` is ``5 + i``; parents come before their
children. ``S`` are the joint axes as spatial twists, ``F[j]`` is the force on the whole tree for a unit acceleration
of column j, ``drift`` is what accelerations are when ``dv = 0``.
"""

from __future__ import annotations

import numpy as np

from wholebody.jit.arrays import Indices, Matrix, Vector
from wholebody.robot.kernels.bodies import base_twist, place_base, place_bodies
from wholebody.robot.kernels.spatial import add_cross_force, body_inertia, cross_motion, dot6, momentum_of

# Sums of the whole robot.
COM, COM_V, COM_DRIFT, MOMENTUM, MOMENTUM_DRIFT, ROOT_FORCE, TOTAL_MASS = 0, 3, 6, 9, 12, 15, 21
"""Centre of mass (world) with its velocity and drift; angular momentum about it with its drift; force on the whole
robot about the base for ``dv = 0``, gravity included; mass."""
SUMS = 22


def move_body(s: Vector, rate: float, V_parent: Vector, A_parent: Vector, V: Vector, A: Vector) -> None:
    """Twist and drift (6,) of the body behind a joint with column ``s`` that turns at a rate [rad/s]."""
    cross_motion(V_parent, s, A)
    for k in range(6):
        V[k] = V_parent[k] + rate * s[k]
        A[k] = A_parent[k] + rate * A[k]


def body_force(n: Vector, V: Vector, A: Vector, gravity: Vector, h: Vector, force: Vector, lifted: Vector) -> None:
    """Momentum ``h`` and force of one body for ``dv = 0``: inertia (drift - gravity) + twist x* momentum."""
    momentum_of(n, V, h)
    for k in range(3):
        lifted[k] = A[k] - gravity[k]
        lifted[3 + k] = A[3 + k]
    momentum_of(n, lifted, force)
    add_cross_force(V, h, force)


def mass_matrix(parent: Indices, S: Matrix, inertia: Matrix, armature: Vector, M: Matrix, F: Matrix) -> None:
    """Full symmetric mass matrix (nv, nv) from the inertias of the subtrees; entries of unrelated joints stay zero."""
    n = parent.shape[0]
    for i in range(n - 1, 0, -1):
        column = 5 + i
        momentum_of(inertia[i], S[column], F[column])
        M[column, column] = dot6(S[column], F[column]) + armature[column]
        k = parent[i]
        while k > 0:
            M[5 + k, column] = M[column, 5 + k] = dot6(S[5 + k], F[column])
            k = parent[k]
        for k in range(6):
            M[k, column] = M[column, k] = dot6(S[k], F[column])
    for column in range(6):
        momentum_of(inertia[0], S[column], F[column])
    for column in range(6):
        for k in range(column + 1):
            M[k, column] = M[column, k] = dot6(S[k], F[column])


def whole_robot(q: Vector, n: Vector, h: Vector, force: Vector, gravity: Vector, sums: Vector) -> None:
    """Centre of mass, momentum about it and the rates of both for ``dv = 0``; n, h, force are those of the tree."""
    m = n[0]
    x, y, z = n[1] / m, n[2] / m, n[3] / m
    for k in range(3):
        sums[COM + k] = q[k] + n[1 + k] / m
        sums[COM_V + k] = h[k] / m
        sums[COM_DRIFT + k] = force[k] / m + gravity[k]
    for at, f in ((MOMENTUM, h), (MOMENTUM_DRIFT, force)):
        sums[at] = f[3] - (y * f[2] - z * f[1])
        sums[at + 1] = f[4] - (z * f[0] - x * f[2])
        sums[at + 2] = f[5] - (x * f[1] - y * f[0])
    for k in range(6):
        sums[ROOT_FORCE + k] = force[k]
    sums[TOTAL_MASS] = m


def dynamics(
    q: Vector, v: Vector, table: Matrix, parent: Indices, armature: Vector, gravity: Vector, R: np.ndarray, p: Matrix,
    S: Matrix, V: Matrix, A: Matrix, inertia: Matrix, h: Matrix, force: Matrix, M: Matrix, F: Matrix, nle: Vector,
    sums: Vector
) -> None:  # fmt: skip
    """Kinematics and dynamics of the robot; see the module's legend.

    Args:
        q: Configuration (7 + n,).
        v: Velocity (6 + n,), base part in base axes.
        table: Bodies (1 + n, BODY).
        parent: Parent bodies (1 + n,).
        armature: Rotor inertias (6 + n,).
        gravity: Linear acceleration of gravity (3,).
        R: Out, rotations of the bodies (1 + n, 3, 3).
        p: Out, joint origins from the base, world axes (1 + n, 3).
        S: Out, columns (6 + n, 6).
        V: Out, twists (1 + n, 6).
        A: Out, drifts (1 + n, 6).
        inertia: Out, inertias of the subtrees (1 + n, 10).
        h: Out, momenta of the subtrees (1 + n, 6).
        force: Out, forces on the subtrees (1 + n, 6).
        M: In and out, mass matrix (6 + n, 6 + n), zero where joints are unrelated.
        F: Out, forces for unit accelerations (6 + n, 6).
        nle: Out, Coriolis, centrifugal and gravity forces (6 + n,).
        sums: Out, (SUMS,).
    """
    n = parent.shape[0]
    lifted = F[0]
    place_base(q, R[0], p[0], S)
    place_bodies(q, table, parent, 1, n, R, p, S)
    base_twist(v, R[0], V[0])
    for k in range(6):
        A[0, k] = 0.0
    for i in range(n):
        if i > 0:
            k = parent[i]
            move_body(S[5 + i], v[5 + i], V[k], A[k], V[i], A[i])
        body_inertia(table[i], R[i], p[i], inertia[i])
        body_force(inertia[i], V[i], A[i], gravity, h[i], force[i], lifted)
    for i in range(n - 1, 0, -1):
        k = parent[i]
        nle[5 + i] = dot6(S[5 + i], force[i])
        for a in range(10):
            inertia[k, a] += inertia[i, a]
        for a in range(6):
            force[k, a] += force[i, a]
            h[k, a] += h[i, a]
    for k in range(6):
        nle[k] = dot6(S[k], force[0])
    mass_matrix(parent, S, inertia, armature, M, F)
    whole_robot(q, inertia[0], h[0], force[0], gravity, sums)
