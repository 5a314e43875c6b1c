"""Strategy: the compiled program against its readable form with daqp on random configurations, references and limits;
what it promises (feet, centre of mass, joint limits) along motions that strain it; and in MuJoCo, where nothing is
promised, that a slow motion is survived.
"""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from models import g1
from models.pinocchio_model import stance_q
from policy.scripted.library import scripted_policy
from wholebody.backends.kinematic.controller import KinematicController
from wholebody.backends.kinematic.formulation import gravity_torques, speed_bounds
from wholebody.backends.kinematic.kernels import program as kernels
from wholebody.bench.reach_script import ReachScript
from wholebody.bench.tick import KINEMATIC, Variant, _tightened
from wholebody.config import ControllerConfig
from wholebody.episode.run import EpisodeConfig, run_episode
from wholebody.execution.supervisor import Supervisor
from wholebody.qp.solvers import solve
from wholebody.sim.plant import MujocoPlant
from wholebody.types import RobotState

SPEC = g1()
SCRIPT = ReachScript(SPEC, 1200, 0.002)
FAR = ReachScript(SPEC, 1200, 0.002, (0.45, 0.1, -0.35))


@pytest.fixture(scope="module", params=["bench", "default"])
def controller(request):
    config = KINEMATIC if request.param == "bench" else ControllerConfig(backend="kinematic")
    return KinematicController(SPEC, config)


def at(q, v=None):
    return RobotState(0.0, q, np.zeros(len(q) - 1) if v is None else v)


def follow(controller, script, ticks=1100):
    """Follow a script from its start."""
    controller.reset(at(script.q0))
    for k in range(ticks):
        before = controller.q
        yield k, before, *controller.step(at(before), script.packed(k))


def test_the_compiled_program_is_the_readable_one(controller):
    rng, robot, compiled = np.random.default_rng(4), controller.robot, controller.compiled
    q0, bound = stance_q(SPEC, robot.model), 0
    for k in range(150):
        controller.reset(at(q0))
        q = pin.integrate(robot.model, q0, rng.normal(0.0, 0.05, robot.nv))
        controller.set_reference((FAR if k % 2 else SCRIPT).packed(int(rng.integers(1100))))
        controller.trust_hands(*[rng.uniform(0.1, 1.0)] * 2)
        controller.q = q
        assert compiled.compute(q), compiled.code
        wanted = solve(controller.build(), "daqp")
        assert wanted.ok
        assert np.abs(compiled.v - wanted.x).max() < 1e-8 * max(1.0, np.abs(wanted.x).max())
        n = robot.n_joints
        dual = np.concatenate([wanted.z_box[6:], wanted.z])
        assert np.abs(compiled.dual[: len(dual)] - dual).max() < 1e-6 * max(1.0, np.abs(dual).max())
        assert np.abs(compiled.com - robot.com).max() < 1e-12
        bound = max(bound, int((np.abs(dual[:n]) > 0.0).sum()))
    assert bound > 3


def test_feet_centre_of_mass_and_joint_limits_hold_while_the_hands_ask_for_too_much(controller):
    controller = KinematicController(_tightened(SPEC, Variant(speed=0.05)), controller.config)
    robot, dt, active, nearest = controller.robot, controller.config.dt, 0, np.inf
    check = robot.model.createData()
    for _, before, _, report in follow(controller, FAR):
        assert report.level == 0
        low, high = speed_bounds(before[7:], controller.joints, dt)
        assert np.all(controller.v[6:] >= low - 1e-8)
        assert np.all(controller.v[6:] <= high + 1e-8)
        assert np.all(controller.q[7:] <= controller.joints[1] + 1e-9)
        assert np.all(controller.q[7:] >= controller.joints[0] - 1e-9)
        pin.framesForwardKinematics(robot.model, check, controller.q)
        for foot in controller.feet:
            T = check.oMf[robot.frame_id(foot.frame)]
            assert np.linalg.norm(pin.log6(foot.T_world_ref.actInv(T)).vector) < 2e-5
        com = pin.centerOfMass(robot.model, check, controller.q)
        nearest = min(nearest, controller.balance.support.margin(com[:2]))
        active = max(active, controller.compiled.active)
    assert nearest >= controller.balance.margin - 1e-5
    assert active >= 5


def test_hands_are_where_they_should_be_on_the_reach_script():
    one = KinematicController(SPEC, KINEMATIC)
    errors = []
    for k, _, _, report in follow(one, SCRIPT):
        assert report.level == 0
        SCRIPT.robot.place(one.q, one.v)
        for p, tool in zip(SCRIPT.wrists[0], SPEC.tools, strict=True):
            errors.append(np.linalg.norm(SCRIPT.robot.pose(tool.wrist_frame).translation - p[k + 1]))
    assert np.median(errors) < 2e-4
    assert max(errors) < 1e-3


def test_the_readable_backend_gives_the_same_motion():
    config = replace(KINEMATIC, solver="daqp")
    runs = [
        [command for _, _, command, _ in follow(KinematicController(SPEC, c), SCRIPT, 30)] for c in (KINEMATIC, config)
    ]
    for fast, slow in zip(*runs, strict=True):
        for name in ("q", "dq", "tau"):
            assert np.abs(getattr(fast, name) - getattr(slow, name)).max() < 1e-8


def test_feed_forward_torques_hold_the_measured_configuration(controller):
    rng, robot, compiled = np.random.default_rng(8), controller.robot, controller.compiled
    q0 = stance_q(SPEC, robot.model)
    controller.reset(at(q0))
    for _ in range(20):
        q = pin.integrate(robot.model, q0, rng.normal(0.0, 0.1, robot.nv))
        compiled.support(q)
        robot.update(q, np.zeros(robot.nv))
        assert np.abs(compiled.tau - gravity_torques(robot, controller.feet)).max() < 1e-9


def test_without_an_answer_the_robot_is_told_to_stay(controller, monkeypatch):
    controller.reset(at(SCRIPT.q0))
    monkeypatch.setattr(controller.compiled, "compute", lambda q: False)
    monkeypatch.setattr(controller, "config", replace(controller.config, fallback="none"))
    command, report = controller.step(at(SCRIPT.q0), SCRIPT.packed(300))
    assert report.level == 2
    assert np.all(command.dq == 0.0)
    assert np.array_equal(controller.q, SCRIPT.q0)


@pytest.mark.parametrize("field", ["value", "J", "g", "lam", "contact_target"])
def test_an_answer_with_one_entry_that_is_not_a_number_is_refused(controller, field):
    for k, *_ in follow(controller, FAR, 400):
        if k > 100 and controller.compiled.active:
            break
    tick = controller.compiled.tick
    assert kernels.conclude(tick)
    array = getattr(tick, field)
    kept, array.flat[0] = array.flat[0], np.nan
    assert not kernels.conclude(tick)
    assert np.isnan(tick.residuals).any()
    array.flat[0] = kept


def test_a_slow_motion_is_survived_in_simulation():
    supervisor, plant = Supervisor(SPEC, ControllerConfig(backend="kinematic")), MujocoPlant(SPEC)
    episode = EpisodeConfig(settle=0.5, hold=0.5)
    result = run_episode(scripted_policy("wave"), supervisor, plant, duration=1.5, config=episode)
    assert result.fall is None
    assert result.tilt < np.deg2rad(10.0)
    assert result.rms < 0.03
