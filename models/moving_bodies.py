"""Bodies of a scene that move: where they are, and joint positions that put them there again."""

from __future__ import annotations

import mujoco
import numpy as np

from models.mujoco_model import BASE_JOINT


def moving_joints(model: mujoco.MjModel) -> list[int]:
    """Joints by which whole bodies of the scene move in the world: objects are free, a drawer slides, a lever turns.

    A body that moves on more joints than one, or on another moving body, has none here.
    """
    robot = model.body_rootid[model.jnt_bodyid[model.joint(BASE_JOINT).id]]
    alone = (model.body_parentid == 0) & (model.body_jntnum == 1) & (np.arange(model.nbody) != robot)
    return [j for j in range(model.njnt) if alone[model.jnt_bodyid[j]]]


def poses_of(model: mujoco.MjModel, qpos: np.ndarray, joints: list[int]) -> np.ndarray:
    """Poses of bodies in a configuration: position [m] and quaternion wxyz, shape (k, 7)."""
    found = np.empty((len(joints), 7))
    for pose, joint in zip(found, joints, strict=True):
        body, at = model.jnt_bodyid[joint], model.jnt_qposadr[joint]
        kind, turn, moved = model.jnt_type[joint], np.empty(4), qpos[at] - model.qpos0[at]
        if kind == mujoco.mjtJoint.mjJNT_FREE:
            pose[:] = qpos[at : at + 7]
            continue
        pose[:3], pose[3:] = model.body_pos[body], model.body_quat[body]
        if kind == mujoco.mjtJoint.mjJNT_SLIDE:
            pose[:3] += moved * _turned(model.jnt_axis[joint], pose[3:])
            continue
        if kind == mujoco.mjtJoint.mjJNT_HINGE:
            mujoco.mju_axisAngle2Quat(turn, model.jnt_axis[joint], moved)
        else:
            turn[:] = qpos[at : at + 4]
        before = pose[3:].copy()
        mujoco.mju_mulQuat(pose[3:], before, turn)
        pivot = model.jnt_pos[joint]
        pose[:3] += _turned(pivot, before) - _turned(pivot, pose[3:])
    return found


def put(model: mujoco.MjModel, qpos: np.ndarray, joints: list[int], poses: np.ndarray) -> None:
    """Write the joint positions at which bodies have poses (k, 7) into a configuration (nq,)."""
    for joint, pose in zip(joints, poses, strict=True):
        body, at = model.jnt_bodyid[joint], model.jnt_qposadr[joint]
        kind, turn = model.jnt_type[joint], np.empty(4)
        if kind == mujoco.mjtJoint.mjJNT_FREE:
            qpos[at : at + 7] = pose
        elif kind == mujoco.mjtJoint.mjJNT_SLIDE:
            axis = _turned(model.jnt_axis[joint], model.body_quat[body])
            qpos[at] = model.qpos0[at] + axis @ (pose[:3] - model.body_pos[body])
        else:
            mujoco.mju_negQuat(turn, model.body_quat[body])
            mujoco.mju_mulQuat(turn, turn.copy(), np.ascontiguousarray(pose[3:]))
            if kind == mujoco.mjtJoint.mjJNT_HINGE:
                angle = 2.0 * np.arctan2(model.jnt_axis[joint] @ turn[1:], turn[0])
                qpos[at] = model.qpos0[at] + (angle + np.pi) % (2.0 * np.pi) - np.pi
            else:
                qpos[at : at + 4] = turn


def _turned(vector: np.ndarray, quat_wxyz: np.ndarray) -> np.ndarray:
    out = np.empty(3)
    mujoco.mju_rotVecQuat(out, np.ascontiguousarray(vector), np.ascontiguousarray(quat_wxyz))
    return out
