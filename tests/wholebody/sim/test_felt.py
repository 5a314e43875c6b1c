"""Strategy: what the touch study measures, against forces that MuJoCo knows by another way, and a lever by hand."""

import mujoco
import numpy as np
import pytest

from models.pinocchio_model import load_pinocchio, stance_q
from tests.support.felt import SPEC, Felt, robot_in, still_force


def test_the_force_on_a_hand_is_what_the_button_gets_the_other_way():
    plant, _ = robot_in("button")
    felt, data = Felt(plant), plant.data
    tip = plant.data.site("right_palm_point").xpos + np.array([0.075, 0.025, 0.03])
    data.qpos[:3] += data.body("button").xpos - tip
    data.joint("fixture").qpos[:] = 0.007
    mujoco.mj_forward(plant.model, data)
    got = data.joint("fixture").qfrc_constraint[0]
    assert got > 1.0
    assert felt.forces()[1, 0] == pytest.approx(-got, rel=1e-9)
    assert not felt.forces()[0].any()


def test_a_robot_that_touches_itself_alone_feels_nothing():
    plant, _ = robot_in("table")
    mujoco.mj_forward(plant.model, plant.data)
    assert not Felt(plant).forces().any()


def test_a_level_force_that_a_still_robot_stands_is_that_of_the_lever_over_the_toes():
    model = load_pinocchio(SPEC)
    q = stance_q(SPEC, model)
    plant, _ = robot_in("floor")
    weight, palm = 9.81 * sum(plant.model.body_mass), plant.data.site("left_palm_point").xpos
    toes = plant.contact_points()[:, 0].max()
    tips = weight * (toes - plant.data.subtree_com[0][0]) / palm[2]
    allowed = still_force(q, "left", np.array([1.0, 0.0, 0.0]), 0.8)
    assert 0.95 * tips < allowed < 1.001 * tips
    assert still_force(q, "left", np.array([1.0, 0.0, 0.0]), 0.01) < 0.2 * tips  # then the soles slide
    assert still_force(q, "left", np.array([0.0, 0.0, -1.0]), 0.8) < 5.0 * tips < np.inf
