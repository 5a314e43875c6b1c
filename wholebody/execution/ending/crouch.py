"""The posture in which a robot is left: low, the centre of mass over the middle of its soles, hands ahead."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from models.pinocchio_model import stance_q
from models.spec import RobotSpec
from wholebody.errors import InputError
from wholebody.robot.feet import Feet

KNEE, LEAN, SHOULDER = 2.0, 0.3, -0.5
"""Angles of knees, trunk (forward) and shoulders (from the stance's pitch, upwards ahead) [rad]; chosen: thighs are
level, the ankles 0.14 rad from their limit, and the pelvis 0.47 m high."""
ANKLE_HALVINGS = 40
"""Halvings of the range of the ankles; chosen: all that a number has."""


def crouch(
    spec: RobotSpec, model: pin.Model, feet: Feet, knee: float = KNEE, lean: float = LEAN, shoulder: float = SHOULDER
) -> np.ndarray:
    """The crouch with the soles on these feet, shape (nq,); an `InputError` for a robot whose crouch is not known."""
    q, data = stance_q(spec, model), model.createData()
    nominal = Feet.at(spec, model, q, data)
    middle = nominal.floor(spec).point[0]
    parts = {part: _joints(model, part) for part in ("knee", "hip_pitch", "ankle_pitch", "shoulder_pitch")}
    q[parts["knee"]] = knee
    q[parts["shoulder_pitch"]] += shoulder
    q[3:7] = pin.Quaternion(pin.rpy.rpyToMatrix(0.0, lean, 0.0)).coeffs()
    low, high = float(model.lowerPositionLimit[parts["ankle_pitch"]].max()), 0.0
    for _ in range(ANKLE_HALVINGS):
        ankle = 0.5 * (low + high)
        q[parts["ankle_pitch"]], q[parts["hip_pitch"]] = ankle, -(knee + ankle + lean)
        q[:3] += (nominal.p - Feet.at(spec, model, q, data).p).mean(axis=0)
        # The shins lean less where the centre of mass is too far ahead.
        ahead = pin.centerOfMass(model, data, q)[0] > middle
        low, high = (ankle, high) if ahead else (low, ankle)
    return feet.stance(spec, model, q)


def _joints(model: pin.Model, part: str) -> list[int]:
    """Indices of the left and the right joint of that name in a configuration."""
    names = [f"{side}_{part}_joint" for side in ("left", "right")]
    if missing := [name for name in names if not model.existJointName(name)]:
        raise InputError(
            f"no crouch is known for '{model.name}', which has no joint '{missing[0]}': it cannot be lowered"
        )
    return [model.joints[model.getJointId(name)].idx_q for name in names]
