"""Strategy: robots that differ from the G1 by their description alone go all the way: a G1 with 27 joints and one with
23 by a setting, and a robot whose joints have other names, with a locked waist and two-finger grippers. Each stands,
follows a reach, is judged by its plans and by simulation, runs on the wall clock, and converts a dataset of its joints.
"""

from dataclasses import replace
from time import monotonic

import numpy as np
import pytest

from models.robots import ROBOTS
from policy.action_spec.builtin import builtin
from policy.dataset.joint_conversion import JointConversion, round_trip
from policy.dataset.joint_layout import arms_of, fingers_of, joint_layout
from policy.executor.executor import ExecutorConfig
from policy.joints import joints_of, layout_robot
from policy.recorded.example import example_file
from policy.scripted.library import scripted_policy
from tests.support.robots import gripper_robot
from tests.support.wide import wide
from wholebody.config import ControllerConfig
from wholebody.config.description import describe
from wholebody.config.robot import RobotConfig
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.errors import ConfigError
from wholebody.execution.supervisor import Supervisor
from wholebody.live.robot_process import RobotProcess, World
from wholebody.live.session import Session, SessionConfig
from wholebody.sim.plant import MujocoPlant
from wholebody.types import Reason, Status
from wholebody.verdict.check import Checker
from wholebody.verdict.fast import FastChecker

ROBOTS_TESTED = {
    "27dof": RobotConfig(body="27dof"),
    "23dof": RobotConfig(model="g1", body="23dof"),
    "gripper": RobotConfig(model="gripper_robot"),
}
REACHED = 2e-3
"""Bar of reaching a pose that is within reach [m]."""


@pytest.fixture(scope="module", params=[*wide("27dof"), "23dof", "gripper"])
def config(request):
    with pytest.MonkeyPatch.context() as patched:
        patched.setitem(ROBOTS, "gripper_robot", gripper_robot)
        yield ControllerConfig(robot=ROBOTS_TESTED[request.param])


@pytest.fixture(scope="module")
def spec(config):
    return describe(config.robot)


@pytest.fixture(scope="module")
def supervisor(config, spec):
    return Supervisor(spec, config)


def test_it_reaches_as_the_g1_does(spec, supervisor):
    policy = scripted_policy("reach", robot=layout_robot(spec))
    short = EpisodeConfig(settle=0.5, hold=0.5)
    result = run_episode(policy, supervisor, MujocoPlant(spec), duration=4.0, config=short)
    assert result.fall is None
    assert result.executed >= 3
    assert result.palms.errors.max() < REACHED
    assert result.time_factor == 1.0


def test_fingers_of_its_own_number_close(spec, supervisor):
    policy = scripted_policy("pick_high", robot=layout_robot(spec))
    plant = MujocoPlant(spec)
    result = run_episode(policy, supervisor, plant, duration=4.6, config=EpisodeConfig(settle=0.2, hold=0.5))
    assert result.fall is None
    right = spec.indices(spec.tool("right").finger_joints)
    if len(right):
        wanted = spec.by_hand(spec.hand_closed)[1]
        moved = plant.joint_positions()[right] - spec.by_hand(spec.hand_neutral)[1]
        assert np.abs(moved).max() > 0.5 * np.abs(wanted - spec.by_hand(spec.hand_neutral)[1]).max()


def test_a_chunk_with_the_fingers_of_another_robot_is_refused(spec, supervisor):
    chunk = example_file(builtin("wbc32", layout_robot(spec))).chunk()
    supervisor.reset(MujocoPlant(spec).reset())
    wrong = replace(chunk, q_lhand=np.zeros((len(chunk), 3)))
    answer = supervisor.accept(wrong, chunk.t_obs)
    assert (answer.status, answer.reason) == (Status.HOLD, Reason.CHUNK_INVALID)
    assert f"{spec.fingers[0]}) is expected" in answer.detail
    assert supervisor.accept(chunk, chunk.t_obs).status is not Status.HOLD


def test_it_is_judged_by_plans_and_by_simulation(config, spec):
    policy = scripted_policy("reach", robot=layout_robot(spec))
    fast = FastChecker(config).check(policy, "reach", 3.0)
    assert fast.verdict == "feasible"
    assert fast.odds is None  # learned from the G1 alone
    assert fast.margins
    assert "spare" not in str(fast.as_dict())  # joints that the optimiser has room for, and the robot lacks
    verdict, _ = Checker(config=config).check(policy, "reach", 1.0)
    assert verdict.verdict == "feasible"
    assert not verdict.fell


@pytest.mark.alone
def test_it_runs_on_the_wall_clock(config, spec, monkeypatch):
    # What keeps time collects garbage and changes the scheduling of the whole process: here that is the tests' own.
    monkeypatch.setattr("wholebody.live.pacing.keep_time", list)
    robot = RobotProcess(World(spec), config.dt)
    session = Session(config, robot, SessionConfig(duration=1.0, settle=0.3, hold=0.2))
    begin = monotonic()
    session.run({"reach": scripted_policy("reach", robot=layout_robot(spec))}, lambda now: None, ExecutorConfig())
    told = session.close()
    assert monotonic() - begin > 1.0
    assert told["fall"] == ""
    assert session.summary()["chunks"]["accepted"] >= 1
    assert not session.summary()["fell"]


def test_joints_of_a_dataset_become_wrists_and_come_back(spec):
    robot = layout_robot(spec)
    hands = fingers_of(robot) or ("left_grasp", "right_grasp")
    names = [*arms_of(robot), *hands, *joints_of(robot, "waist")]
    layout = joint_layout(names, len(names), robot=robot)
    target = builtin("wbc32" if sum(robot.fingers) else "wbc27", robot)
    conversion = JointConversion(layout, target)
    rng, rest = np.random.default_rng(0), conversion._at_rest()
    joints = rest + 0.1 * rng.random((6, layout.dim))
    numbers = conversion.forward(joints)
    assert numbers.shape == (6, target.dim)
    trip = round_trip(conversion, joints, numbers)
    assert trip.unreached == 0
    assert trip.position < 1e-4
    assert trip.fingers < 1e-6 or not sum(robot.fingers)


def test_settings_of_a_g1_say_nothing_of_another_robot(monkeypatch):
    monkeypatch.setitem(ROBOTS, "gripper_robot", gripper_robot)
    with pytest.raises(ConfigError, match="the other settings of robot are those of a G1"):
        describe(RobotConfig(model="gripper_robot", body="27dof"))
    with pytest.raises(ConfigError, match="locked_waist"):
        describe(RobotConfig(body="30dof"))
