"""The near pairs of bodies, as `wholebody.collision.proximity` finds them."""

from __future__ import annotations

import math

from wholebody.collision.gjk import APART, BEYOND, BODY, distance
from wholebody.jit.arrays import Indices, Vector
from wholebody.jit.packed import Packed

SLACK = 0.01
"""Distance beyond what matters at which a lower bound will do [m]; chosen: a pair that is just out of it would be back
soon."""


def near_pairs(tick: Packed) -> int:
    """Measure the pairs that may be near, and list the nearest in ``pairs``.

    The nearest of the last time are measured first: whatever is further away than those need not be known exactly.

    Returns:
        Number of pairs, listed in ``unsure_pairs``, that another algorithm has to measure before this is called again;
        zero if all is done.
    """
    room, bound, margin, chosen = tick.room, tick.distance_bound, tick.margin, tick.nearest
    trigger, n = tick.pair_trigger, tick.room.shape[0]
    if tick.n_unsure == 0:
        shrink(tick)
    tick.n_unsure = 0
    for k in range(n):
        room[k] = bound[k] - margin[k]
    least = min(tick.n_pairs_least, n)
    if tick.n_pairs < least:
        choose(room, n, least, chosen)
        tick.n_pairs = least
    for i in range(tick.n_pairs):
        measure(tick, chosen[i], math.inf)
    # The last of as many pairs as there have to be is at least as far as those will be.
    far, inside = trigger, 0
    for i in range(least):
        far = max(far, room[chosen[i]])
    for k in range(n):
        if room[k] < far:
            measure(tick, k, far + SLACK)
            if room[k] < trigger:
                inside += 1
    if tick.n_unsure == 0:
        count = min(max(inside, least), chosen.shape[0])
        choose(room, n, count, chosen)
        describe_pairs(tick, count)
    return tick.n_unsure


def shrink(tick: Packed) -> None:
    """Take from the bound of each pair how far the joints between its bodies may have moved them since."""
    q, before, start, joint = tick.q, tick.q_before, tick.chain_start, tick.chain_joint
    reach, suffix, level, bound, known = tick.reach, tick.suffix, tick.pair_level, tick.distance_bound, tick.known
    for s in range(start.shape[0] - 1):
        # An entry is the way of the shape for all joints from that one on; the last is none.
        total = 0.0
        suffix[start[s + 1] - 1] = 0.0
        for i in range(start[s + 1] - 2, start[s] - 1, -1):
            total += reach[i] * abs(q[7 + joint[i]] - before[joint[i]])
            suffix[i] = total
    for j in range(before.shape[0]):
        before[j] = q[7 + j]
    for k in range(bound.shape[0]):
        bound[k] -= suffix[level[k, 0]] + suffix[level[k, 1]]
        known[k] = 0


def measure(tick: Packed, k: int, enough: float) -> None:
    """Distance of pair ``k`` now, if it is not known; a lower bound will do for a room of ``enough``.

    Where it stays unsure, the pair is listed as such.
    """
    if tick.known[k]:
        return
    q, shapes, rounds, R, p, out, margin = (
        tick.q, tick.shapes, tick.rounds, tick.R, tick.p, tick.measured[k], tick.margin[k]
    )  # fmt: skip
    first, second = tick.pair_shapes[k, 0], tick.pair_shapes[k, 1]
    a, b = shapes[first, BODY], shapes[second, BODY]
    found, code = distance(
        shapes[first], shapes[second], rounds[first], rounds[second], tick.vertices, tick.edge_start, tick.edge_end,
        enough + margin, R[a], p[a], R[b], p[b], tick.simplex[k], tick.gjk_state[k], tick.gjk_scratch, out,
    )  # fmt: skip
    if code != BEYOND:
        tick.known[k] = 1
        if code != APART:
            tick.unsure_pairs[tick.n_unsure] = k
            tick.n_unsure += 1
            return
        tick.distance[k] = found
        for i in range(3):
            out[3 + i] += q[i]
            out[6 + i] += q[i]
    tick.distance_bound[k], tick.room[k] = found, found - margin


def choose(room: Vector, n: int, count: int, chosen: Indices) -> None:
    """Indices of the ``count`` smallest of ``n`` numbers, smallest first; of equal ones the earlier."""
    held = 0
    for k in range(n):
        if held == count and (count == 0 or not room[k] < room[chosen[count - 1]]):
            continue
        if held < count:
            held += 1
        i = held - 1
        while i > 0 and room[k] < room[chosen[i - 1]]:
            chosen[i] = chosen[i - 1]
            i -= 1
        chosen[i] = k


def describe_pairs(tick: Packed, count: int) -> None:
    """What the rows of the chosen pairs are made of: normal, points and room, and the two bodies."""
    chosen, now, body, shapes, pairs = tick.nearest, tick.pair_now, tick.pair_body, tick.shapes, tick.pair_shapes
    rows, measured, room = tick.pairs, tick.measured, tick.room
    for i in range(count):
        k = chosen[i]
        now[i] = k
        for c in range(9):
            rows[i, c] = measured[k, c]
        rows[i, 9] = room[k]
        body[i, 0], body[i, 1] = shapes[pairs[k, 0], BODY], shapes[pairs[k, 1], BODY]
    tick.n_pairs = count
