"""Sums that may be taken in any order, so that they become vector instructions, and products of small matrices."""

from __future__ import annotations

from wholebody.jit.arrays import Matrix, Vector

FASTMATH = {"contract", "reassoc"}
"""What LLVM may do here: a product and a sum in one instruction, and sums in another order."""


def dot(a: Vector, b: Vector, n: int) -> float:
    """Scalar product of the first n entries."""
    total = 0.0
    for i in range(n):
        total += a[i] * b[i]
    return total


def outer_gram(A: Matrix, out: Matrix) -> None:
    """``out = A A'``."""
    rows, n = A.shape
    for i in range(rows):
        for j in range(i + 1):
            out[i, j] = out[j, i] = dot(A[i], A[j], n)


def times_transposed(A: Matrix, B: Matrix, out: Matrix) -> None:
    """``out = A B'``."""
    rows, n = A.shape
    for i in range(rows):
        for j in range(B.shape[0]):
            out[i, j] = dot(A[i], B[j], n)
