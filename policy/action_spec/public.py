"""Layouts of public datasets and models of the G1, of which each has its source."""

from __future__ import annotations

from models.spec import RobotSpec
from policy.action_spec.parts import fingers, grasp, ignored, joints, scalar, stack, velocity, wrist
from policy.action_spec.slot import SHORT_ARM, SHORT_WAIST
from policy.action_spec.spec import ActionSpec
from policy.joints import joints_of

INSPIRE, BRAINCO = (1.0, 0.0), (0.0, 1.0)
"""Closing numbers of an open and a closed finger. Source: xr_teleoperate ``robot_hand_inspire.py``, where 0 is closed,
and ``robot_hand_brainco.py``, where 1 is."""
DEX1 = "dex1 rad"


def openhlm34(robot: RobotSpec) -> ActionSpec:
    """OpenHLM's π0.5 on the G1: arms with a gripper each, legs, waist, tilt and yaw rate of the root; 34 numbers.

    Joints are absolute, a gripper is 1 where it is open. Legs say where the pelvis is over feet that stay.

    Source:
        OpenHLM-project/OpenHLM (arXiv 2606.22174), its datasets' ``state`` and ``actions``.
    """
    return ActionSpec(
        name="openhlm34",
        robot=robot,
        slots=stack(
            *(joints(robot, "left_arm"), grasp("left", 1.0, 0.0)),
            *(joints(robot, "right_arm"), grasp("right", 1.0, 0.0)),
            *_legs(robot),
            joints(robot, "waist"),
            {"name": "base_tilt", "kind": "tilt", "size": 2, "unit": "rad"},
            scalar("base_yaw_rate", "rad/s"),
        ),
    )


def unifolm_wla54(robot: RobotSpec) -> ActionSpec:
    """UnifoLM-WLA-1.0: hands relative to themselves as xyz and rotation vector, and places of a mask; 54 numbers.

    A mask comes with each chunk: places that a robot does not have are 0 and not meant. What the public text leaves
    open is taken as follows: grippers are Dex1 motor angles, joints are in motor order.

    Source:
        ``robot_action_state_processing.md`` beside unitreerobotics/UnifoLM-WLA-1.0, section 3; post-training code is
        not public.
    """
    hand = "6 raw numbers of whichever hand, which the public text does not name"
    return ActionSpec(
        name="unifolm_wla54",
        robot=robot,
        horizon=30,
        masked=True,
        slots=stack(
            *_relative("left"),
            *(scalar("left_grasp", DEX1), ignored("left_dexterous_hand", 6, hand)),
            *_relative("right"),
            *(scalar("right_grasp", DEX1), ignored("right_dexterous_hand", 6, hand)),
            joints(robot, "waist"),
            ignored("torso", 3, "a G1 has no torso joints beside its waist"),
            velocity(),
            ignored("base_pose", 6, "a pose of the base relative to the state: the feet stay where they are"),
            scalar("base_height", "m"),
            *_legs(robot),
        ),
    )


def decoupled_wbc43(robot: RobotSpec) -> ActionSpec:
    """All 43 joints of the G1 with Dex3 hands in Pinocchio's order, as GR00T-WholeBodyControl exports them.

    Source:
        GR00T-WholeBodyControl ``decoupled_wbc`` exporter: names of its robot model, fingers index, middle, thumb.
    """
    return ActionSpec(
        name="decoupled_wbc43",
        robot=robot,
        fps=50.0,
        slots=stack(
            *_legs(robot),
            joints(robot, "waist"),
            *(joints(robot, "left_arm"), _sorted(robot, "left_hand")),
            *(joints(robot, "right_arm"), _sorted(robot, "right_hand")),
        ),
    )


def decoupled_wbc_eef14(robot: RobotSpec) -> ActionSpec:
    """Both wrists as xyz and quaternion w x y z in the pelvis, GR00T-WholeBodyControl's ``action.eef``; 14 numbers.

    Before the first command of a teleoperator its rows are identity poses at the pelvis, which are told as such.

    Source:
        GR00T-WholeBodyControl ``decoupled_wbc`` exporter, ``action.eef``.
    """
    return ActionSpec(
        name="decoupled_wbc_eef14",
        robot=robot,
        fps=50.0,
        slots=stack(*(part for side in ("left", "right") for part in _quaternion_wrist(side))),
    )


def inspire26(robot: RobotSpec) -> ActionSpec:
    """Both arms, then both Inspire hands, as in Unitree's datasets; a finger is 1 where it is open; 26 numbers.

    Fingers become those of a Dex3 hand: ring and pinky with the middle one, the thumb's rotation is lost.

    Source:
        unitree_lerobot ``constants.py``, G1_INSPIRE_CONFIG.
    """
    return ActionSpec(
        name="inspire26", robot=robot, slots=stack(*_arms(robot), *(fingers(s, "inspire", *INSPIRE) for s in _SIDES))
    )


def inspire26_by_side(robot: RobotSpec) -> ActionSpec:
    """Left arm, left Inspire hand, right arm, right Inspire hand, otherwise as inspire26; 26 numbers.

    Source:
        Public datasets that list each hand behind its arm, such as eunjuri's of the G1.
    """
    hands = (fingers(side, "inspire", *INSPIRE) for side in _SIDES)
    parts = (part for pair in zip(_arms(robot), hands, strict=True) for part in pair)
    return ActionSpec(name="inspire26_by_side", robot=robot, slots=stack(*parts))


def brainco26(robot: RobotSpec) -> ActionSpec:
    """Both arms, then both BrainCo hands, as in Unitree's datasets; a finger is 1 where it is closed; 26 numbers.

    Fingers become those of a Dex3 hand: ring and pinky with the middle one, the second thumb motor is lost.

    Source:
        unitree_lerobot ``constants.py``, G1_BRAINCO_CONFIG.
    """
    return ActionSpec(
        name="brainco26", robot=robot, slots=stack(*_arms(robot), *(fingers(s, "brainco", *BRAINCO) for s in _SIDES))
    )


def joint14(robot: RobotSpec) -> ActionSpec:
    """Both arms in motor order, without hands; fingers stay as they are; 14 numbers.

    Source:
        Recordings of a G1 without hands, such as those of xr_teleoperate without ``--ee``.
    """
    return ActionSpec(name="joint14", robot=robot, slots=stack(*_arms(robot)))


def joint29(robot: RobotSpec) -> ActionSpec:
    """The 29 body joints in motor order, without hands, at 50 Hz; legs say where the pelvis is over feet that stay.

    Source:
        Unitree's G1 motor order; retargeted motions and whole-body policies have it.
    """
    return ActionSpec(
        name="joint29", robot=robot, fps=50.0, slots=stack(*_legs(robot), joints(robot, "waist"), *_arms(robot))
    )


def joint23(robot: RobotSpec) -> ActionSpec:
    """The joints of a G1 with 23: legs, waist yaw, and five joints an arm, at 50 Hz; the other six are at 0.

    Source:
        unitree_sdk2 ``g1_23dof``: waist roll and pitch, wrist pitch and yaw are not fitted.
    """
    return ActionSpec(
        name="joint23",
        robot=robot,
        fps=50.0,
        slots=stack(
            *_legs(robot),
            joints(robot, "waist", first=SHORT_WAIST),
            joints(robot, "left_arm", first=SHORT_ARM),
            joints(robot, "right_arm", first=SHORT_ARM),
        ),
    )


_SIDES = ("left", "right")


def _legs(robot: RobotSpec) -> tuple[dict, dict]:
    return joints(robot, "left_leg"), joints(robot, "right_leg")


def _arms(robot: RobotSpec) -> tuple[dict, dict]:
    return joints(robot, "left_arm"), joints(robot, "right_arm")


def _sorted(robot: RobotSpec, part: str) -> dict:
    """Joints of a part by name, which is Pinocchio's order of siblings."""
    return joints(robot, part, order=tuple(sorted(joints_of(robot, part))))


def _relative(side: str) -> tuple[dict, dict]:
    position, rotation = wrist(side, mode="relative_se3")
    del rotation["rot6d_layout"]
    return position, {**rotation, "kind": "rotvec", "size": 3, "unit": "rad"}


def _quaternion_wrist(side: str) -> tuple[dict, dict]:
    position, rotation = wrist(side)
    del rotation["rot6d_layout"]
    return position, {**rotation, "kind": "quaternion", "size": 4, "quaternion_order": "wxyz"}


LAYOUTS = (
    *(openhlm34, unifolm_wla54, decoupled_wbc43, decoupled_wbc_eef14),
    *(inspire26, inspire26_by_side, brainco26, joint14, joint29, joint23),
)
"""Layouts of this module."""
