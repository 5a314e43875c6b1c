"""Products of matrices by BLAS; compiles with numba as it stands."""

from __future__ import annotations

import numpy as np

ALLOCATES = True
"""numba counts references to the arrays that it hands to BLAS; see `wholebody.jit.entry`."""


def outer_gram(A, out) -> None:
    """``out = A A'``."""
    np.dot(A, A.T, out)


def times_transposed(A, B, out) -> None:
    """``out = A B'``."""
    np.dot(A, B.T, out)
