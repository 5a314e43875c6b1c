"""Arithmetic of a path look-up: one row of a hand's path at one parameter, from one flat array.

The flat array is

``[segments N, channels C, first cell s0, 1 / cell, cells K, K segment indices, N + 1 breaks, N x 6 x C coefficients]``

and the row that of `wholebody.reference.layout`; the channels are position 3, quaternion 4 (of any length), fingers 7.
Cell k covers ``s0 + k cell`` onwards and names the segment in which it begins: a look-up takes constant time.
"""

from __future__ import annotations

import math

from wholebody.jit.arrays import Matrix, Vector

HEADER = 5
CHANNELS = 14


def path_row(flat: Vector, s: float, row: Vector) -> None:
    """Write the row at parameter ``s`` into ``row``, shape ``(40,)``; at rest before and after the path."""
    segments, cells = int(flat[0]), int(flat[4])
    breaks = HEADER + cells
    s = min(max(s, flat[breaks]), flat[breaks + segments])
    cell = min(max(int((s - flat[2]) * flat[3]), 0), cells - 1)
    i = int(flat[HEADER + cell])
    while i < segments - 1 and s >= flat[breaks + i + 1]:
        i += 1
    segment_row(flat, breaks + segments + 1 + 6 * CHANNELS * i, s - flat[breaks + i], row)


def curve_rows(breaks: Vector, flat: Vector, s: Vector, rows: Matrix) -> None:
    """Write the rows (n, 40) at parameters (n,) of a curve with breaks (N + 1,) and N x 6 x C coefficients in a row."""
    i, last = 0, breaks.shape[0] - 2
    for k in range(s.shape[0]):
        at = min(max(s[k], breaks[0]), breaks[last + 1])
        if at < breaks[i]:
            i = 0
        while i < last and at >= breaks[i + 1]:
            i += 1
        segment_row(flat, 6 * CHANNELS * i, at - breaks[i], rows[k])


def segment_row(flat: Vector, base: int, x: float, row: Vector) -> None:
    """Write the row ``x`` after the start of the segment whose first coefficient is entry ``base``."""
    for c in range(3):
        row[c], row[3 + c], row[6 + c] = channel(flat, base + c, x)
    quat_x, quat_y = channel(flat, base + 3, x), channel(flat, base + 4, x)
    quat_z, quat_w = channel(flat, base + 5, x), channel(flat, base + 6, x)
    rotation_part(quat_x, quat_y, quat_z, quat_w, row)
    for c in range(7, CHANNELS):
        row[12 + c], row[19 + c], row[26 + c] = channel(flat, base + c, x)


def channel(flat: Vector, k: int, x: float) -> tuple[float, float, float]:
    """Value and two derivatives of the quintic whose first coefficient is entry ``k``, ``x`` after its break."""
    c0, c1, c2 = flat[k], flat[k + CHANNELS], flat[k + 2 * CHANNELS]
    c3, c4, c5 = flat[k + 3 * CHANNELS], flat[k + 4 * CHANNELS], flat[k + 5 * CHANNELS]
    y = c0 + x * (c1 + x * (c2 + x * (c3 + x * (c4 + x * c5))))
    dy = c1 + x * (2 * c2 + x * (3 * c3 + x * (4 * c4 + x * 5 * c5)))
    return y, dy, 2 * c2 + x * (6 * c3 + x * (12 * c4 + x * 20 * c5))


def rotation_part(
    x: tuple[float, float, float], y: tuple[float, float, float], z: tuple[float, float, float],
    w: tuple[float, float, float], row: Vector
) -> None:  # fmt: skip
    """Unit quaternion, angular velocity and acceleration, into ``row`` (40,), of a quaternion and its derivatives.

    The formulas are those of `wholebody.reference.rotation.angular_rates`. Each component comes with its two
    derivatives.
    """
    n = x[0] * x[0] + y[0] * y[0] + z[0] * z[0] + w[0] * w[0]
    radial = x[0] * x[1] + y[0] * y[1] + z[0] * z[1] + w[0] * w[1]
    size = math.sqrt(n)
    row[9], row[10], row[11], row[12] = x[0] / size, y[0] / size, z[0] / size, w[0] / size
    for d in range(1, 3):
        row[10 + 3 * d] = w[0] * x[d] - w[d] * x[0] - y[d] * z[0] + z[d] * y[0]
        row[11 + 3 * d] = w[0] * y[d] - w[d] * y[0] - z[d] * x[0] + x[d] * z[0]
        row[12 + 3 * d] = w[0] * z[d] - w[d] * z[0] - x[d] * y[0] + y[d] * x[0]
    for i in range(3):
        row[13 + i] *= 2.0 / n
        row[16 + i] = 2.0 * (row[16 + i] - radial * row[13 + i]) / n
