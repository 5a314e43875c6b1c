"""Strategy: robots from settings as a user writes them, down to the plant; the default stance is solved for again."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import yaml

from models.pinocchio_model import load_pinocchio, stance_q
from models.unitree_g1 import ARM, STANCE_DEX3, STANCE_RUBBER, g1
from policy.scripted.library import wave
from wholebody.config import ControllerConfig
from wholebody.config.description import describe
from wholebody.config.file import config_from, load_config
from wholebody.config.robot import GainConfig, GainsConfig, RobotConfig, StanceConfig
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.errors import ConfigError
from wholebody.execution.supervisor import Supervisor
from wholebody.planning.posture import solve
from wholebody.robot.state import Robot
from wholebody.sim.plant import MujocoPlant
from wholebody.types import Reason
from wholebody.verdict.check import Checker

README = (Path(__file__).parents[3] / "configs" / "README.md").read_text()
SHORT = EpisodeConfig(settle=0.1, hold=0.3)
LOW = RobotConfig(stance=StanceConfig(knee=0.8, feet_apart=0.3, shoulder_pitch=0.4))


def stands(spec):
    """Lowest and highest sole point [m], turn of the soles [rad], and centre of mass (2,) [m] in the stance."""
    model = load_pinocchio(spec)
    data, q = model.createData(), stance_q(spec, model)
    pin.framesForwardKinematics(model, data, q)
    feet = [data.oMf[model.getFrameId(foot.frame)] for foot in spec.feet]
    points = np.array([T.act(p) for T, foot in zip(feet, spec.feet, strict=True) for p in foot.points])
    return points, max(np.linalg.norm(pin.log3(T.rotation)) for T in feet), pin.centerOfMass(model, data, q)[:2]


def test_c5_the_robot_of_the_default_settings_is_the_g1_with_hands():
    assert describe(RobotConfig()) == g1()
    assert describe(RobotConfig(model="g1")) == g1(hands=False)
    assert describe(RobotConfig(linkage_effort=50.0)) == g1(linkage_effort=50.0)


def test_c5_a_model_that_there_is_not_is_refused_with_those_that_there_are():
    with pytest.raises(ConfigError, match=r"robot\.model is 'h1'; there are: g1_dex3, g1"):
        describe(RobotConfig(model="h1"))


@pytest.mark.parametrize(("model", "table"), [("g1_dex3", STANCE_DEX3), ("g1", STANCE_RUBBER)])
def test_c5_the_default_stance_is_what_its_knees_feet_and_arms_lead_to(model, table):
    arm = dict(zip(ARM, table["arm"], strict=True)) | {"elbow": table["arm"][3] + 1e-12}
    found, default = describe(RobotConfig(model=model, stance=StanceConfig(**arm))), describe(RobotConfig(model=model))
    np.testing.assert_allclose(found.stance.joints, default.stance.joints, atol=1e-6)
    np.testing.assert_allclose(found.stance.base, default.stance.base, atol=1e-6)


@pytest.mark.parametrize(
    "stance", [{"knee": 1.2, "feet_apart": 0.4}, {"knee": 0.25}, {"shoulder_roll": 1.2, "elbow": 1.0}]
)
def test_c5_a_stance_from_the_settings_has_flat_soles_and_balances(stance):
    points, turned, com = stands(describe(RobotConfig(stance=StanceConfig(**stance))))
    assert np.abs(points[:, 2]).max() < 1e-7
    assert turned < 1e-7
    assert abs(com[0]) < 1e-7
    assert abs(com[1]) < 1e-3
    apart = points[:4, 1].mean() - points[4:, 1].mean()
    assert apart == pytest.approx(stance.get("feet_apart", 0.238), abs=5e-3)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"stance": {"knee": 2.0}}, r"robot\.stance\.knee is 2; 0\.2 to 1\.6 rad is expected"),
        ({"stance": {"feet_apart": 0.0}}, r"robot\.stance\.feet_apart is 0; 0\.16 to 0\.5 m"),
        ({"gains": {"knee": {"kp": -1}}}, r"robot\.gains\.knee\.kp is -1; 0 to 2000 N m/rad"),
        ({"gains": {"knee": {"kd": 1e9}}}, r"robot\.gains\.knee\.kd is 1e\+09; 0 to 100 N m s/rad"),
        ({"gains": {"kne": {}}}, "did you mean 'knee'"),
        ({"linkage_effort": 500}, r"robot\.linkage_effort is 500; 10 to 60 N m"),
    ],
)
def test_c5_stance_and_gains_have_bounds_with_units(changes, says):
    with pytest.raises(ConfigError, match=says):
        config_from({"robot": changes})


def test_c5_an_arm_out_of_its_range_is_refused_with_the_joint():
    with pytest.raises(
        ConfigError, match=r"robot\.stance has left_elbow_joint at 3\.000 rad; its range is -1\.047 to 2\.094"
    ):
        describe(RobotConfig(stance=StanceConfig(elbow=3.0)))


def test_c5_stance_and_gains_from_the_settings_reach_plant_controller_and_recorder():
    config = ControllerConfig(robot=replace(LOW, gains=GainsConfig(knee=GainConfig(kp=200.0, kd=6.0))))
    checker = Checker(config=config, episode=SHORT)
    recorder, plant, spec = checker.recorder(), checker.plant, checker.supervisor.spec
    assert plant.spec is spec
    verdict, _ = checker.check(wave(), "wave", 0.8, recorder=recorder)
    assert verdict.verdict == "feasible"
    columns, knee = recorder.arrays(), spec.index("left_knee_joint")
    assert columns["q"][0, 2] == pytest.approx(describe(LOW).stance.base_position[2])
    assert columns["q_command"][0, knee] == pytest.approx(0.8, abs=1e-3)
    checker.supervisor.reset(plant.reset())
    command = checker.supervisor.step(plant.state())
    assert (command.kp[knee], command.kd[knee]) == (200.0, 6.0)
    assert verdict.config["robot"]["gains"]["knee"] == {"kp": 200.0, "kd": 6.0}


@pytest.mark.parametrize("backend", ["native", "kinematic", "placo"])
def test_c5_the_robot_without_hands_follows_a_chunk(backend):
    """It had no place for its hands' rows of fingers: `ValueError` at the first reset."""
    config = ControllerConfig(robot=RobotConfig(model="g1"), backend=backend)
    spec = describe(config.robot)
    result = run_episode(wave(), Supervisor(spec, config), MujocoPlant(spec), duration=0.5, config=SHORT)
    assert result.fall is None
    assert result.rms < 2e-3
    assert [note.text for note in result.notes] == [
        "the robot has no fingers: what the layout asks of left_hand, right_hand is left out"
    ]


def test_c5_balanced_joint_targets_are_for_the_robot_of_the_settings():
    config = ControllerConfig(robot=RobotConfig(model="g1"))
    robot = Robot(describe(config.robot))
    robot.update(stance_q(robot.spec, robot.model), np.zeros(robot.nv))
    wrists = [robot.pose(tool.wrist_frame).homogeneous for tool in robot.spec.tools]
    found = solve(*wrists, config)
    assert found.reached
    assert sorted(found.joints) == sorted(robot.spec.joint_names)


def test_c5_the_example_of_the_documents_is_read_and_stands(tmp_path):
    (text,) = re.findall(r"## The robot\n.*?```yaml\n(.*?)```", README, re.DOTALL)
    (tmp_path / "robot.yaml").write_text(text)
    config = load_config(tmp_path / "robot.yaml")
    assert config.robot.model == yaml.safe_load(text)["robot"]["model"] == "g1"
    checker = Checker(config=config, episode=EpisodeConfig(settle=0.2, hold=0.5))
    verdict, _ = checker.check(wave(), "wave", 0.5)
    assert verdict.verdict == "feasible"
    assert [one.code for one in verdict.violations] == [Reason.START_OFFSET, Reason.CHUNK_NOTE]
