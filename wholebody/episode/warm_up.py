"""Compile everything that a control tick and a plan need, once: later runs load it from numba's cache on disk."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from time import perf_counter

import numpy as np

from models.g1 import g1
from models.pinocchio_model import stance_q
from policy.joints import BODY_JOINTS
from policy.observation import Observation
from policy.scripted.library import scripted_policy
from wholebody.config import ControllerConfig, PlannerConfig
from wholebody.control.controller import WholeBodyController
from wholebody.episode.run import observe
from wholebody.execution.plan_follower import compile_follow
from wholebody.execution.supervisor import Supervisor
from wholebody.planning.chunk_planner import ChunkPlanner
from wholebody.planning.trajectory import BodyState
from wholebody.planning.trajopt.problem import TrajectoryProblem
from wholebody.planning.trajopt.robot_tables import RobotTables
from wholebody.reference import HandMotion, rest_row
from wholebody.robot.state import Robot
from wholebody.sim import plant
from wholebody.types import RobotState


def warm_up() -> float:
    """Compile the tick and the plan in a process each, then plan one chunk and make a few ticks, without physics.

    Returns:
        How long it took [s]: most of a minute with a cold cache and two free cores, a few seconds with a warm one.
    """
    begin = perf_counter()
    # A fresh interpreter each: threads of libraries do not survive a fork.
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        for part in [pool.submit(compile_plan), pool.submit(compile_tick)]:
            part.result()
    spec = g1()
    supervisor = Supervisor(spec)
    state = RobotState(0.0, stance_q(spec, supervisor.robot.model), np.zeros(supervisor.robot.nv))
    supervisor.reset(state)
    supervisor.accept(scripted_policy("wave").infer(observe(spec, supervisor, state)))
    for _ in range(3):
        supervisor.step(state)
    return perf_counter() - begin


def compile_tick() -> None:
    """Everything that a tick calls, and before that the step of a plan.

    That is what a plan needs last: both processes have the same amount to do, and none of it twice.
    """
    config = PlannerConfig().posture
    problem = TrajectoryProblem(RobotTables(g1(), config), config, 3)
    problem.set_weights(config, 1.0)
    problem.step(1.0)
    WholeBodyController(g1())
    compile_follow(g1().n_joints)
    plant.warm_up()


def compile_plan() -> None:
    """Planning a chunk."""
    spec = g1()
    robot, joints = Robot(spec), np.array(spec.stance.joint_positions)
    q = stance_q(spec, robot.model)
    robot.update(q, np.zeros(robot.nv))
    fingers = [joints[spec.indices(tool.finger_joints)] for tool in spec.tools]
    poses = [robot.pose(tool.wrist_frame).homogeneous for tool in spec.tools]
    rows = np.array([rest_row(T, finger) for T, finger in zip(poses, fingers, strict=True)])
    T_world_base = robot.pose(spec.base_body).homogeneous
    chunk = scripted_policy("wave").infer(Observation(0.0, joints[: len(BODY_JOINTS)], *fingers, T_world_base))
    planner = ChunkPlanner(spec, robot, ControllerConfig())
    planner.plan(chunk, 0.0, BodyState.still(q, robot.nv), HandMotion(rows))
