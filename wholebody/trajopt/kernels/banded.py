"""Cholesky factor ``U' U`` of a block-banded matrix, and solutions with it.

Panel ``k + 1`` (N_BLOCK, N_PANEL) holds the rows of knot k: its own block and those with the next two knots. A block is
N_FREE wide, in room for N_BLOCK, so that rows are whole vector registers. Of the own block only what is right of the
diagonal counts. The last column is the right-hand side; factoring a panel carries that forward. What a panel gives to
the next two moves to the left by one block or two, and its right-hand side with it: that arrives in the spare columns
of their first two blocks, and `collect` adds it up.

Rows come as vectors in which they are N_PANEL apart: distances between them are constants then, and the compiler need
not ask which of them overlap.
"""

from __future__ import annotations

import math

import numpy as np

from wholebody.jit.arrays import Matrix, Vector
from wholebody.jit.vectors import dot
from wholebody.trajopt.layout import N_BLOCK, N_FREE, N_PANEL, RIGHT

FASTMATH = {"contract"}
"""A product and a sum may be one instruction."""


def factor(first: int, K: int, panels: np.ndarray) -> bool:
    """Factor the panels (K + 2, N_BLOCK, N_PANEL) from knot ``first`` on; False if they are singular."""
    size = N_BLOCK * N_PANEL
    flat = panels.reshape(panels.size)
    for k in range(first, K):
        panel = flat[(k + 1) * size : (k + 2) * size]
        for c in range(1, min(3, k)):
            before = flat[(k + 1 - c) * size : (k + 2 - c) * size]
            subtract_rows(c, N_BLOCK, before, before, panel)
        if not factor_panel(panel):
            return False
    return True


def subtract_rows(c: int, count: int, factors: Vector, rows: Vector, panel: Vector) -> None:
    """``panel -= factors' rows``, both of ``count`` rows, a multiple of four, whose block c is the panel's own."""
    n, shift = N_PANEL, c * N_BLOCK
    for i in range(0, N_BLOCK, 4):
        start = i // 8 * 8
        out = panel[i * n + start :]
        for r in range(0, count * n, 4 * n):
            subtract_four(n - shift - start, factors[r + shift + i :], rows[r + shift + start :], out)


def subtract_four(length: int, f: Vector, rows: Vector, out: Vector) -> None:
    """``out -= f' rows`` for four rows each, of this length, and the first four columns of f."""
    n, m, p = N_PANEL, 2 * N_PANEL, 3 * N_PANEL
    f00, f01, f02, f03 = f[0], f[1], f[2], f[3]
    f10, f11, f12, f13 = f[n], f[n + 1], f[n + 2], f[n + 3]
    f20, f21, f22, f23 = f[m], f[m + 1], f[m + 2], f[m + 3]
    f30, f31, f32, f33 = f[p], f[p + 1], f[p + 2], f[p + 3]
    for j in range(length):
        r0, r1, r2, r3 = rows[j], rows[n + j], rows[m + j], rows[p + j]
        out[j] -= f00 * r0 + f10 * r1 + f20 * r2 + f30 * r3
        out[n + j] -= f01 * r0 + f11 * r1 + f21 * r2 + f31 * r3
        out[m + j] -= f02 * r0 + f12 * r1 + f22 * r2 + f32 * r3
        out[p + j] -= f03 * r0 + f13 * r1 + f23 * r2 + f33 * r3


def factor_panel(panel: Vector) -> bool:
    """Factor the own block of a panel (N_BLOCK N_PANEL,), and what is to the right of it; False if it is singular."""
    n = N_PANEL
    collect(panel)
    for i in range(0, N_BLOCK, 4):
        start = i // 8 * 8
        out = panel[i * n + start :]
        for k in range(0, i, 4):
            subtract_four(n - start, panel[k * n + i :], panel[k * n + start :], out)
        if not factor_four(n - start, i - start, out):
            return False
    return True


def collect(panel: Vector) -> None:
    """Add up the right-hand side of a panel; its spare row and columns become those of a unit matrix."""
    n = N_PANEL
    for i in range(N_FREE):
        row = panel[i * n : (i + 1) * n]
        row[RIGHT] += row[N_FREE] + row[N_BLOCK + N_FREE]
        row[N_FREE] = row[N_BLOCK + N_FREE] = 0.0
    spare = panel[N_FREE * n : N_BLOCK * n]
    for j in range(n):
        spare[j] = 0.0
    spare[N_FREE] = 1.0


def factor_four(length: int, i: int, rows: Vector) -> bool:
    """Factor four rows, in which the diagonal begins at column i: it becomes that of the inverse."""
    n, m, p = N_PANEL, 2 * N_PANEL, 3 * N_PANEL
    d0 = rows[i]
    if not d0 > 0.0:
        return False
    s0 = 1.0 / math.sqrt(d0)
    u01, u02, u03 = s0 * rows[i + 1], s0 * rows[i + 2], s0 * rows[i + 3]
    d1 = rows[n + i + 1] - u01 * u01
    if not d1 > 0.0:
        return False
    s1 = 1.0 / math.sqrt(d1)
    u12, u13 = s1 * (rows[n + i + 2] - u01 * u02), s1 * (rows[n + i + 3] - u01 * u03)
    d2 = rows[m + i + 2] - u02 * u02 - u12 * u12
    if not d2 > 0.0:
        return False
    s2 = 1.0 / math.sqrt(d2)
    u23 = s2 * (rows[m + i + 3] - u02 * u03 - u12 * u13)
    d3 = rows[p + i + 3] - u03 * u03 - u13 * u13 - u23 * u23
    if not d3 > 0.0:
        return False
    s3 = 1.0 / math.sqrt(d3)
    for j in range(length):
        r0 = s0 * rows[j]
        r1 = s1 * (rows[n + j] - u01 * r0)
        r2 = s2 * (rows[m + j] - u02 * r0 - u12 * r1)
        rows[j], rows[n + j], rows[m + j] = r0, r1, r2
        rows[p + j] = s3 * (rows[p + j] - u03 * r0 - u13 * r1 - u23 * r2)
    rows[i], rows[n + i + 1], rows[m + i + 2], rows[p + i + 3] = s0, s1, s2, s3
    return True


def solve(K: int, panels: np.ndarray, y: Matrix) -> None:
    """Fill y (K + 3, N_BLOCK) with the solution of the factored panels, and zeros outside."""
    n = N_BLOCK
    flat = y.reshape(y.size)
    for i in range(y.size):
        flat[i] = 0.0
    for k in range(K, 1, -1):
        after = flat[(k + 1) * n : (k + 3) * n]
        for i in range(N_FREE):
            row = panels[k, i]
            y[k, i] = row[RIGHT] - dot(row[n:], after, 2 * n)
        solve_panel(panels[k], y[k])


def solve_panel(U: Matrix, y: Vector) -> None:
    """``y = U^-1 y`` (N_FREE,) for the own block of a panel U (N_BLOCK, N_PANEL)."""
    for i in range(N_FREE - 1, -1, -1):
        y[i] *= U[i, i]
        for j in range(i):
            y[j] -= U[j, i] * y[i]


def times(K: int, H: np.ndarray, x: Matrix, out: Matrix) -> None:
    """``out = H x`` for panels H (K + 2, N_BLOCK, N_PANEL), and vectors (K + 3, N_BLOCK) that are zero outside."""
    n, p = N_BLOCK, N_PANEL
    flat, result, panels = x.reshape(x.size), out.reshape(out.size), H.reshape(H.size)
    for i in range(result.size):
        result[i] = 0.0
    for k in range(2, K + 1):
        here, there = flat[n * k :], result[n * k :]
        for i in range(0, n, 4):
            rows = panels[(k * n + i) * p :]
            c0, c1, c2, c3 = here[i], here[i + 1], here[i + 2], here[i + 3]
            for j in range(p):
                there[j] += c0 * rows[j] + c1 * rows[p + j] + c2 * rows[2 * p + j] + c3 * rows[3 * p + j]
            for a in range(4):
                there[i + a] += dot(rows[a * p + n :], here[n:], 2 * n)
