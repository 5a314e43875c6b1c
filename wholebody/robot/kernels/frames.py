r"""Frames fixed to bodies, and points of bodies, from what `bodies` and `rigid_body` computed.

Offsets are from the origin of the base, in world axes. A frame is fixed to a body; the velocities that move it are
those of the base and of the joints on the way from its body to the base.
"""

from __future__ import annotations

import math

import numpy as np

from wholebody.jit.arrays import Indices, Matrix, Vector
from wholebody.robot.kernels.spatial import velocity_at

SOLE_FRAME, PALM_FRAME, PELVIS_FRAME, TORSO_FRAME = 0, 2, 4, 5
"""Frames of the whole-body program and of the optimiser: both soles, both palms, pelvis, torso."""


def place_frame(R_body: Matrix, p_body: Vector, R_local: Matrix, p_local: Vector, R: Matrix, p: Vector) -> None:
    """Rotation (3, 3) and offset (3,) of a frame that is given in the axes of its body."""
    for a in range(3):
        x, y, z = R_body[a, 0], R_body[a, 1], R_body[a, 2]
        p[a] = p_body[a] + x * p_local[0] + y * p_local[1] + z * p_local[2]
        for b in range(3):
            R[a, b] = x * R_local[0, b] + y * R_local[1, b] + z * R_local[2, b]


def place_frames(
    R: np.ndarray, p: Matrix, body: Indices, R_local: np.ndarray, p_local: Matrix, FR: np.ndarray, FP: Matrix
) -> None:
    """Rotations (k, 3, 3) and offsets (k, 3) of frames in bodies ``body`` (k,)."""
    for f in range(body.shape[0]):
        place_frame(R[body[f]], p[body[f]], R_local[f], p_local[f], FR[f], FP[f])


def move_frames(V: Matrix, A: Matrix, body: Indices, FP: Matrix, FV: Matrix, FA: Matrix) -> None:
    """Velocities and classical drifts (k, 6) at the frames' own origins."""
    for f in range(body.shape[0]):
        twist, drift, x = V[body[f]], A[body[f]], FP[f]
        a, b, c = twist[3], twist[4], twist[5]
        vx, vy, vz = velocity_at(twist, x)
        FV[f, 0], FV[f, 1], FV[f, 2], FV[f, 3], FV[f, 4], FV[f, 5] = vx, vy, vz, a, b, c
        ax, ay, az = velocity_at(drift, x)
        FA[f, 0], FA[f, 1], FA[f, 2] = ax + b * vz - c * vy, ay + c * vx - a * vz, az + a * vy - b * vx
        FA[f, 3], FA[f, 4], FA[f, 5] = drift[3], drift[4], drift[5]


def frame_columns(S: Matrix, parent: Indices, body: int, x: Vector, J: Matrix, row: int) -> None:
    """Fill rows ``row`` to ``row + 5`` of J (m, nv) with the Jacobian of a frame at ``x``, where it is not zero."""
    k = body
    while k > 0:
        fill_column(S[5 + k], 5 + k, x, J, row)
        k = parent[k]
    for column in range(6):
        fill_column(S[column], column, x, J, row)


def fill_column(s: Vector, c: int, x: Vector, J: Matrix, row: int) -> None:
    """Column ``c`` of rows ``row`` to ``row + 5`` of J, for a column ``s`` (6,) about the base."""
    J[row, c], J[row + 1, c], J[row + 2, c] = velocity_at(s, x)
    J[row + 3, c], J[row + 4, c], J[row + 5, c] = s[3], s[4], s[5]


def shorten(x: Vector, start: int, largest: float) -> None:
    """Scale three entries to a norm of at most ``largest``; keeps their direction."""
    size = math.sqrt(x[start] * x[start] + x[start + 1] * x[start + 1] + x[start + 2] * x[start + 2])
    if size > largest:
        for k in range(start, start + 3):
            x[k] *= largest / size


def point_columns(S: Matrix, parent: Indices, body: int, x: Vector, normal: Vector, sign: float, row: Vector) -> None:
    """Add ``sign`` times the speed along ``normal`` of the point of a body at offset ``x`` to ``row`` (nv,)."""
    mx = x[1] * normal[2] - x[2] * normal[1]
    my = x[2] * normal[0] - x[0] * normal[2]
    mz = x[0] * normal[1] - x[1] * normal[0]
    k = body
    while k > 0:
        c = 5 + k
        along = S[c, 0] * normal[0] + S[c, 1] * normal[1] + S[c, 2] * normal[2]
        row[c] += sign * (along + S[c, 3] * mx + S[c, 4] * my + S[c, 5] * mz)
        k = parent[k]
    for c in range(6):
        along = S[c, 0] * normal[0] + S[c, 1] * normal[1] + S[c, 2] * normal[2]
        row[c] += sign * (along + S[c, 3] * mx + S[c, 4] * my + S[c, 5] * mz)


def point_speed(V: Vector, x: Vector, normal: Vector) -> float:
    """Speed along ``normal`` of the point at offset ``x`` of a body with twist ``V`` (6,)."""
    vx, vy, vz = velocity_at(V, x)
    return vx * normal[0] + vy * normal[1] + vz * normal[2]


def point_drift(V: Vector, A: Vector, x: Vector, normal: Vector) -> float:
    """Classical acceleration along ``normal`` of that point when ``dv = 0``; ``A`` (6,) is the body's drift."""
    a, b, c = V[3], V[4], V[5]
    (vx, vy, vz), (ax, ay, az) = velocity_at(V, x), velocity_at(A, x)
    ax, ay, az = ax + b * vz - c * vy, ay + c * vx - a * vz, az + a * vy - b * vx
    return ax * normal[0] + ay * normal[1] + az * normal[2]
