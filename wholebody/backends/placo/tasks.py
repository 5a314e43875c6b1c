"""Our tasks as placo's: the same references, gains and weights, but errors, Jacobians and drifts are placo's own.

What placo cannot say is said in its terms: a proportional part that is limited becomes a reference that is near.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import placo

from wholebody.errors import InputError
from wholebody.qp.kernels.targets import DAMPING
from wholebody.robot.state import Robot
from wholebody.tasks.base import Task, limited
from wholebody.tasks.com import ComTask
from wholebody.tasks.hand import HandTask
from wholebody.tasks.height import HeightTask
from wholebody.tasks.orientation import OrientationTask
from wholebody.tasks.posture import PostureTask


def mirror(solver: placo.DynamicsSolver, task: Task, robot: Robot) -> _HandMirror | _ComMirror | _OrientationMirror:
    """Add a task's counterpart to a solver; its ``update`` hands the present reference over, at every tick.

    Where that is ``relaxed``, the arms give way and the joints slow down.

    Raises:
        InputError: If placo has none.
    """
    for kind, counterpart in _COUNTERPARTS.items():
        if isinstance(task, kind):
            return counterpart(solver, task, robot)
    known = ", ".join(kind.__name__ for kind in _COUNTERPARTS)
    raise InputError(f"placo has no counterpart of {type(task).__name__}; it has one of {known}")


class _HandMirror:
    def __init__(self, solver: placo.DynamicsSolver, task: HandTask, robot: Robot) -> None:
        self.task, self.frame = task, solver.add_frame_task(task.frame, np.eye(4))
        for part in (self.frame.position(), self.frame.orientation()):
            part.kp, part.kd = task.kp, task.kd

    def update(self, robot: Robot, *, relaxed: bool) -> None:
        task, position, orientation = self.task, self.frame.position(), self.frame.orientation()
        T, error = robot.pose(task.frame), task.error(robot)
        position.target_world = T.translation + limited(error[:3], task.feedback_max[0] / task.kp)
        orientation.R_world_frame = pin.exp3(limited(error[3:], task.feedback_max[1] / task.kp)) @ T.rotation
        position.dtarget_world, orientation.omega_world = task.twist_ref[:3], task.twist_ref[3:]
        position.ddtarget_world, orientation.domega_world = task.acceleration_ref[:3], task.acceleration_ref[3:]
        trust = 0.0 if relaxed else task.trust
        self.frame.configure(task.frame, "soft", trust * task.weight[0], trust * task.weight[3])


class _ComMirror:
    """One placo task for each weight: placo has one weight for all axes."""

    def __init__(self, solver: placo.DynamicsSolver, task: ComTask, robot: Robot) -> None:
        self.task, self.parts = task, []
        for weight in dict.fromkeys(task.weight.tolist()):
            part = solver.add_com_task(np.zeros(3))
            axes = "".join(axis for axis, own in zip("xyz", task.weight, strict=True) if own == weight)
            part.mask.set_axises(axes, "task")
            part.configure(f"com_{axes}", "soft", weight)
            part.kp, part.kd = task.kp, task.kd
            self.parts.append(part)

    def update(self, robot: Robot, *, relaxed: bool) -> None:
        task = self.task
        target = robot.com + limited(task.position_ref - robot.com, task.feedback_max / task.kp)
        for part in self.parts:
            part.target_world, part.dtarget_world = target, task.velocity_ref
            part.ddtarget_world = task.acceleration_ref


class _OrientationMirror:
    def __init__(self, solver: placo.DynamicsSolver, task: OrientationTask, robot: Robot) -> None:
        self.task, self.part = task, solver.add_orientation_task(task.frame, np.eye(3))
        self.part.configure(f"{task.frame}_orientation", "soft", task.weight[0])
        self.part.kp, self.part.kd = task.kp, task.kd

    def update(self, robot: Robot, *, relaxed: bool) -> None:
        task, R = self.task, robot.pose(self.task.frame).rotation
        error = limited(pin.log3(task.R_world_ref @ R.T), task.feedback_max / task.kp)
        self.part.R_world_frame = pin.exp3(error) @ R
        self.part.omega_world, self.part.domega_world = task.rate_ref, task.acceleration_ref


class _HeightMirror:
    def __init__(self, solver: placo.DynamicsSolver, task: HeightTask, robot: Robot) -> None:
        self.task, self.part = task, solver.add_position_task(task.frame, np.zeros(3))
        self.part.mask.set_axises("z", "task")
        self.part.configure(f"{task.frame}_height", "soft", task.weight[0])
        self.part.kp, self.part.kd = task.kp, task.kd

    def update(self, robot: Robot, *, relaxed: bool) -> None:
        task, target = self.task, robot.pose(self.task.frame).translation.copy()
        z, dz, ddz = task.reference.tolist()
        target[2] += np.clip(z - target[2], -task.feedback_max / task.kp, task.feedback_max / task.kp)
        self.part.target_world = target
        self.part.dtarget_world, self.part.ddtarget_world = np.array([0, 0, dz]), np.array([0, 0, ddz])


class _PostureMirror:
    """One placo task for each set of gains and weight."""

    def __init__(self, solver: placo.DynamicsSolver, task: PostureTask, robot: Robot) -> None:
        self.task, self.names = task, robot.joint_names
        settings = list(zip(task.kp.tolist(), task.kd.tolist(), task.weight.tolist(), strict=True))
        self.parts = []
        for setting in dict.fromkeys(settings):
            part = solver.add_joints_task()
            part.configure(f"joints_{len(self.parts)}", "soft", setting[2])
            self.parts.append((part, [i for i, own in enumerate(settings) if own == setting], setting))

    def update(self, robot: Robot, *, relaxed: bool) -> None:
        task, q = self.task, robot.q[7:]
        target = q + np.clip(task.q_ref - q, -task.feedback_max / task.kp, task.feedback_max / task.kp)
        for part, joints, (kp, kd, _) in self.parts:
            part.kp, part.kd = (0.0, DAMPING) if relaxed else (kp, kd)
            for i in joints:
                rates = (0.0, 0.0) if relaxed else (float(task.dq_ref[i]), float(task.ddq_ref[i]))
                part.set_joint(self.names[i], float(target[i]), *rates)


_COUNTERPARTS = {
    HandTask: _HandMirror,
    ComTask: _ComMirror,
    OrientationTask: _OrientationMirror,
    HeightTask: _HeightMirror,
    PostureTask: _PostureMirror,
}
