"""All knots of a plan at once: their terms and derivatives; compiles with numba as it stands."""

from __future__ import annotations

from wholebody.posture.ahead_core import capture, sweep
from wholebody.posture.hold_core import hold
from wholebody.posture.motion_core import (
    balance,
    bound_motion,
    force_rates,
    half_steps,
    move_bodies,
    reduce_motion,
    soles,
    torques,
)  # fmt: skip
from wholebody.posture.place_core import configuration
from wholebody.posture.tables import LOAD


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
