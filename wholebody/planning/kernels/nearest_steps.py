r"""Nearest values whose first, second and third differences keep bounds, in a time that grows as their number does.

With y the differences of a value x from those before it, in terms of their bounds, and e what is exceeded:
``min sum (x - c)^2 / 2 + sum e^2 / (2 soft)``, ``|y| <= 1 + e``, by an interior point method. A value, its first and
second differences are the state of a chain of integrators, whose input is the third one. So each Newton step is a
linear regulator of three states: one pass back for its gains, one forth for the step.

Source:
    Rao, Wright and Rawlings 1998, "Application of Interior-Point Methods to Model Predictive Control", JOTA 99(3).
"""

from __future__ import annotations

from wholebody.jit.arrays import Matrix, Vector

N_BEFORE = 3
"""Values of the past, which are kept [no unit]; derived: three differences begin with them."""
VALUE, GAIN, ROOM, FORCE, WEIGHT, PULL, CHANGE, ROOM_CHANGE, FORCE_CHANGE = 0, 4, 8, 14, 20, 23, 26, 30, 36
"""Columns of the memory of a value; definition: it and its differences, three gains of its input and what is added,
room to either side of each bound, force of each, weight and pull of the bounds on each difference, and the step."""
N_COLUMNS = 42
"""Columns of the memory of a value [no unit]; definition: the last is the force of the last bound."""
FIRST_FORCE = 1e-2
"""Force of each bound at first, as a share of the scale [no unit]; chosen: a tenth of its root, squared."""
SHARE, LONG, SHORT = 0.995, 0.9, 0.5
"""Share of the way to where a room or a force is spent that is gone, and shares of a step that count as long and as
short [no unit]; chosen: that are usual."""
CENTRES = 0.05, 0.2, 0.7
"""Share of the present gap that is aimed at after a long step, another one, and a short one [no unit]; chosen: 15 to 35
rounds in all."""


def nearest_steps(
    c: Vector, bounds: Vector, soft: Matrix, scale: float, most: int, small: Vector, memory: Matrix, scratch: Matrix
) -> int:
    """Rounds after which the nearest values are found, in the first column of the memory; ``most`` if they are not.

    Args:
        c: Values (n,), the first `N_BEFORE` of the past.
        bounds: Of the differences (3,).
        soft: Excess for each unit of force of a bound (n, 3), as a share of it.
        scale: Square of how far values are from each other, which costs are compared with.
        most: Most rounds.
        small: Mean product of room and force, in terms of the scale, and largest part of a difference not accounted
            for, at which it ends (2,).
        memory: Scratch (n, N_COLUMNS).
        scratch: Scratch (6, 3).
    """
    begin(c, bounds, scale, memory)
    last = 1.0
    for done in range(most):
        left = residuals(bounds, soft, memory, scratch[5])
        if left < small[0] * scale and scratch[5, 0] < small[1] and last > SHORT:
            return done
        share = CENTRES[0] if last > LONG else CENTRES[1] if last > SHORT else CENTRES[2]
        find_gains(c, bounds, soft, share * left, memory, scratch)
        last = take_step(c, bounds, soft, share * left, memory)
    return most


def begin(c: Vector, bounds: Vector, scale: float, memory: Matrix) -> None:
    """Begin with the values as they are, and room to every bound."""
    for k in range(N_BEFORE, c.shape[0]):
        row = memory[k]
        row[VALUE] = c[k]
        row[VALUE + 1] = c[k] - c[k - 1]
        row[VALUE + 2] = c[k] - 2.0 * c[k - 1] + c[k - 2]
        row[VALUE + 3] = c[k] - 3.0 * c[k - 1] + 3.0 * c[k - 2] - c[k - 3]
        for i in range(6):
            row[ROOM + i] = max(1.0 - signed(i, row[VALUE + 1 + i // 2], bounds), 1.0)
            row[FORCE + i] = FIRST_FORCE * scale


def signed(i: int, difference: float, bounds: Vector) -> float:
    """A difference as a share of its bound, towards either side: that of the i-th of six bounds."""
    return (1.0 - 2.0 * (i % 2)) * difference / bounds[i // 2]


def residuals(bounds: Vector, soft: Matrix, memory: Matrix, largest: Vector) -> float:
    """Mean product of room and force; the first of ``largest`` becomes the largest part of a difference that lacks."""
    gap, largest[0], n = 0.0, 0.0, memory.shape[0]
    for k in range(N_BEFORE, n):
        row = memory[k]
        for i in range(6):
            gap += row[ROOM + i] * row[FORCE + i]
            lacks = abs(missing(i, row, row[VALUE + 1 + i // 2], bounds, soft[k]))
            largest[0] = max(largest[0], lacks / (1.0 + abs(row[VALUE + 1 + i // 2]) / bounds[i // 2]))
    return gap / (6.0 * (n - N_BEFORE))


def missing(i: int, row: Vector, difference: float, bounds: Vector, soft: Vector) -> float:
    """What the i-th bound of a value lacks to hold with its room, as a share of it."""
    return signed(i, difference, bounds) - 1.0 - soft[i // 2] * row[FORCE + i] + row[ROOM + i]


def find_gains(c: Vector, bounds: Vector, soft: Matrix, centre: float, memory: Matrix, scratch: Matrix) -> None:
    """Pass back: the gains with which every input answers to the state before it.

    ``scratch`` has the cost to go of a state in its first three rows, its slope in the fourth.
    """
    P, q, b = scratch[:3], scratch[3], scratch[4]
    for i in range(3):
        q[i] = 0.0
        for j in range(3):
            P[i, j] = 0.0
    for k in range(c.shape[0] - 1, N_BEFORE - 1, -1):
        row = memory[k]
        weigh_bounds(row, bounds, soft[k], centre)
        weight, pull, total, slope = row[WEIGHT + 2], row[PULL + 2], row[WEIGHT + 2], row[PULL + 2]
        for i in range(3):
            P[i, i] += 1.0 if i == 0 else row[WEIGHT + i - 1]
            q[i] += -c[k] if i == 0 else row[PULL + i - 1]
            b[i] = P[i, 0] + P[i, 1] + P[i, 2]
            total += b[i]
            slope += q[i]
        reached = 0.0
        for i in range(3):
            reached += b[i]
            row[GAIN + i] = -reached / total
        row[GAIN + 3] = -slope / total
        cost_before(row[GAIN:], weight, pull, P, q, b, row[CHANGE:])


def weigh_bounds(row: Vector, bounds: Vector, soft: Vector, centre: float) -> None:
    """Weight and pull of the bounds on each difference of a value, for a product of room and force of ``centre``."""
    for d in range(3):
        row[WEIGHT + d] = row[PULL + d] = 0.0
    for i in range(6):
        d, s, f = i // 2, row[ROOM + i], row[FORCE + i]
        below = s + soft[d] * f
        more = (centre - s * f + f * missing(i, row, row[VALUE + 1 + d], bounds, soft)) / below
        row[WEIGHT + d] += f / below / (bounds[d] * bounds[d])
        row[PULL + d] += signed(i, f + more, bounds)
    for d in range(3):
        row[PULL + d] -= row[WEIGHT + d] * row[VALUE + 1 + d]


def cost_before(gain: Vector, weight: float, pull: float, P: Matrix, q: Vector, b: Vector, out: Vector) -> None:
    """Cost to go of the state before an input, from that of the state after it, both ``P`` (3, 3) and ``q`` (3,).

    The state after it is ``M`` times that before, plus what is added: M is upper triangular ones plus the gains.
    Products of that form keep digits where bounds weigh 1e12 times what a value does.

    Args:
        gain: Gains of the input and what is added to it (4,).
        weight: Of the input's bounds.
        pull: Of them.
        P: Cost to go.
        q: Its slope.
        b: Sums of the rows of P.
        out: Scratch (16,).
    """
    added, S = gain[3], out[3:]
    for i in range(3):
        out[i] = q[i] + b[i] * added
        for j in range(3):
            S[3 * i + j] = 0.0
            for n in range(3):
                S[3 * i + j] += P[i, n] * (gain[j] + (1.0 if j >= n else 0.0))
    for i in range(3):
        q[i] = (weight * added + pull) * gain[i]
        for n in range(3):
            q[i] += (gain[i] + (1.0 if i >= n else 0.0)) * out[n]
        for j in range(3):
            P[i, j] = weight * gain[i] * gain[j]
            for n in range(3):
                P[i, j] += (gain[i] + (1.0 if i >= n else 0.0)) * S[3 * n + j]


def take_step(c: Vector, bounds: Vector, soft: Matrix, centre: float, memory: Matrix) -> float:
    """Pass forth: the step, and as much of it as leaves room and force; the share that is."""
    p, v, a = c[N_BEFORE - 1], c[N_BEFORE - 1] - c[N_BEFORE - 2], 0.0
    a = v - (c[N_BEFORE - 2] - c[N_BEFORE - 3])
    share = 1.0
    for k in range(N_BEFORE, c.shape[0]):
        row = memory[k]
        x = row[GAIN] * p + row[GAIN + 1] * v + row[GAIN + 2] * a + row[GAIN + 3]
        a += x
        v += a
        p += v
        row[CHANGE], row[CHANGE + 1], row[CHANGE + 2], row[CHANGE + 3] = p, v, a, x
        for i in range(6):
            s, f, d = row[ROOM + i], row[FORCE + i], i // 2
            lacks = missing(i, row, row[CHANGE + 1 + d], bounds, soft[k])
            more = (centre - s * f + f * lacks) / (s + soft[k, d] * f)
            less = soft[k, d] * more - lacks
            row[ROOM_CHANGE + i], row[FORCE_CHANGE + i] = less, more
            if less < 0.0:
                share = min(share, -SHARE * s / less)
            if more < 0.0:
                share = min(share, -SHARE * f / more)
    for k in range(N_BEFORE, c.shape[0]):
        row = memory[k]
        for i in range(4):
            row[VALUE + i] += share * (row[CHANGE + i] - row[VALUE + i])
        for i in range(6):
            row[ROOM + i] += share * row[ROOM_CHANGE + i]
            row[FORCE + i] += share * row[FORCE_CHANGE + i]
    return share
