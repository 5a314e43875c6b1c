"""Arithmetic of a path look-up: one row of a hand's path at one parameter, from one flat array.

Plain Python on float64 arrays that compiles with numba as it stands (`wholebody.reference.compiled`). The flat array is

``[segments N, channels C, first cell s0, 1 / cell, cells K, K segment indices, N + 1 breaks, N x 6 x C coefficients]``

and the row that of `wholebody.reference.layout`; the channels are position 3, quaternion 4 (of any length), fingers 7.
Cell k covers ``s0 + k cell`` onwards and names the segment in which it begins: a look-up takes constant time.
"""

import math

import numpy as np

HEADER = 5
CHANNELS = 14


def path_row(flat, s, row):
    """Write the row at parameter ``s`` into ``row``, shape ``(40,)``; at rest before and after the path."""
    segments, cells = int(flat[0]), int(flat[4])
    breaks = HEADER + cells
    s = min(max(s, flat[breaks]), flat[breaks + segments])
    cell = min(max(int((s - flat[2]) * flat[3]), 0), cells - 1)
    i = int(flat[HEADER + cell])
    while i < segments - 1 and s >= flat[breaks + i + 1]:
        i += 1
    x = s - flat[breaks + i]
    base = breaks + segments + 1 + 6 * CHANNELS * i
    quat = np.empty((3, 4))
    for c in range(CHANNELS):
        k = base + c
        c0, c1, c2 = flat[k], flat[k + CHANNELS], flat[k + 2 * CHANNELS]
        c3, c4, c5 = flat[k + 3 * CHANNELS], flat[k + 4 * CHANNELS], flat[k + 5 * CHANNELS]
        y = c0 + x * (c1 + x * (c2 + x * (c3 + x * (c4 + x * c5))))
        dy = c1 + x * (2 * c2 + x * (3 * c3 + x * (4 * c4 + x * 5 * c5)))
        ddy = 2 * c2 + x * (6 * c3 + x * (12 * c4 + x * 20 * c5))
        if c < 3:
            row[c], row[3 + c], row[6 + c] = y, dy, ddy
        elif c < 7:
            quat[0, c - 3], quat[1, c - 3], quat[2, c - 3] = y, dy, ddy
        else:
            row[12 + c], row[19 + c], row[26 + c] = y, dy, ddy
    rotation_part(quat, row)


def rotation_part(quat, row):
    """Unit quaternion, angular velocity and acceleration of a quaternion of any length and its derivatives (3, 4).

    The formulas are those of `wholebody.reference.rotation.angular_rates`.
    """
    n, radial = 0.0, 0.0
    for i in range(4):
        n += quat[0, i] * quat[0, i]
        radial += quat[0, i] * quat[1, i]
    size = math.sqrt(n)
    for i in range(4):
        row[9 + i] = quat[0, i] / size
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        w = quat[0, 3] * quat[1, i] - quat[1, 3] * quat[0, i] - quat[1, j] * quat[0, k] + quat[1, k] * quat[0, j]
        alpha = quat[0, 3] * quat[2, i] - quat[2, 3] * quat[0, i] - quat[2, j] * quat[0, k] + quat[2, k] * quat[0, j]
        row[13 + i] = 2.0 * w / n
        row[16 + i] = 2.0 * (alpha - 2.0 * radial * w / n) / n
