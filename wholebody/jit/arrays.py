"""Arrays that kernels take, named by what they hold: annotations for readers, which nothing is compiled from.

Anything else is an ``np.ndarray``, with its shape in the docstring.
"""

from __future__ import annotations

import numpy as np

Vector = np.ndarray
"""Reals, shape (n,)."""
Matrix = np.ndarray
"""Reals, shape (m, n)."""
Indices = np.ndarray
"""Whole numbers, shape (n,)."""
