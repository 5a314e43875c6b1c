"""Strategy: a robot that reaches, lowered in the middle of it, left with its last command, and raised again."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from models import g1
from models.pinocchio_model import load_pinocchio, stance_q
from policy.scripted.library import reach, scripted_policy
from wholebody.episode.run import EpisodeConfig, observe, run_episode
from wholebody.errors import StateError
from wholebody.execution.ending.crouch import crouch
from wholebody.execution.ending.stiff_legs import KD, KP, SOFTEN, STIFFEN, StiffLegs
from wholebody.execution.supervisor import Supervisor
from wholebody.robot.feet import Feet
from wholebody.robot.standing import has_lost_standing
from wholebody.sim.plant import MujocoPlant
from wholebody.types import JointCommand, Reason

SPEC, DT = g1(), 0.002


@pytest.fixture(scope="module")
def loop():
    return Supervisor(SPEC), MujocoPlant(SPEC)


def steps(supervisor, plant, state, until, longest=12.0):
    """Steps until something is true: the last command and state."""
    end, command = state.time + longest, None
    while not until():
        assert state.time < end
        command = supervisor.step(state, state.time)
        state = plant.step(command)
        assert not plant.contacts()
        assert not has_lost_standing(state)
    return command, state


def test_the_crouch_has_its_centre_of_mass_over_the_middle_of_the_soles_wherever_these_are():
    model = load_pinocchio(SPEC)
    data, nominal = model.createData(), Feet.at(SPEC, model, stance_q(SPEC, model))
    for feet in (nominal, replace(nominal, p=nominal.p + np.array([0.3, -0.2, 0.01]))):
        q = crouch(SPEC, model, feet)
        com = pin.centerOfMass(model, data, q)
        np.testing.assert_allclose(com[:2], feet.floor(SPEC).point[:2], atol=2e-3)
        assert not Feet.at(SPEC, model, q).differ(feet, 1e-6, 1e-6)
        assert (q[7:] >= model.lowerPositionLimit[7:]).all()
        assert (q[7:] <= model.upperPositionLimit[7:]).all()
        assert 0.4 < q[2] < 0.5


def test_a_robot_lowered_in_mid_reach_touches_nothing_stays_with_its_last_command_and_stands_up_again(loop):
    """With the last command of a robot that stood upright, which nobody made stiff, it falls after 1.1 to 4.2 s."""
    supervisor, plant = loop
    result = run_episode(reach(0.45, 0.6), supervisor, plant, duration=1.0, config=EpisodeConfig(hold=0.0))
    assert result.fall is None
    state, policy = plant.state(), scripted_policy("reach")
    assert supervisor.lower().reason is Reason.LOWERING
    assert not supervisor.lowered
    policy.reset()
    chunk = policy.infer(observe(SPEC, supervisor, state))
    assert supervisor.accept(chunk).reason is Reason.LOWERING
    command, state = steps(supervisor, plant, state, lambda: supervisor.lowered)
    assert supervisor.status.reason is Reason.LOWERED
    low = state.q.copy()
    for _ in range(round(10.0 / DT)):
        state = plant.step(command)
    np.testing.assert_allclose(state.q, low, atol=5e-3)
    assert np.abs(state.v).max() < 1e-3

    supervisor.reset(state)  # another loop finds it crouched
    assert supervisor.raise_().reason is Reason.RAISING
    _, state = steps(supervisor, plant, state, lambda: supervisor.status.reason is Reason.NO_CHUNK)
    assert state.q[2] > 0.75
    policy.reset()
    chunk = policy.infer(observe(SPEC, supervisor, state))
    assert supervisor.accept(chunk).reason is None


def test_a_robot_is_neither_lowered_nor_raised_before_the_first_reset():
    supervisor = Supervisor(SPEC)
    for ask in (supervisor.lower, supervisor.raise_):
        with pytest.raises(StateError, match="reset"):
            ask()


def test_legs_become_stiff_and_soft_again_and_arms_never():
    legs, zero = StiffLegs(SPEC), np.zeros(SPEC.n_joints)
    command = JointCommand(0.0, zero, zero, zero, SPEC.kp, SPEC.kd)
    assert legs.stiffened(command, False, DT) is command
    for _ in range(round(STIFFEN / DT) + 1):
        stiff = legs.stiffened(command, True, DT)
    arms = np.array([any(part in name for part in ("shoulder", "elbow", "wrist", "hand")) for name in SPEC.joint_names])
    np.testing.assert_array_equal(stiff.kp[arms], SPEC.kp[arms])
    np.testing.assert_array_equal(stiff.kp[~arms], np.maximum(SPEC.kp, KP)[~arms])
    np.testing.assert_array_equal(stiff.kd[~arms], np.maximum(SPEC.kd, KD)[~arms])
    for _ in range(round(SOFTEN / DT) + 1):
        soft = legs.stiffened(command, False, DT)
    assert soft is command
