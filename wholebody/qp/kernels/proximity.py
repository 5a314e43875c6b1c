"""The near pairs of bodies, as `wholebody.collision.proximity` finds them; compiles with numba as it stands."""

import math

from wholebody.collision.gjk import APART, BEYOND, BODY, distance
from wholebody.qp.kernels import blocks as mem

SLACK = 0.01
"""Distance beyond what matters at which a lower bound will do: a pair that is just out of it would be back soon [m]."""


def nearest(reals, ints):
    """Measure the pairs that may be near, and list the nearest in PAIRS.

    The nearest of the last time are measured first: whatever is further away than those need not be known exactly.

    Returns:
        Number of pairs, listed in UNSURE_PAIRS, that somebody else has to measure before this is called again; zero if
        all is done.
    """
    counts, known = mem.vector(ints, mem.COUNTS), mem.vector(ints, mem.KNOWN)
    room, bound, keep = mem.vector(reals, mem.ROOM), mem.vector(reals, mem.BOUND_), mem.vector(reals, mem.KEEP)
    trigger, chosen = mem.vector(reals, mem.TRIGGER)[0], mem.vector(ints, mem.NEAREST)
    n, far = room.shape[0], trigger
    if counts[mem.N_UNSURE] == 0:
        shrink(reals, ints)
        for k in range(n):
            known[k] = 0
    counts[mem.N_UNSURE] = 0
    for k in range(n):
        room[k] = bound[k] - keep[k]
    least = min(counts[mem.LEAST_PAIRS], n)
    if counts[mem.N_PAIRS] < least:
        choose(room, n, least, chosen)
        counts[mem.N_PAIRS] = least
    for i in range(counts[mem.N_PAIRS]):
        measure(chosen[i], math.inf, reals, ints)
    # The last of as many pairs as there have to be is at least as far as those will be.
    for i in range(least):
        far = max(far, room[chosen[i]])
    inside = 0
    for k in range(n):
        if room[k] < far:
            measure(k, far + SLACK, reals, ints)
            if room[k] < trigger:
                inside += 1
    if counts[mem.N_UNSURE] == 0:
        count = min(max(inside, least), chosen.shape[0])
        choose(room, n, count, chosen)
        describe_pairs(count, reals, ints)
    return counts[mem.N_UNSURE]


def shrink(reals, ints):
    """Take from the bound of each pair how far the joints between its bodies may have moved them since."""
    q, turned = mem.vector(reals, mem.Q_), mem.vector(reals, mem.TURNED)
    start, joint = mem.vector(ints, mem.CHAIN_START), mem.vector(ints, mem.CHAIN_JOINT)
    reach, suffix = mem.vector(reals, mem.REACH), mem.vector(reals, mem.SUFFIX)
    level, bound = mem.matrix(ints, mem.PAIR_LEVEL), mem.vector(reals, mem.BOUND_)
    for s in range(start.shape[0] - 1):
        # An entry is the way of the shape for all joints from that one on; the last is none.
        total = 0.0
        suffix[start[s + 1] - 1] = 0.0
        for i in range(start[s + 1] - 2, start[s] - 1, -1):
            total += reach[i] * abs(q[7 + joint[i]] - turned[joint[i]])
            suffix[i] = total
    for j in range(turned.shape[0]):
        turned[j] = q[7 + j]
    for k in range(bound.shape[0]):
        bound[k] -= suffix[level[k, 0]] + suffix[level[k, 1]]


def measure(k, enough, reals, ints):
    """Distance of pair ``k`` now, if it is not known; a lower bound will do for a room of ``enough``.

    Where it stays unsure, the pair is listed as such.
    """
    known, keep = mem.vector(ints, mem.KNOWN), mem.vector(reals, mem.KEEP)[k]
    if known[k]:
        return
    counts, q, p = mem.vector(ints, mem.COUNTS), mem.vector(reals, mem.Q_), mem.matrix(reals, mem.P_)
    pairs, shapes, R = mem.matrix(ints, mem.PAIR_SHAPES), mem.matrix(ints, mem.SHAPES), mem.cube(reals, mem.R_)
    rounds, simplex, state = (
        mem.matrix(reals, mem.ROUNDS),
        mem.matrix(reals, mem.SIMPLEX),
        mem.matrix(ints, mem.GJK_STATE),
    )
    first, second, out = pairs[k, 0], pairs[k, 1], mem.matrix(reals, mem.MEASURED)[k]
    a, b = shapes[first, BODY], shapes[second, BODY]
    found, code = distance(
        shapes[first],
        shapes[second],
        rounds[first],
        rounds[second],
        mem.matrix(reals, mem.VERTICES),
        mem.vector(ints, mem.EDGE_START),
        mem.vector(ints, mem.EDGE_END),
        enough + keep,
        R[a],
        p[a],
        R[b],
        p[b],
        simplex[4 * k : 4 * k + 4],
        state[k],
        mem.vector(reals, mem.GJK),
        out,
    )
    if code == BEYOND:
        mem.vector(reals, mem.BOUND_)[k] = found
        mem.vector(reals, mem.ROOM)[k] = found - keep
        return
    known[k] = 1
    if code != APART:
        mem.vector(ints, mem.UNSURE_PAIRS)[counts[mem.N_UNSURE]] = k
        counts[mem.N_UNSURE] += 1
        return
    for i in range(3):
        out[3 + i] += q[i]
        out[6 + i] += q[i]
    mem.vector(reals, mem.DISTANCE_)[k] = mem.vector(reals, mem.BOUND_)[k] = found
    mem.vector(reals, mem.ROOM)[k] = found - keep


def choose(room, n, count, chosen):
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


def describe_pairs(count, reals, ints):
    """What the rows of the chosen pairs are made of: normal, points and room, and the two bodies."""
    chosen, now, body = mem.vector(ints, mem.NEAREST), mem.vector(ints, mem.PAIR_NOW), mem.vector(ints, mem.PAIR_BODY)
    pairs, shapes = mem.matrix(ints, mem.PAIR_SHAPES), mem.matrix(ints, mem.SHAPES)
    rows, measured, room = mem.matrix(reals, mem.PAIRS), mem.matrix(reals, mem.MEASURED), mem.vector(reals, mem.ROOM)
    for i in range(count):
        k = chosen[i]
        now[i] = k
        for c in range(9):
            rows[i, c] = measured[k, c]
        rows[i, 9] = room[k]
        body[2 * i], body[2 * i + 1] = shapes[pairs[k, 0], BODY], shapes[pairs[k, 1], BODY]
    mem.vector(ints, mem.COUNTS)[mem.N_PAIRS] = count
