"""Sums that may be taken in any order, so that they become vector instructions."""

from __future__ import annotations

FASTMATH = {"contract", "reassoc"}
"""What `wholebody.jit.entry` lets numba do here: a product and a sum in one instruction, and sums in another order."""


def dot(a, b, n) -> float:
    """Scalar product of the first n entries."""
    total = 0.0
    for i in range(n):
        total += a[i] * b[i]
    return total
