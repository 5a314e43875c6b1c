"""Rows that keep bodies off the floor, as `wholebody.limits.floor`; compiles with numba as it stands."""

from wholebody.collision.gjk import support_vertex
from wholebody.qp.kernels import blocks as mem
from wholebody.qp.kernels.limits import barrier
from wholebody.robot.kernels.frames import point_columns, point_drift, point_speed

DISTANCE, TRIGGER, BRAKE, DT = range(4)
"""Entries of FLOOR_LIMIT."""


def limit_floor(reals, ints, at):
    """One soft row a body from slot ``at`` on, switched off where the body is high; the slot after the last.

    The lowest vertex is climbed to from the one that was lowest before.
    """
    body, vertex = mem.vector(ints, mem.FLOOR_BODY), mem.vector(ints, mem.FLOOR_VERTEX)
    reach, bound = mem.vector(reals, mem.FLOOR_REACH), mem.vector(reals, mem.FLOOR_LIMIT)
    R, p, upper = mem.cube(reals, mem.R_), mem.matrix(reals, mem.P_), mem.vector(reals, mem.SOFT_UPPER)
    base, scratch = mem.vector(reals, mem.Q_)[2], mem.vector(reals, mem.SCRATCH)
    for i in range(body.shape[0]):
        k = body[i]
        upper[at + i] = 1e300
        if base + p[k, 2] - reach[i] - bound[DISTANCE] >= bound[TRIGGER]:
            continue
        vertices = mem.matrix(reals, mem.VERTICES)
        n = vertex[i] = support_vertex(
            -R[k, 2, 0],
            -R[k, 2, 1],
            -R[k, 2, 2],
            vertex[i],
            vertices,
            mem.vector(ints, mem.EDGE_START),
            mem.vector(ints, mem.EDGE_END),
        )
        for a in range(3):
            x = vertices[n]
            scratch[a] = p[k, a] + R[k, a, 0] * x[0] + R[k, a, 1] * x[1] + R[k, a, 2] * x[2]
        room = base + scratch[2] - bound[DISTANCE]
        if room < bound[TRIGGER]:
            upper[at + i] = floor_row(k, room, at + i, reals, ints)
    return at + body.shape[0]


def floor_row(body, room, slot, reals, ints):
    """Write the row of a body whose lowest point from the base is in SCRATCH; its bound."""
    row, driven = mem.matrix(reals, mem.JS_)[slot], mem.vector(ints, mem.DRIVEN)
    scratch, bound = mem.vector(reals, mem.SCRATCH), mem.vector(reals, mem.FLOOR_LIMIT)
    point, up = scratch[:3], scratch[3:6]
    V, A = mem.matrix(reals, mem.TWIST)[body], mem.matrix(reals, mem.DRIFT)[body]
    up[0], up[1], up[2] = 0.0, 0.0, 1.0
    for c in range(row.shape[0]):
        row[c] = 0.0
    point_columns(mem.matrix(reals, mem.S_), mem.vector(ints, mem.PARENT), body, point, up, -1.0, row)
    for c in range(driven.shape[0]):
        row[driven[c]] = 0.0
    rate = point_speed(V, point, up)
    return barrier(room, -rate, bound[BRAKE], bound[DT]) + point_drift(V, A, point, up)
