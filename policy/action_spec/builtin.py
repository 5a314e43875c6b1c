"""The action layouts that ship with the package. A layout never changes once released: a change is a new version."""

from __future__ import annotations

from functools import lru_cache
from typing import overload

from models import g1
from models.spec import RobotSpec
from policy.action_spec import public
from policy.action_spec.parts import force, joints, scalar, stack, velocity, wrist
from policy.action_spec.slot import Frame
from policy.action_spec.spec import ActionSpec
from policy.errors import SpecError, did_you_mean

_ROLL_PITCH_YAW = ("waist_roll_joint", "waist_pitch_joint", "waist_yaw_joint")
"""Order of the waist in `wbc27`."""


def wbc32(robot: RobotSpec) -> ActionSpec:
    """Two wrist poses in the stance, all fingers: 32 numbers, exactly ``max_action_dim`` of π0 and π0.5 weights.

    Left wrist xyz and rot6d, right wrist likewise, left Dex3, right Dex3; absolute, in the measured pelvis.
    """
    return _wbc32(robot, 2, "stance")


def wbc32_v1(robot: RobotSpec) -> ActionSpec:
    """The first wbc32: the same numbers in the measured pelvis, which moves in a reach; for what was made with it."""
    return _wbc32(robot, 1, "pelvis")


def _wbc32(robot: RobotSpec, version: int, frame: Frame) -> ActionSpec:
    return ActionSpec(
        name="wbc32",
        version=version,
        robot=robot,
        slots=stack(
            *wrist("left", frame=frame),
            *wrist("right", frame=frame),
            joints(robot, "left_hand"),
            joints(robot, "right_hand"),
        ),
    )


def wbc32_forces(robot: RobotSpec) -> ActionSpec:
    """`wbc32` and the force that each palm is to meet, in the stance: 38 numbers."""
    slots = [{key: value for key, value in vars(slot).items() if key != "start"} for slot in wbc32(robot).slots]
    return ActionSpec(name="wbc32_forces", robot=robot, slots=stack(*slots, force("left"), force("right")))


def wbc27(robot: RobotSpec) -> ActionSpec:
    """Wrist poses, one closing number a hand, waist roll, pitch, yaw, base height and planar velocity: 27 numbers."""
    return ActionSpec(
        name="wbc27",
        robot=robot,
        slots=stack(
            *wrist("left"),
            *wrist("right"),
            scalar("left_grasp", "1", limits=((0.0, 1.0),)),
            scalar("right_grasp", "1", limits=((0.0, 1.0),)),
            joints(robot, "waist", order=_ROLL_PITCH_YAW),
            scalar("base_height", "m"),
            velocity(),
        ),
    )


def unifolm23(robot: RobotSpec) -> ActionSpec:
    """UnifoLM-VLA-0 ``EE_R6_G1``: wrist poses, Dex1 grippers right before left, waist yaw, roll, pitch.

    Source:
        unifolm-vla ``rlds_dataset.py`` (``batch_pose17_to_pose23``: rot6d by columns, grippers last, right first) and
        its dataset statistics (grippers up to 4.5: motor angle, not a share). Dex1 grippers become Dex3 closings.
    """
    return ActionSpec(
        name="unifolm23",
        robot=robot,
        horizon=25,
        slots=stack(
            *wrist("left"),
            *wrist("right"),
            scalar("right_grasp", "dex1 rad"),
            scalar("left_grasp", "dex1 rad"),
            joints(robot, "waist"),
        ),
    )


def joint28(robot: RobotSpec) -> ActionSpec:
    """Both arms and both Dex3 hands as joint targets, as in the datasets ``unitreerobotics/G1_Dex3_*``.

    Waist and pelvis are not in it: wrist poses follow with the anchor's.

    Source:
        unitree_lerobot ``constants.py``: left arm, right arm, left hand, right hand (index before middle).
    """
    return ActionSpec(
        name="joint28",
        robot=robot,
        slots=stack(
            joints(robot, "left_arm"),
            joints(robot, "right_arm"),
            joints(robot, "left_hand"),
            joints(robot, "right_hand"),
        ),
    )


def joint16(robot: RobotSpec) -> ActionSpec:
    """Both arms as joint targets and two Dex1 grippers, as in the datasets ``unitreerobotics/G1_Dex1_*``."""
    return ActionSpec(
        name="joint16",
        robot=robot,
        slots=stack(
            joints(robot, "left_arm"),
            joints(robot, "right_arm"),
            scalar("left_grasp", "dex1 rad"),
            scalar("right_grasp", "dex1 rad"),
        ),
    )


def gr00t_g1(robot: RobotSpec) -> ActionSpec:
    """GR00T N1.7 ``REAL_G1``: wrists relative to the state (``T_ref @ T_rel``, rot6d by rows), then joints; 53 numbers.

    Hands and arms are relative joints, waist, height and velocity absolute. Upstream states neither the rate (30 Hz is
    taken) nor the finger order (Dex3 DDS order is taken: GR00T-WholeBodyControl hands the numbers straight to the
    driver). For a checkpoint fine-tuned with absolute hands, change ``mode`` in the JSON: the hash changes with it.

    Source:
        Keys and widths of ``real_g1_relative_eef_relative_joints`` in the checkpoint's processor_config.json.
    """
    return ActionSpec(
        name="gr00t_g1",
        robot=robot,
        horizon=40,
        slots=stack(
            *wrist("left", mode="relative_se3", rot6d_layout="rows"),
            *wrist("right", mode="relative_se3", rot6d_layout="rows"),
            joints(robot, "left_hand", mode="relative_add"),
            joints(robot, "right_hand", mode="relative_add"),
            joints(robot, "left_arm", mode="relative_add"),
            joints(robot, "right_arm", mode="relative_add"),
            joints(robot, "waist"),
            scalar("base_height", "m"),
            velocity(),
        ),
    )


LAYOUTS = {
    layout.__name__.replace("_v", "-v"): layout
    for layout in (wbc32, wbc32_v1, wbc32_forces, wbc27, unifolm23, joint28, joint16, gr00t_g1, *public.LAYOUTS)
}
"""Built-in layouts by name; of several versions the last has the name alone."""


def builtin(name: str, robot: RobotSpec | None = None) -> ActionSpec:
    """A built-in layout of a robot, the G1 with Dex3 hands if not given.

    Args:
        name: As in `LAYOUTS`, with a version (``wbc32-v2``), or a whole id (``wbc32-v1-9425ce13fd02``).
        robot: The robot.

    Raises:
        SpecError: If there is none of that name.
    """
    robot = robot or g1()
    if name in LAYOUTS:
        return _made(name, robot)
    for spec in (_made(known, robot) for known in LAYOUTS):
        if name in (f"{spec.name}-v{spec.version}", spec.id):
            return spec
    raise SpecError(f"no layout is called '{name}'; {did_you_mean(name, LAYOUTS)}built in: {', '.join(LAYOUTS)}")


@lru_cache(maxsize=128)
def _made(name: str, robot: RobotSpec) -> ActionSpec:
    return LAYOUTS[name](robot)


@overload
def as_spec(spec: ActionSpec | str, robot: RobotSpec | None = None) -> ActionSpec: ...
@overload
def as_spec(spec: None, robot: RobotSpec | None = None) -> None: ...
def as_spec(spec: ActionSpec | str | None, robot: RobotSpec | None = None) -> ActionSpec | None:
    """Layout by its built-in name, for that robot, or a layout unchanged."""
    return builtin(spec, robot) if isinstance(spec, str) else spec
