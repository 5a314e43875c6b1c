"""What compiled code works on: the motion, distances, the linear program and scratch memory, by names."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from wholebody.collision.gjk import SCRATCH
from wholebody.trajopt.layout import (  # fmt: skip
    FREE_LOWER,
    LOWER,
    N_BETWEEN,
    N_BLOCK,
    N_BODY,
    N_DISTANCES,
    N_DYNAMICS,
    N_FRAME,
    N_FREE,
    N_JOINTS,
    N_LISTED,
    N_PAIRS,
    N_PANEL,
    N_POSITION,
    UPPER,
    WAIST,
    n_rows,
)

LINE = 8
"""Numbers in a line of the cache, 64 bytes."""


class KnotMotion(NamedTuple):
    """K knots and everything about them, linear in the free directions; block ``c`` of three is knot ``k - 1 + c``."""

    q: np.ndarray  # (K, 36)
    free: np.ndarray  # (K, FREE_LOWER, LOWER)
    R: np.ndarray  # (K, bodies, 3, 3)
    p: np.ndarray  # (K, bodies, 3) from the base
    S: np.ndarray  # (K, N_BODY, 6)
    inertia: np.ndarray  # (K, 30, 10) of the bodies
    I_composite: np.ndarray  # (K, 30, 10) of each with all that hangs on it
    F: np.ndarray  # (K, N_BODY, 6) forces for unit accelerations
    palms: np.ndarray  # (K, 2, 4, 4)
    r: np.ndarray  # (K, N_POSITION)
    J: np.ndarray  # (K, N_FRAME, N_FREE)
    J_tilt: np.ndarray  # (K, 2, N_FREE)
    J_static: np.ndarray  # (K, WAIST, N_FREE) of the waist's torques at rest
    J_distance: np.ndarray  # (K, N_DISTANCES, N_FREE)
    n_near: np.ndarray  # (K,) how many distances count
    approach: np.ndarray  # (K, N_DISTANCES, N_BODY) of the bounds on distances, by velocities
    v_mid: np.ndarray  # (K + 1, N_BODY) velocities between the knots; entry k is before knot k
    dv_dprev: np.ndarray  # (K + 1, FREE_LOWER, LOWER) minus its derivative by the knot before
    dv_dnext: np.ndarray  # (K + 1, FREE_LOWER, LOWER) its derivative by the knot itself
    v: np.ndarray  # (K, N_BODY)
    a: np.ndarray  # (K, N_BODY)
    dynamics: np.ndarray  # (K, N_DYNAMICS)
    J_dynamics: np.ndarray  # (K, N_DYNAMICS, 3 N_FREE)
    zmp: np.ndarray  # (K, 2)
    pushed: np.ndarray  # (K, 3) by how much forces on the palms change the first three rows of the dynamics
    J_between: np.ndarray  # (K, N_BETWEEN, 3 N_FREE) of the torques before and after a knot
    violation: np.ndarray  # (K, n_rows) by how much bounds are exceeded, negative inside
    sign: np.ndarray  # (K, n_rows) of what is bounded


def new_motion(K: int, bodies: int, n_edges: int) -> KnotMotion:
    """Room for the motion of K knots."""
    shapes = {
        "q": (K, N_BODY + 1),
        "free": (K, FREE_LOWER, LOWER),
        "R": (K, bodies, 3, 3),
        "p": (K, bodies, 3),
        "S": (K, N_BODY, 6),
        "inertia": (K, N_BODY - 5, 10),
        "I_composite": (K, N_BODY - 5, 10),
        "F": (K, N_BODY, 6),
        "palms": (K, 2, 4, 4),
        "r": (K, N_POSITION),
        "J": (K, N_FRAME, N_FREE),
        "J_tilt": (K, 2, N_FREE),
        "J_static": (K, WAIST, N_FREE),
        "J_distance": (K, N_DISTANCES, N_FREE),
        "n_near": (K,),
        "approach": (K, N_DISTANCES, N_BODY),
        "v_mid": (K + 1, N_BODY),
        "dv_dprev": (K + 1, FREE_LOWER, LOWER),
        "dv_dnext": (K + 1, FREE_LOWER, LOWER),
        "v": (K, N_BODY),
        "a": (K, N_BODY),
        "dynamics": (K, N_DYNAMICS),
        "J_dynamics": (K, N_DYNAMICS, 3 * N_FREE),
        "zmp": (K, 2),
        "pushed": (K, 3),
        "J_between": (K, N_BETWEEN, 3 * N_FREE),
        "violation": (K, n_rows(n_edges)),
        "sign": (K, n_rows(n_edges)),
    }
    arrays = {name: np.zeros(shape, dtype=np.int64 if name == "n_near" else float) for name, shape in shapes.items()}
    arrays["palms"][:] = np.eye(4)
    arrays["sign"][:] = 1.0
    arrays["violation"][:] = -1.0
    return KnotMotion(**arrays)


class Distances(NamedTuple):
    """Distances at K knots, and where the search for each pair and each lowest vertex was, for the next knot."""

    q: np.ndarray  # (K, N_JOINTS) where they were measured
    measured: np.ndarray  # (K,) whether they were measured now
    count: np.ndarray  # (K,) pairs listed
    chosen: np.ndarray  # (K,) pairs that count
    pair: np.ndarray  # (K, N_LISTED)
    slack: np.ndarray  # (K, N_LISTED) distance less margin
    rows: np.ndarray  # (K, N_LISTED, 9) normal and both points
    violation: np.ndarray  # (K, N_PAIRS) when measured
    J: np.ndarray  # (K, N_PAIRS, N_BODY)
    centre: np.ndarray  # (n, 3) from the base
    simplex: np.ndarray  # (pairs, 4, 6)
    state: np.ndarray  # (pairs, 3)
    scratch: np.ndarray
    touching: np.ndarray  # (any, 3) pairs that touch: knot, pair, place in the list of the knot
    lowest: np.ndarray  # (low,) vertices


def new_distances(K: int, n_shapes: int, first: np.ndarray, low: np.ndarray) -> Distances:
    """Room for the distances at K knots; climbing begins at the vertices ``first`` (pairs, 2) and ``low`` (low,)."""
    n = len(first)
    return Distances(
        q=np.full((K, N_JOINTS), 1e3),
        measured=np.zeros(K, dtype=bool),
        count=np.zeros(K, dtype=np.int64),
        chosen=np.zeros(K, dtype=np.int64),
        pair=np.zeros((K, N_LISTED), dtype=np.int64),
        slack=np.zeros((K, N_LISTED)),
        rows=np.zeros((K, N_LISTED, 9)),
        violation=np.zeros((K, N_PAIRS)),
        J=np.zeros((K, N_PAIRS, N_BODY)),
        centre=np.zeros((n_shapes, 3)),
        simplex=np.zeros((n, 4, 6)),
        state=np.column_stack([np.zeros(n, dtype=np.int64), first]).astype(np.int64),
        scratch=np.zeros(SCRATCH),
        touching=np.zeros((K * N_LISTED + 1, 3), dtype=np.int64),
        lowest=low.copy(),
    )


class System(NamedTuple):
    """The linear program of K knots, as in `cost` and `newton`."""

    H: np.ndarray  # (K + 2, N_BLOCK, N_PANEL) Hessian without bounds
    g: np.ndarray  # (K + 2, N_FREE) gradient without bounds; likewise all vectors
    panels: np.ndarray  # (K + 2, N_BLOCK, N_PANEL) with the active bounds, then its Cholesky factor, as in `banded`
    damping: np.ndarray
    z: np.ndarray  # the step
    Hz: np.ndarray
    y: np.ndarray  # (K + 3, N_BLOCK)
    Hy: np.ndarray  # (K + 3, N_BLOCK)
    direction: np.ndarray
    Hd: np.ndarray
    along: np.ndarray  # (K, n_rows) change of the violations by z
    change: np.ndarray  # (K, n_rows) by the direction
    active: np.ndarray  # (K, n_rows) the bounds of each knot that are exceeded
    n_active: np.ndarray  # (K,) how many are
    rows: np.ndarray  # (K n_rows, 3) of the line search


def aligned(*shape: int) -> np.ndarray:
    """Zeros that begin where a line of the cache does: else every vector register is loaded from two lines."""
    memory = np.zeros(math.prod(shape) + LINE)
    start = -memory.ctypes.data % (memory.itemsize * LINE) // memory.itemsize
    return memory[start : start + math.prod(shape)].reshape(shape)


def new_system(K: int, n_edges: int) -> System:
    """Room for the linear program of K knots."""
    n, f = n_rows(n_edges), N_FREE
    vectors = {name: np.zeros((K + 2, f)) for name in ("g", "damping", "z", "Hz", "direction", "Hd")}
    return System(
        H=aligned(K + 2, N_BLOCK, N_PANEL),
        panels=aligned(K + 2, N_BLOCK, N_PANEL),
        y=aligned(K + 3, N_BLOCK),
        Hy=aligned(K + 3, N_BLOCK),
        along=np.zeros((K, n)),
        change=np.zeros((K, n)),
        active=np.zeros((K, n), dtype=np.int64),
        n_active=np.zeros(K, dtype=np.int64),
        rows=np.zeros((K * n, 3)),
        **vectors,
    )


class KnotScratch(NamedTuple):
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
    psi_dot: np.ndarray
    psi_S_dot: np.ndarray
    psi_ddot: np.ndarray
    F: np.ndarray
    palms: np.ndarray
    pushes: np.ndarray
    push_turns: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    turns: np.ndarray
    adjoint: np.ndarray
    J_next: np.ndarray
    J_prev: np.ndarray
    by_prev: np.ndarray
    by_next: np.ndarray
    reduced: np.ndarray


def new_knot_scratch() -> KnotScratch:
    """Scratch memory of one knot."""
    n, nb = N_BODY, N_BODY - 5
    return KnotScratch(
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
        psi_dot=np.zeros((n, 6)),
        psi_S_dot=np.zeros((n, 6)),
        psi_ddot=np.zeros((n, 6)),
        F=np.zeros((2, n, 6)),
        palms=np.zeros((2, 3)),
        pushes=np.zeros((2, 6)),
        push_turns=np.zeros((2, n, 6)),
        lower=np.zeros((3, N_DYNAMICS, LOWER)),
        upper=np.zeros((3, N_DYNAMICS, UPPER)),
        turns=np.zeros((4, 3, 3)),
        adjoint=np.zeros((6, 6)),
        J_next=np.zeros((6, 6)),
        J_prev=np.zeros((6, 6)),
        by_prev=np.zeros((N_DYNAMICS, LOWER)),
        by_next=np.zeros((N_DYNAMICS, LOWER)),
        reduced=np.zeros((3, N_DYNAMICS, FREE_LOWER)),
    )


class AssemblyScratch(NamedTuple):
    """Memory to work in while the linear program is assembled and solved."""

    frames: np.ndarray
    frame_values: np.ndarray
    dense: np.ndarray
    legs: np.ndarray
    leg_values: np.ndarray
    leg_square: np.ndarray
    dv_mid: np.ndarray
    dynamics: np.ndarray
    row: np.ndarray
    bounds: np.ndarray
    weighted: np.ndarray


def new_assembly_scratch(K: int) -> AssemblyScratch:
    """Room to assemble and solve the linear program of K knots."""
    f = N_FREE
    return AssemblyScratch(
        frames=aligned(N_FRAME, N_BLOCK),
        frame_values=np.zeros(N_FRAME),
        dense=aligned(2 + WAIST, N_PANEL),
        legs=np.zeros((3 * FREE_LOWER, 2 * LOWER + 4)),
        leg_values=np.zeros(2 * LOWER + 4),
        leg_square=np.zeros((3 * FREE_LOWER, 3 * FREE_LOWER)),
        dv_mid=np.zeros((K + 1, N_BODY)),
        dynamics=np.zeros(N_DYNAMICS),
        row=np.zeros(3 * f),
        bounds=aligned(4, N_PANEL),
        weighted=aligned(4, N_PANEL),
    )
