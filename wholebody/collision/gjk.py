r"""Distance of two convex shapes.

The algorithm of Gilbert, Johnson and Keerthi on the difference of the two sets: a simplex of at most four of its
points is moved towards the origin. It starts with the simplex that the same pair ended with last time, whose points are
kept in the axes of the bodies, and support points are found by climbing from the last one: next to the last posture it
needs one or two steps. It ends when a supporting plane shows that nothing is nearer.

Shapes are fixed to bodies and given in their axes. A row of ``shapes`` is ``kind first count body``: the first of its
vertices and their number. A row of ``rounds`` is ``centre (3) axis (3) radius half-length``; a sphere is its centre
with a radius around it.

Source:
    Gilbert, Johnson and Keerthi 1988, "A fast procedure for computing the distance between complex objects in
    three-dimensional space", IEEE Journal of Robotics and Automation 4(2); Ericson 2005, "Real-Time Collision
    Detection", 9.5.
"""

from __future__ import annotations

import math

from wholebody.collision.simplex import dot3, keep, nearest_of
from wholebody.jit.arrays import Indices, Matrix, Vector

HULL, SPHERE, CYLINDER = range(3)
KIND, FIRST, COUNT, BODY = range(4)
CENTRE, AXIS, RADIUS, HALF_LENGTH = 0, 3, 6, 7

APART, BEYOND, UNSURE = range(3)
"""What `distance` answers: it is known; or only that the shapes are at least that far apart, which is enough; or
another algorithm has to find it: the shapes touch, or rounding won."""

ITERATIONS_MAX = 64
"""Steps after which rounding has won; from a cold start it takes about ten."""
PLANE_GAP = 1e-12
"""Distance to the supporting plane at which the nearest point is found [m]; chosen: rounding of lengths of a metre."""
GAP_ACCEPTED = 1e-8
"""Distance to the supporting plane that is accepted where no step brings the simplex nearer any more [m]; chosen, no
trial is on record."""
SCRATCH = 35
"""Room that `distance` works in."""
TOUCHING = 1e-8
"""Distance below which shapes, without their radius, count as touching [m]; chosen: their normal would be rounding."""


def support_vertex(x: float, y: float, z: float, at: int, vertices: Matrix, start: Indices, neighbours: Indices) -> int:
    """Vertex (n, 3) furthest along a direction, climbed to from vertex ``at`` over the edges of the hull."""
    best = x * vertices[at, 0] + y * vertices[at, 1] + z * vertices[at, 2]
    while True:
        here = at
        for e in range(start[here], start[here + 1]):
            k = neighbours[e]
            height = x * vertices[k, 0] + y * vertices[k, 1] + z * vertices[k, 2]
            if height > best:
                at, best = k, height
        if at == here:
            return at


def support_cylinder(x: float, y: float, z: float, row: Vector) -> tuple[float, float, float]:
    """Point of a cylinder, ``row`` (8,) of ``rounds``, furthest along a direction."""
    a, b, c = row[AXIS], row[AXIS + 1], row[AXIS + 2]
    along = x * a + y * b + z * c
    u, v, w = x - along * a, y - along * b, z - along * c
    size = math.sqrt(u * u + v * v + w * w)
    around = row[RADIUS] / size if size > 1e-12 * abs(along) else 0.0
    half = row[HALF_LENGTH] if along > 0.0 else -row[HALF_LENGTH]
    return row[0] + half * a + around * u, row[1] + half * b + around * v, row[2] + half * c + around * w


def relative(R_a: Matrix, p_a: Vector, R_b: Matrix, p_b: Vector, move: Vector) -> None:
    """Placement of body b in the axes of body a, ``R`` (9) and ``p`` (3) into ``move`` (12,)."""
    x, y, z = p_b[0] - p_a[0], p_b[1] - p_a[1], p_b[2] - p_a[2]
    for i in range(3):
        for j in range(3):
            move[3 * i + j] = R_a[0, i] * R_b[0, j] + R_a[1, i] * R_b[1, j] + R_a[2, i] * R_b[2, j]
        move[9 + i] = R_a[0, i] * x + R_a[1, i] * y + R_a[2, i] * z


def difference(point: Vector, move: Vector, w: Vector) -> None:
    """``w = a - b`` in the axes of body a, of a row ``a (3) b (3)`` with each point in the axes of its own body."""
    for i in range(3):
        b = move[3 * i] * point[3] + move[3 * i + 1] * point[4] + move[3 * i + 2] * point[5] + move[9 + i]
        w[i] = point[i] - b


def begin(shapes: tuple[Indices, Vector, Indices, Vector], vertices: Matrix, point: Vector, hints: Indices) -> None:
    """Any point (6,) of the difference: middles of round shapes, vertices of the last climb, hints (2,), of hulls."""
    first, rounds_a, second, rounds_b = shapes
    for k in range(3):
        point[k] = rounds_a[k] if first[KIND] != HULL else vertices[hints[0], k]
        point[3 + k] = rounds_b[k] if second[KIND] != HULL else vertices[hints[1], k]


def furthest(
    x: float, y: float, z: float, shape: Indices, row: Vector, at: int, side: int,
    hulls: tuple[Matrix, Indices, Indices], point: Vector
) -> int:  # fmt: skip
    """Write the support point of a shape along a direction into half of ``point`` (6,); the vertex it is, if any."""
    vertices, start, neighbours = hulls
    if shape[KIND] == CYLINDER:
        point[side], point[side + 1], point[side + 2] = support_cylinder(x, y, z, row)
        return at
    at = support_vertex(x, y, z, at, vertices, start, neighbours) if shape[KIND] == HULL else shape[FIRST]
    for k in range(3):
        point[side + k] = vertices[at, k]
    return at


def approach(
    shapes: tuple[Indices, Vector, Indices, Vector], hulls: tuple[Matrix, Indices, Indices], enough: float,
    move: Vector, n: int, simplex: Matrix, hints: Indices, W: Matrix, v: Vector, weights: Vector, trial: Vector
) -> tuple[int, float]:  # fmt: skip
    """Move the simplex to where it is nearest to the origin.

    Args:
        shapes: Rows of ``shapes`` and of ``rounds`` of the first shape, and those of the second, a tuple.
        hulls: ``vertices``, ``start`` and ``neighbours`` as in `distance`, a tuple.
        enough: Distance from which on a lower bound will do [m].
        move: Placement of the second body in the first (12,).
        n: Number of points that the simplex has, 0 to 4.
        simplex: In and out, rows ``a (3) b (3)`` in the axes of the bodies (4, 6).
        hints: In and out, vertices from which climbing starts (2,).
        W: Scratch (4, 3).
        v: Out, nearest point of the difference (3,).
        weights: Out, weights of the points of the simplex in it (4,).
        trial: Scratch (4,).

    Returns:
        Number of points of the simplex, 0 if it is not known whether there is nothing nearer; and a lower bound of the
        distance where that is enough, else -1.
    """
    if n == 0:
        begin(shapes, hulls[0], simplex[0], hints)
        n = 1
    for i in range(n):
        difference(simplex[i], move, W[i])
    before, gap = math.inf, math.inf
    for _ in range(ITERATIONS_MAX):
        if not nearest_of(W, n, weights, trial):
            return 0, -1.0
        n = keep(W, simplex, n, weights)
        size = nearest_point(W, n, weights, v)
        if not size > TOUCHING:
            return 0, -1.0
        # Where no step helps any more, what the last one could have gained tells how good it is.
        if not size < before:
            break
        before = size
        support_point(shapes, hulls, move, v, hints, simplex[n])
        difference(simplex[n], move, W[n])
        least = dot3(v, W[n]) / size
        gap = size - least
        if gap <= PLANE_GAP:
            return n, -1.0
        n += 1
        if least >= enough:
            return n, least
    return n if gap <= GAP_ACCEPTED else 0, -1.0


def nearest_point(W: Matrix, n: int, weights: Vector, v: Vector) -> float:
    """``v`` (3,) by the weights of ``n`` points; its distance from the origin."""
    for k in range(3):
        v[k] = 0.0
        for i in range(n):
            v[k] += weights[i] * W[i, k]
    return math.sqrt(dot3(v, v))


def support_point(
    shapes: tuple[Indices, Vector, Indices, Vector], hulls: tuple[Matrix, Indices, Indices], move: Vector, v: Vector,
    hints: Indices, point: Vector
) -> None:  # fmt: skip
    """Write the support point of the difference against ``v`` (3,) as a row ``a (3) b (3)``."""
    first, row_a, second, row_b = shapes
    x, y, z = v[0], v[1], v[2]
    u = move[0] * x + move[3] * y + move[6] * z
    s = move[1] * x + move[4] * y + move[7] * z
    t = move[2] * x + move[5] * y + move[8] * z
    hints[0] = furthest(-x, -y, -z, first, row_a, hints[0], 0, hulls, point)
    hints[1] = furthest(u, s, t, second, row_b, hints[1], 3, hulls, point)


def distance(
    first: Indices, second: Indices, row_a: Vector, row_b: Vector, vertices: Matrix, start: Indices,
    neighbours: Indices, enough: float, R_a: Matrix, p_a: Vector, R_b: Matrix, p_b: Vector, simplex: Matrix,
    state: Indices, scratch: Vector, out: Vector
) -> tuple[float, int]:  # fmt: skip
    """Distance of two shapes with the nearest points.

    Args:
        first: Row of ``shapes`` of the first shape.
        second: Of the second.
        row_a: Row of ``rounds`` of the first shape.
        row_b: Of the second.
        vertices: Of all shapes (any, 3).
        start: Where the neighbours of each vertex begin in the next.
        neighbours: Vertices at the other ends of the edges.
        enough: Distance from which on a lower bound will do, infinite where it will not [m].
        R_a: Rotation of the first body (3, 3).
        p_a: Its origin (3,).
        R_b: Rotation of the second body.
        p_b: Its origin.
        simplex: In and out, what `approach` ended with for this pair (4, 6).
        state: In and out, number of its points, and the two vertices to climb from (3,).
        scratch: (SCRATCH,).
        out: Out, normal from the first shape to the second and the nearest points, in the axes in which the bodies are
            placed (9,).

    Returns:
        The distance [m] and `APART`, or a lower bound and `BEYOND`; nothing is known if it is `UNSURE`. Only `APART`
        leaves ``out``.
    """
    move, W, v = scratch[:12], scratch[12:24].reshape((4, 3)), scratch[24:27]
    weights, trial, hints = scratch[27:31], scratch[31:35], state[1:3]
    relative(R_a, p_a, R_b, p_b, move)
    extra_a = row_a[RADIUS] if first[KIND] == SPHERE else 0.0
    extra_b = row_b[RADIUS] if second[KIND] == SPHERE else 0.0
    shapes, hulls = (first, row_a, second, row_b), (vertices, start, neighbours)
    near = enough + extra_a + extra_b
    n, least = approach(shapes, hulls, near, move, state[0], simplex, hints, W, v, weights, trial)
    state[0] = n
    if n == 0:
        return 0.0, UNSURE
    if least >= 0.0:
        return least - extra_a - extra_b, BEYOND
    size = math.sqrt(dot3(v, v))
    for k in range(3):
        out[k] = -(R_a[k, 0] * v[0] + R_a[k, 1] * v[1] + R_a[k, 2] * v[2]) / size
        out[3 + k], out[6 + k] = p_a[k] + extra_a * out[k], p_b[k] - extra_b * out[k]
        for i in range(n):
            p, c = simplex[i], weights[i]
            out[3 + k] += c * (R_a[k, 0] * p[0] + R_a[k, 1] * p[1] + R_a[k, 2] * p[2])
            out[6 + k] += c * (R_b[k, 0] * p[3] + R_b[k, 1] * p[4] + R_b[k, 2] * p[5])
    return size - extra_a - extra_b, APART
