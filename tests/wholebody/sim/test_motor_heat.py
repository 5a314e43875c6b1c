"""Strategy: a robot stands in MuJoCo, and its motors give what statics say; then one is given torques of its own."""

import numpy as np
import pytest

from models import g1
from wholebody.sim.motor_heat import HeatMeter, stance_torques
from wholebody.sim.plant import MujocoPlant
from wholebody.verdict.quantity import heated

SPEC = g1()


class Gives:
    """A plant whose motors give what they are told."""

    spec = SPEC

    def __init__(self):
        self.torque = np.zeros(SPEC.n_joints)


def meter(torques):
    plant = Gives()
    found = HeatMeter(plant)
    for torque in torques:
        plant.torque[:] = torque
        found.look()
    return found.hottest()


def test_statics_of_the_stance_are_what_motors_give_there():
    from wholebody.execution.supervisor import Supervisor

    plant, supervisor = MujocoPlant(SPEC), Supervisor(SPEC)
    state = plant.reset()
    supervisor.reset(state)
    for _ in range(300):
        state = plant.step(supervisor.step(state))
    np.testing.assert_allclose(plant.torque[~SPEC.is_finger], stance_torques(SPEC)[~SPEC.is_finger], atol=0.15)


def test_standing_heats_as_standing_does_and_the_ankle_comes_first():
    ankle, *others = meter([stance_torques(SPEC)] * 3)
    assert "ankle" in ankle.joint
    assert [one.of_stance for one in (ankle, *others)] == pytest.approx([1.0] * 3)
    assert not any("ankle" in one.joint or "hand" in one.joint for one in others)


def test_heat_goes_with_the_mean_square():
    still = stance_torques(SPEC)
    ankle = meter([2.0 * still, 0.0 * still])[0]
    assert ankle.of_stance == pytest.approx(2.0)
    assert ankle.torque_rms_nm == pytest.approx(np.sqrt(2.0) * abs(still[SPEC.joint_names.index(ankle.joint)]))


def test_what_hardly_stands_is_no_measure():
    torques = np.zeros(SPEC.n_joints)
    torques[SPEC.joint_names.index("left_ankle_roll_joint")] = 10.0
    ankle = meter([torques])[0]
    assert (ankle.joint, ankle.of_stance) == ("left_ankle_roll_joint", None)
    assert heated([ankle]) == "left ankle roll 10 N m RMS, 29% of its most"


def test_before_anything_was_looked_at_there_is_none():
    assert meter([]) == []
