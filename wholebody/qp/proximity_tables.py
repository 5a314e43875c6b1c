"""Tables of shapes and pairs for the compiled tick."""

from __future__ import annotations

import numpy as np

from models.spec import RobotSpec
from wholebody.collision import gjk
from wholebody.collision.floor_clearance import FloorClearance
from wholebody.collision.proximity import Proximity
from wholebody.collision.shapes import shape_table

Fields = dict[str, np.ndarray]


def proximity_tables(spec: RobotSpec, proximity: Proximity, clearance: FloorClearance) -> tuple[Fields, Fields]:
    """Fields of reals and of integers by name: those that do not change, and where searches begin.

    The way of a pair is that of its two shapes less the joints that carry both. Those are the first ones of both
    chains, so it is the sum of two suffixes of the chains' own ways.
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
    reals = {
        "reach": np.concatenate(reach),
        "rounds": table.rounds,
        "vertices": table.vertices,
        "margin": proximity.margin,
        "floor_reach": clearance.reach,
    }
    ints = {
        "chain_start": np.array(start),
        "chain_joint": np.concatenate(joints),
        "pair_shapes": pairs,
        "pair_level": level,
        "gjk_state": np.column_stack([np.zeros(len(pairs), dtype=np.int64), first[pairs]]),
        "shapes": table.shapes,
        "edge_start": table.start,
        "edge_end": table.neighbours,
        "floor_body": clearance.joints - 1,
        "floor_vertex": first[clearance.shapes],
    }
    return reals, ints


def no_tables() -> tuple[Fields, Fields]:
    """Fields of the tables for a program without distances."""
    none, no_ints = np.zeros(0), np.zeros(0, dtype=np.int64)
    pairs, points = np.zeros((0, 2), dtype=np.int64), np.zeros((0, 3))
    reals = {"reach": none, "rounds": np.zeros((0, 8)), "vertices": points, "margin": none, "floor_reach": none}
    ints = {
        "chain_start": no_ints, "chain_joint": no_ints, "pair_shapes": pairs, "pair_level": pairs,
        "gjk_state": np.zeros((0, 3), dtype=np.int64), "shapes": np.zeros((0, 4), dtype=np.int64),
        "edge_start": no_ints, "edge_end": no_ints, "floor_body": no_ints, "floor_vertex": no_ints,
    }  # fmt: skip
    return reals, ints


def changing_shapes(n_pairs: int, n_joints: int, n_reach: int, most: int) -> tuple[dict, dict]:
    """Shapes of the fields that do change."""
    reals = {
        "pair_trigger": (), "q_before": (n_joints,), "suffix": (n_reach,), "room": (n_pairs,), "distance": (n_pairs,),
        "distance_bound": (n_pairs,), "measured": (n_pairs, 9), "simplex": (n_pairs, 4, 6),
        "gjk_scratch": (gjk.SCRATCH,), "pairs": (most, 10),
    }  # fmt: skip
    ints = {
        "known": (n_pairs,), "unsure_pairs": (n_pairs,), "nearest": (most,), "pair_body": (most, 2),
        "pair_now": (most,), "pair_before": (most,),
        "n_pairs": (), "n_pairs_least": (), "n_unsure": (),
    }  # fmt: skip
    return reals, ints
