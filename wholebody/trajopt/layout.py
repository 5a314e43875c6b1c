"""Sizes of the optimiser's arrays, and which row of them is what."""

from __future__ import annotations

FIRST_RATE = 1.5
"""Factor, derived: a cubic B-spline that begins at q0 with velocity v0 has the first control point P0 = 3/2 q0 - 1/2 P1
+ dt/2 v0, so its first velocity between control points is (P1 - P0) / dt = 3/2 (P1 - q0) / dt - 1/2 v0."""
N_BODY = 35
"""Velocities of the body without fingers: `LOWER` of base and legs, `UPPER` of waist and arms."""
LOWER, UPPER = 18, 17
FREE_LOWER = 6
"""Directions that the feet leave to base and legs."""
N_FREE = FREE_LOWER + UPPER
N_BLOCK = 24
"""`N_FREE` rounded up to vector registers of eight numbers: rows of a block of the linear program, in `banded`."""
N_PANEL = 3 * N_BLOCK
RIGHT = N_PANEL - 1
"""Spare column of a panel that has its right-hand side."""
N_JOINTS = N_BODY - 6
WAIST = 3
"""Joints of the waist, which come first among the upper ones."""

# Residuals of one configuration: palms (position, rotation vector each), then these. Joints need no Jacobian.
COM, TORSO, PELVIS, HEIGHT, JOINTS = 12, 14, 17, 20, 21
N_POSITION, N_FRAME = 50, 21
"""Residuals of one configuration, and how many of them have rows in its Jacobian."""

# Rows of the dynamics: zero-moment point times vertical force (2) and vertical force, per weight; torques, waist first;
# acceleration of the soles (4); horizontal force (2) and moment about the vertical, per weight.
ZMP_FORCE, VERTICAL, TAU, SOLE, HORIZONTAL, YAW, N_DYNAMICS = 0, 2, 3, 20, 24, 26, 27
N_FRICTION = 12
"""Sides of the cone of contact wrenches: two for each horizontal force, eight for the moment about the vertical."""

# Inequalities of a knot. Those of its configuration come first; edges of the support follow three times, first those of
# the centre of mass.
TILT, BASE_HEIGHT, POSITION, STATIC, DISTANCE = 0, 2, 3, 32, 35
N_PAIRS, N_FLOOR = 16, 24
"""Most pairs of bodies, and most bodies near the floor, that are bounds of one knot: the nearest ones."""
N_DISTANCES = N_PAIRS + N_FLOOR
COM_EDGE = DISTANCE + N_DISTANCES
# After the first edges, from here on plus their number: load, torques, edges of the zero-moment point. Then come edges
# of the capture point, accelerations, speeds, friction.
LOAD, TORQUE, ZMP = COM_EDGE, COM_EDGE + 1, COM_EDGE + 1 + UPPER
N_LISTED = 96
"""Most pairs of bodies that are listed at one knot before the nearest are chosen."""


def n_inequalities(n_edges: int) -> int:
    """Number of inequalities of a knot."""
    return ZMP + 3 * n_edges + 2 * N_JOINTS + N_FRICTION


N_BETWEEN = 2 * UPPER
"""Torques of waist and arms before a knot, then those after it: inequalities that count where a plan needs them."""


def n_rows(n_edges: int) -> int:
    """Number of inequalities of a knot, those between knots included, which come last."""
    return n_inequalities(n_edges) + N_BETWEEN
