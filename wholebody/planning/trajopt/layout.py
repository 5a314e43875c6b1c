"""What compiled code works on: named arrays for the robot, for what is asked of the plan, and for the motion."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wholebody.collision.gjk import SCRATCH

FIRST = 1.5
"""Share of the way to the second control point in the first velocity between knots: the first is not free."""
N_BODY = 35
"""Velocities of the body without fingers: `LOWER` of base and legs, `UPPER` of waist and arms."""
LOWER, UPPER = 18, 17
FREE_LOWER = 6
"""Directions that the feet leave to base and legs."""
N_FREE = FREE_LOWER + UPPER
N_JOINTS = N_BODY - 6

# Rows of a knot with squares that are wanted small, and those of their Jacobian; joints need none.
COM, TORSO, PELVIS, HEIGHT, JOINTS = 12, 14, 17, 20, 21
N_POSITION, N_FRAME = 50, 21
# Rows that depend on the motion: zero-moment point times load (2), load; torques, waist first; slide of the soles;
# horizontal force (2) and moment about the vertical, per weight.
MOMENT, LOADED, TAU, SLIDE, FORCE, TWIST, N_MOTION = 0, 2, 3, 20, 24, 26, 27
N_FRICTION = 12
"""Sides of the cone of friction: two for each horizontal force, eight for the moment."""
WAIST = 3
# One-sided rows of a knot; edges of the support follow three times, first those of the centre of mass.
TILT, LOWEST, LIMIT, HOLD, NEAR = 0, 2, 3, 32, 35
N_PAIRS, N_LOW = 16, 24
"""Most pairs of bodies, and most bodies near the floor, that count at one knot."""
N_NEAR = N_PAIRS + N_LOW
EDGE = NEAR + N_NEAR
# After the first edges, from here on plus their number: load, torques, edges of the zero-moment point. Then come edges
# of the capture point, accelerations, speeds, friction.
LOAD, TORQUE, ZMP = EDGE, EDGE + 1, EDGE + 1 + UPPER


def n_sided(n_edges: int) -> int:
    """Number of one-sided rows of a knot."""
    return ZMP + 3 * n_edges + 2 * N_JOINTS + N_FRICTION


class Tables(NamedTuple):
    """The robot; bodies 0 to 29 are those of the plan, then come the fingers.

    Frames are both palms, torso, pelvis and both soles.
    """

    bodies: np.ndarray  # (44, 25), as in fixed_feet_kinematics
    parent: np.ndarray  # (44,)
    frame_body: np.ndarray  # (6,)
    frame_R: np.ndarray  # (6, 3, 3)
    frame_p: np.ndarray  # (6, 3)
    carries: np.ndarray  # (6, N_BODY) bool
    R_feet: np.ndarray  # (2, 3, 3) where they stay
    p_feet: np.ndarray  # (2, 3)
    q_stance: np.ndarray  # (36,)
    com_stance: np.ndarray  # (2,)
    gravity: np.ndarray  # (3,)
    mass: float
    load_min: float  # share of the weight
    limits: np.ndarray  # (3,) tilt of torso and of pelvis, height
    q_min: np.ndarray  # (29,)
    q_max: np.ndarray  # (29,)
    speed_max: np.ndarray  # (29,)
    acceleration_max: np.ndarray  # (29,)
    tau_max: np.ndarray  # (UPPER,)
    normals: np.ndarray  # (E, 2) of the support's edges
    com_offsets: np.ndarray  # (E,)
    zmp_offsets: np.ndarray  # (E,)
    capture_offsets: np.ndarray  # (E,)
    cone: np.ndarray  # (N_FRICTION, 6) sides of the cone of friction, by MOMENT, LOADED, FORCE, TWIST
    capture_time: float  # in which the capture point may reach them
    sweep: float  # for which bodies may go on approaching each other


class Task(NamedTuple):
    """What is asked of K knots."""

    T_palms: np.ndarray  # (K, 2, 4, 4)
    q_fingers: np.ndarray  # (K, n_fingers) in the order of their bodies
    v_start: np.ndarray  # (N_BODY,)
    bend: np.ndarray  # (K, 12) of the palms' curve away from its control points
    dt: float


class Motion(NamedTuple):
    """K knots and everything about them, linear in the free directions; block ``c`` of three is knot ``k - 1 + c``."""

    q: np.ndarray  # (K, 36)
    free: np.ndarray  # (K, FREE_LOWER, LOWER)
    R: np.ndarray  # (K, bodies, 3, 3)
    p: np.ndarray  # (K, bodies, 3) from the base
    S: np.ndarray  # (K, N_BODY, 6)
    inertia: np.ndarray  # (K, 30, 10) of the bodies
    trees: np.ndarray  # (K, 30, 10) of what they carry
    F: np.ndarray  # (K, N_BODY, 6) forces for unit accelerations
    palms: np.ndarray  # (K, 2, 4, 4)
    r: np.ndarray  # (K, N_POSITION)
    J: np.ndarray  # (K, N_FRAME, N_FREE)
    J_tilt: np.ndarray  # (K, 2, N_FREE)
    J_hold: np.ndarray  # (K, WAIST, N_FREE) of the waist's torques at rest
    J_near: np.ndarray  # (K, N_NEAR, N_FREE)
    near: np.ndarray  # (K,) how many
    sweeps: np.ndarray  # (K, N_NEAR, N_BODY) by velocities
    half: np.ndarray  # (K + 1, N_BODY) velocities between the knots
    behind: np.ndarray  # (K + 1, FREE_LOWER, LOWER) change of half a step back by the knot before, less
    ahead: np.ndarray  # (K + 1, FREE_LOWER, LOWER) and by the knot itself
    v: np.ndarray  # (K, N_BODY)
    a: np.ndarray  # (K, N_BODY)
    m: np.ndarray  # (K, N_MOTION)
    J_m: np.ndarray  # (K, N_MOTION, 3 N_FREE)
    zmp: np.ndarray  # (K, 2)
    over: np.ndarray  # (K, n_sided) by how much bounds are exceeded, negative inside
    sign: np.ndarray  # (K, n_sided) of what is bounded


def new_motion(K: int, bodies: int, n_edges: int) -> Motion:
    """Room for the motion of K knots."""
    shapes = {
        "q": (K, N_BODY + 1),
        "free": (K, FREE_LOWER, LOWER),
        "R": (K, bodies, 3, 3),
        "p": (K, bodies, 3),
        "S": (K, N_BODY, 6),
        "inertia": (K, N_BODY - 5, 10),
        "trees": (K, N_BODY - 5, 10),
        "F": (K, N_BODY, 6),
        "palms": (K, 2, 4, 4),
        "r": (K, N_POSITION),
        "J": (K, N_FRAME, N_FREE),
        "J_tilt": (K, 2, N_FREE),
        "J_hold": (K, WAIST, N_FREE),
        "J_near": (K, N_NEAR, N_FREE),
        "near": (K,),
        "sweeps": (K, N_NEAR, N_BODY),
        "half": (K + 1, N_BODY),
        "behind": (K + 1, FREE_LOWER, LOWER),
        "ahead": (K + 1, FREE_LOWER, LOWER),
        "v": (K, N_BODY),
        "a": (K, N_BODY),
        "m": (K, N_MOTION),
        "J_m": (K, N_MOTION, 3 * N_FREE),
        "zmp": (K, 2),
        "over": (K, n_sided(n_edges)),
        "sign": (K, n_sided(n_edges)),
    }
    arrays = {name: np.zeros(shape, dtype=np.int64 if name == "near" else float) for name, shape in shapes.items()}
    arrays["palms"][:] = np.eye(4)
    arrays["sign"][:] = 1.0
    arrays["over"][:] = -1.0
    return Motion(**arrays)


class Work(NamedTuple):
    """Memory to work in."""

    feet: np.ndarray
    error: np.ndarray
    step: np.ndarray
    reflections: np.ndarray
    sums: np.ndarray
    lower_step: np.ndarray
    diagonal: np.ndarray
    R: np.ndarray
    p: np.ndarray
    rows: np.ndarray
    six: np.ndarray
    V: np.ndarray
    A: np.ndarray
    A_kept: np.ndarray
    h: np.ndarray
    f: np.ndarray
    D: np.ndarray
    turning: np.ndarray
    moving: np.ndarray
    swinging: np.ndarray
    F: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    turns: np.ndarray
    back: np.ndarray
    turn_right: np.ndarray
    turn_left: np.ndarray
    before: np.ndarray
    after: np.ndarray
    reduced: np.ndarray


def new_work() -> Work:
    """Room for what is computed at one knot."""
    n, nb = N_BODY, N_BODY - 5
    return Work(
        feet=np.zeros((LOWER, 12)),
        error=np.zeros(12),
        step=np.zeros((LOWER, 8)),
        reflections=np.zeros((12, LOWER)),
        sums=np.zeros(12),
        lower_step=np.zeros(LOWER),
        diagonal=np.zeros(12),
        R=np.zeros((3, 3)),
        p=np.zeros(3),
        rows=np.zeros((6, n)),
        six=np.zeros((8, 6)),
        V=np.zeros((nb, 6)),
        A=np.zeros((nb, 6)),
        A_kept=np.zeros((nb, 6)),
        h=np.zeros((nb, 6)),
        f=np.zeros((nb, 6)),
        D=np.zeros((nb, 6)),
        turning=np.zeros((n, 6)),
        moving=np.zeros((n, 6)),
        swinging=np.zeros((n, 6)),
        F=np.zeros((2, n, 6)),
        lower=np.zeros((3, N_MOTION, LOWER)),
        upper=np.zeros((3, N_MOTION, UPPER)),
        turns=np.zeros((4, 3, 3)),
        back=np.zeros((6, 6)),
        turn_right=np.zeros((6, 6)),
        turn_left=np.zeros((6, 6)),
        before=np.zeros((N_MOTION, LOWER)),
        after=np.zeros((N_MOTION, LOWER)),
        reduced=np.zeros((3, N_MOTION, FREE_LOWER)),
    )


class Shapes(NamedTuple):
    """Convex shapes of the robot, as in `collision.shapes`; which pairs of them count, and which near the floor."""

    shapes: np.ndarray
    rounds: np.ndarray
    vertices: np.ndarray
    start: np.ndarray
    neighbours: np.ndarray
    centre: np.ndarray  # (n, 3) of a box around each, in the axes of its body
    half: np.ndarray  # (n, 3) half its sides
    radius: np.ndarray  # (n,) of a sphere about the same centre
    pairs: np.ndarray  # (pairs, 2)
    margin: np.ndarray  # (pairs,) distance to keep
    low_body: np.ndarray  # (low,) of those that can reach the floor
    low_anchor: np.ndarray  # (low,) the same, or for fingers the last body of the plan before it
    low_reach: np.ndarray  # (low,) from the origin of that one, however the fingers are bent
    low_first: np.ndarray  # (low,) first of their vertices
    floor: np.ndarray  # (2,) height to keep, and height beyond it from which they count


N_LISTED = 96
"""Most pairs of bodies that are listed at one knot before the nearest are chosen."""


class Near(NamedTuple):
    """Distances at K knots, and what is remembered from one knot to the next."""

    q: np.ndarray  # (K, N_JOINTS) where they were measured
    fresh: np.ndarray  # (K,) whether they were measured now
    count: np.ndarray  # (K,) pairs listed
    chosen: np.ndarray  # (K,) pairs that count
    pair: np.ndarray  # (K, N_LISTED)
    room: np.ndarray  # (K, N_LISTED) distance less margin
    rows: np.ndarray  # (K, N_LISTED, 9) normal and both points
    over: np.ndarray  # (K, N_PAIRS) when measured
    J: np.ndarray  # (K, N_PAIRS, N_BODY)
    centre: np.ndarray  # (n, 3) from the base
    simplex: np.ndarray  # (pairs, 4, 6)
    state: np.ndarray  # (pairs, 3)
    scratch: np.ndarray
    unsure: np.ndarray  # (any, 3)
    lowest: np.ndarray  # (low,) vertices


def new_near(K: int, n_shapes: int, first: np.ndarray, low: np.ndarray) -> Near:
    """Room for the distances at K knots; climbing begins at the vertices ``first`` (pairs, 2) and ``low`` (low,)."""
    n = len(first)
    return Near(
        q=np.full((K, N_JOINTS), 1e3),
        fresh=np.zeros(K, dtype=bool),
        count=np.zeros(K, dtype=np.int64),
        chosen=np.zeros(K, dtype=np.int64),
        pair=np.zeros((K, N_LISTED), dtype=np.int64),
        room=np.zeros((K, N_LISTED)),
        rows=np.zeros((K, N_LISTED, 9)),
        over=np.zeros((K, N_PAIRS)),
        J=np.zeros((K, N_PAIRS, N_BODY)),
        centre=np.zeros((n_shapes, 3)),
        simplex=np.zeros((n, 4, 6)),
        state=np.column_stack([np.zeros(n, dtype=np.int64), first]).astype(np.int64),
        scratch=np.zeros(SCRATCH),
        unsure=np.zeros((K * N_LISTED + 1, 3), dtype=np.int64),
        lowest=low.copy(),
    )


class Scales(NamedTuple):
    """Weights of the squares, and of palms the scales and the errors at which they begin to give."""

    position: float
    position_give: float
    orientation: float
    orientation_give: float
    com: float
    torso: float
    pelvis: float
    height: float
    posture: float
    zmp: float
    waist: float
    slide: float
    smooth: float
    speed: float
    legs: float


class System(NamedTuple):
    """The linear program of K knots, as in `cost` and `newton`."""

    H: np.ndarray
    g: np.ndarray
    panels: np.ndarray
    gradient: np.ndarray
    tails: np.ndarray
    extra: np.ndarray
    z: np.ndarray
    Hz: np.ndarray
    y: np.ndarray
    direction: np.ndarray
    Hd: np.ndarray
    along: np.ndarray
    change: np.ndarray
    active: np.ndarray
    rows: np.ndarray


def new_system(K: int, n_edges: int) -> System:
    """Room for the linear program of K knots."""
    n, f = n_sided(n_edges), N_FREE
    vectors = {name: np.zeros((K + 2, f)) for name in ("g", "gradient", "extra", "z", "Hz", "y", "direction", "Hd")}
    return System(
        H=np.zeros((K + 2, f, 3 * f)),
        panels=np.zeros((K + 2, f, 3 * f)),
        tails=np.zeros((K + 2, 2 * f, 2 * f)),
        along=np.zeros((K, n)),
        change=np.zeros((K, n)),
        active=np.zeros((K, n), dtype=bool),
        rows=np.zeros((K * n, 3)),
        **vectors,
    )


class SumWork(NamedTuple):
    """Memory to work in while the linear program is assembled and solved."""

    frames: np.ndarray
    frame_values: np.ndarray
    dense: np.ndarray
    legs: np.ndarray
    leg_values: np.ndarray
    leg_square: np.ndarray
    half: np.ndarray
    motion: np.ndarray
    row: np.ndarray
    rest: np.ndarray


def new_sum_work(K: int) -> SumWork:
    """Room to assemble and solve the linear program of K knots."""
    f = N_FREE
    return SumWork(
        frames=np.zeros((N_FRAME, f)),
        frame_values=np.zeros(N_FRAME),
        dense=np.zeros((2 + WAIST, 3 * f)),
        legs=np.zeros((3 * FREE_LOWER, 2 * LOWER + 4)),
        leg_values=np.zeros(2 * LOWER + 4),
        leg_square=np.zeros((3 * FREE_LOWER, 3 * FREE_LOWER)),
        half=np.zeros((K + 1, N_BODY)),
        motion=np.zeros(N_MOTION),
        row=np.zeros(3 * f),
        rest=np.zeros((f, 2 * f)),
    )
