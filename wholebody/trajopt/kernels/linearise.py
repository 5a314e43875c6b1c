"""All knots of a plan at once: their terms and derivatives."""

from __future__ import annotations

from wholebody.trajopt.arrays import KnotTargets, Tables
from wholebody.trajopt.kernels.capture_point import approach_margin, capture_point
from wholebody.trajopt.kernels.configuration_terms import configuration_terms
from wholebody.trajopt.kernels.dynamics_rows import (
    contact_wrench,
    dynamics_violations,
    project_dynamics,
    sole_accelerations,
)
from wholebody.trajopt.kernels.inverse_dynamics import force_derivatives, forward_pass, torques
from wholebody.trajopt.kernels.mid_velocities import mid_velocities
from wholebody.trajopt.kernels.static_torque import static_torque
from wholebody.trajopt.layout import LOAD
from wholebody.trajopt.workspace import KnotMotion, KnotScratch


def place(robot: Tables, task: KnotTargets, m: KnotMotion, work: KnotScratch, first: int, last: int) -> None:
    """Everything that depends on the configurations of some knots, distances aside; puts the feet back in place."""
    for k in range(first, last):
        configuration_terms(k, robot, task, m, work)
        static_torque(k, robot, m, work)


def rates(robot: Tables, task: KnotTargets, m: KnotMotion, work: KnotScratch) -> None:
    """Everything that depends on velocities and accelerations."""
    mid_velocities(m, task, work)
    for k in range(m.q.shape[0]):
        forward_pass(k, robot, m, work)
        force_derivatives(k, m, work)
        contact_wrench(k, robot, m, work)
        torques(k, robot, m, work)
        sole_accelerations(k, robot, m, work)
        project_dynamics(k, task, m, work)
        dynamics_violations(k, robot, m, LOAD + robot.normals.shape[0])
        approach_margin(k, robot, m, task.dt)
        capture_point(k, robot, m)
