"""Strategy: postures told by hand, from each of which a walk can begin or not; seeds that fell are in the study.

`python -m tests.studies.hostile_walks` walks from what hostile chunks leave the robot in.
"""

import numpy as np
import pinocchio as pin
import pytest

from models import g1
from models.pinocchio_model import stance_q
from wholebody.execution.feet.hands_of_walks import HandsOfWalks
from wholebody.execution.feet.ready_to_walk import ReadyToWalk
from wholebody.robot.state import Robot

SPEC = g1()


@pytest.fixture(scope="module")
def ready():
    robot = Robot(SPEC)
    stance = stance_q(SPEC, robot.model)
    return ReadyToWalk(robot, stance, HandsOfWalks(robot, stance)), robot, stance


def turned(q, axis, angle):
    """The base turned about an axis of its own."""
    turn = np.zeros(3)
    turn[axis] = angle
    q[3:7] = (pin.Quaternion(q[3:7]) * pin.Quaternion(pin.exp3(turn))).coeffs()


def bent(robot, q, joint, angle):
    """One joint moved on."""
    q[7 + robot.pin_to_motor[[one.name for one in SPEC.joints].index(joint)]] += angle


@pytest.mark.parametrize(
    ("change", "walks"),
    [
        (lambda robot, q: None, True),
        (lambda robot, q: turned(q, 1, 0.25), True),  # ahead
        (lambda robot, q: turned(q, 0, 0.13), False),  # to a side, as one did that fell
        (lambda robot, q: bent(robot, q, "waist_roll_joint", -0.13), False),
        (lambda robot, q: bent(robot, q, "left_knee_joint", 0.7), False),
        (lambda robot, q: bent(robot, q, "right_shoulder_pitch_joint", 1.5), False),  # a hand behind
        (lambda robot, q: bent(robot, q, "left_elbow_joint", 1.4), False),  # a long arm
    ],
)
def test_a_walk_begins_upright_with_hands_that_it_can_have(ready, change, walks):
    looks, robot, stance = ready
    q = stance.copy()
    change(robot, q)
    T_pelvis = pin.XYZQUATToSE3(stance[:7]).homogeneous
    assert looks.look(q, T_pelvis) is walks
