"""Bounds on distances at the knots of a plan: the nearest pairs of bodies, and the bodies near the floor.

Knots are too far apart for the distances of one to bound those of the next. Spheres and boxes around the shapes say
which pairs may be distances, and those are measured, each from where it was at the knot before.
"""

from __future__ import annotations

import numpy as np

from wholebody.collision.gjk import APART, BEYOND, BODY, distance, support_vertex
from wholebody.collision.hull_pairs import outside_box
from wholebody.jit.arrays import Matrix, Vector
from wholebody.robot.kernels.bodies import place_body
from wholebody.trajopt.arrays import KnotTargets, Shapes, Tables
from wholebody.trajopt.kernels.configuration_terms import reduce_row
from wholebody.trajopt.layout import DISTANCE, FREE_LOWER, LOWER, N_BODY, N_DISTANCES, N_JOINTS, N_PAIRS
from wholebody.trajopt.workspace import Distances, KnotMotion

REMEASURE = 0.01
"""Motion of a joint up to which measured distances are extrapolated by their derivatives [rad]: at an arm's length of
0.6 m the error, second order in it, is 0.03 mm."""


def measure(
    robot: Tables, shapes: Shapes, task: KnotTargets, m: KnotMotion, distances: Distances, trigger: float
) -> int:
    """Measure the pairs within ``trigger`` of their margin at all knots that have moved.

    Returns:
        Number of pairs listed in ``distances.touching`` as (knot, pair, place in the list of the knot): their shapes
        touch, and the caller measures them by other means. Then `describe` completes the rows.
    """
    touching = 0
    for k in range(1, m.q.shape[0]):
        moved = 0.0
        for j in range(N_JOINTS):
            moved = max(moved, abs(m.q[k, 7 + j] - distances.q[k, j]))
        distances.measured[k] = moved >= REMEASURE
        if not distances.measured[k]:
            continue
        for j in range(N_JOINTS):
            distances.q[k, j] = m.q[k, 7 + j]
        R, p = m.R[k], m.p[k]
        place_fingers(robot, task.q_fingers[k], R, p)
        centres(shapes, R, p, distances.centre)
        touching = measure_knot(k, shapes, R, p, distances, trigger, touching)
    return touching


def place_fingers(robot: Tables, angles: Vector, R: np.ndarray, p: Matrix) -> None:
    """Placements of the fingers, which come after the bodies of the plan."""
    for i in range(N_JOINTS + 1, R.shape[0]):
        before = robot.parent[i]
        place_body(robot.bodies[i], angles[i - N_JOINTS - 1], R[before], p[before], R[i], p[i])


def centres(shapes: Shapes, R: np.ndarray, p: Matrix, out: Matrix) -> None:
    """Middles (n, 3) of the boxes around the shapes, from the base [m]."""
    for s in range(out.shape[0]):
        b, c = shapes.shapes[s, BODY], shapes.centre[s]
        for a in range(3):
            out[s, a] = p[b, a] + R[b, a, 0] * c[0] + R[b, a, 1] * c[1] + R[b, a, 2] * c[2]


def measure_knot(
    k: int, shapes: Shapes, R: np.ndarray, p: Matrix, distances: Distances, trigger: float, touching: int
) -> int:
    """Fill the list of one knot; see `measure`."""
    most, count = distances.pair.shape[1], 0
    centre, reach = distances.centre, shapes.radius
    for n in range(shapes.pairs.shape[0]):
        i, j = shapes.pairs[n, 0], shapes.pairs[n, 1]
        enough = trigger + shapes.margin[n]
        x, y, z = centre[j, 0] - centre[i, 0], centre[j, 1] - centre[i, 1], centre[j, 2] - centre[i, 2]
        size = enough + reach[i] + reach[j]
        if x * x + y * y + z * z >= size * size:
            continue
        a, b = shapes.shapes[i, BODY], shapes.shapes[j, BODY]
        if outside_box(R[a], shapes.half[i], x, y, z) >= enough + reach[j]:
            continue
        if outside_box(R[b], shapes.half[j], x, y, z) >= enough + reach[i]:
            continue
        if count == most:
            break
        found, code = distance(
            shapes.shapes[i], shapes.shapes[j], shapes.rounds[i], shapes.rounds[j], shapes.vertices, shapes.start,
            shapes.neighbours, enough, R[a], p[a], R[b], p[b], distances.simplex[n], distances.state[n],
            distances.scratch, distances.rows[k, count],
        )  # fmt: skip
        if code == BEYOND or (code == APART and found >= enough):
            continue
        distances.pair[k, count], distances.slack[k, count] = n, found - shapes.margin[n]
        if code != APART:
            distances.touching[touching, 0], distances.touching[touching, 1], distances.touching[touching, 2] = (
                k,
                n,
                count,
            )
            touching += touching + 1 < distances.touching.shape[0]
        count += 1
    distances.count[k] = count
    return touching


def describe(robot: Tables, shapes: Shapes, task: KnotTargets, m: KnotMotion, distances: Distances) -> None:
    """The bounds DISTANCE and their derivatives at all knots: first those of the pairs, then those of the floor.

    Where little has moved, those of the pairs are the ones measured before, moved on.
    """
    for k in range(1, m.q.shape[0]):
        if distances.measured[k]:
            choose(k, distances)
            for c in range(distances.chosen[k]):
                n = distances.pair[k, c]
                row = distances.J[k, c]
                for j in range(N_BODY):
                    row[j] = 0.0
                normal = distances.rows[k, c]
                carry(robot, shapes.shapes[shapes.pairs[n, 0], BODY], 1.0, normal, normal[3:6], m.S[k], row)
                carry(robot, shapes.shapes[shapes.pairs[n, 1], BODY], -1.0, normal, normal[6:9], m.S[k], row)
                distances.violation[k, c] = -distances.slack[k, c]
        for c in range(N_DISTANCES):
            m.violation[k, DISTANCE + c] = -1.0
        m.n_near[k] = distances.chosen[k]
        for c in range(m.n_near[k]):
            row, out, speeds = distances.J[k, c], m.J_distance[k, c], m.approach[k, c]
            value = distances.violation[k, c]
            for j in range(6, N_BODY):
                value += row[j] * (m.q[k, 1 + j] - distances.q[k, j - 6])
            m.violation[k, DISTANCE + c] = value
            for j in range(N_BODY):
                speeds[j] = row[j]
            for r in range(FREE_LOWER):
                d = 0.0
                for j in range(6, LOWER):
                    d += row[j] * m.free[k, r, j]
                out[r] = d
            for j in range(LOWER, N_BODY):
                out[FREE_LOWER + j - LOWER] = row[j]
        describe_floor(k, robot, shapes, task, m, distances)


def describe_floor(
    k: int, robot: Tables, shapes: Shapes, task: KnotTargets, m: KnotMotion, distances: Distances
) -> None:
    """Add the bounds of the bodies near the floor to those of the pairs, each by its lowest vertex."""
    base, R, p, S, up, x = m.q[k, 2], m.R[k], m.p[k], m.S[k], distances.scratch[:3], distances.scratch[3:6]
    keep, placed = shapes.floor[0], False
    up[0], up[1], up[2] = 0.0, 0.0, 1.0
    for i in range(shapes.low_body.shape[0]):
        if base + p[shapes.low_anchor[i], 2] - shapes.low_reach[i] - keep >= shapes.floor[1]:
            continue
        if not placed:
            place_fingers(robot, task.q_fingers[k], R, p)
            placed = True
        b = shapes.low_body[i]
        distances.lowest[i] = support_vertex(
            -R[b, 2, 0], -R[b, 2, 1], -R[b, 2, 2], distances.lowest[i], shapes.vertices, shapes.start, shapes.neighbours
        )  # fmt: skip
        vertex = shapes.vertices[distances.lowest[i]]
        for a in range(3):
            x[a] = p[b, a] + R[b, a, 0] * vertex[0] + R[b, a, 1] * vertex[1] + R[b, a, 2] * vertex[2]
        slack = base + x[2] - keep
        if slack >= shapes.floor[1]:
            continue
        c = m.n_near[k]
        row = m.approach[k, c]
        for j in range(N_BODY):
            row[j] = 0.0
        for j in range(6):
            row[j] = -(S[j, 2] + S[j, 3] * x[1] - S[j, 4] * x[0])
        carry(robot, b, -1.0, up, x, S, row)
        m.violation[k, DISTANCE + c] = -slack
        reduce_row(row, m.free[k], m.J_distance[k, c])
        m.n_near[k] = c + 1


def choose(k: int, distances: Distances) -> None:
    """Bring the nearest pairs of a knot to the front of its list, in their order."""
    count = distances.count[k]
    chosen = min(count, N_PAIRS)
    for c in range(chosen):
        best = c
        for i in range(c + 1, count):
            if distances.slack[k, i] < distances.slack[k, best]:
                best = i
        if best != c:
            distances.pair[k, c], distances.pair[k, best] = distances.pair[k, best], distances.pair[k, c]
            distances.slack[k, c], distances.slack[k, best] = distances.slack[k, best], distances.slack[k, c]
            for i in range(9):
                distances.rows[k, c, i], distances.rows[k, best, i] = (
                    distances.rows[k, best, i],
                    distances.rows[k, c, i],
                )
    distances.chosen[k] = chosen


def carry(robot: Tables, body: int, sign: float, normal: Vector, x: Vector, S: Matrix, row: Vector) -> None:
    """Add ``sign`` times how the joints that carry a body move its point x along a normal.

    Fingers are locked, and the base, which moves both bodies of a pair alike, is left out.
    """
    m0 = x[1] * normal[2] - x[2] * normal[1]
    m1 = x[2] * normal[0] - x[0] * normal[2]
    m2 = x[0] * normal[1] - x[1] * normal[0]
    while body > 0:
        if body <= N_JOINTS:
            s = S[5 + body]
            along = normal[0] * s[0] + normal[1] * s[1] + normal[2] * s[2] + m0 * s[3] + m1 * s[4] + m2 * s[5]
            row[5 + body] += sign * along
        body = robot.parent[body]
