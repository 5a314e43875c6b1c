"""The robot in Pinocchio: free-flyer base, armature and limits of the spec, tool frames, collision hulls."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from functools import lru_cache
from itertools import product
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin

from models.cache import whole_file
from models.spec import PAYLOAD_AHEAD, PAYLOAD_RADIUS, RobotSpec, RobotSpecError, ToolSpec
from models.urdf import light_urdf, read_urdf

# Position and speed limits of the free flyer are this in Pinocchio: neither infinite nor usable.
_HUGE = 1e300


def load_pinocchio(spec: RobotSpec, *, payload_kg: tuple[float, float] = (0.0, 0.0)) -> pin.Model:
    """The robot with a free-flyer base; joint limits, armature, dry friction and damping are the spec's.

    Limits of the base entries are infinite (Pinocchio has +-1.8e308 there). Frames named ``*_palm_point`` are added.

    Args:
        spec: The robot.
        payload_kg: Mass held by the left and right hand [kg], where `load_mujoco` puts it.

    Raises:
        RobotSpecError: If the URDF lacks a joint or frame of the spec, or has a joint more, or a payload is negative.
    """
    if spec.locked:
        model = pin.buildModelFromXML(ET.tostring(read_urdf(spec), encoding="unicode"), pin.JointModelFreeFlyer())
    else:
        model = pin.buildModelFromUrdf(str(spec.urdf), pin.JointModelFreeFlyer())
    model.name = spec.name
    _check_joints(spec, model)
    _set_joint_numbers(spec, model)
    add_tool_frames(spec, model)
    _add_payload(spec, model, payload_kg)
    return model


def load_collision(spec: RobotSpec, model: pin.Model) -> pin.GeometryModel:
    """Convex collision shapes of the robot with the pairs whose distance matters.

    Pairs within two joints and within one hand are left out. Shapes are named ``<link>_<n>``.

    Args:
        spec: The robot.
        model: Made by `load_pinocchio` from the same spec.

    Raises:
        RobotSpecError: If a mesh is missing or the cache of hulls cannot be written.
    """
    urdf = light_urdf(spec)
    geometry = _read_shapes(urdf, model)
    shapes: dict[str, list[int]] = {}
    for index, shape in enumerate(geometry.geometryObjects):
        shapes.setdefault(shape.name.rpartition("_")[0], []).append(index)
    for first, second in json.loads((urdf.parent / "collisions.json").read_text()):
        for a, b in product(shapes[first], shapes[second]):
            geometry.addCollisionPair(pin.CollisionPair(min(a, b), max(a, b)))
    return geometry


def _read_shapes(urdf: Path, model: pin.Model) -> pin.GeometryModel:
    """Shapes without pairs; kept in binary form, because building them from meshes takes 0.5 s."""
    stored = urdf.with_name(f"shapes-pin{pin.__version__}-coal{coal.__version__}.bin")
    if stored.is_file():
        try:
            return _stored_shapes(stored).copy()
        except RuntimeError:  # damaged: made again below
            pass
    geometry = pin.buildGeomFromUrdf(model, str(urdf), pin.GeometryType.COLLISION)
    geometry.removeAllCollisionPairs()
    with whole_file(stored) as temporary:
        geometry.saveToBinary(str(temporary))
    return geometry


@lru_cache(maxsize=2)
def _stored_shapes(stored: Path) -> pin.GeometryModel:
    """Shapes from a file, read once; copies have their own pairs and share the hulls, which are read-only.

    Raises:
        RuntimeError: If the file is damaged.
    """
    geometry = pin.GeometryModel()
    geometry.loadFromBinary(str(stored))
    if not geometry.ngeoms:
        raise RuntimeError(f"no shapes in {stored}")
    return geometry


def stance_q(spec: RobotSpec, model: pin.Model) -> np.ndarray:
    """The default stance as a configuration of the model, shape (nq,)."""
    q = pin.neutral(model)
    q[:7] = spec.stance.base
    for name, angle in zip(spec.joint_names, spec.stance.joint_positions, strict=True):
        q[model.joints[model.getJointId(name)].idx_q] = angle
    return q


def add_tool_frames(spec: RobotSpec, model: pin.Model) -> None:
    """Add the palm points as operational frames fixed to the wrists; frames that exist already are left alone.

    Raises:
        RobotSpecError: If the model lacks a wrist frame.
    """
    for tool in spec.tools:
        if model.existFrame(tool.palm_frame):
            continue
        parent = frame_id(model, tool.wrist_frame)
        wrist = model.frames[parent]
        placement = wrist.placement * pin.SE3(np.eye(3), np.array(tool.palm_offset))
        model.addFrame(pin.Frame(tool.palm_frame, wrist.parentJoint, parent, placement, pin.FrameType.OP_FRAME))


def palm_frame_ids(spec: RobotSpec, model: pin.Model) -> tuple[int, ...]:
    """Frame indices of the palm points, left then right.

    Raises:
        RobotSpecError: If the model lacks them; `add_tool_frames` adds them.
    """
    return tuple(frame_id(model, tool.palm_frame) for tool in spec.tools)


def frame_id(model: pin.Model, name: str) -> int:
    """Index of a frame; Pinocchio's own look-up answers ``nframes`` for a name it does not know.

    Raises:
        RobotSpecError: If there is no such frame.
    """
    index = model.getFrameId(name)
    if index >= model.nframes:
        bodies = sorted(frame.name for frame in model.frames if frame.type == pin.FrameType.BODY)
        raise RobotSpecError(f"model '{model.name}' has no frame '{name}'; bodies: {', '.join(bodies)}")
    return index


def _check_joints(spec: RobotSpec, model: pin.Model) -> None:
    in_model = set(list(model.names)[2:])
    missing, extra = sorted(set(spec.joint_names) - in_model), sorted(in_model - set(spec.joint_names))
    if missing or extra:
        raise RobotSpecError(
            f"{spec.urdf.name} and spec '{spec.name}' differ: missing {missing}, not in the spec {extra}"
        )
    for frame in [*(foot.frame for foot in spec.feet), spec.torso_body, spec.imu_frame]:
        frame_id(model, frame)


def _set_joint_numbers(spec: RobotSpec, model: pin.Model) -> None:
    for joint in spec.joints:
        entry = model.joints[model.getJointId(joint.name)]
        v, q = entry.idx_v, entry.idx_q
        model.armature[v] = joint.armature
        model.damping[v] = joint.damping
        model.friction[v] = joint.friction_loss
        model.effortLimit[v] = joint.effort_max
        model.velocityLimit[v] = joint.velocity_max
        model.lowerPositionLimit[q] = joint.position_min
        model.upperPositionLimit[q] = joint.position_max
    for limit in (model.effortLimit, model.velocityLimit, model.upperPositionLimit):
        limit[limit > _HUGE] = np.inf
    model.lowerPositionLimit[model.lowerPositionLimit < -_HUGE] = -np.inf


def payload(model: pin.Model, tool: ToolSpec, mass: float) -> tuple[int, pin.Inertia]:
    """A mass in a hand [kg] where `load_mujoco` puts it: the joint that moves it, and its inertia in the joint's axes.

    Raises:
        RobotSpecError: If the mass is negative or not finite, or the model lacks the palm.
    """
    if not 0.0 <= mass < np.inf:
        raise RobotSpecError(f"payload of the {tool.side} hand is {mass} kg, must be finite and at least 0")
    palm = model.frames[frame_id(model, tool.palm_body)]
    placement = palm.placement * pin.SE3(np.eye(3), np.array([PAYLOAD_AHEAD, 0.0, 0.0]))
    return palm.parentJoint, placement.act(pin.Inertia.FromSphere(mass, PAYLOAD_RADIUS))


def _add_payload(spec: RobotSpec, model: pin.Model, payload_kg: tuple[float, float]) -> None:
    for tool, mass in zip(spec.tools, payload_kg, strict=True):
        joint, inertia = payload(model, tool, mass)
        if mass > 0.0:
            model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
