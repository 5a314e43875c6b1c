"""Strategy: postures for the same wrists with and without told loads, by the solver that a user calls."""

import numpy as np

from models import g1
from wholebody.config import ControllerConfig, LoadConfig
from wholebody.planning.posture import PostureSolver
from wholebody.planning.still_postures import PostureLimit

SPEC = g1()
PALM = np.array(SPEC.tools[0].palm_offset)


def wrist(x, y, z):
    """A level hand whose palm point is there."""
    T = np.eye(4)
    T[:3, 3] = np.array([x, y, z]) - PALM * [1.0, np.sign(y), 1.0]
    return T


def test_a_told_load_is_held_in_another_posture_or_it_is_said_what_is_in_the_way():
    hands = wrist(0.45, 0.16, 0.80), wrist(0.45, -0.16, 0.80)
    bare, light, heavy = (
        PostureSolver(SPEC, ControllerConfig(loads=LoadConfig(source="told", left=kg, right=kg))).solve(*hands)
        for kg in (0.0, 0.5, 3.0)
    )
    assert bare.reached
    assert light.reached
    assert np.abs(light.q - bare.q).max() > 0.01
    assert light.margins[PostureLimit.WAIST_TORQUE] > -0.01
    assert abs(light.torques["left_shoulder_pitch_joint"]) > abs(bare.torques["left_shoulder_pitch_joint"]) + 1.0
    assert not heavy.reached
