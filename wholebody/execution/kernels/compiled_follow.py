"""`wholebody.execution.kernels.plan_follower` in compiled form."""

from __future__ import annotations

from functools import cache

import numpy as np

from wholebody.execution.kernels import plan_follower as kernel
from wholebody.jit.entry import Entry
from wholebody.reference.kernels.smoother_memory import HAND, LIMITS


@cache
def compiled_follow(n_joints: int) -> tuple[Entry, Entry]:
    """The compiled `kernel.follow` and `kernel.foresee` for robots with so many joints, compiled when first called."""
    return Entry(kernel.follow), Entry(kernel.foresee)


def compile_follow(n_joints: int) -> None:
    """Compile both for robots with so many joints, or load them: what their arguments hold does not matter."""
    vector, matrix, trajectory = np.zeros(1), np.zeros((1, 1)), np.zeros(1, kernel.trajectory_row(n_joints))
    plan = kernel.Plan(np.zeros(1, kernel.SETTINGS), vector, vector, trajectory, vector, vector)
    smoothing = kernel.Smoothing(np.zeros(2, HAND), matrix, matrix, np.zeros(2, LIMITS), matrix)
    body = kernel.Body(matrix, np.zeros((1, 1), dtype=int), vector, np.zeros(1, dtype=int))
    clock, (follow, foresee) = np.zeros(1, kernel.CLOCK), compiled_follow(n_joints)
    follow.compile(plan, clock, smoothing, body, vector, vector, vector, matrix, vector, 0.0, 0.0)
    foresee.compile(plan, clock, smoothing, 0)
