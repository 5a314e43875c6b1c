"""Tables of shapes and pairs for the compiled tick."""

from __future__ import annotations

import numpy as np

from models.spec import RobotSpec
from wholebody.collision import gjk
from wholebody.collision.floor_clearance import FloorClearance
from wholebody.collision.proximity import Proximity
from wholebody.collision.shapes import shape_table
from wholebody.qp.kernels import blocks as b

Blocks = dict[int, np.ndarray]


def near_tables(spec: RobotSpec, proximity: Proximity, underside: FloorClearance) -> tuple[Blocks, Blocks]:
    """Blocks of reals and of integers by number: those that do not change, and where searches begin.

    The sweep of a pair is that of its two shapes less the joints that carry both. Those are the first ones of both
    chains, so it is the sum of two suffixes of the chains' own sweeps.
    """
    table, pairs = shape_table(spec, proximity.geometry), proximity.pairs
    joints, reach, start = [], [], [0]
    for row in proximity.radii:
        carried = np.flatnonzero(row)
        joints.append(np.append(carried, 0))
        reach.append(np.append(row[carried], 0.0))
        start.append(start[-1] + len(carried) + 1)
    carries = proximity.radii > 0.0
    shared = (carries[pairs[:, 0]] & carries[pairs[:, 1]]).sum(1)
    level = np.array(start)[pairs] + shared[:, None]
    first = table.shapes[:, gjk.FIRST]
    state = np.column_stack([np.zeros(len(pairs), dtype=np.int64), first[pairs]])
    reals = {
        b.REACH: np.concatenate(reach),
        b.ROUNDS: table.rounds,
        b.VERTICES: table.vertices,
        b.KEEP: proximity.margin,
        b.FLOOR_REACH: underside.reach,
    }
    ints = {
        b.CHAIN_START: np.array(start), b.CHAIN_JOINT: np.concatenate(joints), b.PAIR_SHAPES: pairs,
        b.PAIR_LEVEL: level, b.GJK_STATE: state, b.SHAPES: table.shapes, b.EDGE_START: table.start,
        b.EDGE_END: table.neighbours, b.FLOOR_BODY: underside.joints - 1, b.FLOOR_VERTEX: first[underside.shapes],
    }  # fmt: skip
    return reals, ints


def near_shapes(n_pairs: int, n_joints: int, n_reach: int, most: int) -> tuple[dict, dict]:
    """Shapes of the blocks that do change."""
    reals = {
        b.TRIGGER: (1,), b.TURNED: (n_joints,), b.SUFFIX: (n_reach,), b.ROOM: (n_pairs,), b.DISTANCE_: (n_pairs,),
        b.BOUND_: (n_pairs,), b.MEASURED: (n_pairs, 9), b.SIMPLEX: (4 * n_pairs, 6), b.GJK: (gjk.SCRATCH,),
        b.FLOOR_LIMIT: (4,),
    }  # fmt: skip
    return reals, {b.KNOWN: (n_pairs,), b.UNSURE_PAIRS: (n_pairs,), b.NEAREST: (most,)}
