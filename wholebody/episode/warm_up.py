"""Compile everything that a control tick and a plan need, once: later runs load it from the cache on disk."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from time import perf_counter

import numpy as np

from models.pinocchio_model import stance_q
from models.spec import RobotSpec
from policy.joints import layout_robot
from policy.observation import Observation
from policy.scripted.library import scripted_policy
from wholebody.config import ControllerConfig, PlannerConfig
from wholebody.config.description import describe
from wholebody.config.robot import RobotConfig
from wholebody.control.controller import WholeBodyController
from wholebody.episode.observation import fingers_of
from wholebody.episode.run import observe
from wholebody.estimation.state_estimator import StateEstimator
from wholebody.execution.kernels.compiled_follow import compile_follow
from wholebody.execution.standing import hands_at_rest
from wholebody.execution.supervisor import Supervisor
from wholebody.planning.chunk_planner import ChunkPlanner
from wholebody.planning.trajectory import BodyState
from wholebody.reference import HandMotion
from wholebody.robot.state import Robot
from wholebody.sim import plant
from wholebody.trajopt.problem import TrajectoryProblem
from wholebody.trajopt.robot_tables import RobotTables
from wholebody.types import RobotState

CHILD = """
import pickle, signal, sys
signal.signal(signal.SIGINT, signal.SIG_DFL)
compiled, robot = pickle.loads(bytes.fromhex(sys.argv[1]))
compiled(robot)
"""
"""What runs in a process of its own; after Ctrl-C it ends without a word."""


def warm_up(robot: RobotConfig | None = None, progress: Callable[[], None] | None = None) -> float:
    """Compile the tick and the plan in a process each, then plan one chunk and make a few ticks, without physics.

    Args:
        robot: For which robot; the default one if not given.
        progress: Called when the plan is compiled; the tick takes as long, beside it.

    Returns:
        How long it took [s]: most of a minute with a cold cache and two free cores, a few seconds with a warm one.

    Raises:
        ConfigError: If there is no such robot.
        RuntimeError: If a process that compiles fails; what it says is on standard error.
    """
    begin, robot = perf_counter(), robot or RobotConfig()
    spec = describe(robot)
    _apart([compile_plan, compile_tick], robot, progress)
    supervisor = Supervisor(spec)
    state = RobotState(0.0, stance_q(spec, supervisor.robot.model), np.zeros(supervisor.robot.nv))
    supervisor.reset(state)
    supervisor.accept(scripted_policy("wave", robot=layout_robot(spec)).infer(observe(spec, supervisor, state)))
    for _ in range(3):
        supervisor.step(state)
    return perf_counter() - begin


def _apart(
    parts: list[Callable[[RobotConfig], None]], robot: RobotConfig, progress: Callable[[], None] | None = None
) -> None:
    """Call functions side by side, each in a fresh interpreter: threads of libraries do not survive a fork.

    Not those of ``multiprocessing``: they run the caller's script again, which may have no guard against that.
    """
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    children = [
        subprocess.Popen(
            [sys.executable, "-P", "-c", CHILD, pickle.dumps((part, robot)).hex()],
            env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
        )
        for part in parts
    ]  # fmt: skip
    try:
        codes = [children[0].wait()]
        if progress is not None and not codes[0]:
            progress()
        codes += [child.wait() for child in children[1:]]
    finally:
        # Also after Ctrl-C: no child compiles on.
        for child in children:
            child.kill()
            child.wait()
    if any(codes):
        code = max(codes, key=abs)
        raise RuntimeError(f"a process that compiles ended with code {code}: it says why above, or memory is short")


def compile_tick(robot: RobotConfig) -> None:
    """Everything that a tick calls, and before that the step of a plan.

    That is what a plan needs last: both processes have the same amount to do, and none of it twice.
    """
    config, spec = PlannerConfig().posture, describe(robot)
    problem = TrajectoryProblem(RobotTables(spec, config), config, 3)
    problem.set_weights(config, 1.0)
    problem.step(1.0)
    WholeBodyController(spec)
    StateEstimator(spec)
    compile_follow(spec.n_joints)
    plant.warm_up()


def compile_plan(robot: RobotConfig | RobotSpec) -> None:
    """Planning a chunk."""
    spec = robot if isinstance(robot, RobotSpec) else describe(robot)
    model, joints = Robot(spec), spec.stance.joints
    q = stance_q(spec, model.model)
    model.update(q, np.zeros(model.nv))
    left, right = fingers_of(spec, joints)
    T_world_base, body = model.pose(spec.base_body).homogeneous, joints[: len(spec.body_joints)]
    chunk = scripted_policy("wave", robot=layout_robot(spec)).infer(Observation(0.0, body, left, right, T_world_base))
    planner = ChunkPlanner(spec, model, ControllerConfig())
    # With a plan before, too: whether its palms are where these are wanted is looked at in compiled code.
    planner.plan(chunk, 0.0, BodyState.still(q, model.nv), HandMotion(hands_at_rest(model, q)), q[None])
