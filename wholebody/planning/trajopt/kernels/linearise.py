"""All knots of a plan at once: their terms and derivatives; compiles with numba as it stands."""

from __future__ import annotations

from wholebody.planning.trajopt.kernels.capture_point import capture, sweep
from wholebody.planning.trajopt.kernels.configuration_terms import configuration
from wholebody.planning.trajopt.kernels.inverse_dynamics import (  # fmt: skip
    balance,
    bound_motion,
    force_rates,
    half_steps,
    move_bodies,
    reduce_motion,
    soles,
    torques,
)
from wholebody.planning.trajopt.kernels.static_torque import hold
from wholebody.planning.trajopt.layout import LOAD


def place(robot, task, m, work, first, last):
    """Everything that depends on the configurations of some knots, distances aside; puts the feet back."""
    for k in range(first, last):
        configuration(k, robot, task, m, work)
        hold(k, robot, m, work)


def rates(robot, task, m, work):
    """Everything that depends on the motion."""
    half_steps(m, task, work)
    for k in range(m.q.shape[0]):
        move_bodies(k, robot, m, work)
        force_rates(k, m, work)
        balance(k, robot, m, work)
        torques(k, robot, m, work)
        soles(k, robot, m, work)
        reduce_motion(k, task, m, work)
        bound_motion(k, robot, m, LOAD + robot.normals.shape[0])
        sweep(k, robot, m)
        capture(k, robot, m)
