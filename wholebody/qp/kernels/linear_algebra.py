"""Small dense linear algebra on preallocated arrays; compiled by `wholebody.jit`.

Loops run along rows, whose entries lie side by side, and add up rows rather than products: that is what vector
instructions can do without reordering sums.
"""

from __future__ import annotations

import math

from wholebody.jit.arrays import Matrix, Vector


def dot(a: Vector, b: Vector, n: int) -> float:
    """Scalar product of the first ``n`` entries, in four interleaved sums."""
    s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0
    whole = n - n % 4
    for k in range(0, whole, 4):
        s0 += a[k] * b[k]
        s1 += a[k + 1] * b[k + 1]
        s2 += a[k + 2] * b[k + 2]
        s3 += a[k + 3] * b[k + 3]
    for k in range(whole, n):
        s0 += a[k] * b[k]
    return (s0 + s1) + (s2 + s3)


def add_scaled(a: Vector, factor: float, b: Vector, n: int) -> None:
    """``a += factor b`` on the first ``n`` entries."""
    for k in range(n):
        a[k] += factor * b[k]


def cholesky(H: Matrix, n: int) -> bool:
    """Upper factor ``U``, ``U' U = H`` (n, n), in place in the upper triangle; False if H is not positive definite."""
    for i in range(n):
        row, m, k = H[i, i:], n - i, 0
        while k + 4 <= i:
            c0, c1, c2, c3 = H[k, i], H[k + 1, i], H[k + 2, i], H[k + 3, i]
            r0, r1, r2, r3 = H[k, i:], H[k + 1, i:], H[k + 2, i:], H[k + 3, i:]
            for j in range(m):
                row[j] -= c0 * r0[j] + c1 * r1[j] + c2 * r2[j] + c3 * r3[j]
            k += 4
        while k < i:
            c0, r0 = H[k, i], H[k, i:]
            for j in range(m):
                row[j] -= c0 * r0[j]
            k += 1
        if not row[0] > 0.0:
            return False
        size = 1.0 / math.sqrt(row[0])
        for j in range(m):
            row[j] *= size
    return True


def solve_transposed(U: Matrix, b: Vector, n: int) -> None:
    """``U' x = b`` (n,) in place, U (n, n) upper triangular."""
    for k in range(n):
        c = b[k] / U[k, k]
        b[k] = c
        if c != 0.0:
            left, row = b[k + 1 :], U[k, k + 1 :]
            for j in range(n - k - 1):
                left[j] -= c * row[j]


def solve_upper(U: Matrix, b: Vector, n: int) -> None:
    """``U x = b`` (n,) in place, U (n, n) upper triangular."""
    for k in range(n - 1, -1, -1):
        b[k] = (b[k] - dot(U[k, k + 1 :], b[k + 1 :], n - k - 1)) / U[k, k]


def inverse_6(A: Matrix, U: Matrix, inverse: Matrix) -> bool:
    """Inverse of a symmetric positive definite matrix (6, 6); U is scratch. False if it is not one."""
    for i in range(6):
        for j in range(6):
            U[i, j] = A[i, j]
            inverse[i, j] = 1.0 if i == j else 0.0
    if not cholesky(U, 6):
        return False
    for i in range(6):
        solve_transposed(U, inverse[i], 6)
        solve_upper(U, inverse[i], 6)
    return True


def null_space(B: Matrix, m: int, n: int, beta: Matrix, Z: Matrix) -> bool:
    """Orthonormal basis of the vectors that m rows of length n map to zero, by Householder reflections.

    Args:
        B: Rows (m, n), m < n; afterwards row k holds ``L[k, :k + 1]`` of ``B = L Q'`` and from k on the reflector k,
            whose own ``L[k, k]`` is in ``beta[1, k]``.
        m: Number of rows.
        n: Their length.
        beta: Out, (2, m): factor of each reflector and diagonal of L.
        Z: Out, basis, shape (n, n - m).

    Returns:
        False if the rows are dependent.
    """
    for k in range(m):
        size = 0.0
        for j in range(k, n):
            size += B[k, j] * B[k, j]
        size = math.sqrt(size)
        if not size > 1e-9:
            return False
        alpha = -size if B[k, k] > 0.0 else size
        beta[1, k] = alpha
        beta[0, k] = 1.0 / (size * (size + abs(B[k, k])))
        B[k, k] -= alpha
        for i in range(k + 1, m):
            c = 0.0
            for j in range(k, n):
                c += B[i, j] * B[k, j]
            c *= beta[0, k]
            if c != 0.0:
                for j in range(k, n):
                    B[i, j] -= c * B[k, j]
    for r in range(n - m):
        for j in range(n):
            Z[j, r] = 0.0
        Z[m + r, r] = 1.0
    for k in range(m - 1, -1, -1):
        reflect_rows(B[k], beta[0, k], k, n, Z)
    return True


def reflect_rows(reflector: Vector, factor: float, start: int, n: int, X: Matrix) -> None:
    """``X -= factor w (w' X)`` for ``w`` the reflector from ``start`` on; X has shape (n, any)."""
    width = X.shape[1]
    for r in range(width):
        c = 0.0
        for j in range(start, n):
            c += reflector[j] * X[j, r]
        c *= factor
        for j in range(start, n):
            X[j, r] -= c * reflector[j]


def particular(B: Matrix, beta: Matrix, m: int, n: int, b: Vector, x: Vector) -> None:
    """Shortest ``x`` (n,) with ``rows x = b`` (m,), from what `null_space` left; b is overwritten."""
    for k in range(m):
        total = b[k]
        for j in range(k):
            total -= B[k, j] * x[j]
        x[k] = total / beta[1, k]
    for j in range(m, n):
        x[j] = 0.0
    for k in range(m - 1, -1, -1):
        c = 0.0
        for j in range(k, n):
            c += B[k, j] * x[j]
        c *= beta[0, k]
        for j in range(k, n):
            x[j] -= c * B[k, j]
