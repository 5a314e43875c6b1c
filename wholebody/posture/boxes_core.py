"""Lower bounds of the distances between bodies from their boxes and spheres, in a function that compiles."""

from __future__ import annotations

import numpy as np


def bounds(pairs, T, centre, half, radius, out):
    """Fill out (n,) for pairs (n, 2) of shapes with poses T (m, 4, 4).

    Every shape lies in a box, ``centre`` and ``half`` (m, 3) in its own axes, and in the sphere of ``radius`` (m,)
    about the box's centre. The distance from one's box to the other's sphere is a bound, and so is the reverse.
    """
    m = len(T)
    world = np.empty((m, 3))
    for i in range(m):
        for r in range(3):
            world[i, r] = T[i, r, 3] + T[i, r, 0] * centre[i, 0] + T[i, r, 1] * centre[i, 1] + T[i, r, 2] * centre[i, 2]
    for k in range(len(pairs)):
        best = -1.0
        for turn in range(2):
            a, b = pairs[k, turn], pairs[k, 1 - turn]
            total = 0.0
            for c in range(3):
                d = 0.0
                for r in range(3):
                    d += T[a, r, c] * (world[b, r] - world[a, r])
                outside = abs(d) - half[a, c]
                if outside > 0.0:
                    total += outside * outside
            best = max(best, np.sqrt(total) - radius[b])
        out[k] = best
