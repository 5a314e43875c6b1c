"""A system of second order over one step."""

from __future__ import annotations

import numpy as np


def second_order_step(omega: float, zeta: float, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Value and rate of ``y'' = omega^2 (u - y) - 2 zeta omega y'`` after a step with constant ``u``: ``A x + b u``.

    Args:
        omega: Natural frequency [rad/s].
        zeta: Damping ratio.
        step: [s]

    Returns:
        ``A`` (2, 2) and ``b`` (2,), exact. With the system matrix ``-zeta omega I + N``, ``N N = (zeta^2 - 1) omega^2
        I``; at rest ``y = u``.
    """
    N = omega * np.array([[zeta, 1.0 / omega], [-omega, -zeta]])
    root = omega * np.sqrt(complex(zeta**2 - 1.0))
    ramp = step if abs(root) * step < 1e-9 else (np.sinh(root * step) / root).real
    A = np.exp(-zeta * omega * step) * (np.cosh(root * step).real * np.eye(2) + ramp * N)
    return A, np.array([1.0, 0.0]) - A[:, 0]
