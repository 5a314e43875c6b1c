"""The motion that the search begins with: inverse kinematics from knot to knot, and steps of configurations."""

from __future__ import annotations

import numpy as np

from wholebody.jit.arrays import Matrix, Vector
from wholebody.trajopt.arrays import KnotTargets, Tables, TrajectoryWeights
from wholebody.trajopt.kernels.banded import factor_panel, solve_panel
from wholebody.trajopt.kernels.configuration_terms import configuration_terms, static_torque
from wholebody.trajopt.kernels.cost import add_configuration
from wholebody.trajopt.kernels.fixed_feet_kinematics import integrate
from wholebody.trajopt.kernels.inequalities import configuration_changes, configuration_derivative
from wholebody.trajopt.kernels.newton import list_exceeded
from wholebody.trajopt.layout import COM_EDGE, DISTANCE, FREE_LOWER, LOWER, N_FREE, RIGHT, UPPER
from wholebody.trajopt.workspace import AssemblyScratch, KnotMotion, KnotScratch, System

STEP_COST = 30.0
"""Weight of the step from one knot to the next [1/m^2, 1/rad^2]: without it a knot near a singular pose leaps; chosen:
a step of 0.18 rad costs as much as a palm 2 mm off its target."""
STEP_MAX = 0.25
"""Largest entry of a step [m, rad], chosen so that the linearisation is still good; 3.75 rad/s at 15 knots a second."""
NEWTON_STEPS = 4
"""Most Newton steps at a knot, each on the active set that the one before led to; the knot after it goes on."""


def warm_start(
    k: int, robot: Tables, m: KnotMotion, weights: TrajectoryWeights, penalties: Vector, system: System,
    work: KnotScratch, sums: AssemblyScratch
) -> None:  # fmt: skip
    """Move a knot, which is where the knot before it is, towards its palm targets."""
    for i in range(N_FREE):
        system.g[k + 1, i] = 0.0
        for j in range(N_FREE):
            system.H[k + 1, i, j] = 0.0
    add_configuration(k, m, weights, system.H, system.g, sums)
    newton_step(k, robot, m, penalties, COM_EDGE + robot.normals.shape[0], system, sums)
    largest = 0.0
    for i in range(N_FREE):
        largest = max(largest, abs(system.z[k + 1, i]))
    shrink = min(1.0, STEP_MAX / largest) if largest > 0.0 else 1.0
    for i in range(N_FREE):
        system.z[k + 1, i] *= shrink
    shift(m.free[k], system.z[k + 1], m.q[k], work.lower_step)


def follow_rows(
    begins: np.ndarray, passes: int, robot: Tables, task: KnotTargets, m: KnotMotion, weights: TrajectoryWeights,
    penalties: Vector, system: System, work: KnotScratch, sums: AssemblyScratch
) -> None:  # fmt: skip
    """Move each row from where the one before it is towards its palm targets, distances aside, by some passes.

    Rows that begin a motion (K,) stay where they are.
    """
    for k in range(m.q.shape[0]):
        if begins[k]:
            continue
        for j in range(m.q.shape[1]):
            m.q[k, j] = m.q[k - 1, j]
        m.n_near[k] = 0
        for c in range(DISTANCE, COM_EDGE):
            m.violation[k, c] = -1.0
        for _ in range(passes):
            configuration_terms(k, robot, task, m, work)
            static_torque(k, robot, task, m, work)
            warm_start(k, robot, m, weights, penalties, system, work, sums)


def newton_step(
    k: int, robot: Tables, m: KnotMotion, penalties: Vector, count: int, s: System, sums: AssemblyScratch
) -> None:
    """The step of one knot, on the set of bounds that are exceeded after it."""
    n, z, row, change = N_FREE, s.z[k + 1], sums.row, s.change[k]
    U, y = s.panels[k + 1], s.y[k + 1]
    change[:] = 0.0
    list_exceeded(k, 0, count, m.violation[k], change, s)
    for _ in range(NEWTON_STEPS):
        U[:] = 0.0
        for i in range(n):
            U[i, RIGHT] = -s.g[k + 1, i]
            for j in range(n):
                U[i, j] = s.H[k + 1, i, j]
            U[i, i] += STEP_COST
        for b in s.active[k, : s.n_active[k]]:
            configuration_derivative(b, k, robot, m, row)
            add_row(penalties[b], m.violation[k, b], row[n:], U)
        factor_panel(U.reshape(U.size))
        for i in range(n):
            y[i] = U[i, RIGHT]
        solve_panel(U, y)
        for i in range(n):
            z[i] = y[i]
        configuration_changes(k, robot, m, z, change, m.sign[k], sums)
        if not list_exceeded(k, 0, count, m.violation[k], change, s):
            break


def add_row(weight: float, value: float, row: Vector, U: Matrix) -> None:
    """Add one bound to the panel of a knot."""
    n = N_FREE
    for i in range(n):
        x = weight * row[i]
        U[i, RIGHT] -= x * value
        for j in range(n):
            U[i, j] += x * row[j]


def take_step(m: KnotMotion, z: Matrix, lower: Vector, other: KnotMotion) -> None:
    """Write the configurations after a step z (K + 2, N_FREE) of the whole motion into another motion."""
    for k in range(m.q.shape[0]):
        for j in range(m.q.shape[1]):
            other.q[k, j] = m.q[k, j]
        if k > 0:
            shift(m.free[k], z[k + 1], other.q[k], lower)


def shift(free: Matrix, x: Vector, q: Vector, lower: Vector) -> None:
    """Move a configuration q (36,) by a step x (N_FREE,) of the free directions."""
    for j in range(LOWER):
        lower[j] = 0.0
    for r in range(FREE_LOWER):
        for j in range(LOWER):
            lower[j] += x[r] * free[r, j]
    integrate(q, lower)
    for u in range(UPPER):
        q[1 + LOWER + u] += x[FREE_LOWER + u]
