"""All knots of a plan at once: their terms and derivatives."""

from __future__ import annotations

from wholebody.trajopt.arrays import KnotTargets, Tables
from wholebody.trajopt.kernels.between import torques_between
from wholebody.trajopt.kernels.capture_point import approach_margin, capture_point
from wholebody.trajopt.kernels.configuration_terms import configuration_terms, static_torque
from wholebody.trajopt.kernels.dynamics_rows import (
    contact_wrench,
    dynamics_violations,
    project_dynamics,
    pushed_rows,
    sole_accelerations,
)
from wholebody.trajopt.kernels.inverse_dynamics import subtree_forces, torque_rows
from wholebody.trajopt.kernels.mid_velocities import mid_velocities
from wholebody.trajopt.layout import LOAD
from wholebody.trajopt.workspace import KnotMotion, KnotScratch

AT_KNOT, AT_FIRST = (0.5, 0.5, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)
"""Shares of `project_dynamics` [no unit, s]; definition: the velocity at a knot is the mean of those before and after
it, and given at the first one."""


def place(robot: Tables, task: KnotTargets, m: KnotMotion, work: KnotScratch, first: int, last: int) -> None:
    """Everything that depends on the configurations of some knots, distances aside; puts the feet back in place."""
    for k in range(first, last):
        configuration_terms(k, robot, task, m, work)
        static_torque(k, robot, task, m, work)


def between(robot: Tables, task: KnotTargets, m: KnotMotion, beside: KnotMotion, work: KnotScratch) -> None:
    """Torques between the knots of a motion, of which everything else is known."""
    for k in range(m.q.shape[0]):
        torques_between(k, robot, task, m, beside, work)


def rates(robot: Tables, task: KnotTargets, m: KnotMotion, beside: KnotMotion, work: KnotScratch) -> None:
    """Everything that depends on velocities and accelerations; ``beside`` is scratch, the motion of one knot."""
    mid_velocities(m, task, work)
    for k in range(m.q.shape[0]):
        if task.between:
            torques_between(k, robot, task, m, beside, work)
        subtree_forces(k, k, robot, task, m, work)
        if task.pushed:
            pushed_rows(k, robot, m, work)
        contact_wrench(k, robot, m, work)
        torque_rows(k, robot, task, m, work)
        sole_accelerations(k, robot, m, work)
        project_dynamics(k, 0, AT_KNOT if k > 0 else AT_FIRST, task, m, m.J_dynamics[k], work)
        dynamics_violations(k, robot, task, m, LOAD + robot.normals.shape[0])
        approach_margin(k, robot, m, task.dt)
        capture_point(k, robot, task, m)
