"""The nearest pairs of bodies at the knots of a plan, and the bodies near the floor; compiles with numba as it stands.

Knots are too far apart for the distances of one to bound those of the next. Spheres and boxes around the shapes say
which pairs may be near, and those are measured, each from where it was at the knot before.
"""

from __future__ import annotations

import math

from wholebody.collision.gjk import APART, BEYOND, BODY, distance, support_vertex
from wholebody.planning.trajopt.kernels.configuration_terms import reduce_row
from wholebody.planning.trajopt.kernels.fixed_feet_kinematics import place_body
from wholebody.planning.trajopt.layout import FREE_LOWER, LOWER, N_BODY, N_JOINTS, N_NEAR, N_PAIRS, NEAR

REMEASURE = 0.01
"""Motion of a joint up to which measured distances are changed by their derivatives [rad]."""


def measure(robot, shapes, task, m, near, trigger):
    """Measure the pairs within ``trigger`` of their margin at all knots that have moved.

    Returns:
        Number of pairs listed in ``near.unsure`` as (knot, pair, place in the list of the knot): their shapes touch,
        and somebody else has to measure them. Then `describe` completes the rows.
    """
    unsure = 0
    for k in range(1, m.q.shape[0]):
        moved = 0.0
        for j in range(N_JOINTS):
            moved = max(moved, abs(m.q[k, 7 + j] - near.q[k, j]))
        near.fresh[k] = moved >= REMEASURE
        if not near.fresh[k]:
            continue
        for j in range(N_JOINTS):
            near.q[k, j] = m.q[k, 7 + j]
        R, p = m.R[k], m.p[k]
        place_fingers(robot, task.q_fingers[k], R, p)
        centres(shapes, R, p, near.centre)
        unsure = measure_knot(k, shapes, R, p, near, trigger, unsure)
    return unsure


def place_fingers(robot, angles, R, p):
    """Placements of the fingers, which come after the bodies of the plan."""
    for i in range(N_JOINTS + 1, R.shape[0]):
        before = robot.parent[i]
        place_body(robot.bodies[i], angles[i - N_JOINTS - 1], R[before], p[before], R[i], p[i])


def centres(shapes, R, p, out):
    """Middles of the boxes around the shapes, from the base."""
    for s in range(out.shape[0]):
        b, c = shapes.shapes[s, BODY], shapes.centre[s]
        for a in range(3):
            out[s, a] = p[b, a] + R[b, a, 0] * c[0] + R[b, a, 1] * c[1] + R[b, a, 2] * c[2]


def measure_knot(k, shapes, R, p, near, trigger, unsure):
    """Fill the list of one knot; see `measure`."""
    most, count = near.pair.shape[1], 0
    centre, reach = near.centre, shapes.radius
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
            shapes.neighbours, enough, R[a], p[a], R[b], p[b], near.simplex[n], near.state[n], near.scratch,
            near.rows[k, count],
        )  # fmt: skip
        if code == BEYOND or (code == APART and found >= enough):
            continue
        near.pair[k, count], near.room[k, count] = n, found - shapes.margin[n]
        if code != APART:
            near.unsure[unsure, 0], near.unsure[unsure, 1], near.unsure[unsure, 2] = k, n, count
            unsure += unsure + 1 < near.unsure.shape[0]
        count += 1
    near.count[k] = count
    return unsure


def outside_box(R, half, x, y, z):
    """Distance of a point, seen from the middle of a box, from the box; R are the axes of the box."""
    total = 0.0
    for c in range(3):
        d = abs(R[0, c] * x + R[1, c] * y + R[2, c] * z) - half[c]
        if d > 0.0:
            total += d * d
    return math.sqrt(total)


def describe(robot, shapes, task, m, near):
    """The bounds NEAR and their derivatives at all knots: first those of the pairs, then those of the floor.

    Where little has moved, those of the pairs are the ones measured before, moved on.
    """
    for k in range(1, m.q.shape[0]):
        if near.fresh[k]:
            choose(k, near)
            for c in range(near.chosen[k]):
                n = near.pair[k, c]
                row = near.J[k, c]
                for j in range(N_BODY):
                    row[j] = 0.0
                normal = near.rows[k, c]
                carry(robot, shapes.shapes[shapes.pairs[n, 0], BODY], 1.0, normal, normal[3:6], m.S[k], row)
                carry(robot, shapes.shapes[shapes.pairs[n, 1], BODY], -1.0, normal, normal[6:9], m.S[k], row)
                near.over[k, c] = -near.room[k, c]
        for c in range(N_NEAR):
            m.over[k, NEAR + c] = -1.0
        m.near[k] = near.chosen[k]
        for c in range(m.near[k]):
            row, out, speeds = near.J[k, c], m.J_near[k, c], m.sweeps[k, c]
            value = near.over[k, c]
            for j in range(6, N_BODY):
                value += row[j] * (m.q[k, 1 + j] - near.q[k, j - 6])
            m.over[k, NEAR + c] = value
            for j in range(N_BODY):
                speeds[j] = row[j]
            for r in range(FREE_LOWER):
                d = 0.0
                for j in range(6, LOWER):
                    d += row[j] * m.free[k, r, j]
                out[r] = d
            for j in range(LOWER, N_BODY):
                out[FREE_LOWER + j - LOWER] = row[j]
        describe_floor(k, robot, shapes, task, m, near)


def describe_floor(k, robot, shapes, task, m, near):
    """Add the bounds of the bodies near the floor to those of the pairs, each by its lowest vertex."""
    base, R, p, S, up, x = m.q[k, 2], m.R[k], m.p[k], m.S[k], near.scratch[:3], near.scratch[3:6]
    keep, placed = shapes.floor[0], False
    up[0], up[1], up[2] = 0.0, 0.0, 1.0
    for i in range(shapes.low_body.shape[0]):
        if base + p[shapes.low_anchor[i], 2] - shapes.low_reach[i] - keep >= shapes.floor[1]:
            continue
        if not placed:
            place_fingers(robot, task.q_fingers[k], R, p)
            placed = True
        b = shapes.low_body[i]
        near.lowest[i] = support_vertex(
            -R[b, 2, 0], -R[b, 2, 1], -R[b, 2, 2], near.lowest[i], shapes.vertices, shapes.start, shapes.neighbours
        )  # fmt: skip
        vertex = shapes.vertices[near.lowest[i]]
        for a in range(3):
            x[a] = p[b, a] + R[b, a, 0] * vertex[0] + R[b, a, 1] * vertex[1] + R[b, a, 2] * vertex[2]
        room = base + x[2] - keep
        if room >= shapes.floor[1]:
            continue
        c = m.near[k]
        row = m.sweeps[k, c]
        for j in range(N_BODY):
            row[j] = 0.0
        for j in range(6):
            row[j] = -(S[j, 2] + S[j, 3] * x[1] - S[j, 4] * x[0])
        carry(robot, b, -1.0, up, x, S, row)
        m.over[k, NEAR + c] = -room
        reduce_row(row, m.free[k], m.J_near[k, c])
        m.near[k] = c + 1


def choose(k, near):
    """Bring the nearest pairs of a knot to the front of its list, in their order."""
    count = near.count[k]
    chosen = min(count, N_PAIRS)
    for c in range(chosen):
        best = c
        for i in range(c + 1, count):
            if near.room[k, i] < near.room[k, best]:
                best = i
        if best != c:
            near.pair[k, c], near.pair[k, best] = near.pair[k, best], near.pair[k, c]
            near.room[k, c], near.room[k, best] = near.room[k, best], near.room[k, c]
            for i in range(9):
                near.rows[k, c, i], near.rows[k, best, i] = near.rows[k, best, i], near.rows[k, c, i]
    near.chosen[k] = chosen


def carry(robot, body, sign, normal, x, S, row):
    """Add ``sign`` times how the joints that carry a body move its point x along a normal."""
    m0 = x[1] * normal[2] - x[2] * normal[1]
    m1 = x[2] * normal[0] - x[0] * normal[2]
    m2 = x[0] * normal[1] - x[1] * normal[0]
    while body > 0:
        if body <= N_JOINTS:
            s = S[5 + body]
            along = normal[0] * s[0] + normal[1] * s[1] + normal[2] * s[2] + m0 * s[3] + m1 * s[4] + m2 * s[5]
            row[5 + body] += sign * along
        body = robot.parent[body]
